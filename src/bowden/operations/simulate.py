"""`simulate`: laws on a rig, checked before they run."""

from collections.abc import Sequence
from dataclasses import KW_ONLY, asdict, dataclass
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

from bowden.operations.check import Verdict
from bowden.operations.support.operation import GivenLaw, GivenProgress, GivenRig, Operation, Progress, Switch
from bowden.operations.support.results import Result, ResultPart
from bowden.records.run_figures import Metrics

if TYPE_CHECKING:
    from bowden.records.trace import Trace
    from bowden.records.traces import Traces
    from bowden.rig.rig import Rig


@dataclass(frozen=True)
class FeltTorque(ResultPart):
    """What the wearer felt of the suit."""

    rms_nm: float
    """RMS of the suit's torque on the elbow less the weight that it is to carry, settled [N m]."""
    peak_nm: float
    """Its largest size [N m]."""
    estimate_error_nm: float | None
    """RMS error of the torque that is estimated without a load cell [N m]."""


@dataclass(frozen=True)
class MotorRun(ResultPart):
    """One of two motors on one joint."""

    axis: str
    """Its name."""
    largest_pull_nm: float | None
    """Largest torque of its cable on the joint [N m]."""
    slack_share: float | None
    """Share of the run in which its cable was slack."""
    rms_current_a: float | None
    """Of its motor [A]."""
    mechanical_energy_j: float | None
    """Integral of the mechanical power, Eq. 18 [J]."""
    electrical_energy_j: float | None
    """Integral of the electrical power, Eq. 18 [J]."""


@dataclass(frozen=True)
class SimulatedRun(Metrics):
    """One law that ran."""

    axis: str
    """The axis that ran; two motors on one joint are named together. Empty of a rig with one motor."""
    law: str
    """Its name; laws of one name are numbered: adaptive-2."""
    check: Verdict | None
    """What bowden check says of it on this rig; null where it cannot judge a law of your own."""
    stable: bool
    """Whether the run reached its end; if not, every figure is null."""
    interaction: FeltTorque | None
    """What the wearer felt of a suit that follows their push ([admittance]); null for any other run."""
    motors: tuple[MotorRun, ...]
    """Of two motors on one joint each, the agonist first; else empty."""


class SimulatedJoint(NamedTuple):
    """What ran on one joint."""

    axis: str
    """As in `SimulatedRun`."""
    folder: str
    """For its files, in that of the whole; empty for that itself."""
    rig: "Rig"
    traces: "Traces"
    """By law; of two motors on one joint by ``law-axis``."""
    runs: tuple[SimulatedRun, ...]
    by_law: "dict[str, Traces]"
    """Of two motors on one joint, law → the trace of each motor."""


@dataclass(frozen=True)
class Simulation(Result[Any]):
    """Laws on a rig, side by side."""

    rig: str
    """Hash of the rig: equal rigs have the same, whether they come from a file, Python or a log."""
    runs: tuple[SimulatedRun, ...]
    """One entry for each law, in the order they were asked for; of a rig with several axes for each of them too."""
    _: KW_ONLY
    joints: tuple[SimulatedJoint, ...]
    whole: "Rig"
    alone: bool = True
    """Whether one law was asked for, not in a list."""

    @property
    def value(self) -> "Trace | Traces":
        """The trace; of a list of laws all of them; of several axes by axis, or ``law-axis`` of a list."""
        from bowden.records.traces import Traces

        first, *others = self.joints
        if not others and not first.by_law:
            return next(iter(first.traces.values())) if self.alone else first.traces
        found = Traces()
        for one in self.joints:
            by_law = one.by_law or {law: Traces({one.axis: trace}) for law, trace in one.traces.items()}
            for law, traces in by_law.items():
                found |= {axis if self.alone else f"{law}-{axis}": trace for axis, trace in traces.items()}
        return found


