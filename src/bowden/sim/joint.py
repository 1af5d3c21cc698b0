"""Several motors on one joint, each under a law of its own: one loop, compiled as one function, with a trace for each.

The joint stands where all cables' pulls are in balance (`bowden.models.cable.shared_joint`). Each cable is played in
the coordinate in which its motor pulls upwards; everything else, and all traces, are in the joint's. At one sample
all laws see the joint's one encoder and their own motor's, from which the co-contraction is taken away.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.control.conditioning import Conditioning
from bowden.control.law import Law
from bowden.control.reference import Trajectory
from bowden.control.source import TABLE, Measurement
from bowden.core.errors import ParameterError
from bowden.core.kernel import kernel, specialise
from bowden.core.nested import flat
from bowden.core.signals import Reference
from bowden.cycle.one_cycle import BARE, LAW, Plan, bare_settings, bare_start, law_and_source, one_cycle
from bowden.models.cable.shared_joint import JointLoad, cable_pull, shared_joint
from bowden.models.cable.sheath_path import BendPath, constant_bend
from bowden.models.drive.encoder import Encoder, reading
from bowden.plants.bench import Bench, prepare_bench
from bowden.plants.bench_body import BenchBody, Moving, bench_moved, bench_rest
from bowden.plants.plant import SheathPath, sheath_at
from bowden.records.trace import Trace
from bowden.sim.run import RUNAWAY, inputs_of, refuse_no_number_in, settings_of, state_columns

Array = NDArray[np.float64]
Range = tuple[float, float]
"""Smallest and largest bend of one sheath, or ends of a stroke [rad]."""

OF_SIDE = {
    "motor": "rad",
    "motor_measured": "rad",
    "motor_velocity": "rad/s",
    "motor_acceleration": "rad/s²",
    "command": "rad",
    "current": "A",
    "pull": "N·m",
}
"""Columns that the loop fills for each motor, in its order, and their units; ``pull`` is the cable's torque on the
joint, 0 where it is slack."""


class JointMotor(NamedTuple):
    """One motor with its cable, and who leads it."""

    name: str
    bench: Bench
    """Motor, cable and encoders, in the coordinate in which the motor pulls upwards."""
    bend: BendPath
    """The sheath's total bend over time."""
    seed: int
    """Of the encoders' noise."""
    sign: float
    """1 where the motor pulls the joint up, −1 where it pulls it down [–]."""

    def own_stroke(self, stroke: Range) -> Range:
        """Ends of the joint's motion in this motor's coordinate, the lower first [rad]."""
        one, other = (self.sign * end for end in stroke)
        return min(one, other), max(one, other)


class CabledJoint(NamedTuple):
    """Several motors on one joint."""

    motors: tuple[JointMotor, ...]
    """The drive of the first has the joint's encoder."""
    stiffness: float
    """Of each cable at the joint [N·m/rad]."""
    co_contraction: float
    """How much further each motor pulls than the joint asks for [rad]."""

    @property
    def load(self) -> JointLoad:
        """What all pull at; the spring is that of the first motor that pulls upwards, as in the twin."""
        motor = next(one.bench.motor for one in self.motors if one.sign > 0.0)
        return JointLoad(self.stiffness, motor.pretension, motor.spring)

    @property
    def first(self) -> Bench:
        """Of the motor whose drive has the joint's encoder; its clock is that of all."""
        return self.motors[0].bench

    def at_bends(self, bends: Sequence[float]) -> "CabledJoint":
        """The joint with its sheaths held at these bends [rad]."""
        held = zip(self.motors, bends, strict=True)
        return self._replace(motors=tuple(one._replace(bend=constant_bend(bend)) for one, bend in held))

    def seeded(self, seed: int) -> "CabledJoint":
        """The joint whose encoders' noise begins with this seed."""
        return self._replace(motors=tuple(one._replace(seed=seed + i) for i, one in enumerate(self.motors)))

    def resting_motors(self, joint: float, bends: Sequence[float]) -> tuple[float, ...]:
        """The motors' angles, without co-contraction, at which each cable alone would have the joint at `joint` [rad].

        Args:
            joint: [rad]
            bends: total bend of each sheath [rad].

        Raises:
            ParameterError: a cable has its joint there at no motor angle.
        """
        each = zip(self.motors, bends, strict=True)
        return tuple(one.sign * one.bench.resting_motor(one.sign * joint, bend) for one, bend in each)


class Side(NamedTuple):
    """A motor as the loop is handed it."""

    gains: Any
    conditioning: Conditioning
    source: Any
    """Settings of the reference's source."""
    plant: Moving
    sheath: SheathPath
    normals: Array  # (n,)
    """Of the motor's encoder."""
    initial_motor: float
    """Before the start, in the joint's coordinate and without co-contraction [rad]."""
    sign: float
    contraction: float
    """[rad]"""
    delay: int
    """[cycles]"""


