"""`check`: does a law hold on a rig, before anything moves?"""

import math
from dataclasses import KW_ONLY, dataclass, replace
from typing import TYPE_CHECKING, Literal

from bowden.core.documented import Documented
from bowden.operations.support.operation import GivenLaw, GivenProgress, GivenRig, Operation
from bowden.operations.support.results import Result, degrees, filled

if TYPE_CHECKING:
    from bowden.design.check_result import Check
    from bowden.rig.joints import RigJoint
    from bowden.rig.rig import Rig

Verdict = Literal["holds", "little_margin", "limit_cycle", "does_not_hold"]


@dataclass(frozen=True)
class WorstLoop(Documented):
    """The linear loop that decides."""

    bend_deg: float
    at: str
    """What else differs between the loops: of a suit the elbow's angle, and whether the extensor is taut."""
    slope: float
    """Joint motion per motor motion."""
    estimates: dict[str, float]
    """The law's estimates, in SI units, as they were frozen."""
    largest_pole: float
    """Largest magnitude of a closed-loop pole."""


@dataclass(frozen=True)
class CycleAtRest(Documented):
    """The limit cycle that backlash can cause."""

    predicted: bool
    """True if the describing function shows a stable one."""
    amplitude_deg: float | None
    """Predicted, half of the span at the joint [deg]."""
    period_s: float | None
    """Predicted [s]."""
    confirmed: bool | None
    """True if the joint swings at rest in simulation by at least a quarter of the prediction; null where nothing was
    predicted or the run ran away."""
    simulated_amplitude_deg: float | None
    """Half of the joint's span while the reference rests; null where the run ran away [deg]."""
    simulated_period_s: float | None
    """Null where it does not swing to and fro [s]."""


@dataclass(frozen=True)
class Chatter(Documented):
    """What the encoder's counts do to the command."""

    predicted: bool
    """Unstable for one count, stable for the whole stroke."""
    command_per_count_deg: float | None
    """Largest change of the command in one cycle for one count of the joint's encoder; above 0.5 is chatter [deg]."""
    simulated_ripple_deg: float | None
    """Root mean square of the command's step in one cycle at rest [deg]."""


@dataclass(frozen=True)
class TautMargins(Documented):
    """Margins of several motors on one joint, of a case of taut cables."""

    at: str
    """Which cables are taut."""
    gain_margin_db: float | None
    """Smallest over all slopes and estimates; null where a loop is unstable or nothing limits it [dB]."""
    phase_margin_deg: float | None
    """The same [deg]."""
    delay_margin_s: float | None
    """The same, as further delay [s]."""


@dataclass(frozen=True)
class SharedLoops(Documented):
    """What is found of several motors on one joint besides."""

    motors: tuple[str, ...]
    """Their names; the drive of the first has the joint's encoder."""
    co_contraction_deg: float
    """How much further each motor pulls than the joint asks for [deg]."""
    loops: tuple[TautMargins, ...]
    """Smallest margins with all cables taut, and with each alone."""
    motors_apart_deg: float | None
    """How far motors went apart beyond the co-contraction in simulation; null where a trial ran away [deg]."""
    largest_pole_apart: float
    """Largest magnitude of a pole with which motors part while the joint stands: what it comes to is
    motors_apart_deg."""


@dataclass(frozen=True)
class LoopCheck(Documented):
    """Verdict on a law on one joint."""

    joint: str
    """Its name or, where one motor moves it, that motor's; empty of a rig with one motor."""
    law: str
    """Name of the law."""
    verdict: Verdict
    """little_margin: below 6 dB or 30 degrees, or chatter that stays bounded, or a trial that does not stand a further
    delay of 7.5 degrees."""
    holds: bool
    """True if the loop stays bounded: any verdict but does_not_hold."""
    reason: str
    """What decided."""
    gain_margin_db: float | None
    """Smallest over all slopes and estimates; null where a loop is unstable or nothing limits it [dB]."""
    phase_margin_deg: float | None
    """The same [deg]."""
    delay_margin_s: float | None
    """The same, as further delay [s]."""
    worst: WorstLoop
    """The linear loop that decides."""
    limit_cycle: CycleAtRest
    """The cycle that backlash can cause."""
    chatter: Chatter
    """What a steep curve such as tanh(s/ε) does with the encoder's counts."""
    ultimate_bound_deg: float | None
    """The paper's Lyapunov bound on the error; null for other laws [deg]."""
    ultimate_bound_s: float | None
    """The same on s [rad·s]."""
    simulated_peak_deg: float | None
    """Largest error of the trials, for comparison; null where one ran away [deg]."""
    leaves_out: str
    """What the linear loops leave to the trials, which then alone decide whether it holds: of a suit; else empty."""
    refuted: bool
    """A linear loop is unstable where a trial without all that comes to rest: no linear loop stands for the law, and
    its margins are null."""
    advice: str
    """Which number to change, and to what; empty where nothing is to be mended."""
    shared: SharedLoops | None
    """Findings on several motors of one joint, which are judged as one; null for one motor."""
    rig: str
    """Hash of the rig: equal rigs have the same, whether they come from a file, Python or a log."""


@dataclass(frozen=True)
class CheckResult(LoopCheck, Result["Check | dict[str, Check]"]):
    """Verdict on a law; of a rig with several joints the figures of the worst, and of each."""

    joints: tuple[LoopCheck, ...]
    """Figures of each joint of a rig with several; empty for a rig with one."""
    refusals: tuple[str, ...]
    """Why bowden run refuses the rig, whether the law holds or not; empty where it takes it."""
    _: KW_ONLY
    checks: "dict[str, Check]"
    """Name of the joint → its check."""
    whole: "Rig"

    @property
    def exit_code(self) -> int:
        """1 where it does not hold, or a run refuses it."""
        return 0 if self.holds and not self.refusals else 1


