"""The closed loop: a law against any plant, compiled as one function, with a trace of every cycle."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden import __version__
from bowden.control import user_law
from bowden.control.conditioning import COLUMNS as CONDITIONED
from bowden.control.conditioning import Conditioning
from bowden.control.law import Law
from bowden.control.reference import Trajectory
from bowden.control.source import TABLE, Source
from bowden.core.errors import ParameterError
from bowden.core.kernel import kernel, specialise
from bowden.core.nested import flat
from bowden.core.signals import Reference
from bowden.cycle.one_cycle import BARE, LAW, Plan, bare_settings, bare_start, law_and_source, one_cycle
from bowden.models.cable.sheath_path import BendPath, constant_bend
from bowden.plants.plant import (
    Dynamics,
    Plant,
    SheathPath,
    joint_sense,
    joint_start,
    measured_as,
    plain,
    plant_advance,
    plant_effort,
    plant_look,
    plant_observe,
    plant_rest,
    refuse_no_number,
    sample_of,
    sheath_at,
    sheath_path,
)
from bowden.records.trace import Trace
from bowden.sim.injected import Injected, SensorFault, as_it_is, faulty

Array = NDArray[np.float64]

RECORDED = {"joint_measured": "rad", "motor_measured": "rad", "command": "rad", "current": "A"}
"""Columns that the compiled loop fills beside the plant's own, in its order, and their units."""

RUNAWAY = 1e3
"""A command beyond this [rad] ends the run: the loop is unstable and the rest of the record stays NaN."""

_AT_ONCE = 15_000
"""Cycles whose reference is worked out in one go; beyond that the system hands out fresh memory for every step."""


@kernel
def run_loop(
    gains: Any,
    conditioning: Conditioning,
    source: Any,
    plant: Any,
    sensing: Any,
    references: Array,
    sheath: SheathPath,
    normals: Array,
    initial_motor: float,
    dt: float,
    delay: int,
    record: Array,
    states: Array,
    fault: Any,
    kept: Array,
    allowed: float,
) -> int:
    """One run; returns the number of cycles that it lasted.

    Each cycle reads the sensors, asks the source for the reference, steps the law, and moves the plant by one sample
    time under the command that was computed `delay` cycles before. The sheath goes straight from cycle to cycle.

    Args:
        gains: of the law.
        conditioning: of its reference.
        source: settings of what makes the reference.
        plant: `Dynamics.plant`.
        sensing: `Dynamics.sensing`.
        references: what the source gets (3, n); overwritten with what it makes of them.
        sheath: at the edges of the cycles.
        normals: of the sensors (n, m).
        initial_motor: angle at rest before the start [rad].
        dt: length of a cycle [s].
        delay: from a sample to the moment its command reaches the servo [cycles].
        record: to be filled: `RECORDED`, then the plant's columns.
        states: to be filled: the law's state, the reference that it was shown with what the conditioner remembers, then
            the source's state, as far as there is room.
        fault: of a sensor; a number in a loop in which none fails.
        kept: (2, n) for the readings that a fault may look back at; without one it is not touched.
        allowed: the run ends where the sum of its squared errors is larger [rad²].
    """
    cycles, spent = references.shape[1], 0.0
    body = plant_rest(plant, initial_motor, sheath_at(sheath, 0))
    seen = plant_look(plant, body)
    sensor = joint_start(sensing, seen[0], initial_motor)
    _, first = joint_sense(sensing, sensor, plant_observe(plant, body, normals[0])[1], seen[0], normals[0], dt)
    settings = bare_settings(gains, conditioning, source)
    state = bare_start(settings, measured_as(sample_of(first), first))
    for k in range(cycles):
        body, read = plant_observe(plant, body, normals[k])
        seen = plant_look(plant, body)  # which begins with its joint
        sensor, measured = joint_sense(sensing, sensor, read, seen[0], normals[k], dt)
        sample = as_it_is(fault, sample_of(measured), kept, k)
        measured = measured_as(sample, measured)
        scheduled = Reference(references[0, k], references[1, k], references[2, k])
        state, reference, command, _ = one_cycle(settings, state, measured, Plan(LAW, initial_motor, scheduled), dt)
        references[0, k], references[1, k], references[2, k] = reference
        now = sheath_at(sheath, k)
        record[0, k] = sample.joint
        record[1, k] = sample.motor
        record[2, k] = command
        record[3, k] = plant_effort(plant, body, now)
        columns = flat(seen)
        for j in range(len(columns)):
            record[4 + j, k] = columns[j]
        if states.shape[0] > 0:
            numbers = flat((state.law, state.conditioned))  # a number of stores that the compiler knows, without a jump
            for j in range(len(numbers)):
                states[j, k] = numbers[j]
            if states.shape[0] > len(numbers):
                asked = flat(state.source)
                for j in range(len(asked)):
                    states[len(numbers) + j, k] = asked[j]
        spent += (seen[0] - reference.position) ** 2
        if not abs(command) < RUNAWAY or spent > allowed:
            return k
        applied = record[2, k - delay] if k >= delay else initial_motor
        body = plant_advance(plant, body, applied, now, sheath_at(sheath, k + 1))
    return cycles


