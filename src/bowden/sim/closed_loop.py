"""The closed loop: a law against the bench, compiled as one function."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

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
from bowden.models.cable.sheath import slope_factor as slope_factor_at
from bowden.models.cable.sheath import width as width_at
from bowden.models.drive import motor as motor_model
from bowden.models.drive.encoder import reading
from bowden.plants.bench import Bench, bench_moved, bench_start, prepare_bench
from bowden.sim.faulty import Fault, as_it_is, faulty
from bowden.sim.scenario import BendPath, constant_bend

if TYPE_CHECKING:
    from bowden.plants.cable_plant import CablePlant

UNITS = {
    "time": "s",
    "reference": "rad",
    "reference_velocity": "rad/s",
    "joint": "rad",
    "motor": "rad",
    "joint_measured": "rad",
    "motor_measured": "rad",
    "command": "rad",
    "motor_velocity": "rad/s",
    "motor_acceleration": "rad/s²",
    "h": "1",
    "width": "1",
    "slope": "rad/rad",
    "current": "A",
}
"""The columns of a run's trace and their units; the law's own state follows."""

_RECORDED = list(UNITS)[3:11]
"""The columns that the compiled loop fills, in its order."""

RUNAWAY = 1e3
"""A command beyond this [rad] ends the run: the loop is unstable and the rest of the record stays NaN."""

_AT_ONCE = 15_000
"""Cycles whose reference is worked out in one go; beyond that the system hands out fresh memory for every step."""


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
    fault: Fault,
    kept: NDArray[np.float64],
) -> int:
    """One run; fills `record` (8, n) and `states` (m, n) and returns the number of cycles that it lasted.

    Each cycle reads the encoders, steps the law, and moves the plant by one sample time under the command that was
    computed `delay` cycles before. The sheath's width and slope are linear between cycles.
    """
    cycles = references.shape[1]
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
        sample = as_it_is(fault, sample, kept, k)
        reference = Reference(references[0, k], references[1, k], references[2, k])
        state, command = law_step(gains, state, sample, reference, dt)
        record[0, k] = plant.joint
        record[1, k] = plant.motor.position
        record[2, k] = sample.joint
        record[3, k] = sample.motor
        record[4, k] = command
        record[5, k] = plant.motor.velocity
        record[6, k] = plant.motor.acceleration
        record[7, k] = plant.h
        numbers = flat(state)
        for j in range(len(numbers)):
            states[j, k] = numbers[j]
        if not abs(command) < RUNAWAY:
            return k
        applied = record[4, k - delay] if k >= delay else initial_motor
        plant = bench_moved(bench, plant, applied, widths[k], widths[k + 1], slope_factors[k + 1], substeps)
    return cycles


class Inputs(NamedTuple):
    """All that is known of a run before it begins."""

    time: NDArray[np.float64]  # (n,)
    references: NDArray[np.float64]  # (3, n)
    widths: NDArray[np.float64]  # (n + 1,)
    slope_factors: NDArray[np.float64]  # (n + 1,)
    normals: NDArray[np.float64]  # (n, 2)


def simulate(
    plant: "Bench | CablePlant",
    law: Law,
    reference: Trajectory,
    *,
    duration: float,
    bend: BendPath | None = None,
    seed: int = 0,
    initial_motor: float = 0.0,
    fault: Fault | None = None,
) -> Trace:
    """Run a law against the bench, or against any other cable.

    Args:
        plant: the bench, or a plant round another cable.
        law: the control law with its gains.
        reference: the joint's desired motion.
        duration: length of the run [s].
        bend: the sheath's total bend over time; constant at the identified bend where it is not given.
        seed: of the encoders' noise.
        initial_motor: motor angle at rest before the start [rad].
        fault: of a sensor of the bench; the measured columns have what the law was shown.

    Returns:
        The trace; of a run that ran away (a command beyond 1000 rad or not a number) the rest is NaN.

    Raises:
        ParameterError: a duration or setting that cannot be.
    """
    bend = bend or constant_bend(plant.sheath.bend)
    if not isinstance(plant, Bench):
        if fault is not None:
            raise ParameterError("simulate: a sensor's fault round another cable", expected="it on the bench alone")
        from bowden.sim.cable_loop import simulate_cable  # which takes the law's stand-ins from here

        return simulate_cable(
            plant, law, reference, duration=duration, bend=bend, seed=seed, initial_motor=initial_motor
        )
    inputs = inputs_of(plant, reference, duration, bend, seed)
    fields = law.columns()
    # one block: a system hands out a large piece of memory far faster than many small ones
    block = np.empty((len(_RECORDED) + len(fields), len(inputs.time)))
    record, states = block[: len(_RECORDED)], block[len(_RECORDED) :]
    fault = fault or Fault()
    lasted = compiled_loop(law, fails=fault.kind > 0.0)(
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
        fault,
        np.empty((2, len(inputs.time))) if fault.kind > 0.0 else np.empty((2, 0)),
    )
    block[:, lasted:] = np.nan
    values = {"time": inputs.time, "reference": inputs.references[0], "reference_velocity": inputs.references[1]}
    values |= dict(zip(_RECORDED, record, strict=True))
    values |= {"width": inputs.widths[:-1], "slope": inputs.slope_factors[:-1] * plant.cable.slope}
    values["current"] = _spread(
        motor_model.current, values["motor_acceleration"], values["joint"], values["slope"], plant.motor
    )
    values |= dict(zip(fields, states, strict=True))
    return Trace(
        values,
        UNITS | fields,
        _settings(plant, law, reference),
        seed,
    )


def compiled_loop(law: Law, *, fails: bool = False) -> Callable[..., int]:
    """`run_loop` with the law's kernels in it, compiled at the first call and cached on disk.

    Args:
        law: whose.
        fails: whether a sensor may go wrong in it.
    """
    parts: dict[str, Callable[..., Any]] = {"law_start": law.start_kernel, "law_step": law.step_kernel}
    return specialise(run_loop, law.name, **parts | ({"as_it_is": faulty} if fails else {}))


def check_clock(plant: "Bench | CablePlant", duration: float) -> None:
    """Refuse a clock, a delay or a duration that cannot be.

    Raises:
        ParameterError: one of these.
    """
    dt = plant.sample_time
    for name, value, fine in (
        ("sample_time", dt, dt > 0.0),
        ("duration", duration, 2.0 * dt <= duration < 1e9 * dt),
        ("delay", plant.delay, plant.delay >= 0),
        ("substeps", plant.substeps, plant.substeps >= 1),
    ):
        if not fine:
            raise ParameterError(f"simulate: {name} is {value}", expected="a positive number that makes sense here")


def edges_of(plant: "Bench | CablePlant", duration: float) -> NDArray[np.float64]:
    """The edges of a run's cycles (n + 1,) [s]."""
    return np.arange(round(duration / plant.sample_time) + 1, dtype=np.float64) * plant.sample_time


