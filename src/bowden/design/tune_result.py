"""What a tuning found, and how it is said and drawn."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from bowden.control.law import Law
from bowden.core.errors import ParameterError
from bowden.core.units import DEGREES
from bowden.design.check_result import Check, milliseconds, no_margins
from bowden.drawing.shown import Panels, Plotted, listed, number
from bowden.drawing.style import COLOURS, CYCLE
from bowden.plants.trust import Trust
from bowden.rig import rig as rigs

if TYPE_CHECKING:
    from matplotlib.axes import Axes


REACH = 8.0
"""How far a gain may go in one search, up or down, as the logarithm of its share of where it began."""


@dataclass(frozen=True, repr=False)
class Tuning(Plotted):
    """The gains that were found, and the evidence; drawn, by how much each changed, and the largest errors."""

    _panels = Panels(1, 2, 7.0, 3.0)

    law: Law
    """With the new gains."""
    gains: Mapping[str, float]
    """Name → value of those that differ from before."""
    stood: Mapping[str, float]
    """Name → value of all gains before."""
    found: Check
    """Of the new gains."""
    before: Check
    """Of the gains from which the search started."""
    worst_rmse: float
    """Largest RMSE over all runs, from rest [rad]."""
    worst_before: float | None
    """The same of the gains before [rad]; None where a run was unstable."""
    bends: tuple[float, float]
    """Smallest and largest total bend of the sheath over which the margins hold [rad]."""
    runs: str
    """By what the errors were judged, in words."""
    generations: int
    """After which the search was over, or broken off."""
    short: str = ""
    """What the gains fall short of, of what is looked for; empty where they keep it all."""
    given: rigs.Rig | None = None
    """The rig whose law was tuned, with these gains; None where a bench alone was handed over."""
    study: Any = None
    """Of a tuning against the plants of a study: its ``name``, how many it was ``tuned_on``, and what the gains
    ``before`` and ``after`` make of other plants of it (`bowden.study.results.PlantsSpread`); None where they were
    not judged by any."""

    @property
    def rig(self) -> rigs.Rig:
        """The rig with these gains.

        Raises:
            ParameterError: gains were sought for a bench alone.
        """
        if self.given is None:
            raise ParameterError("this tuning is of a bench alone", expected="one of a rig: bowden.tune(rig)")
        return self.given

    @property
    def cable_trust(self) -> Trust | None:
        """Trust in the model of the rig's cable; None where nothing says it."""
        return None if self.given is None else self.given.cable_trust

    @property
    def gain_margin_db(self) -> float | None:
        """The smallest with the new gains [dB]; None where none has a limit."""
        return self.found.gain_margin_db

    @property
    def phase_margin_deg(self) -> float | None:
        """The smallest with the new gains [deg]; None where none has a limit."""
        return self.found.phase_margin_deg

    @property
    def delay_margin_s(self) -> float | None:
        """The smallest with the new gains [s]; None where none has a limit."""
        return self.found.delay_margin_s

    @property
    def at_bounds(self) -> tuple[str, ...]:
        """Which gains the search would have taken further, and why it did not, in sentences; empty if none."""
        return tuple(self._bounds())

    def _bounds(self) -> Iterator[str]:
        for name in self.law.choices:
            value, begun = self.law.numbers[name], self.stood[name]
            low, high = self.law.limits.get(name, (-math.inf, math.inf))
            if value == 0.0 or (low, high) == (0.0, 1.0):  # off, or a switch: not searched
                continue
            if value in (low, high):
                end, beyond = ("smallest", "less") if value == low else ("largest", "more")
                yield (
                    f"{name} = {value:g} is the {end} value that the law takes: {beyond} of it might follow better, "
                    "and no longer search will find that"
                )
            elif begun not in (0.0, value) and abs(math.log(value / begun)) > _NEAR * REACH:
                yield (
                    f"{name} = {value:g} is as far from {begun:g} as one search goes: tune once more, to go on from "
                    "there"
                )

    def _title(self) -> str:
        return f"Tuning of {self.law.name}"

    def _rows(self) -> list[tuple[str, str]]:
        return tuning_rows(self)

    def _draw(self, axes: "Sequence[Axes]") -> None:
        draw_tuning(axes, self)


