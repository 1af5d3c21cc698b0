"""What a check found, and how it is said and drawn."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, NamedTuple

from bowden.control.stability import Margins
from bowden.core.guesses import answering
from bowden.core.units import DEGREES, RADIANS
from bowden.design.limit_cycle import LimitCycle
from bowden.design.trial import Trial
from bowden.drawing.shown import Panels, Plotted, listed, number
from bowden.drawing.style import COLOURS, CYCLE, legend
from bowden.plants.trust import Trust

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_WIDEST = math.pi
"""No joint of a limb moves so far [rad]."""
_SAID = {True: "confirmed in simulation", False: "not seen in simulation", None: "nothing to confirm"}


ENOUGH_DB, ENOUGH_DEG = 6.0, 30.0
"""Margins below which a loop has little of them."""


MOST_PER_COUNT = 0.5 * RADIANS
"""Change of the command in one cycle, for one count of the joint's encoder, beyond which a law is said to chatter and
tuned gains are refused (docs/decisions/0016-new-user-path.md) [rad]."""


VerdictName = Literal["holds", "little_margin", "limit_cycle", "does_not_hold"]


Estimates = dict[str, float]


@dataclass(frozen=True)
class Point:
    """One linear loop, and what its margins are."""

    bend: float
    """[rad]"""
    slope: float
    """Joint motion per motor motion [rad/rad]."""
    estimates: Estimates
    """The law's estimates, frozen here."""
    margins: Margins
    at: str = ""
    """What else differs between the loops: of a suit the elbow's angle, and whether the extensor is taut."""
    per_count: float = 0.0
    """Largest change of the command in one cycle for one count of the joint's encoder [rad]."""


class TautLoop(NamedTuple):
    """The smallest margins of several motors on one joint, of a case of taut cables; None where one is unstable or none
    has a limit."""

    at: str
    """Which cables are taut."""
    gain_margin_db: float | None
    phase_margin_deg: float | None
    delay_margin_s: float | None


class SharedFindings(NamedTuple):
    """What is found of several motors on one joint besides."""

    loops: tuple[TautLoop, ...]
    """All cables taut, then each alone."""
    drift: float | None
    """How far the motors went apart in the trials beyond the co-contraction, or less far, each; None where one ran away
    [rad]."""
    apart: float
    """Largest pole with which the motors part while the joint stands; what it comes to, `drift` says [–]."""