class Case(NamedTuple):
    """One plant with all that happens to it, and the laws that are set against it with the same noise."""

    plant: Plant
    laws: tuple[Law, ...]
    reference: Trajectory
    bend: BendPath
    seed: int
    """Of the sensors' noise."""
    initial_motor: float | None = None
    """As `simulate` takes it [rad]."""
    fault: SensorFault | None = None
    """Of a sensor."""
    sources: tuple[Source, ...] = ()
    """What makes the reference, one for each law; the table of `reference` itself where there are none."""

    def source_of(self, i: int) -> Source:
        """What makes the reference of law i."""
        return self.sources[i] if self.sources else TABLE

    def trace(self, i: int, duration: float) -> Trace:
        """The run of law i, with its trace, for `duration` [s].

        Raises:
            ParameterError: a duration or a part of the plant that cannot be.
        """
        return Ready(self, duration).trace(self.laws[i], self.source_of(i))


class Inputs(NamedTuple):
    """All that is known of a run before it begins."""

    time: Array  # (n,) [s]
    references: Array  # (3, n)
    sheath: SheathPath
    normals: Array  # (n, m)


def simulate(
    plant: Plant,
    law: Law,
    reference: Trajectory,
    *,
    duration: float,
    bend: BendPath | None = None,
    seed: int = 0,
    initial_motor: float | None = None,
    source: Source = TABLE,
    fault: SensorFault | None = None,
) -> Trace:
    """Run a law against a plant.

    Args:
        plant: any: the bench, a plant round another cable, a suit on an arm, a user's own.
        law: the control law with its gains.
        reference: the joint's desired motion.
        duration: length of the run [s].
        bend: the sheath's total bend over time; constant at the identified bend where it is not given.
        seed: of the sensors' noise.
        initial_motor: motor angle at rest before the start [rad]; where it is not given 0, and on a plant whose motor
            is counted in the joint's coordinate where the reference begins.
        source: what makes the reference, cycle by cycle; the table of `reference` itself if nothing else is given.
        fault: of a sensor; the measured columns have what the law was shown.

    Returns:
        The trace: time, reference, the plant's columns, its sheath, and the state of the law and of the source; of a
        run that ran away (a command beyond 1000 rad or not a number) the rest is NaN.

    Raises:
        ParameterError: a duration, a setting or a part of the plant that cannot be, or a user's own plant or law that
            gives no number.
    """
    path = bend or constant_bend(plant.sheath.bend)
    return Ready(Case(plant, (), reference, path, seed, initial_motor, fault), duration).trace(law, source)


