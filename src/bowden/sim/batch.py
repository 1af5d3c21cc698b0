"""Many closed loops in one compiled call: figures of merit, and nothing else kept.

A run here is the run of `bowden.sim.run.simulate` to the last bit, made of the same kernels, and its figures
are those of `bowden.records.metrics`: their sums are taken in NumPy's order. A handful of rows as long as one run are
filled again by each run, so that memory does not grow with their number.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.control.conditioning import Conditioning
from bowden.core.kernel import kernel, noinline, sqrt
from bowden.core.nested import unflatten_like
from bowden.core.signals import Reference
from bowden.cycle.one_cycle import LAW, Plan, bare_settings, bare_start, one_cycle
from bowden.plants.plant import (
    SheathPath,
    measured_as,
    plant_advance,
    plant_effort,
    plant_look,
    plant_observe,
    plant_rest,
    plant_sample,
    sheath_at,
)
from bowden.records.metrics import LATE, SMALLEST_STROKE
from bowden.sim.injected import SensorFault, as_it_is
from bowden.sim.run import RUNAWAY

Array = NDArray[np.float64]


@noinline
def pairwise_sum(values: Array, begin: int, end: int) -> float:
    """The sum of values[begin:end] in the order in which NumPy adds up a row, and so equal to its last bit.

    Halves (the first a multiple of eight long) down to 128 numbers, and in these eight sums side by side.
    """
    ends, sums, depth = np.empty(64, np.int64), np.empty(64), 0
    left = np.zeros(64, np.int64)  # whether a level's first half is being summed, 0, or its second, 1
    start, stop = begin, end
    while True:
        while stop - start > 128:
            half = (stop - start) // 2
            ends[depth], left[depth] = stop, 0
            depth += 1
            stop = start + half - half % 8
        total = _short_sum(values, start, stop)
        while depth > 0 and left[depth - 1] == 1:
            depth -= 1
            total = sums[depth] + total
        if depth == 0:
            return total
        sums[depth - 1], left[depth - 1] = total, 1
        start, stop = stop, ends[depth - 1]


@kernel
def _short_sum(values: Array, start: int, stop: int) -> float:
    """Of at most 128 numbers."""
    n = stop - start
    if n < 8:
        total = 0.0
        for i in range(start, stop):
            total += values[i]
        return total
    r0, r1, r2, r3 = values[start], values[start + 1], values[start + 2], values[start + 3]
    r4, r5, r6, r7 = values[start + 4], values[start + 5], values[start + 6], values[start + 7]
    i = start + 8
    while i < start + n - n % 8:
        r0, r1, r2, r3 = r0 + values[i], r1 + values[i + 1], r2 + values[i + 2], r3 + values[i + 3]
        r4, r5, r6, r7 = r4 + values[i + 4], r5 + values[i + 5], r6 + values[i + 6], r7 + values[i + 7]
        i += 8
    total = ((r0 + r1) + (r2 + r3)) + ((r4 + r5) + (r6 + r7))
    while i < stop:
        total += values[i]
        i += 1
    return total


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
ROWS = 8
"""Of the scratch memory."""


class One(NamedTuple):
    """The numbers of one run."""

    gains: Any
    conditioning: Conditioning
    """Of the law's reference."""
    source: Any
    """Settings of what makes the reference."""
    plant: Any
    """`bowden.plants.plant.Dynamics.plant`."""
    resistance: float
    """Of the motor [Ω]."""
    constant: float
    """Torque at the spool per ampere [N·m/A]."""
    initial_motor: float
    """[rad]"""
    dt: float
    """[s]"""
    delay: int
    """[cycles]"""
    fault: SensorFault


class BatchLimits(NamedTuple):
    """When the rest of a batch need not be run any more."""

    rmse: float = np.inf
    """A run with a larger RMSE, or one that does not end, is the last one [rad]."""
    at_once: bool = False
    """A run ends, too, as soon as its RMSE must become larger than that."""


class BatchInputs(NamedTuple):
    """What the runs of a batch are given over time; each run names its row."""

    references: Array  # (p, 3, n)
    bends: Array  # (q, n + 1)
    widths: Array  # (q, n + 1)
    slope_factors: Array  # (q, n + 1)
    normals: Array  # (b, n, m)


_SURELY = 1.0 + 1e-9
"""A sum of squares that is larger by this share is larger in whatever order it is taken."""


