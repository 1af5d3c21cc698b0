"""The closed loop round the suit: a law and the suit, compiled together as one function."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bowden import __version__
from bowden.control.law import Law, law_start, law_step
from bowden.control.reference import Trajectory
from bowden.control.source import TABLE, Heard, Source, source_start, source_step
from bowden.core.errors import ParameterError
from bowden.core.kernel import kernel, specialise
from bowden.core.signals import Reference, Sample
from bowden.core.trace import Trace
from bowden.models.arm import Wearer
from bowden.models.encoder import reading
from bowden.models.flex_sensor import flex_start, flex_step
from bowden.models.load_cell import CURRENT_NOISE, LoadCell, cell_reading
from bowden.models.sheath import slope_factor as slope_factor_at
from bowden.models.sheath import width as width_at
from bowden.sim.closed_loop import RUNAWAY
from bowden.sim.scenario import BendPath, constant_bend
from bowden.sim.suit_parts import PreparedSuit, Suit, prepare_suit
from bowden.sim.suit_plant import Bends, suit_motor, suit_start, suit_step

RECORDED = {
    "joint": "rad",
    "motor": "rad",
    "joint_measured": "rad",
    "motor_measured": "rad",
    "command": "rad",
    "joint_velocity": "rad/s",
    "spool": "rad",
    "motor_velocity": "rad/s",
    "current": "A",
    "flexor_tension": "N",
    "flexor_motor_tension": "N",
    "extensor_tension": "N",
    "extensor_motor_tension": "N",
    "interaction_torque": "N·m",
    "wearer_torque": "N·m",
    "winding_temperature": "°C",
}
"""The columns that the compiled loop fills, in its order, and their units.