@kernel
def own_angle(side: Side, motor: float) -> float:
    """A motor's angle in the coordinate in which it pulls upwards, with the co-contraction [rad]."""
    return side.sign * motor + side.contraction


@kernel
def joint_angle(side: Side, own: float) -> float:
    """The other way round [rad]."""
    return side.sign * (own - side.contraction)


@kernel
def measure(side: Side, body: BenchBody, joint: float, k: int) -> Measurement:
    """What a law sees in cycle k, the `joint` being measured [rad]."""
    motor = reading(body.motor.position, side.normals[k], side.plant.motor_encoder)
    return Measurement(joint, joint_angle(side, motor), np.nan, np.nan, np.nan, np.nan)


@kernel
def moved(side: Side, body: BenchBody, commands: Array, k: int) -> BenchBody:
    """A motor with its cable one cycle later, under what its law has commanded up to cycle k."""
    command = commands[k - side.delay] if k >= side.delay else side.initial_motor
    return bench_moved(
        side.plant, body, own_angle(side, command), sheath_at(side.sheath, k), sheath_at(side.sheath, k + 1)
    )


@kernel
def keep_side(
    record: Array, k: int, side: Side, body: BenchBody, measured: Measurement, command: float, pull: float
) -> None:
    """Fill column k of `record` (7, n): `OF_SIDE`."""
    drive, motor = side.plant.drive, body.motor
    load = sheath_at(side.sheath, k).slope_factor * abs(side.plant.slope) * pull
    record[0, k] = joint_angle(side, motor.position)
    record[1, k] = measured.motor
    record[2, k] = side.sign * motor.velocity
    record[3, k] = side.sign * motor.acceleration
    record[4, k] = command
    record[5, k] = side.sign * (drive.inertia * motor.acceleration + load) / (drive.gear * drive.torque_constant)
    record[6, k] = pull


@kernel
def run_joint(
    sides: tuple[Side, ...],
    load: JointLoad,
    encoder: Encoder,
    normals: Array,
    references: Array,
    push: Array,
    dt: float,
    joints: Array,
    records: Array,
    states: Array,
) -> int:
    """One run; returns the number of cycles that it lasted.

    Args:
        sides: all motors, of one kind.
        load: what they pull at.
        encoder: of the joint.
        normals: of its noise (n,).
        references: common to all (3, n).
        push: torque of whoever pushes the joint upwards (n,) [N·m].
        dt: length of a cycle [s].
        joints: to be filled: true and measured (2, n) [rad].
        records: to be filled, for each motor as `keep_side` has it (m, 7, n).
        states: to be filled, for each motor with its law's state and what the conditioner remembers (m, k, n).
    """
    count, cycles = len(sides), references.shape[1]
    ends, signs = np.empty(count), np.empty(count)
    for i in range(count):
        signs[i] = sides[i].sign
    bodies = [bench_rest(one.plant, own_angle(one, one.initial_motor), sheath_at(one.sheath, 0)) for one in sides]
    settings = [bare_settings(side.gains, side.conditioning, side.source) for side in sides]
    for i in range(count):
        ends[i] = signs[i] * bodies[i].joint
    shown = reading(shared_joint(ends, signs, push[0], load), normals[0], encoder)
    led = [bare_start(settings[i], measure(sides[i], bodies[i], shown, 0)) for i in range(count)]
    for k in range(cycles):
        for i in range(count):
            ends[i] = signs[i] * bodies[i].joint
        joint = shared_joint(ends, signs, push[k], load)
        shown = reading(joint, normals[k], encoder)
        joints[0, k], joints[1, k] = joint, shown
        scheduled = Reference(references[0, k], references[1, k], references[2, k])
        ran_away = False
        for i in range(count):
            side, body = sides[i], bodies[i]
            seen = measure(side, body, shown, k)
            state, _, command, _ = one_cycle(settings[i], led[i], seen, Plan(LAW, side.initial_motor, scheduled), dt)
            led[i] = state
            pull = cable_pull(body.joint, side.sign * joint, load.stiffness)
            keep_side(records[i], k, side, body, seen, command, pull)
            numbers = flat((state.law, state.conditioned))
            for j in range(states.shape[1]):
                states[i, j, k] = numbers[j]
            ran_away = ran_away or not abs(command) < RUNAWAY
        if ran_away:
            return k
        for i in range(count):
            bodies[i] = moved(sides[i], bodies[i], records[i, 4], k)
    return cycles


