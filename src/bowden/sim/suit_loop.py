"""The loop round the suit: a law and the suit, compiled together as one function, and what a run of it is given."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.control.law import Law, law_start, law_step
from bowden.control.reference import Trajectory
from bowden.control.source import TABLE, Heard, Source, source_start, source_step
from bowden.core.errors import ParameterError
from bowden.core.kernel import kernel, specialise
from bowden.core.nested import flat
from bowden.core.signals import Reference, Sample
from bowden.models.drive.encoder import reading
from bowden.models.suit.arm import Wearer
from bowden.models.suit.flex_sensor import flex_start, flex_step
from bowden.models.suit.load_cell import CURRENT_NOISE, LoadCell, cell_reading
from bowden.plants.suit_parts import PreparedSuit, Suit, prepare_suit
from bowden.plants.suit_plant import Bends, suit_motor, suit_start, suit_step
from bowden.sim.closed_loop import RUNAWAY
from bowden.sim.faulty import Fault, faulty
from bowden.sim.scenario import BendPath, constant_bend

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
    fault: Fault,
    kept: NDArray[np.float64],
) -> int:
    """One run after `settling` cycles at rest; fills `record` (16, n) and `states` (m, n), returns how long it lasted.

    `references` (3, n) are what the source is told, and are overwritten with what it makes of them. `kept` (2, n) is
    for the readings that a `fault` may look back at; without one it is not touched.
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
            if fault.kind > 0.0:
                sample = faulty(fault, sample, kept, k)
                heard = Heard(sample.joint, sample.motor, heard.current, heard.load)
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
            numbers = flat((state, asked))
            for j in range(len(numbers)):
                states[j, k] = numbers[j]
            if not abs(command) < RUNAWAY:
                return k
            applied = record[4, k - delay] if k >= delay else initial_motor
            bend = Bends(bends[k], bends[k + 1])
        on = powered or k < 0
        plant = suit_step(suit, plant, applied, on, bend, wearer, dt)  # called in one place: it is long to compile
    return references.shape[1]


class SuitInputs(NamedTuple):
    """All that is known of a run of the suit before it begins."""

    suit: Suit
    prepared: PreparedSuit
    edges: NDArray[np.float64]  # (n + 1,) of the cycles [s]
    bends: NDArray[np.float64]  # (n + 1,) [rad]
    references: NDArray[np.float64]  # (3, n)
    normals: NDArray[np.float64]  # (n, 5)
    initial_motor: float
    """[rad]"""


def suit_inputs(
    suit: Suit, reference: Trajectory, duration: float, bend: BendPath | None, seed: int, initial_motor: float | None
) -> SuitInputs:
    """The suit's constants, the reference, the sheaths and the noise of a run; the arguments are `simulate_suit`'s.

    Raises:
        ParameterError: a duration or a part of the suit that cannot be.
    """
    dt = suit.sample_time
    prepared = prepare_suit(suit)
    if not (2.0 * dt <= duration < 1e9 * dt and suit.delay >= 0):
        raise ParameterError(
            f"simulate: duration is {duration:g} s, delay {suit.delay}",
            expected="a duration of two cycles or more, a delay not below 0",
        )
    edges = np.arange(round(duration / dt) + 1, dtype=np.float64) * dt
    angles = np.asarray((bend or constant_bend(suit.sheath.bend))(edges), dtype=np.float64)
    references = np.ascontiguousarray(reference.sample(edges[:-1]).T)
    initial = float(references[0, 0]) if initial_motor is None else float(initial_motor)
    return SuitInputs(suit, prepared, edges, angles, references, _normals(seed, len(edges) - 1), initial)


def run_suit(
    inputs: SuitInputs,
    law: Law,
    references: NDArray[np.float64],
    record: NDArray[np.float64],
    states: NDArray[np.float64],
    *,
    source: Source = TABLE,
    cell: LoadCell | None = None,
    powered: bool = True,
    fault: Fault | None = None,
) -> int:
    """`run_suit_loop` for a law and a source; returns how many cycles the run lasted.

    Args:
        inputs: of the run.
        law: the control law.
        references: those of the inputs (3, n), overwritten with what the source makes of them.
        record: to be filled (`RECORDED`, n).
        states: to be filled, of law and source (m, n).
        source: what makes the reference.
        cell: the load cell that it hears.
        powered: see `simulate_suit`.
        fault: of a sensor.
    """
    suit, fault = inputs.suit, fault or Fault()
    return compiled_suit_loop(law, source)(
        law.gains,
        source.settings,
        inputs.prepared,
        references,
        inputs.bends,
        inputs.normals,
        (suit.joint_sensor, suit.motor_encoder, cell or LoadCell()),
        suit.wearer,
        inputs.initial_motor,
        round(SETTLING / suit.sample_time),
        suit.sample_time,
        suit.delay,
        powered,
        record,
        states,
        fault,
        np.empty((2, references.shape[1] if fault.kind > 0.0 else 0)),
    )


def state_fields(law: Law, source: Source) -> tuple[list[str], list[str]]:
    """What law and source remember, as the columns of a trace name it."""
    return list(law.columns()), list(source.columns())


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