def inputs_of(plant: Bench, reference: Trajectory, duration: float, bend: BendPath, seed: int) -> Inputs:
    """The reference, the sheath and the noise of a run; the arguments are those of `simulate`."""
    check_clock(plant, duration)
    edges = edges_of(plant, duration)
    cycles = len(edges) - 1
    widths, slope_factors = sheath_over(plant, edges, bend)
    noisy = plant.joint_encoder.noise > 0.0 or plant.motor_encoder.noise > 0.0
    references = np.empty((3, cycles))
    for begin in range(0, cycles, _AT_ONCE):
        part = slice(begin, min(begin + _AT_ONCE, cycles))
        references[:, part] = reference.sample(edges[part]).T
    return Inputs(
        time=edges[:-1],
        references=references,
        widths=widths,
        slope_factors=slope_factors,
        normals=np.random.default_rng(seed).standard_normal((cycles, 2)) if noisy else np.zeros((cycles, 2)),
    )


def sheath_over(
    plant: "Bench | CablePlant", edges: NDArray[np.float64], bend: BendPath
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Width and slope factor of the sheath at the `edges` of the cycles [s]."""
    angles = bend(edges)
    return _spread(width_at, angles, plant.sheath), _spread(slope_factor_at, angles, plant.sheath)


def _settings(plant: Bench, law: Law, reference: Trajectory) -> dict[str, Any]:
    return {
        "bowden": __version__,
        "law": law.name,
        "gains": dict(law.gains._asdict()),
        "reference": reference.describe(),
        "plant": _plain(plant),
        "sample_time": plant.sample_time,
        "motor_resistance": plant.motor.resistance,
        "torque_constant": plant.motor.torque_constant * plant.motor.gear,
    }


def _spread(kernel_of_numbers: Callable[..., Any], *arguments: Any) -> NDArray[np.float64]:
    """A kernel made of ufuncs, called with arrays in place of numbers."""
    return np.asarray(kernel_of_numbers(*arguments), dtype=np.float64)


def _plain(value: Any) -> Any:
    return {k: _plain(v) for k, v in value._asdict().items()} if hasattr(value, "_asdict") else value
