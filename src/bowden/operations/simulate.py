"""`simulate`: laws on a rig, checked before they run."""

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, asdict, dataclass
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

from bowden.core.documented import Documented
from bowden.operations.check import Verdict
from bowden.operations.support.operation import GivenLaw, GivenProgress, GivenRig, Operation, Progress, Switch
from bowden.operations.support.results import Result
from bowden.records.run_figures import Metrics

if TYPE_CHECKING:
    from bowden.control import Law
    from bowden.design.verdict import CheckVerdict
    from bowden.records.trace import Trace, Traces
    from bowden.rig.joints import RigJoint
    from bowden.rig.rig import Rig


@dataclass(frozen=True)
class FeltTorque(Documented):
    """Interaction torque between wearer and suit."""

    rms_nm: float
    """RMS of the suit's torque on the elbow less the weight that it is to carry, settled [N m]."""
    peak_nm: float
    """Its largest size [N m]."""
    estimate_error_nm: float | None
    """RMS error of the torque that is estimated without a load cell [N m]."""


@dataclass(frozen=True)
class MotorRun(Documented):
    """One of several motors on one joint."""

    motor: str
    """Its name."""
    largest_pull_nm: float | None
    """Largest torque of its cable on the joint [N m]."""
    slack_share: float | None
    """Share of the run in which its cable was slack."""
    rms_current_a: float | None
    """RMS current of its motor [A]."""
    mechanical_energy_j: float | None
    """Integral of the mechanical power, Eq. 18 [J]."""
    electrical_energy_j: float | None
    """Integral of the electrical power, Eq. 18 [J]."""


@dataclass(frozen=True)
class SimulatedRun(Metrics):
    """One law that ran."""

    joint: str
    """The joint that was moved or, where one motor moves it, that motor. Empty of a rig with one motor."""
    law: str
    """Its name; laws of one name are numbered: adaptive-2."""
    check: Verdict | None
    """What bowden check says of it on this rig; null where it cannot judge a law of your own."""
    stable: bool
    """True if the run reached its end; if not, every figure is null."""
    interaction: FeltTorque | None
    """What the wearer felt of a suit that follows their push ([admittance]); null for any other run."""
    motors: tuple[MotorRun, ...]
    """The same for each of several motors on one joint; else empty."""


class SimulatedJoint(NamedTuple):
    """Motors and errors of one joint."""

    joint: "RigJoint"
    """With its motors, under the rig's own law."""
    traces: "Traces"
    """By law; of several motors on one joint by ``law-motor``."""
    runs: tuple[SimulatedRun, ...]
    by_law: "dict[str, Traces]"
    """Law → the trace of each motor, by its name."""
    notes: list[str]
    done: str
    """What was done before an interruption; empty where there was none."""

    @property
    def name(self) -> str:
        """Of the joint, and of the folder for its files in that of the whole; empty of a rig with one motor."""
        return self.joint.name


@dataclass(frozen=True)
class Simulation(Result[Any]):
    """Laws on a rig, side by side."""

    rig: str
    """Hash of the rig: equal rigs have the same, whether they come from a file, Python or a log."""
    runs: tuple[SimulatedRun, ...]
    """One entry for each law, in the order they were asked for; of a rig with several joints for each of them too."""
    _: KW_ONLY
    joints: tuple[SimulatedJoint, ...]
    whole: "Rig"
    alone: bool = True
    """True if one law was asked for, not in a list."""

    @property
    def value(self) -> "Trace | Traces":
        """The trace; of a list of laws all of them; of several motors by motor, or ``law-motor`` of a list."""
        from bowden.records.trace import Traces

        first, *others = self.joints
        if not others and not first.joint.shared:
            return next(iter(first.traces.values())) if self.alone else first.traces
        found = Traces()
        for one in self.joints:
            for law, traces in one.by_law.items():
                found |= {motor if self.alone else f"{law}-{motor}": trace for motor, trace in traces.items()}
        return found


