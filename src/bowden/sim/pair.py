"""Two motors on one joint, each under a law of its own: one loop, compiled as one function, with a trace for each.

The joint stands where both cables' pulls are in balance (`bowden.models.cable.shared_joint`). Each cable is played in
the coordinate in which its motor pulls upwards; everything else, and both traces, are in the joint's. At one sample
both laws see the joint's one encoder and their own motor's, from which the co-contraction is taken away.
"""

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
from bowden.models.cable.shared_joint import Ends, JointLoad, cable_pull, shared_joint
from bowden.models.drive.encoder import Encoder, reading
from bowden.plants.bench import Bench
from bowden.plants.cable_body import CableBody, Moving, cable_moved, cable_rest
from bowden.plants.cable_plant import CablePlant, prepare_plant
from bowden.plants.cables import as_cable_plant
from bowden.plants.plant import SheathPath, sheath_at
from bowden.records.trace import Trace
from bowden.sim.run import RUNAWAY, inputs_of, refuse_no_number_in, settings_of, state_columns
from bowden.sim.scenario import BendPath

Array = NDArray[np.float64]

OF_SIDE = {
    "motor": "rad",
    "motor_measured": "rad",
    "motor_velocity": "rad/s",
    "motor_acceleration": "rad/s²",
    "command": "rad",
    "current": "A",
    "pull": "N·m",
}
"""Columns that the loop fills for each side, in its order, and their units; ``pull`` is the cable's torque on the
joint, 0 where it is slack."""


class PairSide(NamedTuple):
    """One motor with its cable, and who leads it."""

    name: str
    """Of the axis."""
    bench: Bench | CablePlant
    """Motor, cable and encoders, in the coordinate in which the motor pulls upwards."""
    bend: BendPath
    """The sheath's total bend over time."""
    seed: int
    """Of the encoders' noise."""
    sign: float
    """1 where the motor pulls the joint up, −1 where it pulls it down [–]."""

    @property
    def plant(self) -> CablePlant:
        """The bench as a plant round its cable."""
        return as_cable_plant(self.bench)

    def own_stroke(self, stroke: tuple[float, float]) -> tuple[float, float]:
        """Ends of the joint's motion in this side's coordinate, the lower first [rad]."""
        one, other = (self.sign * end for end in stroke)
        return min(one, other), max(one, other)


class PairPlant(NamedTuple):
    """Two motors on one joint."""

    agonist: PairSide
    """Whose drive has the joint's encoder."""
    antagonist: PairSide
    stiffness: float
    """Of each cable at the joint [N·m/rad]."""
    co_contraction: float
    """How much further each motor pulls than the joint asks for [rad]."""

    @property
    def sides(self) -> tuple[PairSide, PairSide]:
        """The agonist first."""
        return self.agonist, self.antagonist

    @property
    def up(self) -> int:
        """Place of the side that pulls upwards."""
        return 0 if self.agonist.sign > 0.0 else 1

    @property
    def load(self) -> JointLoad:
        """What both pull at; the spring is that of the side that pulls upwards, as in the twin."""
        motor = self.sides[self.up].bench.motor
        return JointLoad(self.stiffness, motor.pretension, motor.spring)

    @property
    def sample_time(self) -> float:
        """Of both [s]."""
        return self.agonist.bench.sample_time

    def resting_motors(self, joint: float, bends: tuple[float, float]) -> tuple[float, float]:
        """Both motors' angles, without co-contraction, at which each cable alone would have the joint at `joint` [rad].

        Args:
            joint: [rad]
            bends: total bend of each sheath, the agonist's first [rad].

        Raises:
            ParameterError: a cable has its joint there at no motor angle.
        """
        one, other = (
            side.sign * side.bench.resting_motor(side.sign * joint, bend)
            for side, bend in zip(self.sides, bends, strict=True)
        )
        return one, other


class Side(NamedTuple):
    """A side as the loop is handed it."""

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
def at_start(side: Side) -> CableBody:
    """A side at rest before the run."""
    return cable_rest(side.plant, own_angle(side, side.initial_motor), sheath_at(side.sheath, 0))


@kernel
def measure(side: Side, body: CableBody, joint: float, k: int) -> Measurement:
    """What a law sees in cycle k, the `joint` being measured [rad]."""
    motor = reading(body.motor.position, side.normals[k], side.plant.motor_encoder)
    return Measurement(joint, joint_angle(side, motor), np.nan, np.nan)