class Ready:
    """A case with its inputs over time, for one law after the other.

    Args:
        case: whose laws are not looked at.
        duration: of a run [s].
        before: another one; what both share is not made again.

    Raises:
        ParameterError: a duration or setting that cannot be.
    """

    def __init__(self, case: Case, duration: float, before: "Ready | None" = None) -> None:
        self.case, self.duration, self.dynamics, plant = case, duration, case.plant.dynamics(), case.plant
        old = before if before is not None and (before.duration, before.dt) == (duration, plant.sample_time) else None
        sampled = old.inputs.references if old is not None and old.case.reference is case.reference else None
        self.inputs: Inputs = inputs_of(plant, case.reference, duration, case.bend, case.seed, self.dynamics, sampled)
        if old is not None and old.case.bend is case.bend and old.case.plant.sheath == plant.sheath:
            self.inputs = self.inputs._replace(sheath=old.inputs.sheath)
        self.initial = initial_angle(self.dynamics, case.initial_motor, self.inputs.references)
        self._kept: Array | None = None if old is None else old._kept

    @property
    def dt(self) -> float:
        """Length of a cycle [s]."""
        return self.case.plant.sample_time

    @property
    def rows(self) -> list[str]:
        """Names of the rows that a run records."""
        return [*RECORDED, *self.dynamics.columns]

    def scratch(self) -> Array:
        """Memory for references and `rows`, which runs of one length share: a system takes its time to hand it out."""
        shape = 3 + len(self.rows), len(self.inputs.time)
        if self._kept is None or self._kept.shape != shape:
            self._kept = np.empty(shape)
        return self._kept

    def run(
        self, law: Law, source: Source, references: Array, block: Array, allowed: float = np.inf
    ) -> tuple[int, dict[str, Array]]:
        """Run a law: how many cycles it lasted, and what it recorded by `rows`.

        Args:
            law: with its gains.
            source: of the reference.
            references: (3, n), those of the inputs; overwritten with what the source makes of them.
            block: to be filled, the `rows` and below them the states, if there is room (m, n).
            allowed: the run ends where the sum of its squared errors is larger [rad²].

        Raises:
            ParameterError: a plant of the user's own that fails.
        """
        case, inputs, count, fault = self.case, self.inputs, len(self.rows), self.case.fault or SensorFault()
        fails = fault.kind != Injected.NOTHING
        with self.dynamics.explained():
            lasted = compiled_loop(self.dynamics, law, source, fails=fails)(
                law.gains,
                law.conditioning,
                source.settings,
                self.dynamics.plant,
                self.dynamics.sensing,
                references,
                inputs.sheath,
                inputs.normals,
                self.initial,
                case.plant.sample_time,
                case.plant.delay,
                block[:count],
                block[count:],
                fault if fails else 0.0,  # the type of an enum's member is sought at each call, a number's is known
                np.empty((2, len(inputs.time) if fails else 0)),
                allowed,
            )
        return lasted, dict(zip(self.rows, block, strict=False))

    def trace(self, law: Law, source: Source = TABLE) -> Trace:
        """The trace of a law's run; see `simulate`."""
        plant, dynamics, inputs, references = self.case.plant, self.dynamics, self.inputs, self.inputs.references.copy()
        laws, asked = state_columns(law, source)
        # one block: a system hands out a large piece of memory far faster than many small ones
        names = [*self.rows, *laws, *asked]
        block = np.empty((len(names), len(inputs.time)))
        lasted, _ = self.run(law, source, references, block)
        found = dict(zip(names, block, strict=True))
        if not self.case.fault or self.case.fault.kind == Injected.NOTHING:  # else no number is what it is to show
            refuse_no_number_in({name: found[name] for name in (*self.rows, *laws)}, inputs.time, lasted, law, dynamics)
        block[:, lasted:] = np.nan
        if source is not TABLE:
            references[:, lasted:] = np.nan
        values = {"time": inputs.time, "reference": references[0], "reference_velocity": references[1]}
        values |= {name: found[name] for name in ("joint", "motor", "joint_measured", "motor_measured", "command")}
        values |= {name: found[name] for name in dynamics.columns if name not in values}
        values |= plant.sheath_columns(found["joint"], inputs.sheath)
        values |= {"current": found["current"]}
        values |= {name: found[name] for name in (*laws, *asked)}
        units = {"time": "s", "reference": "rad", "reference_velocity": "rad/s", **RECORDED, **dynamics.columns}
        units |= {"bend": "rad", "width": "1", "slope": "rad/rad", **laws, **asked}
        settings = settings_of(plant, law, self.case.reference, source, self.initial)
        return Trace(values, {name: units[name] for name in values}, settings, self.case.seed)