``motor`` is the motor in the joint's coordinate, ``spool`` and ``motor_velocity`` the spool; tensions are those at the
arm, and with ``motor`` in the name those at the spool.
"""

SETTLING = 3.0
"""Time for which the suit holds its initial motor angle before a run begins, so that the arm hangs in balance [s]."""


@kernel
def run_suit_loop(
    gains: Any,
    source: Any,
    suit: PreparedSuit,
    references: NDArray[np.float64],
    bends: NDArray[np.float64],
    normals: NDArray[np.float64],
    sensors: Any,
    wearer: Wearer,
    initial_motor: float,
    settling: int,
    dt: float,
    delay: int,
    powered: bool,
    record: NDArray[np.float64],
    states: NDArray[np.float64],
) -> int:
    """One run after `settling` cycles at rest; fills `record` (16, n) and `states` (m, n), returns how long it lasted.

    `references` (3, n) are what the source is told, and are overwritten with what it makes of them.
    """
    plant = suit_start(suit, initial_motor, initial_motor, bends[0])
    flex, state = flex_start(plant.joint), law_start(gains, Sample(plant.joint, initial_motor))
    asked = source_start(source, Heard(plant.joint, initial_motor, 0.0, 0.0))
    for k in range(-settling, references.shape[1]):
        applied, bend = initial_motor, Bends(bends[0], bends[0])
        if k == 0:
            flex = flex_start(plant.joint)
        if k >= 0:
            motor = suit_motor(suit, plant)
            flex, seen = flex_step(sensors[0], flex, plant.joint, normals[k, 0], normals[k, 1], dt)
            sample = Sample(seen, reading(motor, normals[k, 2], sensors[1]))
            current = plant.spool.current + CURRENT_NOISE * normals[k, 3]
            heard = Heard(seen, sample.motor, current, cell_reading(sensors[2], plant.interaction, normals[k, 4]))
            if k == 0:
                state, asked = law_start(gains, sample), source_start(source, heard)
            told = Reference(references[0, k], references[1, k], references[2, k])
            asked, reference, added = source_step(source, asked, heard, told, dt)
            references[0, k], references[1, k], references[2, k] = reference
            state, command = law_step(gains, state, sample, reference, dt)
            command = command + added
            record[0, k] = plant.joint
            record[1, k] = motor
            record[2, k] = sample.joint
            record[3, k] = sample.motor
            record[4, k] = command
            record[5, k] = plant.joint_velocity
            record[6, k] = plant.spool.position
            record[7, k] = plant.spool.velocity
            record[8, k] = plant.spool.current
            record[9, k] = plant.flexor_pull.joint
            record[10, k] = plant.flexor_pull.motor
            record[11, k] = plant.extensor_pull.joint
            record[12, k] = plant.extensor_pull.motor
            record[13, k] = plant.interaction
            record[14, k] = plant.wearer
            record[15, k] = plant.motor_heat.winding
            for j in range(len(state)):
                states[j, k] = state[j]
            for j in range(len(asked)):
                states[len(state) + j, k] = asked[j]
            if not abs(command) < RUNAWAY:
                return k
            applied = record[4, k - delay] if k >= delay else initial_motor
            bend = Bends(bends[k], bends[k + 1])
        on = powered or k < 0
        plant = suit_step(suit, plant, applied, on, bend, wearer, dt)  # called in one place: it is long to compile
    return references.shape[1]


def simulate_suit(
    suit: Suit,
    law: Law,
    reference: Trajectory,
    *,
    duration: float,
    bend: BendPath | None = None,
    wearer: Wearer | None = None,
    seed: int = 0,
    initial_motor: float | None = None,
    source: Source = TABLE,
    cell: LoadCell | None = None,
    powered: bool = True,
) -> Trace:
    """Run a law on the suit.

    Args:
        suit: with the arm that wears it.
        law: the control law with its gains.
        reference: the elbow's desired motion.
        duration: length of the run [s].
        bend: total bend of the sheaths over time, but for what the posture adds; constant where it is not given.
        wearer: what their muscles do; the suit's own wearer where it is not given.
        seed: of the sensors' noise and drift.
        initial_motor: motor angle before the start, in the joint's coordinate; where the reference begins if it is not
            given [rad].
        source: what makes the reference, cycle by cycle; the table of `reference` itself if nothing else is given.
        cell: the load cell that the source hears; the default one where it is not given.
        powered: False: the drive is switched off when the run begins, and the wearer drives the suit back.

    Returns:
        The trace, with the columns of `bowden.sim.closed_loop.simulate` that a suit has and those of `RECORDED`; of a
        run that ran away the rest is NaN.

    Raises:
        ParameterError: a duration, a part of the suit or a wearer that cannot be.
    """
    suit = suit._replace(wearer=wearer or suit.wearer)
    dt = suit.sample_time
    prepared = prepare_suit(suit)
    if not (2.0 * dt <= duration < 1e9 * dt and suit.delay >= 0):
        raise ParameterError(
            f"simulate: duration is {duration:g} s, delay {suit.delay}",
            expected="a duration of two cycles or more, a delay not below 0",
        )
    edges = np.arange(round(duration / dt) + 1, dtype=np.float64) * dt
    time, angles = edges[:-1], (bend or constant_bend(suit.sheath.bend))(edges)
    references = np.ascontiguousarray(reference.sample(time).T)
    initial = float(references[0, 0]) if initial_motor is None else float(initial_motor)
    fields = [f"law.{name}" for name in type(law.start(Sample(0.0, 0.0)))._fields]
    asked = [f"{source.name}.{name}" for name in type(source.start(Heard(0.0, 0.0, 0.0, 0.0)))._fields]
    block = np.empty((len(RECORDED) + len(fields) + len(asked), len(time)))
    fields += [] if source is TABLE else asked  # which remembers nothing that is worth a column
    record, states = block[: len(RECORDED)], block[len(RECORDED) :]
    lasted = compiled_suit_loop(law, source)(
        law.gains,
        source.settings,
        prepared,
        references,
        np.asarray(angles, dtype=np.float64),
        _normals(seed, len(time)),
        (suit.joint_sensor, suit.motor_encoder, cell or LoadCell()),
        suit.wearer,
        initial,
        round(SETTLING / dt),
        dt,
        suit.delay,
        powered,
        record,
        states,
    )
    block[:, lasted:] = np.nan
    if source is not TABLE:
        references[:, lasted:] = np.nan
    values = {"time": time, "reference": references[0], "reference_velocity": references[1]}
    values |= dict(zip(RECORDED, record, strict=True))
    whole: Any = angles[:-1] + suit.posture * values["joint"]
    values |= {"bend": whole, "width": width_at(whole, suit.sheath), "slope": slope_factor_at(whole, suit.sheath)}
    values |= dict(zip(fields, states, strict=False))
    units = {"time": "s", "reference": "rad", "reference_velocity": "rad/s"} | RECORDED
    units |= {"bend": "rad", "width": "1", "slope": "rad/rad"}
    known = {f"law.{name}": unit for name, unit in law.state_units.items()}
    known |= {f"{source.name}.{name}": unit for name, unit in source.state_units.items()}
    units |= {name: known.get(name, "1") for name in fields}
    return Trace(values, units, _settings(suit, prepared, law, reference, source), seed)


def compiled_suit_loop(law: Law, source: Source = TABLE) -> Callable[..., int]:
    """`run_suit_loop` with the law's and the source's kernels in it, compiled at the first call and cached on disk."""
    return specialise(
        run_suit_loop,
        f"{law.name}_{source.name}",
        law_start=law.start_kernel,
        law_step=law.step_kernel,
        source_start=source.start_kernel,
        source_step=source.step_kernel,
    )


def _normals(seed: int, cycles: int) -> NDArray[np.float64]:
    """Noise of the angles' sensors (n, 3), and of current and load cell (n, 2), which leaves the others as they are."""
    angles = np.random.default_rng(seed).standard_normal((cycles, 3))
    return np.hstack([angles, np.random.default_rng((seed, 1)).standard_normal((cycles, 2))])


def _settings(suit: Suit, prepared: PreparedSuit, law: Law, reference: Trajectory, source: Source) -> dict[str, Any]:
    own = {} if source is TABLE else {source.name: _plain(source.settings)}
    return {
        "bowden": __version__,
        "law": law.name,
        "gains": dict(law.gains._asdict()),
        "reference": reference.describe(),
        "plant": _plain(suit) | {"extensor_spool_radius": prepared.extensor_radius},
        "sample_time": suit.sample_time,
        "motor_resistance": suit.motor.resistance,
        "torque_constant": suit.motor.torque_constant * suit.motor.gear,
        **own,
    }


def _plain(value: Any) -> Any:
    """NamedTuples as objects, tuples as lists, for JSON."""
    if hasattr(value, "_asdict"):
        return {name: _plain(part) for name, part in value._asdict().items()}
    return [_plain(part) for part in value] if isinstance(value, tuple) else value
