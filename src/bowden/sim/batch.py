"""Many closed loops in one compiled call: figures of merit, and nothing else kept.

A run here is the run of `bowden.sim.closed_loop.simulate` to the last bit, made of the same kernels, and its figures
are those of `bowden.core.metrics`: their sums are taken in NumPy's order. A handful of rows as long as one run are
filled again by each run, so that memory does not grow with their number.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.control.law import law_start, law_step
from bowden.core.kernel import apart, kernel
from bowden.core.nested import refilled
from bowden.core.pairwise import pairwise_sum
from bowden.core.signals import Reference, Sample
from bowden.models.drive.encoder import reading
from bowden.models.drive.motor import Motor, current
from bowden.plants.bench import BenchState, BenchStep, bench_moved, bench_start
from bowden.sim.closed_loop import RUNAWAY
from bowden.sim.faulty import Fault, as_it_is

Array = NDArray[np.float64]

LATE = 10.0
"""From when on the second RMSE counts [s]."""
FIGURES = {
    "cycles": "1",
    "ended": "1",
    "stable": "1",
    "rmse": "rad",
    "rmse_after_10s": "rad",
    "peak": "rad",
    "lag": "s",
    "command_travel": "rad",
    "largest_command": "rad",
    "mechanical_energy": "J",
    "electrical_energy": "J",
}
"""Name → unit of what is kept of a run; see `bowden.sim.many.Outcome`."""
ROWS = 6
"""Of the scratch memory."""


class One(NamedTuple):
    """The numbers of one run."""

    gains: Any
    plant: Any
    """What `plant_rest` and `plant_moved` take."""
    encoders: Any
    """Of joint and motor."""
    motor: Motor
    slope: float
    """Of the cable at the identified bend [rad/rad]."""
    initial_motor: float
    """[rad]"""
    dt: float
    """[s]"""
    delay: int
    """[cycles]"""
    substeps: int
    stroke: float
    """An error larger than this counts as unstable [rad]."""
    fault: Fault


class Limits(NamedTuple):
    """When the rest of a batch need not be run any more."""

    rmse: float = np.inf
    """A run with a larger RMSE, or one that does not end, is the last one [rad]."""
    at_once: float = 0.0
    """1: a run ends, too, as soon as its RMSE must become larger than that."""


class Inputs(NamedTuple):
    """What the runs of a batch are given over time; each run names its row."""

    references: Array  # (p, 3, n)
    widths: Array  # (q, n + 1)
    slope_factors: Array  # (q, n + 1)
    normals: Array  # (b, n, 2)


@kernel
def plant_rest(plant: Any, motor: float, width: float, slope_factor: float) -> Any:
    """Stand-in for how a plant begins; `specialise` puts its own in its place."""
    raise NotImplementedError  # never compiled: always replaced


@kernel
def plant_moved(
    plant: Any, body: Any, applied: float, width: float, after: float, factor: float, factor_after: float, substeps: int
) -> Any:
    """Stand-in for a plant's motion over one cycle."""
    raise NotImplementedError  # never compiled: always replaced


@kernel
def plant_current(one: Any, body: Any, factor: float) -> float:
    """Stand-in for the motor's current [A]."""
    raise NotImplementedError  # never compiled: always replaced


@kernel
def bench_step(
    plant: BenchStep,
    body: BenchState,
    applied: float,
    width: float,
    after: float,
    factor: float,
    factor_after: float,
    substeps: int,
) -> BenchState:
    """`bench_moved`, called as `plant_moved` is."""
    return bench_moved(plant, body, applied, width, after, factor_after, substeps)


@kernel
def spring_current(one: One, body: Any, factor: float) -> float:
    """The current that holds the bench's spring through a cable that knows no forces [A]."""
    return current(body.motor.acceleration, body.joint, factor * one.slope, one.motor)


@kernel
def torque_current(one: One, body: Any, factor: float) -> float:
    """The current against the torque of a cable that knows it [A]."""
    motor = one.motor
    return (motor.inertia * body.motor.acceleration + body.seen.torque) / (motor.gear * motor.torque_constant)


BENCH: dict[str, Callable[..., Any]] = {
    "plant_rest": bench_start,
    "plant_moved": bench_step,
    "plant_current": spring_current,
}
"""What stands for the stand-ins on the bench."""


_SURELY = 1.0 + 1e-9
"""A sum of squares that is larger by this share is larger in whatever order it is taken."""


