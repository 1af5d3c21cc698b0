"""How a check and a tuning say and draw what they found."""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from bowden.core.units import DEGREES
from bowden.drawing.shown import listed, number
from bowden.drawing.style import COLOURS, CYCLE, legend

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from bowden.control.stability import Margins
    from bowden.design.check import Check
    from bowden.design.tune import Tuning

_WIDEST = math.pi
"""No joint of a limb moves so far [rad]."""
_SAID = {True: "confirmed in simulation", False: "not seen in simulation", None: "nothing to confirm"}


def check_rows(found: "Check") -> list[tuple[str, str]]:
    """What a check found, a line for each thing."""
    cycle, swing, ripple = found.cycle, found.swing, found.command_per_count
    none = "not defined for a suit: trials decide" if found.leaves_out else "none"
    predicted = "none predicted"
    if cycle is not None:
        about = f"±{cycle.amplitude * DEGREES:.2g}° every {cycle.period:.2g} s predicted"
        predicted = f"{about}, {_SAID[found.cycle_confirmed]}"
    return [
        ("verdict", f"{found.verdict}: {found.reason}"),
        ("gain margin", number(found.gain_margin_db, "dB") or none),
        ("phase margin", number(found.phase_margin_deg, "°") or none),
        ("delay margin", _milliseconds(found.delay_margin_s) or none),
        ("limit cycle", predicted),
        ("at rest", "" if swing is None else f"{_swing(swing * DEGREES)} at the joint in simulation"),
        ("chatter", _chatter(ripple)),
        ("error", "" if found.peak is None else f"at most {found.peak * DEGREES:.3g}° in simulation"),
        ("proven bound", _proven(found.ultimate_error)),
        *_pair_rows(found),
        ("limits", found.leaves_out),
        ("advice", found.advice),
    ]


def _pair_rows(found: "Check") -> list[tuple[str, str]]:
    """Of two motors on one joint: the margins by what is taut, and how far the motors part."""
    if found.pair is None:
        return []
    rows = []
    for loop in found.pair.loops:
        margins = (
            number(loop.gain_margin_db, "dB"),
            number(loop.phase_margin_deg, "°"),
            _milliseconds(loop.delay_margin_s),
        )
        rows.append((loop.at, listed(margins) or "none"))
    drift = found.pair.drift
    apart = "" if drift is None else f"±{round(drift * DEGREES, 6):.2g}° beyond the co-contraction"
    return [*rows, ("motors apart", apart)]


def _swing(swing_deg: float) -> str:
    """What is left of rounding is no swing."""
    return f"±{swing_deg:.3g}°" if swing_deg > 1e-6 else "no swing"


def _chatter(ripple: float) -> str:
    """What a count of the joint's encoder does to the command, and whether that is much."""
    from bowden.design.check import MOST_PER_COUNT

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
        return "none of use: the paper's Lyapunov bound is wider here than any joint moves"
    return f"{bound * DEGREES:.3g}° (the paper's Lyapunov bound)"


def tuning_rows(tuning: "Tuning") -> list[tuple[str, str]]:
    """What a tuning found, a line for each thing."""
    stood = tuning.stood
    gains = [f"{name} {value:.4g} (was {stood[name]:.4g})" for name, value in tuning.gains.items()]
    before = "unstable" if tuning.worst_before is None else number(tuning.worst_before * DEGREES, "°")
    found = tuning.found
    margins = (number(found.gain_margin_db, "dB"), number(found.phase_margin_deg, "°"))
    delay = _milliseconds(found.delay_margin_s)
    return [
        ("gains", ", ".join(gains) or "as they were"),
        ("verdict", f"{found.verdict} (was {tuning.before.verdict})"),
        ("margins", listed((*margins, f"{delay} of delay" if delay else "")) or no_margins(found)),
        ("worst RMSE", f"{number(tuning.worst_rmse * DEGREES, '°')} over {tuning.runs} (was {before})"),
        *(("other plants", text) for text in ([] if tuning.study is None else [study_text(tuning.study, "after")])),
        *([("short of", tuning.short)] if tuning.short else []),
        ("search", f"{tuning.generations} generations"),
    ]


def no_margins(found: "Check") -> str:
    """Why a check has no margins."""
    return "none, since no linear loop shows why it holds" if found.refuted else "no feedback"


def study_text(found: Mapping[str, Any], when: str) -> str:
    """What gains make of plants that they were not tuned against.

    Args:
        found: `Tuning.study`.
        when: ``before`` or ``after``.
    """
    one = found[when]
    figures = [one[f"rmse_{name}_deg"] for name in ("median", "90", "worst")]
    median, most, worst = ("none" if value is None else f"{value:.3g}°" for value in figures)
    return (
        f"{one['runs']} other plants, {'' if when == 'after' else 'before: '}{one['unstable']} unstable; "
        f"RMSE median {median}, 90 % {most}, worst {worst}"
    )


def draw_check(axes: "Axes", found: "Check") -> None:
    """Phase margin over gain margin of every linear loop; little of either is shaded."""
    from bowden.design.check import ENOUGH_DB, ENOUGH_DEG

    colours = dict(zip(sorted({point.bend for point in found.points}), CYCLE, strict=False))
    for bend, colour in colours.items():
        margins = [point.margins for point in found.points if point.bend == bend]
        pairs = [(one.gain_margin_db or 0.0, one.phase_margin_deg or 0.0) for one in margins if _limited(one)]
        unstable = sum(not one.stable for one in margins)
        label = f"bend of {bend * DEGREES:.0f}°" + (f", {unstable} unstable" if unstable else "")
        axes.plot([gain for gain, _ in pairs], [phase for _, phase in pairs], "o", color=colour, label=label)
    if not any(_limited(point.margins) for point in found.points):
        axes.text(0.5, 0.5, "no limit to gain or phase", transform=axes.transAxes, ha="center")
    axes.set(xlabel="gain margin [dB]", ylabel="phase margin [°]")
    axes.set_xlim(0.0, max(2.0 * ENOUGH_DB, 1.05 * axes.get_xlim()[1]))
    axes.set_ylim(0.0, max(2.0 * ENOUGH_DEG, 1.05 * axes.get_ylim()[1]))
    axes.axvspan(0.0, ENOUGH_DB, color=COLOURS["error"], alpha=0.12, lw=0.0)
    axes.axhspan(0.0, ENOUGH_DEG, color=COLOURS["error"], alpha=0.12, lw=0.0)
    legend(axes)


def _limited(margins: "Margins") -> bool:
    """Whether a loop has both margins, or is unstable and has none."""
    return not margins.stable or (margins.gain_margin_db is not None and margins.phase_margin_deg is not None)


def draw_tuning(axes: "Sequence[Axes]", tuning: "Tuning") -> None:
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


def _milliseconds(seconds: float | None) -> str:
    return number(None if seconds is None else 1e3 * seconds, "ms")