@kernel
def moved(side: Side, body: CableBody, commands: Array, k: int) -> CableBody:
    """A side one cycle later, under what its law has commanded up to cycle k."""
    command = commands[k - side.delay] if k >= side.delay else side.initial_motor
    return cable_moved(
        side.plant, body, own_angle(side, command), sheath_at(side.sheath, k), sheath_at(side.sheath, k + 1)
    )


@kernel
def keep_side(
    record: Array, k: int, side: Side, body: CableBody, measured: Measurement, command: float, pull: float
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
def keep_state(states: Array, k: int, state: Any) -> None:
    """Fill column k of `states` with a law's state and what the conditioner remembers."""
    numbers = flat((state.law, state.conditioned))
    for j in range(states.shape[0]):
        states[j, k] = numbers[j]


@kernel
def run_pair(
    up: Side,
    down: Side,
    load: JointLoad,
    encoder: Encoder,
    normals: Array,
    references: Array,
    push: Array,
    dt: float,
    joints: Array,
    up_record: Array,
    down_record: Array,
    up_states: Array,
    down_states: Array,
) -> int:
    """One run; returns the number of cycles that it lasted.

    Args:
        up: the side that pulls the joint up.
        down: the one that pulls it down.
        load: what they pull at.
        encoder: of the joint.
        normals: of its noise (n,).
        references: common to both (3, n).
        push: torque of whoever pushes the joint upwards (n,) [N·m].
        dt: length of a cycle [s].
        joints: to be filled: true and measured (2, n) [rad].
        up_record: to be filled, see `keep_side`.
        down_record: likewise.
        up_states: to be filled, see `keep_state`.
        down_states: likewise.
    """
    cycles = references.shape[1]
    up_body, down_body = at_start(up), at_start(down)
    joint = shared_joint(Ends(up_body.joint, -down_body.joint, True, True), push[0], load)
    up_settings = bare_settings(up.gains, up.conditioning, up.source)
    down_settings = bare_settings(down.gains, down.conditioning, down.source)
    shown = reading(joint, normals[0], encoder)
    up_state = bare_start(up_settings, measure(up, up_body, shown, 0))
    down_state = bare_start(down_settings, measure(down, down_body, shown, 0))
    for k in range(cycles):
        joint = shared_joint(Ends(up_body.joint, -down_body.joint, True, True), push[k], load)
        shown = reading(joint, normals[k], encoder)
        joints[0, k], joints[1, k] = joint, shown
        scheduled = Reference(references[0, k], references[1, k], references[2, k])
        seen = measure(up, up_body, shown, k)
        up_state, _, command, _ = one_cycle(up_settings, up_state, seen, Plan(LAW, up.initial_motor, scheduled), dt)
        keep_side(up_record, k, up, up_body, seen, command, cable_pull(up_body.joint, joint, load.stiffness))
        keep_state(up_states, k, up_state)
        seen = measure(down, down_body, shown, k)
        down_state, _, other, _ = one_cycle(
            down_settings, down_state, seen, Plan(LAW, down.initial_motor, scheduled), dt
        )
        keep_side(down_record, k, down, down_body, seen, other, cable_pull(down_body.joint, -joint, load.stiffness))
        keep_state(down_states, k, down_state)
        if not (abs(command) < RUNAWAY and abs(other) < RUNAWAY):
            return k
        up_body, down_body = moved(up, up_body, up_record[4], k), moved(down, down_body, down_record[4], k)
    return cycles


def simulate_pair(
    pair: PairPlant,
    laws: tuple[Law, Law],
    reference: Trajectory,
    *,
    duration: float,
    initial_motors: tuple[float, float] = (0.0, 0.0),
    push: Array | None = None,
) -> tuple[Trace, Trace]:
    """Run two laws against one joint.

    Args:
        pair: both sides.
        laws: of each, the agonist's first.
        reference: the joint's desired motion.
        duration: length of the run [s].
        initial_motors: of each, at rest before the start, without co-contraction [rad].
        push: torque of whoever pushes the joint upwards, cycle by cycle (n,) [N·m]; nobody's where it is not given.

    Returns:
        A trace for each side, as `bowden.sim.run.simulate` has it, with `OF_SIDE` in the joint's coordinate; the joint
        is the same in both. Of a run that ran away the rest is NaN.

    Raises:
        ParameterError: a setting that cannot be, two sides that are not moved by the same equations, or a law of the
            user's own that gives no number.
    """
    check_alike(pair, laws)
    found = [inputs_of(side.plant, reference, duration, side.bend, side.seed) for side in pair.sides]
    count = len(found[0].time)
    pushed = np.zeros(count) if push is None else np.asarray(push, dtype=np.float64)
    if pushed.shape != (count,) or not np.isfinite(pushed).all():
        raise ParameterError(f"simulate_pair: push has the shape {pushed.shape}", expected=f"{count} finite numbers")
    sides = [
        Side(
            law.gains,
            law.conditioning,
            TABLE.settings,
            prepare_plant(side.plant),
            inputs.sheath,
            np.ascontiguousarray(inputs.normals[:, 1]),
            float(initial),
            side.sign,
            pair.co_contraction,
            side.plant.delay,
        )
        for side, law, inputs, initial in zip(pair.sides, laws, found, initial_motors, strict=True)
    ]
    columns = [{name: unit for part in state_columns(law, TABLE) for name, unit in part.items()} for law in laws]
    joints, records = np.empty((2, count)), [np.empty((len(OF_SIDE), count)) for _ in sides]
    states = [np.empty((len(names), count)) for names in columns]
    up, down = pair.up, 1 - pair.up
    lasted = _compiled(pair, laws)(
        sides[up],
        sides[down],
        pair.load,
        pair.agonist.bench.joint_encoder,
        np.ascontiguousarray(found[0].normals[:, 0]),
        found[0].references,
        pushed,
        pair.sample_time,
        joints,
        records[up],
        records[down],
        states[up],
        states[down],
    )
    for law, record, names, numbers in zip(laws, records, columns, states, strict=True):
        given = dict(zip(OF_SIDE, record, strict=True)) | dict(zip(names, numbers, strict=True))
        refuse_no_number_in(given, found[0].time, lasted, law)
    for block in (joints, *records, *states):
        block[:, lasted:] = np.nan
    common = {
        "time": found[0].time,
        "reference": found[0].references[0],
        "reference_velocity": found[0].references[1],
        "joint": joints[0],
        "joint_measured": joints[1],
    }
    units = {"time": "s", "reference": "rad", "reference_velocity": "rad/s", "joint": "rad", "joint_measured": "rad"}
    traces = []
    for i, side in enumerate(pair.sides):
        values = common | dict(zip(OF_SIDE, records[i], strict=True))
        values |= side.plant.sheath_columns(joints[0], found[i].sheath) | dict(zip(columns[i], states[i], strict=True))
        own = units | OF_SIDE | {"width": "1", "slope": "rad/rad"} | columns[i]
        settings = _settings(pair, side, laws[i], reference, initial_motors[i])
        traces.append(Trace(values, {name: own[name] for name in values}, settings, side.seed))
    return traces[0], traces[1]


def check_alike(pair: PairPlant, laws: tuple[Law, Law]) -> None:
    """Refuse what one loop cannot have: sides whose laws or cables have other equations, or another clock.

    Raises:
        ParameterError: see above.
    """
    (one, other), (law, second) = pair.sides, laws
    do = f"take each by itself: --axis {one.name}"
    if (law.start_kernel, law.step_kernel) != (second.start_kernel, second.step_kernel):
        raise ParameterError(
            f"the axes {one.name} and {other.name} on one joint have the laws {law.name} and {second.name}",
            expected="one law for both, each with gains of its own",
            do=do,
        )
    if one.plant.dynamics().parts != other.plant.dynamics().parts:
        kinds = " and ".join(side.plant.cable.name for side in pair.sides)
        raise ParameterError(
            f"the cables of the axes {one.name} and {other.name} on one joint are of the kinds {kinds}",
            expected="one kind for both, each with parameters of its own",
            do=do,
        )
    if one.plant.sample_time != other.plant.sample_time:
        raise ParameterError(
            f"the axes {one.name} and {other.name} have cycles of {one.plant.sample_time:g} and "
            f"{other.plant.sample_time:g} s",
            expected="one clock for both",
            do="correct sample_time",
        )


def _compiled(pair: PairPlant, laws: tuple[Law, Law]) -> Any:
    dynamics = pair.agonist.plant.dynamics()
    return specialise(run_pair, f"{laws[0].name}_{dynamics.name}", **law_and_source(laws[0]), **BARE, **dynamics.parts)


def _settings(pair: PairPlant, side: PairSide, law: Law, reference: Trajectory, initial: float) -> dict[str, Any]:
    return settings_of(side.bench, law, reference, TABLE, initial) | {
        "axis": side.name,
        "pair": {
            "agonist": pair.agonist.name,
            "antagonist": pair.antagonist.name,
            "co_contraction": pair.co_contraction,
            "stiffness": pair.stiffness,
        },
    }
