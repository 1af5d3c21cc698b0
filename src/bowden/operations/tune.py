"""`tune`: gains with margins for a rig."""

from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from bowden.operations.check import Verdict
from bowden.operations.support.operation import GivenLaw, GivenProgress, GivenRig, Operation, Role, Switch
from bowden.operations.support.results import Result, degrees, filled
from bowden.study.results import JudgedByStudy

if TYPE_CHECKING:
    from bowden.design.tune import BrokenOff
    from bowden.design.tune_result import Tuning


@dataclass(frozen=True)
class TuneResult(Result["Tuning"]):
    """Gains with margins, and what they are better than."""

    rig: str
    """Hash of the rig: equal rigs have the same, whether they come from a file, Python or a log."""
    law: str
    """Name of the law."""
    preset: str | None
    """The named set of gains on which these stand, written to the file as well; null where there is none."""
    gains: dict[str, float]
    """The gains that were changed, in SI units."""
    before: dict[str, float]
    """The same gains before."""
    verdict: Literal["holds"]
    """Verdict of bowden check."""
    verdict_before: Verdict
    """The same of the gains before."""
    gain_margin_db: float | None
    """Smallest over slopes and estimates [dB]."""
    phase_margin_deg: float | None
    """The same [deg]."""
    delay_margin_s: float | None
    """The same [s]."""
    worst_rmse_deg: float
    """Largest RMSE over all runs [deg]."""
    worst_rmse_before_deg: float | None
    """The same with the gains before; null where a run was unstable [deg]."""
    short: str
    """What these gains fall short of, of what is looked for, and why; empty where they keep it all."""
    at_bounds: tuple[str, ...]
    """Which gains stand at a bound of the law or of the search, and what that means; empty where none does."""
    study: JudgedByStudy | None
    """With --study: what the gains make of plants that they were not tuned against; null without."""
    _: KW_ONLY
    made: "Tuning"
    motors: tuple[str | None, ...] = (None,)
    """In the gains of which motors these are; None of a rig with one motor."""
    alone: bool = False
    """True if one of several motors on one joint was tuned by itself."""

    def interruption(self) -> "BrokenOff":
        """With the best gains."""
        from bowden.design.tune import BrokenOff

        return BrokenOff(self.value)


def tune(
    rig: GivenRig,
    law: Annotated["GivenLaw | None", Switch(Role.PYTHON)] = None,
    *,
    preset: Annotated[str | None, Switch(Role.PYTHON)] = None,
    study: Path | None = None,
    motor: str | None = None,
    seed: Annotated[int, Switch(least=0)] = 0,
    generations: Annotated[int | None, Switch(Role.PYTHON, least=1)] = None,
    progress: GivenProgress = None,
) -> TuneResult:
    """Find gains of the rig's law that keep margins of 6 dB and 45°, and follow best.

    The margins are kept over all bends of the sheath. Best means the smallest error in the worst of nine runs. All
    motors on one joint (docs/several_motors.md) get the same gains, which are judged on the joint. The command writes
    the gains into the rig; interrupted, the best ones so far, if they are better than those before.

    Args:
        rig: the rig, whose [control.gains] the command rewrites; no log of a run is changed, and from Python no file.
        law: a key of `LAWS`, ``FILE.py:NAME`` or a `Law`; the rig's by default.
        preset: a named set of gains of that law, to begin with.
        study: tune against some of the plants of this study, and judge by others (docs/campaign.md).
        motor: the motor, of a rig with several.
        seed: seed of the search; the same seed gives the same result.
        generations: of the search; the time grows with them. 32 by default, 8 on a suit; both take minutes.
        progress: True for a line that says how far it is, or a function of what is being done and the share done.

    Returns:
        The tuning: ``rig``, the rig with the law and these gains; ``gains`` that changed; margins and errors.

    Raises:
        ParameterError: a rig, law, study or setting that cannot be used; or no gains hold, and the message names the
            nearest rig for which some do.
        BrokenOff: interrupted; a KeyboardInterrupt whose ``tuning`` has the best gains so far.

    Examples:
        bowden tune rig.toml
        bowden tune rig.toml --dry-run --json
        bowden tune rig.toml --study study.toml

    >>> from bowden import Rig, tune
    >>> tuning = tune(Rig(), "adaptive", generations=1)
    >>> tuning.rig.gains == tuning.gains, tuning.found.verdict
    (True, 'holds')
    """
    from bowden.design.objections import refusals
    from bowden.design.tune import BrokenOff
    from bowden.operations.support import given
    from bowden.operations.support.progress import reported
    from bowden.study.tune_law import tuned, tuned_together

    whole = given.rig_of(rig)
    shared = next((joint for joint in whole.each_joint if joint.shared), None)
    together = shared is not None and motor is None
    chosen = given.under(whole if together else whole.only(motor), law, preset)
    path = None if study is None else Path(study)
    alone = shared is not None and motor in shared.names
    notes = [*given.notes_of(chosen), *refusals(chosen)]
    if alone:
        notes.append(f"motor {motor} was tuned as if it were alone on the joint; check all together")
    broken = False
    with reported(progress, "tune") as report:
        try:
            search = tuned_together if together else tuned
            found = search(chosen, path, seed=seed, generations=generations, progress=report)
        except BrokenOff as broken_off:
            found, broken = broken_off.tuning, True
    return filled(
        TuneResult,
        found,
        rig=chosen.hash,
        law=found.law.name,
        preset=None if found.rig.motors else found.rig.preset,
        gains=dict(found.gains),
        before={name: found.stood[name] for name in found.gains},
        verdict=found.found.verdict,
        verdict_before=found.before.verdict,
        worst_rmse_before_deg=degrees(found.worst_before),
        made=found,
        motors=shared.names if together and shared is not None else (motor,),
        alone=alone,
        notes=tuple(notes),
        interrupted=f"the best gains after {found.generations} generations are" if broken else "",
    )


OPERATIONS = (Operation("tune", tune, 110),)