@answering(
    {
        **dict.fromkeys(("ok", "passed", "stable", "passes", "result"), "check.holds, and check.verdict"),
        **dict.fromkeys(("margins", "margin"), "check.gain_margin_db, check.phase_margin_deg, check.delay_margin_s"),
    },
    "change the rig, and check it again",
)
@dataclass(frozen=True, repr=False)
class Check(Plotted):
    """What was found; drawn, the phase margin over the gain margin of every linear loop, little of either shaded."""

    _panels = Panels(1, 1, 4.5, 3.4)

    law: str
    """Name of the law that was judged."""

    verdict: VerdictName
    reason: str
    """What decided, in a sentence."""
    points: tuple[Point, ...]
    """Every linear loop that was looked at."""
    worst: Point
    """The one that decides."""
    cycle: LimitCycle | None
    """The limit cycle that the describing function predicts, at the worse end of the bends."""
    trials: tuple[Trial, ...]
    """At the smallest and, if it is another, at the largest bend."""
    reserve: bool | None
    """True if a trial with a delay of `RESERVE` is bounded too; None where no such trial was made."""
    chatters: bool
    """Unstable for one count of the encoder, stable for the whole stroke: a steep curve such as tanh(s/ε) chatters."""
    command_per_count: float
    """Largest change of the command in one cycle for one count of the joint's encoder, over all points [rad]."""
    ultimate_s: float | None
    """The bound on |s| that the law's own proof gives [rad·s]; None where it has none."""
    ultimate_error: float | None
    """The bound on |e| likewise [rad]."""
    leaves_out: str = ""
    """What the linear loops leave to the trials, where so much that the trials alone decide whether it holds."""
    refuted: bool = False
    """True if a linear loop is unstable, as it is or with a delay beyond its margin, where a trial without all that it
    leaves out comes to rest: then no linear loop stands for this law, and margins there are none."""
    advice: str = ""
    """What to change where it does not hold, if that was asked for (`bowden.design.advice`)."""
    of_rig: bool = False
    """True if that changes the rig, where no gains would do."""
    instead: str = ""
    """Law that holds where this one does not, likewise (`bowden.design.verdict`); empty where none was found."""
    shared: SharedFindings | None = None
    """Of several motors on one joint: what else was found; `trials` are then of each motor by turns."""

    cable_trust: Trust | None = None
    """Trust in the model of the rig's cable; None where nothing says it."""

    @property
    def holds(self) -> bool:
        """True if the loop stays bounded: any verdict but ``does_not_hold``, with little margin or a limit cycle too.

        Where it does not, `bowden.simulate`, `run` and `export` refuse the law, and ``bowden check`` ends with 1.
        """
        return self.verdict != "does_not_hold"

    @property
    def gain_margin_db(self) -> float | None:
        """The smallest over all points; None where a loop is unstable or refuted, or none has a limit."""
        return None if self.refuted else least(self.points, "gain_margin_db")

    @property
    def phase_margin_deg(self) -> float | None:
        """The smallest over all points; None where a loop is unstable or refuted, or none has a limit."""
        return None if self.refuted else least(self.points, "phase_margin_deg")

    @property
    def delay_margin_s(self) -> float | None:
        """The smallest over all points; None as above."""
        return None if self.refuted else least(self.points, "delay_margin_s")

    @property
    def swing(self) -> float | None:
        """Half of the joint's span while the reference rests, at the worse bend [rad]."""
        return swing_of(self.trials)

    @property
    def peak(self) -> float | None:
        """Largest error of the trials [rad]; None where one ran away."""
        return None if any(t.peak is None for t in self.trials) else max(t.peak or 0.0 for t in self.trials)

    @property
    def cycle_confirmed(self) -> bool | None:
        """True if the trials swing at rest by at least a quarter of what is predicted; None without a prediction."""
        return confirmed_by(self.cycle, self.swing)

    def _title(self) -> str:
        return f"Check of {self.law}"

    def _rows(self) -> list[tuple[str, str]]:
        return check_rows(self)

    def _draw(self, axes: "Sequence[Axes]") -> None:
        draw_check(axes[0], self)


def least(points: Iterable[Point], margin: str) -> float | None:
    """The smallest of one of the `Margins` of loops; None where one is unstable, or none has a limit."""
    found = [point.margins for point in points]
    there = [value for one in found if (value := getattr(one, margin)) is not None]
    return min(there) if there and all(one.stable for one in found) else None


def swing_of(trials: Sequence[Trial]) -> float | None:
    """Half of the joint's span while the reference rests, at the worse bend [rad]; None where a trial ran away."""
    return None if any(t.swing is None for t in trials) else max(t.swing or 0.0 for t in trials)


def confirmed_by(cycle: LimitCycle | None, swing: float | None) -> bool | None:
    """See `Check.cycle_confirmed`."""
    return None if cycle is None or swing is None else swing > 0.25 * cycle.amplitude


def check_rows(found: Check) -> list[tuple[str, str]]:
    """What a check found, a line for each thing."""
    cycle, swing, ripple = found.cycle, found.swing, found.command_per_count
    none = "not defined for a suit: trials decide" if found.leaves_out else _no_margin(found)
    predicted = "none predicted"
    if cycle is not None:
        about = f"±{cycle.amplitude * DEGREES:.2g}° every {cycle.period:.2g} s predicted"
        predicted = f"{about}, {_SAID[found.cycle_confirmed]}"
    return [
        ("verdict", f"{found.verdict}: {found.reason}"),
        ("gain margin", number(found.gain_margin_db, "dB") or none),
        ("phase margin", number(found.phase_margin_deg, "°") or none),
        ("delay margin", milliseconds(found.delay_margin_s) or none),
        ("limit cycle", predicted),
        ("at rest", "" if swing is None else f"{_swing(swing * DEGREES)} at the joint in simulation"),
        ("chatter", _chatter(ripple)),
        ("error", _peak(found.peak)),
        ("proven bound", _proven(found.ultimate_error)),
        *_shared_rows(found),
        ("limits", found.leaves_out),
        ("advice", found.advice),
    ]