def check(
    rig: GivenRig,
    law: GivenLaw | None = None,
    *,
    preset: str | None = None,
    motor: str | None = None,
    progress: GivenProgress = None,
) -> CheckResult:
    """Check whether a rig's gains hold, before anything moves: margins, limit cycle, chatter, bounds, what to change.

    Margins are looked at over all bends of the sheath; trial runs confirm them. Each joint is checked by
    itself; all motors on one joint (docs/several_motors.md) are checked as one. The command's exit code is 0 where the
    loop stays bounded, with little margin or a limit cycle too (the verdict says which), 1 where it does not hold or a
    run would refuse the rig, 2 where nothing could be judged.

    Args:
        rig: the bench, law and scenario; ``bowden init`` writes one.
        law: a law's name, or FILE.py:NAME of your own, in place of the rig's.
        preset: a named set of gains of that law.
        motor: one motor alone, of a rig with several.
        progress: True for a line that says how far it is, or a function of what is being done and the share done.

    Returns:
        The check: ``holds``, whether the loop stays bounded; ``verdict`` (``holds``, ``little_margin``, ``limit_cycle``
        or ``does_not_hold``), its ``reason``, the margins, and ``advice`` on what to change. Of several motors on one
        joint ``shared`` too; of several joints a dictionary of checks.

    Raises:
        ParameterError: a rig, law or setting that cannot be used.

    Examples:
        bowden check rig.toml
        bowden check rig.toml --preset paper
        bowden check rig.toml --law my_law.py --json

    >>> from bowden import Rig, check
    >>> found = check(Rig(), "adaptive")
    >>> found.holds, found.verdict, round(found.gain_margin_db)
    (True, 'holds', 19)
    """
    from bowden.core.errors import error_context
    from bowden.design.forecast import foreseen
    from bowden.design.objections import as_notes, objections, refuse_sources
    from bowden.design.verdict import checked
    from bowden.operations.support import given
    from bowden.operations.support.progress import reported

    whole = given.under(given.of_motor(given.rig_of(rig), motor), law, preset)
    refuse_sources(whole)
    joints = {one.name: one for one in whole.each_joint}
    checks: dict[str, Check] = {}
    found_wrong = [*objections(whole)]
    with reported(progress, "check") as report:
        for name, joint in joints.items():
            report(f"checking {name} {joint.first.law_name}".replace("  ", " "), len(checks) / len(joints))
            with error_context(joint.said):
                checks[name] = replace(checked(joint), cable_trust=whole.cable_trust)
                asked = checks[name].holds and not (joint.shared or found_wrong)
                ends = "" if not asked else foreseen(joint.first, joint.first.fitted())
            found_wrong += [f"{joint.said}: {ends}" if joint.said else ends] if ends else []
    worst = max(checks, key=lambda name: _badness(checks[name]))
    figures = {name: _figures(one, joints[name]) for name, one in checks.items()}
    several = tuple(figures.values()) if len(checks) > 1 else ()
    said = as_notes(found_wrong)
    return CheckResult(
        **(vars(figures[worst]) | {"rig": whole.hash}),
        joints=several,
        refusals=tuple(found_wrong),
        made=checks if several else checks[worst],
        checks=checks,
        whole=whole,
        notes=(*given.notes_of(whole), *said),
        needless=said,
    )


_VERDICTS = ("holds", "little_margin", "limit_cycle", "does_not_hold")
"""From the best to the worst."""


def _badness(found: "Check") -> tuple[int, float]:
    """By verdict, then by gain margin: of a loop that holds none is no limit, of another instability."""
    margin = found.gain_margin_db
    return _VERDICTS.index(found.verdict), -(margin if margin is not None else math.inf if found.holds else -math.inf)


def _figures(found: "Check", joint: "RigJoint") -> LoopCheck:
    """The figures of one check."""
    period = next((t.period for t in found.trials if t.swing is not None and t.swing == found.swing), None)
    cycle, apart, worst = found.cycle, found.shared, found.worst
    ripple = [t.ripple for t in found.trials if t.ripple is not None]
    shared = None
    if apart is not None:
        loops = tuple(TautMargins(*loop) for loop in apart.loops)
        contraction = degrees(joint.settings.co_contraction)
        shared = SharedLoops(joint.names, contraction, loops, degrees(apart.drift), apart.apart)
    return filled(
        LoopCheck,
        found,
        joint=joint.name,
        worst=filled(WorstLoop, worst, largest_pole=worst.margins.largest_pole),
        limit_cycle=CycleAtRest(
            cycle is not None,
            degrees(cycle.amplitude) if cycle else None,
            cycle.period if cycle else None,
            found.cycle_confirmed,
            degrees(found.swing),
            period,
        ),
        chatter=Chatter(
            found.chatters,
            degrees(found.command_per_count),
            degrees(max(ripple)) if found.peak is not None else None,
        ),
        ultimate_bound_deg=degrees(found.ultimate_error),
        ultimate_bound_s=found.ultimate_s,
        simulated_peak_deg=degrees(found.peak),
        shared=shared,
        rig=joint.first.hash,
    )


OPERATIONS = (Operation("check", check, 80),)