def simulate(
    rig: GivenRig,
    law: Annotated["GivenLaw | Sequence[GivenLaw] | None", Switch(list[str])] = None,
    *,
    preset: str | None = None,
    duration: float | None = None,
    seed: int | None = None,
    axis: str | None = None,
    emg: str | None = None,
    force: bool = False,
    progress: GivenProgress = None,
) -> Simulation:
    """Simulate one law or several on a rig.

    Every law is checked first, as by `check`. A law that does not hold is refused. Interrupted between two laws, the
    command writes those that are done. Of a rig with several axes each is simulated by itself, into a folder of its
    name; two motors on one joint (docs/pair.md) together, into the folder pair.

    Args:
        rig: the bench, reference and scenario; ``bowden init`` writes one.
        law: a law's name, or FILE.py:NAME of your own; several of them, side by side. The rig's law by default.
        preset: a named set of gains, for every law of this run.
        duration: length of the run, in place of the rig's [s].
        seed: of the encoders' noise and of a random bend, in place of the rig's.
        axis: one axis alone, of a rig with several.
        emg: EMG moves the joint: file:PATH of a recording, in place of the rig's.
        force: run laws that fail the check on the rig, too.
        progress: True for a line that says how far it is, or a function of what is being done and the share done.

    Returns:
        The trace. For a list of laws: a dictionary, name of the law → trace, which shows and draws all of them. Of two
        motors on one joint it is a dictionary for one law too, name of the axis → trace, and for a list of laws
        ``law-axis`` → trace.

    Raises:
        ParameterError: a rig, law or setting that cannot be used, or a law that does not hold.

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
    whole = given.with_axis(given.rig_of(rig), axis)
    whole = whole.replace(**changes) if changes else whole
    whole = whole if emg is None else whole.with_emg(emg)
    laws = given.several(law)
    entire, chosen = duration is not None, [law] if laws is None else laws
    joints, notes, interrupted = [], [], ""
    with reported(progress, "simulate") as report:
        for one in given.singles(whole):
            rigs = [given.under(one.rig, name, preset) for name in chosen]
            found, said, ended = _of_motor(one.name, one.rig.offline(whole=entire), rigs, force, report)
            joints.append(found)
            notes += said
            interrupted = interrupted or ended
        if given.joint_name(whole):
            rigs = [given.under(whole, name, preset) for name in chosen]
            found, said, ended = _of_pair(rigs, force, entire, report)
            joints.append(found)
            notes += said
            interrupted = interrupted or ended
    runs = tuple(run for joint in joints for run in joint.runs)
    return Simulation(
        whole.hash,
        runs,
        joints=tuple(joints),
        whole=whole,
        alone=laws is None,
        notes=tuple(notes),
        interrupted=interrupted,
    )


def _of_motor(
    name: str, setup: "Rig", rigs: "Sequence[Rig]", force: bool, progress: Progress
) -> tuple[SimulatedJoint, list[str], str]:
    """One axis, or a rig with one motor, under each of the laws; what the user should know, and what was done."""
    from bowden.design.objections import refusals
    from bowden.design.verdict import verdicts
    from bowden.operations.support import given
    from bowden.records.traces import Traces
    from bowden.sim.one_run import run_of

    laws = [rig.fitted() for rig in rigs]
    progress(f"checking {', '.join(law.name for law in laws)} (compiled at first)", 0.0)
    checked = verdicts(setup, laws, given.name_of(setup), force=force)
    pushing = setup.pushing.notes(laws, force=force) if setup.pushing else []
    found, ended = given.in_turn(laws, lambda i: run_of(setup, laws[i]), progress)
    runs = tuple(
        SimulatedRun(
            axis=name,
            law=law,
            check=verdict.name,
            stable=trace.stable,
            interaction=_felt(setup, trace),
            motors=(),
            **asdict(trace.metrics()),
        )
        for (law, trace), verdict in zip(found.items(), checked, strict=False)
    )
    notes = [*setup.notes, *refusals(setup), *pushing, *(one.note for one in checked if one.note), *_of_suit(setup)]
    done = f"{', '.join(found)} (of {len(laws)} laws) done and" if ended else ""
    return SimulatedJoint(name, name, setup, Traces(found), runs, {}), notes, done


def _of_pair(
    rigs: "Sequence[Rig]", force: bool, entire: bool, progress: Progress
) -> tuple[SimulatedJoint, list[str], str]:
    """Two motors on one joint, under each of the laws."""
    from bowden.design.check_rig import pair_laws
    from bowden.design.verdict import pair_verdicts
    from bowden.operations.support import given
    from bowden.records.traces import Traces
    from bowden.sim.pair_of_rig import agonist_of, run_of_pair

    laws = [pair_laws(rig) for rig in rigs]
    progress(f"checking {', '.join(one.name for one, _ in laws)} (compiled at first)", 0.0)
    checked = pair_verdicts(rigs, given.name_of(rigs[0]), force=force)
    firsts, name = [one for one, _ in laws], given.joint_name(rigs[0])
    found, ended = given.in_turn(firsts, lambda i: run_of_pair(rigs[i], laws[i], whole=entire), progress)
    runs = []
    for (law, both), verdict in zip(found.items(), checked, strict=False):
        first = next(iter(both.values()))
        motors = tuple(_motor(axis, trace) for axis, trace in both.items())
        figures = asdict(first.metrics()) | {"mechanical_energy_j": None, "electrical_energy_j": None}
        told = {"check": verdict.name, "stable": first.stable, "interaction": None, "motors": motors}
        runs.append(SimulatedRun(axis=name, law=law, **told, **figures))
    traces = Traces({f"{law}-{axis}": trace for law, both in found.items() for axis, trace in both.items()})
    notes = [*agonist_of(rigs[0]).notes, *(one.note for one in checked if one.note)]
    done = f"{', '.join(found)} (of {len(laws)} laws) done and" if ended else ""
    return SimulatedJoint(name, "pair", rigs[0], traces, tuple(runs), found), notes, done


def _motor(axis: str, trace: "Trace") -> MotorRun:
    """Figures of one motor and its cable; None of a run that ran away."""
    import numpy as np

    metrics, pull, current = trace.metrics(), trace["pull"], trace["current"]
    ended = trace.ended
    return MotorRun(
        axis,
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


OPERATIONS = (
    Operation(
        "simulate",
        simulate,
        (
            "bowden simulate rig.toml",
            "bowden simulate rig.toml --law uncompensated --law observer --law adaptive",
            "bowden simulate rig.toml --law my_law.py --duration 30 --csv",
            "bowden simulate rig.toml --law adaptive --preset paper --force --json",
        ),
        place=30,
    ),
)