def _no_margin(found: Check) -> str:
    """Why there is no figure of a margin."""
    if found.refuted:
        return "none: no linear loop shows why it holds"
    return "unlimited" if all(point.margins.stable for point in found.points) else "none: a linear loop is unstable"


def _shared_rows(found: Check) -> list[tuple[str, str]]:
    """Of several motors on one joint: the margins by what is taut, and how far the motors part."""
    if found.shared is None:
        return []
    rows = []
    for loop in found.shared.loops:
        margins = (
            number(loop.gain_margin_db, "dB"),
            number(loop.phase_margin_deg, "°"),
            milliseconds(loop.delay_margin_s),
        )
        rows.append((loop.at, listed(margins) or "none"))
    drift = found.shared.drift
    apart = "" if drift is None else f"±{round(drift * DEGREES, 6):.2g}° beyond the co-contraction"
    return [*rows, ("motors apart", apart)]


def _peak(peak: float | None) -> str:
    """The largest error, and of which motion."""
    return "" if peak is None else f"at most {peak * DEGREES:.3g}° in the check's own trial, not on [reference]"


def _swing(swing_deg: float) -> str:
    """What is left of rounding is no swing."""
    return f"±{swing_deg:.3g}°" if swing_deg > 1e-6 else "no swing"


def _chatter(ripple: float) -> str:
    """What a count of the joint's encoder does to the command, and whether that is much."""
    if not ripple:
        return ""
    said = f"{ripple * DEGREES:.3g}° of command for one count of the encoder"
    much = f": more than {MOST_PER_COUNT * DEGREES:g}°, so the motor buzzes; lower the gains, or take a finer encoder"
    return said + (much if ripple > MOST_PER_COUNT else "")


def _proven(bound: float | None) -> str:
    """The bound of a law's own proof; one that is wider than any joint moves says nothing, and no figure of it does."""
    if bound is None:
        return ""
    if bound > _WIDEST:
        return "no help here: the error that the paper's Lyapunov proof allows is larger than any joint's motion"
    return f"{bound * DEGREES:.3g}° (the paper's Lyapunov bound)"


def no_margins(found: Check) -> str:
    """Why a check has no margins."""
    return "none, since no linear loop shows why it holds" if found.refuted else "no feedback"


def draw_check(axes: "Axes", found: Check) -> None:
    """Phase margin over gain margin of every linear loop; little of either is shaded."""
    colours = dict(zip(sorted({point.bend for point in found.points}), CYCLE, strict=False))
    for bend, colour in colours.items():
        margins = [point.margins for point in found.points if point.bend == bend]
        both = [(one.gain_margin_db or 0.0, one.phase_margin_deg or 0.0) for one in margins if _limited(one)]
        unstable = sum(not one.stable for one in margins)
        label = f"bend of {bend * DEGREES:.0f}°" + (f", {unstable} unstable" if unstable else "")
        axes.plot([gain for gain, _ in both], [phase for _, phase in both], "o", color=colour, label=label)
    if not any(_limited(point.margins) for point in found.points):
        axes.text(0.5, 0.5, "no limit to gain or phase", transform=axes.transAxes, ha="center")
    axes.set(xlabel="gain margin [dB]", ylabel="phase margin [°]")
    axes.set_xlim(0.0, max(2.0 * ENOUGH_DB, 1.05 * axes.get_xlim()[1]))
    axes.set_ylim(0.0, max(2.0 * ENOUGH_DEG, 1.05 * axes.get_ylim()[1]))
    axes.axvspan(0.0, ENOUGH_DB, color=COLOURS["error"], alpha=0.12, lw=0.0)
    axes.axhspan(0.0, ENOUGH_DEG, color=COLOURS["error"], alpha=0.12, lw=0.0)
    legend(axes)


def _limited(margins: Margins) -> bool:
    """True if a loop has both margins, or is unstable and has none."""
    return not margins.stable or (margins.gain_margin_db is not None and margins.phase_margin_deg is not None)


def milliseconds(seconds: float | None) -> str:
    """A time in words; empty of none."""
    return number(None if seconds is None else 1e3 * seconds, "ms")