_NEAR = 0.95
"""Share of its reach from which on a search may have been held back: it draws anew what would go beyond [–]."""


def tuning_rows(tuning: Tuning) -> list[tuple[str, str]]:
    """What a tuning found, a line for each thing."""
    stood = tuning.stood
    gains = [f"{name} {value:.4g} (was {stood[name]:.4g})" for name, value in tuning.gains.items()]
    before = "unstable" if tuning.worst_before is None else number(tuning.worst_before * DEGREES, "°")
    found = tuning.found
    was = _margins(tuning.before)
    return [
        ("gains", ", ".join(gains) or "as they were"),
        ("verdict", f"{found.verdict} (was {tuning.before.verdict})"),
        ("margins", (_margins(found) or no_margins(found)) + (f" (was {was})" if was else "")),
        ("worst RMSE", f"{number(tuning.worst_rmse * DEGREES, '°')} over {tuning.runs} (was {before})"),
        *(("other plants", text) for text in ([] if tuning.study is None else [study_text(tuning.study, "after")])),
        *([("short of", tuning.short)] if tuning.short else []),
        *(("at a bound", text) for text in tuning.at_bounds),
        ("search", f"{tuning.generations} generations"),
    ]


def _margins(found: Check) -> str:
    """Gain, phase and delay margin, those that there are."""
    delay = milliseconds(found.delay_margin_s)
    gain, phase = number(found.gain_margin_db, "dB"), number(found.phase_margin_deg, "°")
    return listed((gain, phase, f"{delay} of delay" if delay else ""))


def study_text(found: Any, when: str) -> str:
    """What gains make of plants that they were not tuned against.

    Args:
        found: `Tuning.study`.
        when: ``before`` or ``after``.
    """
    one = getattr(found, when)
    figures = [getattr(one, f"rmse_{name}_deg") for name in ("median", "90", "worst")]
    median, most, worst = ("none" if value is None else f"{value:.3g}°" for value in figures)
    return (
        f"{one.runs} other plants, {'' if when == 'after' else 'before: '}{one.unstable} unstable; "
        f"RMSE median {median}, 90 % {most}, worst {worst}"
    )


def draw_tuning(axes: "Sequence[Axes]", tuning: Tuning) -> None:
    """How far each gain moved, as a factor, and on second axes the largest error before and after."""
    stood = tuning.stood
    moved = {
        name: value / stood[name] for name, value in tuning.gains.items() if stood[name] and value / stood[name] > 0
    }
    panel = axes[0]
    panel.barh(list(moved), [math.log2(factor) for factor in moved.values()], color=COLOURS["joint"])
    for i, factor in enumerate(moved.values()):
        panel.annotate(f" ×{factor:.3g} ", (math.log2(factor), i), va="center", ha="left" if factor >= 1.0 else "right")
    panel.axvline(0.0, color=COLOURS["reference"], lw=0.8)
    panel.margins(x=0.25)
    panel.invert_yaxis()
    panel.set_xlabel("doublings of the gain")
    if len(axes) > 1:
        errors = {"before": tuning.worst_before, "after": tuning.worst_rmse}
        heights = [0.0 if value is None else value * DEGREES for value in errors.values()]
        bars = axes[1].bar(list(errors), heights, color=[COLOURS["limit"], CYCLE[2]], width=0.6)
        axes[1].bar_label(bars, ["unstable" if v is None else f"{v * DEGREES:.3g}°" for v in errors.values()])
        axes[1].set_ylabel("largest RMSE [°]")
        axes[1].margins(y=0.15)