def simulate(
    rig: GivenRig,
    law: Annotated["GivenLaw | Sequence[GivenLaw] | None", Switch(list[str])] = None,
    *,
    preset: str | None = None,
    duration: float | None = None,
    seed: int | None = None,
    motor: str | None = None,
    emg: str | None = None,
    force: bool = False,
    progress: GivenProgress = None,
) -> Simulation:
    """Simulate one law or several on a rig.

    Every law is checked first, as by `check`. A law that does not hold is refused. After Ctrl-C between two laws
    the command writes those that are done. Several joints are simulated one by one, each into a folder of its name;
    motors on one joint (docs/several_motors.md) are simulated together.

    Args:
        rig: the bench, reference and scenario; ``bowden init`` writes one.
        law: a law's name, or FILE.py:NAME of your own; several of them, side by side. The rig's law by default.
        preset: a named set of gains, for every law of this run.
        duration: length of the run, in place of the rig's [s].
        seed: seed of the encoders' noise and of a random bend, in place of the rig's.
        motor: one motor alone, of a rig with several.
        emg: EMG moves the joint: file:PATH of a recording, in place of the rig's.
        force: run laws that fail the check on the rig, too.
        progress: True for a line that says how far it is, or a function of what is being done and the share done.

    Returns:
        The trace. For a list of laws: a dictionary, name of the law → trace, which shows and draws all of them. Of
        several motors it is a dictionary for one law too, name of the motor → trace, and for a list of laws
        ``law-motor`` → trace.

    Raises:
        ParameterError: a rig, law or setting that cannot be used, or a law that does not hold.

    Examples:
        bowden simulate rig.toml
        bowden simulate rig.toml --law uncompensated --law observer --law adaptive
        bowden simulate rig.toml --law my_law.py --duration 30 --csv
        bowden simulate rig.toml --law adaptive --preset paper --force --json

    >>> from bowden import Rig, simulate
    >>> trace = simulate(Rig(duration=5.0), "uncompensated")
    >>> trace.metrics().peak_deg > 1.0
    True
    >>> list(simulate(Rig(duration=5.0), ["uncompensated", "adaptive"]))
    ['uncompensated', 'adaptive']
    """
    from bowden.operations.support import given
    from bowden.operations.support.progress import reported

    changes = {name: value for name, value in (("duration", duration), ("seed", seed)) if value is not None}
    whole = given.of_motor(given.rig_of(rig), motor)
    whole = whole.replace(**changes) if changes else whole
    whole = whole if emg is None else whole.with_emg(emg)
    laws = given.several(law)
    chosen, entire, joints = [law] if laws is None else laws, duration is not None, list[SimulatedJoint]()
    with reported(progress, "simulate") as report:
        for joint in whole.each_joint:
            joints.append(_of_joint(joint, [_under(joint, name, preset) for name in chosen], force, entire, report))
    return Simulation(
        whole.hash,
        tuple(run for one in joints for run in one.runs),
        joints=tuple(joints),
        whole=whole,
        alone=laws is None,
        notes=tuple(note for one in joints for note in one.notes),
        interrupted=next((one.done for one in joints if one.done), ""),
    )


def _under(joint: "RigJoint", law: GivenLaw | None, preset: str | None) -> "RigJoint":
    """The joint with all of its motors under a law; their own where none is given."""
    from bowden.operations.support import given

    return joint._replace(motors=tuple(one._replace(rig=given.under(one.rig, law, preset)) for one in joint.motors))


