"""The closed loop: a law against the bench, compiled as one function."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden import __version__
from bowden.control.law import Law
from bowden.control.reference import Trajectory
from bowden.core.errors import ParameterError
from bowden.core.kernel import kernel, specialise
from bowden.core.signals import Reference, Sample
from bowden.core.trace import Trace
from bowden.models import motor as motor_model
from bowden.models.encoder import reading
from bowden.models.sheath import slope_factor as slope_factor_at
from bowden.models.sheath import width as width_at
from bowden.sim.plant import Bench, bench_start, bench_step, prepare_bench
from bowden.sim.scenario import BendPath, constant_bend

COLUMNS = {
    "joint": "rad",
    "motor": "rad",
    "joint_measured": "rad",
    "motor_measured": "rad",
    "command": "rad",
    "motor_velocity": "rad/s",
    "motor_acceleration": "rad/s²",
    "h": "1",
}
"""What the compiled loop records, in this order, with units."""

RUNAWAY = 1e3
"""A command beyond this [rad] ends the run: the loop is unstable and the rest of the record stays NaN."""


@kernel
def law_start(gains: Any, sample: Sample) -> Any:
    """Stand-in for the law's ``start`` in the loop's source; `specialise` puts the law's own in its place."""
    raise NotImplementedError  # never compiled: always replaced


@kernel
def law_step(gains: Any, state: Any, sample: Sample, reference: Reference, dt: float) -> Any:
    """Stand-in for the law's ``step``."""
    raise NotImplementedError  # never compiled: always replaced


@kernel
def run_loop(
    gains: Any,
    bench: Any,
    references: NDArray[np.float64],
    widths: NDArray[np.float64],
    slope_factors: NDArray[np.float64],
    normals: NDArray[np.float64],
    encoders: Any,
    initial_motor: float,
    dt: float,
    delay: int,
    substeps: int,
    record: NDArray[np.float64],
    states: NDArray[np.float64],
) -> int:
    """One run; fills `record` (n, 8) and `states` (n, m) and returns the number of cycles that it lasted.

    Each cycle reads the encoders, steps the law, and moves the plant by one sample time under the command that was
    computed `delay` cycles before. The sheath's width and slope are linear between cycles.
    """
    cycles = references.shape[0]
    plant = bench_start(bench, initial_motor, widths[0], slope_factors[0])
    sample = Sample(
        reading(plant.joint, normals[0, 0], encoders[0]),
        reading(plant.motor.position, normals[0, 1], encoders[1]),
    )
    state = law_start(gains, sample)
    for k in range(cycles):
        sample = Sample(
            reading(plant.joint, normals[k, 0], encoders[0]),
            reading(plant.motor.position, normals[k, 1], encoders[1]),
        )
        reference = Reference(references[k, 0], references[k, 1], references[k, 2])
        state, command = law_step(gains, state, sample, reference, dt)
        record[k, 0] = plant.joint
        record[k, 1] = plant.motor.position
        record[k, 2] = sample.joint
        record[k, 3] = sample.motor
        record[k, 4] = command
        record[k, 5] = plant.motor.velocity
        record[k, 6] = plant.motor.acceleration
        record[k, 7] = plant.h
        for j in range(len(state)):
            states[k, j] = state[j]
        if not abs(command) < 1e3:
            return k
        applied = record[k - delay, 4] if k >= delay else initial_motor
        for i in range(substeps):
            part = (i + 1.0) / substeps
            width = widths[k] + part * (widths[k + 1] - widths[k])
            slope_factor = slope_factors[k] + part * (slope_factors[k + 1] - slope_factors[k])
            plant = bench_step(bench, plant, applied, width, slope_factor)
    return cycles


class _Inputs(NamedTuple):
    time: NDArray[np.float64]
    references: NDArray[np.float64]
    widths: NDArray[np.float64]
    slope_factors: NDArray[np.float64]
    normals: NDArray[np.float64]