@kernel
def run_batch(
    like: One,
    numbers: Array,
    rows: NDArray[np.int64],
    inputs: BatchInputs,
    limits: BatchLimits,
    scratch: Array,
    figures: Array,
) -> None:
    """Run after run, cycle by cycle as `bowden.sim.run.run_loop`; fills `figures` (b, `FIGURES`), NaN where a run was
    not needed any more.

    In one piece: every kernel that a loop is cut into costs as much time to compile as the loop itself.

    Args:
        like: an example of a run's numbers.
        numbers: those of each run (b, m), see `bowden.core.nested`.
        rows: cycles, row of the references, of the sheath's and of the normal numbers for each run (b, 4).
        inputs: see there.
        limits: see there.
        scratch: (`ROWS`, n): commands, joint angles, mechanical and electrical power, readings of joint and motor, the
            reference and its speed; of the last run it keeps commands, joint angles and reference.
        figures: to be filled.
    """
    figures[:, :] = np.nan
    for r in range(numbers.shape[0]):
        one = unflatten_like(like, numbers[r])
        cycles, references, normals = rows[r, 0], inputs.references[rows[r, 1]], inputs.normals[rows[r, 3]]
        place = rows[r, 2]
        sheath = SheathPath(inputs.bends[place], inputs.widths[place], inputs.slope_factors[place])
        allowed = limits.rmse * limits.rmse * cycles * _SURELY if limits.at_once else math.inf
        spent = 0.0
        body = plant_rest(one.plant, one.initial_motor, sheath_at(sheath, 0))
        _, first = plant_observe(one.plant, body, normals[0])
        settings = bare_settings(one.gains, one.conditioning, one.source)
        state = bare_start(settings, measured_as(plant_sample(first), first))
        lasted = cycles
        for k in range(cycles):
            body, measured = plant_observe(one.plant, body, normals[k])
            measured = measured_as(as_it_is(one.fault, plant_sample(measured), scratch[4:6], k), measured)
            scheduled = Reference(references[0, k], references[1, k], references[2, k])
            plan = Plan(LAW, one.initial_motor, scheduled)
            state, reference, command, _ = one_cycle(settings, state, measured, plan, one.dt)
            now, seen = sheath_at(sheath, k), plant_look(one.plant, body)
            scratch[0, k], scratch[1, k] = command, seen.joint
            scratch[6, k], scratch[7, k] = reference.position, reference.velocity
            amperes = plant_effort(one.plant, body, now)
            power = seen.motor_velocity * one.constant * amperes
            scratch[2, k], scratch[3, k] = power, power + one.resistance * (amperes * amperes)
            error = seen.joint - reference.position
            spent += error * error
            if not abs(command) < RUNAWAY or spent > allowed:
                lasted = k
                break
            applied = scratch[0, k - one.delay] if k >= one.delay else one.initial_motor
            body = plant_advance(one.plant, body, applied, now, sheath_at(sheath, k + 1))
        figures[r, 0] = lasted
        judge(one.dt, one.initial_motor, cycles, lasted, scratch, figures[r])
        rmse = figures[r, 3] if figures[r, 1] > 0.0 else math.inf
        if rmse > limits.rmse:
            return


@noinline
def judge(dt: float, initial_motor: float, cycles: int, lasted: int, scratch: Array, figures: Array) -> None:
    """The figures of a run whose scratch rows are filled; of one that ran away only that.

    The readings' rows serve for its sums; commands, joint angles and reference stay.
    """
    figures[1], figures[2] = 0.0, 0.0
    peak, along, moved, low, high = 0.0, 0.0, 0.0, scratch[6, 0], scratch[6, 0]
    for k in range(lasted):
        error, speed = scratch[1, k] - scratch[6, k], scratch[7, k]
        if not math.isfinite(error):
            return
        peak = max(peak, abs(error))
        low, high = min(low, scratch[6, k]), max(high, scratch[6, k])
        along += error * speed
        moved += speed * speed
    if lasted < cycles:
        return
    figures[1] = 1.0
    figures[2] = 1.0 if peak <= max(high - low, SMALLEST_STROKE) else 0.0
    figures[5], largest, late = peak, 0.0, cycles
    if moved > 0.0:
        figures[6] = -along / moved
    before = initial_motor
    for k in range(cycles):
        if late == cycles and k * dt >= LATE:
            late = k
        command = scratch[0, k]
        largest = max(largest, abs(command))
        error = scratch[1, k] - scratch[6, k]
        scratch[4, k], scratch[5, k] = abs(command - before), error * error
        before = command
    figures[3] = sqrt(pairwise_sum(scratch[5], 0, cycles) / cycles)
    if late < cycles:
        figures[4] = sqrt(pairwise_sum(scratch[5], late, cycles) / (cycles - late))
    figures[7], figures[8] = pairwise_sum(scratch[4], 0, cycles), largest
    for row in (2, 3):
        for k in range(cycles - 1):
            step = (k + 1) * dt - k * dt
            scratch[row, k] = step * (scratch[row, k + 1] + scratch[row, k]) / 2.0
        figures[row + 7] = pairwise_sum(scratch[row], 0, cycles - 1)