def refuse_no_number_in(
    found: Mapping[str, Array], time: Array, lasted: int, law: Law, dynamics: Dynamics | None = None
) -> None:
    """Refuse a run in which a user's own plant or law gave what is no number, by what was the first.

    Args:
        found: columns of the run, or of one motor of several.
        time: of its cycles (n,) [s].
        lasted: how many cycles were run.
        law: that led.
        dynamics: of a plant that may be the user's own.

    Raises:
        ParameterError: one of them did.
    """
    if not (user_law.is_own(law) or (dynamics is not None and dynamics.file)):
        return
    end = min(lasted + 1, len(time))
    seen = [] if dynamics is None else [*dynamics.columns, "joint_measured", "motor_measured"]
    given = ["command", *(name for name in found if name.startswith("law."))]
    firsts = []
    for names in (seen, given):
        fine = np.isfinite([found[name][:end] for name in names]).all(axis=0)
        firsts.append(int(np.flatnonzero(~fine)[0]) if not np.all(fine) else end)
    k = min(firsts)
    if dynamics is not None and k < end and firsts[0] <= firsts[1]:  # a law that is shown no number gives none
        refuse_no_number(dynamics, {name: float(found[name][k]) for name in seen}, float(time[k]))
    elif k < end:
        user_law.refuse_no_number(law, {name: float(found[name][k]) for name in given}, float(time[k]))


def initial_angle(dynamics: Dynamics, initial_motor: float | None, references: Array) -> float:
    """Where the motor rests before a run [rad]; see `simulate`."""
    if initial_motor is None:
        return float(references[0, 0]) if dynamics.begins_at_reference else 0.0
    return float(initial_motor)


def compiled_loop(dynamics: Dynamics, law: Law, source: Source = TABLE, *, fails: bool = False) -> Callable[..., int]:
    """`run_loop` with these kernels in it, compiled at the first call and cached on disk.

    Args:
        dynamics: of the plant.
        law: whose.
        source: of the reference.
        fails: whether a sensor may go wrong in it.
    """
    parts = {**law_and_source(law, source), **BARE, **dynamics.kernels()} | ({"as_it_is": faulty} if fails else {})
    return specialise(run_loop, f"{law.name}_{dynamics.name}", **parts)


def state_columns(law: Law, source: Source) -> tuple[dict[str, str], dict[str, str]]:
    """What law, conditioner and source remember, as a trace names it, each with its unit; a table's is left out."""
    return law.columns(), CONDITIONED | ({} if source is TABLE else source.columns())


def check_clock(plant: Plant, duration: float) -> None:
    """Refuse a clock, a delay or a duration that cannot be.

    Raises:
        ParameterError: one of these.
    """
    dt = plant.sample_time
    for name, value, fine in (
        ("sample_time", dt, dt > 0.0),
        ("duration", duration, 2.0 * dt <= duration < 1e9 * dt),
        ("delay", plant.delay, plant.delay >= 0),
    ):
        if not fine:
            raise ParameterError(f"simulate: {name} is {value}", expected="a positive number in a sensible range")


def inputs_of(
    plant: Plant,
    reference: Trajectory,
    duration: float,
    bend: BendPath | None = None,
    seed: int = 0,
    dynamics: Dynamics | None = None,
    sampled: Array | None = None,
) -> Inputs:
    """The reference, the sheath and the noise of a run; the arguments are those of `simulate`.

    The reference is not looked at where it is `sampled` already (3, n).

    Raises:
        ParameterError: a duration or setting that cannot be.
    """
    check_clock(plant, duration)
    edges = np.arange(round(duration / plant.sample_time) + 1, dtype=np.float64) * plant.sample_time
    cycles = len(edges) - 1
    references = np.empty((3, cycles)) if sampled is None else sampled
    for begin in range(0, cycles if sampled is None else 0, _AT_ONCE):
        part = slice(begin, min(begin + _AT_ONCE, cycles))
        references[:, part] = reference.sample(edges[part]).T
    normals = np.empty((cycles, (dynamics or plant.dynamics()).normals))
    plant.draw(seed, normals)
    path = sheath_path(plant.sheath, (bend or constant_bend(plant.sheath.bend))(edges))
    return Inputs(edges[:-1], references, path, normals)


def settings_of(plant: Plant, law: Law, reference: Trajectory, source: Source, initial: float) -> dict[str, Any]:
    """What a trace keeps of how it was made."""
    own = {} if source is TABLE else {source.name: plain(source.settings)}
    return {
        "bowden": __version__,
        "law": law.name,
        "gains": plain(law.gains),
        "reference": reference.describe(),
        "plant": plant.describe(),
        "sample_time": plant.sample_time,
        "initial_motor": initial,
        "motor_resistance": plant.motor.resistance,
        "torque_constant": plant.motor.torque_constant * plant.motor.gear,
        **own,
    }