def simulate(
    plant: Bench,
    law: Law,
    reference: Trajectory,
    *,
    duration: float,
    bend: BendPath | None = None,
    seed: int = 0,
    initial_motor: float = 0.0,
) -> Trace:
    """Run a law against the bench.

    Args:
        plant: the bench.
        law: the control law with its gains.
        reference: the joint's desired motion.
        duration: length of the run [s].
        bend: the sheath's total bend over time; constant at the identified bend where it is not given.
        seed: of the encoders' noise.
        initial_motor: motor angle at rest before the start [rad].

    Returns:
        The trace; of a run that ran away (a command beyond 1000 rad or not a number) the rest is NaN.

    Raises:
        ParameterError: a duration or setting that cannot be.
    """
    inputs = _inputs(plant, reference, duration, bend or constant_bend(plant.sheath.bend), seed)
    cycles = len(inputs.time)
    record = np.full((cycles, len(COLUMNS)), np.nan)
    fields = type(law.start(Sample(0.0, 0.0)))._fields
    states = np.full((cycles, len(fields)), np.nan)
    lasted = compiled_loop(law)(
        law.gains,
        prepare_bench(plant),
        inputs.references,
        inputs.widths,
        inputs.slope_factors,
        inputs.normals,
        (plant.joint_encoder, plant.motor_encoder),
        float(initial_motor),
        plant.sample_time,
        plant.delay,
        plant.substeps,
        record,
        states,
    )
    record[lasted:] = np.nan
    return _trace(plant, law, reference, inputs, record, dict(zip(fields, states.T, strict=True)), seed)


def compiled_loop(law: Law) -> Callable[..., int]:
    """`run_loop` with the law's kernels in it, compiled at the first call and cached on disk."""
    return specialise(run_loop, law.name, law_start=law.start_kernel, law_step=law.step_kernel)


def _inputs(plant: Bench, reference: Trajectory, duration: float, bend: BendPath, seed: int) -> _Inputs:
    dt = plant.sample_time
    for name, value, fine in (
        ("sample_time", dt, dt > 0.0),
        ("duration", duration, duration >= 2.0 * dt and duration / dt < 1e9),
        ("delay", plant.delay, plant.delay >= 0),
        ("substeps", plant.substeps, plant.substeps >= 1),
    ):
        if not fine:
            raise ParameterError(f"simulate: {name} is {value}", expected="a positive number that makes sense here")
    cycles = round(duration / dt)
    edges = np.arange(cycles + 1, dtype=np.float64) * dt
    angles = bend(edges)
    return _Inputs(
        time=edges[:-1],
        references=reference.sample(edges[:-1]),
        widths=_spread(width_at, angles, plant.sheath),
        slope_factors=_spread(slope_factor_at, angles, plant.sheath),
        normals=np.random.default_rng(seed).standard_normal((cycles, 2)),
    )


def _trace(
    plant: Bench,
    law: Law,
    reference: Trajectory,
    inputs: _Inputs,
    record: NDArray[np.float64],
    states: dict[str, NDArray[np.float64]],
    seed: int,
) -> Trace:
    columns = {
        "time": inputs.time,
        "reference": inputs.references[:, 0].copy(),
        "reference_velocity": inputs.references[:, 1].copy(),
    } | {name: record[:, i].copy() for i, name in enumerate(COLUMNS)}
    units = {"time": "s", "reference": "rad", "reference_velocity": "rad/s"} | COLUMNS
    columns["width"], units["width"] = inputs.widths[:-1].copy(), "1"
    columns["slope"], units["slope"] = inputs.slope_factors[:-1] * plant.cable.slope, "rad/rad"
    columns["current"] = _spread(
        motor_model.current, columns["motor_acceleration"], columns["joint"], columns["slope"], plant.motor
    )
    units["current"] = "A"
    for name, values in states.items():
        columns[f"law.{name}"], units[f"law.{name}"] = values.copy(), law.state_units.get(name, "1")
    settings = {
        "bowden": __version__,
        "law": law.name,
        "gains": dict(law.gains._asdict()),
        "reference": reference.describe(),
        "plant": _plain(plant),
        "sample_time": plant.sample_time,
        "motor_resistance": plant.motor.resistance,
        "torque_constant": plant.motor.torque_constant * plant.motor.gear,
    }
    return Trace(columns, units, settings, seed)


def _spread(kernel_of_numbers: Callable[..., Any], *arguments: Any) -> NDArray[np.float64]:
    """A kernel made of ufuncs, called with arrays in place of numbers."""
    return np.asarray(kernel_of_numbers(*arguments), dtype=np.float64)


def _plain(value: Any) -> Any:
    return {k: _plain(v) for k, v in value._asdict().items()} if hasattr(value, "_asdict") else value