def _of_joint(
    joint: "RigJoint", under: "Sequence[RigJoint]", force: bool, entire: bool, progress: Progress
) -> SimulatedJoint:
    """A joint with all of its motors, under each of the laws."""
    from bowden.design.objections import refusals
    from bowden.design.verdict import verdicts
    from bowden.operations.support import given
    from bowden.records.trace import Traces
    from bowden.sim.rig_runs import laws_of, run_of_joint

    setup, laws = joint.first.offline(whole=entire), [laws_of(one) for one in under]
    firsts = [law for law, *_ in laws]
    offline = joint if joint.shared else joint._replace(motors=(joint.motors[0]._replace(rig=setup),))
    progress(f"checking {', '.join(law.name for law in firsts)} (compiled at first)", 0.0)
    checked = verdicts(offline, laws, given.name_of(setup), force=force)
    pushing = setup.pushing.notes(firsts, force=force) if setup.pushing else []
    by_law, ended = given.in_turn(firsts, lambda i: run_of_joint(joint, laws[i], setup.hash, whole=entire), progress)
    runs = []
    for (law, each), verdict in zip(by_law.items(), checked, strict=False):
        first = next(iter(each.values()))
        figures = asdict(first.metrics())
        if joint.shared:
            figures |= {"mechanical_energy_j": None, "electrical_energy_j": None}
        runs.append(
            SimulatedRun(
                joint=joint.name,
                law=law,
                check=verdict.name,
                stable=first.stable,
                interaction=_felt(setup, first),
                motors=tuple(_motor(name, trace) for name, trace in each.items() if joint.shared),
                **figures,
            )
        )
    traces = Traces(
        {f"{law}-{name}" if joint.shared else law: one for law, each in by_law.items() for name, one in each.items()}
    )
    said = [] if joint.shared else [*refusals(setup)]
    if not (joint.shared or said):
        said = _ending(setup, firsts, by_law, checked)
    notes = [*setup.notes, *said, *pushing, *(one.note for one in checked if one.note), *_of_suit(setup)]
    done = f"{', '.join(by_law)} (of {len(laws)} laws) done and" if ended else ""
    return SimulatedJoint(joint, traces, tuple(runs), by_law, notes, done)


def _ending(
    rig: "Rig", laws: "Sequence[Law]", found: "Mapping[str, Traces]", verdicts: "Sequence[CheckVerdict]"
) -> list[str]:
    """That the supervisor would end a live run of what was simulated, under laws that hold."""
    from bowden.design.forecast import foreseen
    from bowden.design.objections import as_notes

    ran = zip(laws, found.values(), verdicts, strict=False)
    ends = (foreseen(rig, law, next(iter(each.values()))) for law, each, one in ran if one.name != "does_not_hold")
    return list(as_notes(one for one in ends if one))


def _motor(name: str, trace: "Trace") -> MotorRun:
    """Figures of one motor and its cable; None of a run that ran away."""
    import numpy as np

    metrics, pull, current = trace.metrics(), trace["pull"], trace["current"]
    ended = trace.ended
    return MotorRun(
        name,
        float(np.max(pull)) if ended else None,
        float(np.mean(pull <= 0.0)) if ended else None,
        float(np.sqrt(np.mean(current**2))) if ended else None,
        metrics.mechanical_energy_j,
        metrics.electrical_energy_j,
    )


def _of_suit(rig: "Rig") -> list[str]:
    """What is said of a suit whose drive does not follow its target in gears with friction."""
    if rig.worn is None or rig.worn.motor.integral > 0.0 or rig.pushing is not None:
        return []
    less = "friction in the gears then leaves any law degrees of error; bowden init --suit has 40"
    return [f"suit.drive_integral_per_s is 0: {less}"]


def _felt(rig: "Rig", trace: "Trace") -> FeltTorque | None:
    """What the wearer felt of a suit that follows their push; None of any other run, and of one that ran away."""
    if rig.pushing is None or not trace.ended:
        return None
    from bowden.design.felt import felt

    found = felt(trace, rig.pushing.suit.arm, rig.pushing.section.carried)
    return FeltTorque(found.rms, found.peak, found.estimate)


OPERATIONS = (Operation("simulate", simulate, 30),)
