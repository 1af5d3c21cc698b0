"""The closed loop round any cable: a law and a cable, compiled together as one function."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bowden import __version__
from bowden.control.law import Law, law_start, law_step
from bowden.control.reference import Trajectory
from bowden.core.errors import ParameterError
from bowden.core.kernel import kernel, specialise
from bowden.core.nested import flat
from bowden.core.signals import Reference, Sample
from bowden.core.trace import Trace
from bowden.models.drive import motor as motor_model
from bowden.models.drive.encoder import reading
from bowden.plants.cable_body import Moving, cable_moved, cable_rest
from bowden.plants.cable_plant import CablePlant, prepare_servo
from bowden.sim.closed_loop import RUNAWAY, UNITS, check_clock, edges_of, sheath_over
from bowden.sim.scenario import BendPath

_RECORDED = ["joint", "motor", "joint_measured", "motor_measured", "command", "motor_velocity", "motor_acceleration"]
_RECORDED += ["h", "torque"]
"""The columns that the compiled loop fills, in its order."""


@kernel
def run_cable_loop(
    gains: Any,
    cable: Any,
    servo: Any,
    references: NDArray[np.float64],
    widths: NDArray[np.float64],
    slope_factors: NDArray[np.float64],
    normals: NDArray[np.float64],
    encoders: Any,
    initial_motor: float,
    dt: float,
    delay: int,
    substeps: int,
    load_lag: float,
    record: NDArray[np.float64],
    states: NDArray[np.float64],
) -> int:
    """One run; fills `record` (9, n) and `states` (m, n) and returns the number of cycles that it lasted.

    A cycle is `bowden.sim.closed_loop.run_loop`'s.
    """
    plant = Moving(cable, servo, dt, load_lag)
    body = cable_rest(plant, initial_motor, widths[0], slope_factors[0])
    sample = Sample(reading(body.joint, normals[0, 0], encoders[0]), reading(initial_motor, normals[0, 1], encoders[1]))
    state = law_start(gains, sample)
    for k in range(references.shape[1]):
        joint, motor = body.joint, body.motor
        sample = Sample(reading(joint, normals[k, 0], encoders[0]), reading(motor.position, normals[k, 1], encoders[1]))
        reference = Reference(references[0, k], references[1, k], references[2, k])
        state, command = law_step(gains, state, sample, reference, dt)
        record[0, k] = joint
        record[1, k] = motor.position
        record[2, k] = sample.joint
        record[3, k] = sample.motor
        record[4, k] = command
        record[5, k] = motor.velocity
        record[6, k] = motor.acceleration
        record[7, k] = body.seen.h
        record[8, k] = body.seen.torque
        numbers = flat(state)
        for j in range(len(numbers)):
            states[j, k] = numbers[j]
        if not abs(command) < RUNAWAY:
            return k
        applied = record[4, k - delay] if k >= delay else initial_motor
        width, factor = widths[k], slope_factors[k]
        body = cable_moved(plant, body, applied, width, widths[k + 1], factor, slope_factors[k + 1], substeps)
    return references.shape[1]


def simulate_cable(
    plant: CablePlant,
    law: Law,
    reference: Trajectory,
    *,
    duration: float,
    bend: BendPath,
    seed: int = 0,
    initial_motor: float = 0.0,
) -> Trace:
    """Run a law against any cable; what `bowden.sim.closed_loop.simulate` does with a `CablePlant`.

    The trace has that function's columns. ``h`` is NaN for a cable that has no single internal variable; the current
    holds the cable's own torque where the cable knows forces, and else the bench's spring through ``slope``.

    Raises:
        ParameterError: a duration or setting that cannot be.
    """
    check_clock(plant, duration)
    check_cable(plant)
    edges = edges_of(plant, duration)
    time, (widths, slope_factors) = edges[:-1], sheath_over(plant, edges, bend)
    references = np.ascontiguousarray(reference.sample(time).T)
    noisy = plant.joint_encoder.noise > 0.0 or plant.motor_encoder.noise > 0.0
    shape = (len(time), 2)
    fields = law.columns()
    block = np.empty((len(_RECORDED) + len(fields), len(time)))
    record, states = block[: len(_RECORDED)], block[len(_RECORDED) :]
    lasted = compiled_cable_loop(plant, law)(
        law.gains,
        plant.cable.prepared,
        prepare_servo(plant),
        references,
        widths,
        slope_factors,
        np.random.default_rng(seed).standard_normal(shape) if noisy else np.zeros(shape),
        (plant.joint_encoder, plant.motor_encoder),
        float(initial_motor),
        plant.sample_time,
        plant.delay,
        plant.substeps,
        float(plant.load_lag),
        record,
        states,
    )
    block[:, lasted:] = np.nan
    values = {"time": time, "reference": references[0], "reference_velocity": references[1]}
    values |= dict(zip(_RECORDED, record, strict=True))
    torque = values.pop("torque")
    values |= {"width": widths[:-1], "slope": slope_factors[:-1] * plant.cable.slope}
    acceleration, motor = values["motor_acceleration"], plant.motor
    if plant.cable.physical:
        values["current"] = (motor.inertia * acceleration + torque) / (motor.gear * motor.torque_constant)
    else:
        values["current"] = np.asarray(motor_model.current(acceleration, values["joint"], values["slope"], motor))
    values |= dict(zip(fields, states, strict=True))
    units = UNITS | fields
    return Trace(values, units, _settings(plant, law, reference), seed)


def compiled_cable_loop(plant: CablePlant, law: Law) -> Callable[..., int]:
    """`run_cable_loop` with the law's and the cable's kernels in it, compiled at the first call and cached on disk.

    Cables with the same kernels (a play and a stack of them) share it.
    """
    cable = plant.cable
    return specialise(
        run_cable_loop,
        f"{law.name}_{cable.advance.__name__}",
        law_start=law.start_kernel,
        law_step=law.step_kernel,
        cable_start=cable.start,
        cable_advance=cable.advance,
        cable_look=cable.look,
    )


def check_cable(plant: CablePlant) -> None:
    """Refuse a load's lag that cannot be, and a sheath that loses what the cable itself loses.

    Raises:
        ParameterError: one of these.
    """
    loss = plant.sheath.loss
    if not 0.0 <= plant.load_lag < float("inf"):
        raise ParameterError(
            f"simulate: load_lag is {plant.load_lag}", expected="a positive number that makes sense here"
        )
    if plant.cable.physical and loss != 0.0:
        raise ParameterError(
            f"simulate: the sheath's loss is {loss} with a cable of the kind {plant.cable.name!r}",
            expected="0, since that cable computes what its sheath loses",
        )


def _settings(plant: CablePlant, law: Law, reference: Trajectory) -> dict[str, Any]:
    parts = {name: _plain(value) for name, value in plant._asdict().items() if name != "cable"}
    return {
        "bowden": __version__,
        "law": law.name,
        "gains": dict(law.gains._asdict()),
        "reference": reference.describe(),
        "plant": {"cable": {"kind": plant.cable.name, **_plain(plant.cable.parameters)}, **parts},
        "sample_time": plant.sample_time,
        "motor_resistance": plant.motor.resistance,
        "torque_constant": plant.motor.torque_constant * plant.motor.gear,
    }


def _plain(value: Any) -> Any:
    """NamedTuples as objects, arrays and tuples as lists, for JSON."""
    if hasattr(value, "_asdict"):
        return {name: _plain(part) for name, part in value._asdict().items()}
    if isinstance(value, tuple):
        return [_plain(part) for part in value]
    return value.tolist() if isinstance(value, np.ndarray) else value