def simulate_joint(
    joint: CabledJoint,
    laws: Sequence[Law],
    reference: Trajectory,
    *,
    duration: float,
    initial_motors: Sequence[float] = (),
    push: Array | None = None,
) -> tuple[Trace, ...]:
    """Run laws against one joint.

    Args:
        joint: with its motors.
        laws: of each motor.
        reference: the joint's desired motion.
        duration: length of the run [s].
        initial_motors: of each, at rest before the start, without co-contraction; 0 where they are not given [rad].
        push: torque of whoever pushes the joint upwards, cycle by cycle (n,) [N·m]; nobody's where it is not given.

    Returns:
        A trace for each motor, as `bowden.sim.run.simulate` has it, with `OF_SIDE` in the joint's coordinate; the joint
        is the same in all. Of a run that ran away the rest is NaN.

    Raises:
        ParameterError: a setting that cannot be, motors that are not moved by the same equations, or a law of the
            user's own that gives no number.
    """
    motors = joint.motors
    check_alike(motors, laws)
    found = [inputs_of(one.bench, reference, duration, one.bend, one.seed) for one in motors]
    count, initials = len(found[0].time), initial_motors or (0.0,) * len(motors)
    pushed = np.zeros(count) if push is None else np.asarray(push, dtype=np.float64)
    if pushed.shape != (count,) or not np.isfinite(pushed).all():
        raise ParameterError(f"simulate_joint: push has the shape {pushed.shape}", expected=f"{count} finite numbers")
    sides = tuple(
        Side(
            law.gains,
            law.conditioning,
            TABLE.settings,
            prepare_bench(one.bench),
            inputs.sheath,
            np.ascontiguousarray(inputs.normals[:, 1]),
            float(initial),
            one.sign,
            joint.co_contraction,
            one.bench.delay,
        )
        for one, law, inputs, initial in zip(motors, laws, found, initials, strict=True)
    )
    columns = {name: unit for part in state_columns(laws[0], TABLE) for name, unit in part.items()}
    joints, records = np.empty((2, count)), np.empty((len(motors), len(OF_SIDE), count))
    states = np.empty((len(motors), len(columns), count))
    dynamics = motors[0].bench.dynamics()
    kernels = {**law_and_source(laws[0]), **BARE, **dynamics.parts}
    lasted = specialise(run_joint, f"{laws[0].name}_{dynamics.name}", **kernels)(
        sides,
        joint.load,
        joint.first.joint_encoder,
        np.ascontiguousarray(found[0].normals[:, 0]),
        found[0].references,
        pushed,
        joint.first.sample_time,
        joints,
        records,
        states,
    )
    for law, record, numbers in zip(laws, records, states, strict=True):
        given = dict(zip(OF_SIDE, record, strict=True)) | dict(zip(columns, numbers, strict=True))
        refuse_no_number_in(given, found[0].time, lasted, law)
    for block in (joints, records, states):
        block[..., lasted:] = np.nan
    common = {
        "time": found[0].time,
        "reference": found[0].references[0],
        "reference_velocity": found[0].references[1],
        "joint": joints[0],
        "joint_measured": joints[1],
    }
    units = {"time": "s", "reference": "rad", "reference_velocity": "rad/s", "joint": "rad", "joint_measured": "rad"}
    units |= OF_SIDE | {"width": "1", "slope": "rad/rad"} | columns
    about = joint._asdict() | {"motors": [one.name for one in motors]}
    traces = []
    for i, one in enumerate(motors):
        values = common | dict(zip(OF_SIDE, records[i], strict=True))
        values |= one.bench.sheath_columns(joints[0], found[i].sheath) | dict(zip(columns, states[i], strict=True))
        settings = settings_of(one.bench, laws[i], reference, TABLE, initials[i]) | {"motor": one.name, "joint": about}
        traces.append(Trace(values, {name: units[name] for name in values}, settings, one.seed))
    return tuple(traces)


def check_alike(motors: Sequence[JointMotor], laws: Sequence[Law]) -> None:
    """Refuse what one loop cannot have: motors whose laws or cables have other equations, or another clock.

    Raises:
        ParameterError: see above.
    """
    one, law = motors[0], laws[0]
    for other, second in zip(motors[1:], laws[1:], strict=True):
        both, do = f"the motors {one.name} and {other.name} on one joint", f"take each by itself: --motor {one.name}"
        if (law.start_kernel, law.step_kernel) != (second.start_kernel, second.step_kernel):
            raise ParameterError(
                f"{both} have the laws {law.name} and {second.name}",
                expected="one law for all, each with gains of its own",
                do=do,
            )
        if one.bench.dynamics().parts != other.bench.dynamics().parts:
            raise ParameterError(
                f"{both} have cables of the kinds {' and '.join(m.bench.simulated_cable.name for m in (one, other))}",
                expected="one kind for all, each with parameters of its own",
                do=do,
            )
        if one.bench.sample_time != other.bench.sample_time:
            raise ParameterError(
                f"{both} have cycles of {one.bench.sample_time:g} and {other.bench.sample_time:g} s",
                expected="one clock for all",
                do="correct sample_time",
            )