@kernel
def run_batch(
    like: One,
    numbers: Array,
    rows: NDArray[np.int64],
    inputs: Inputs,
    limits: Limits,
    scratch: Array,
    figures: Array,
) -> None:
    """Run after run, cycle by cycle as `bowden.sim.closed_loop.run_loop`; fills `figures` (b, `FIGURES`), NaN where a
    run was not needed any more.

    In one piece: every kernel that a loop is cut into costs as much time to compile as the loop itself.

    Args:
        like: an example of a run's numbers.
        numbers: those of each run (b, m), see `bowden.core.nested`.
        rows: cycles, row of the references, of the sheath's and of the normal numbers for each run (b, 4).
        inputs: see there.
        limits: see there.
        scratch: (`ROWS`, n): commands, joint angles, mechanical and electrical power, readings of joint and motor; of
            the last run it keeps commands and joint angles.
        figures: to be filled.
    """
    figures[:, :] = np.nan
    for r in range(numbers.shape[0]):
        one = refilled(like, numbers[r])
        cycles, references, normals = rows[r, 0], inputs.references[rows[r, 1]], inputs.normals[rows[r, 3]]
        widths, factors = inputs.widths[rows[r, 2]], inputs.slope_factors[rows[r, 2]]
        allowed = limits.rmse * limits.rmse * cycles * _SURELY if limits.at_once > 0.0 else np.inf
        motor, constant, spent = one.motor, one.motor.torque_constant * one.motor.gear, 0.0
        joint_encoder, motor_encoder = one.encoders
        body = plant_rest(one.plant, one.initial_motor, widths[0], factors[0])
        sample = Sample(
            reading(body.joint, normals[0, 0], joint_encoder),
            reading(body.motor.position, normals[0, 1], motor_encoder),
        )
        state = law_start(one.gains, sample)
        lasted = cycles
        for k in range(cycles):
            sample = Sample(
                reading(body.joint, normals[k, 0], joint_encoder),
                reading(body.motor.position, normals[k, 1], motor_encoder),
            )
            sample = as_it_is(one.fault, sample, scratch[4:6], k)
            reference = Reference(references[0, k], references[1, k], references[2, k])
            state, command = law_step(one.gains, state, sample, reference, one.dt)
            scratch[0, k], scratch[1, k] = command, body.joint
            amperes = plant_current(one, body, factors[k])
            power = body.motor.velocity * constant * amperes
            scratch[2, k], scratch[3, k] = power, power + motor.resistance * (amperes * amperes)
            error = body.joint - references[0, k]
            spent += error * error
            if not abs(command) < RUNAWAY or spent > allowed:
                lasted = k
                break
            applied = scratch[0, k - one.delay] if k >= one.delay else one.initial_motor
            body = plant_moved(
                one.plant, body, applied, widths[k], widths[k + 1], factors[k], factors[k + 1], one.substeps
            )
        figures[r, 0] = lasted
        judge(one.dt, one.initial_motor, one.stroke, cycles, lasted, references, scratch, figures[r])
        rmse = figures[r, 3] if figures[r, 1] > 0.0 else np.inf
        if rmse > limits.rmse:
            return


@apart
def judge(
    dt: float,
    initial_motor: float,
    stroke: float,
    cycles: int,
    lasted: int,
    references: Array,
    scratch: Array,
    figures: Array,
) -> None:
    """The figures of a run whose scratch rows are filled; of one that ran away only that.

    The readings' rows serve for its sums; commands and joint angles stay.
    """
    figures[1], figures[2] = 0.0, 0.0
    peak, along, moved = 0.0, 0.0, 0.0
    for k in range(lasted):
        error = scratch[1, k] - references[0, k]
        if not abs(error) < np.inf:
            return
        peak = max(peak, abs(error))
        along += error * references[1, k]
        moved += references[1, k] * references[1, k]
    if lasted < cycles:
        return
    figures[1] = 1.0
    figures[2] = 1.0 if peak <= stroke else 0.0
    figures[5], largest, late = peak, 0.0, cycles
    if moved > 0.0:
        figures[6] = -along / moved
    before = initial_motor
    for k in range(cycles):
        if late == cycles and k * dt >= LATE:
            late = k
        command = scratch[0, k]
        largest = max(largest, abs(command))
        error = scratch[1, k] - references[0, k]
        scratch[4, k], scratch[5, k] = abs(command - before), error * error
        before = command
    figures[3] = np.sqrt(pairwise_sum(scratch[5], 0, cycles) / cycles)
    if late < cycles:
        figures[4] = np.sqrt(pairwise_sum(scratch[5], late, cycles) / (cycles - late))
    figures[7], figures[8] = pairwise_sum(scratch[4], 0, cycles), largest
    for row in (2, 3):
        for k in range(cycles - 1):
            step = (k + 1) * dt - k * dt
            scratch[row, k] = step * (scratch[row, k + 1] + scratch[row, k]) / 2.0
        figures[row + 7] = pairwise_sum(scratch[row], 0, cycles - 1)
