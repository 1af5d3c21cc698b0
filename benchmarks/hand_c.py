"""One minute of the adaptive closed loop against a hand-written C program of the same arithmetic."""

import ctypes
import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bowden.control import LAWS
from bowden.control.conditioning import COLUMNS as CONDITIONED
from bowden.control.source import TABLE
from bowden.plants.bench import Bench
from bowden.plants.plant import SheathPath
from bowden.plants.presets import paper
from bowden.plants.presets.bench import bench
from bowden.records.trace import Trace
from bowden.sim.run import RECORDED, compiled_loop, simulate
from measure import Row, by_turns

Array = NDArray[np.float64]
DURATION = 60.0
FLAGS = ("-O3", "-std=c99", "-ffp-contract=off", "-fPIC", "-shared")
SEED = 1

PLANT, LAW, REFERENCE = bench(), LAWS["adaptive"], paper.minimum_jerk()
DYNAMICS = PLANT.dynamics()
CYCLES = round(DURATION / PLANT.sample_time)
RECORD, ROWS = 9, 22
"""Rows of the record, and of the record with the states of law and conditioner."""
CABLE, SERVO, MOTOR = PLANT.cable, PLANT.servo, PLANT.motor
QUICK = PLANT._replace(servo=SERVO._replace(natural_frequency=300.0))
"""With a servo so quick beside the cycle that C goes in sub-steps, and ours where the motor turns in a cycle."""

NUMBERS: dict[str, float] = {
    "sample_time": PLANT.sample_time,
    **CABLE._asdict(),
    "bend": PLANT.sheath.bend,
    "identified_bend": PLANT.sheath.bend,
    "gap": PLANT.sheath.gap,
    "loss": PLANT.sheath.loss,
    "natural_frequency": SERVO.natural_frequency,
    "damping": SERVO.damping,
    "speed_limit": SERVO.speed_limit,
    "acceleration_limit": DYNAMICS.plant.servo.cycle.acceleration_limit,
    **{name: getattr(MOTOR, name) for name in ("torque_constant", "gear", "inertia", "spring", "pretension")},
    "joint_resolution": PLANT.joint_encoder.resolution,
    "joint_noise": PLANT.joint_encoder.noise,
    "motor_resolution": PLANT.motor_encoder.resolution,
    "motor_noise": PLANT.motor_encoder.noise,
    **LAW.gains._asdict(),
    "conditioning_frequency": LAW.conditioning.servo_frequency,
    "conditioning_delay": LAW.conditioning.delay,
    "low": REFERENCE.low,
    "high": REFERENCE.high,
    "period": REFERENCE.period,
    "initial_motor": 0.0,
}
"""The C program's parameters, in the order of its ``struct parameters``."""


class Parameters(ctypes.Structure):
    """The C program's ``struct parameters``."""

    _fields_ = [  # a list, as ctypes asks for
        *((name, ctypes.c_double) for name in NUMBERS),
        *((name, ctypes.c_long) for name in ("delay", "substeps", "cycles")),
    ]


def compiler() -> str | None:
    """The C compiler, or None where there is none."""
    names = (os.environ.get("CC"), "cc", "gcc", "clang")
    return next((path for name in names if name and (path := shutil.which(name))), None)


def rows(rounds: int = 40) -> tuple[list[Row], str]:
    """Against C for any x86-64, as Debian compiles, and for this processor alone.

    Raises:
        RuntimeError: the two do not agree to 1e-9: they did not do the same work.
    """
    cc = compiler()
    if cc is None:
        return [Row("a minute of the adaptive loop against C", "", "", "skipped: no C compiler (set CC)", "")], ""
    found: list[Row] = []
    for flags in (FLAGS, (*FLAGS, "-march=native")):
        with _built(cc, flags) as library:
            said = "" if flags is FLAGS else ", -march=native"
            quick = f", a quick servo, C in {QUICK.substeps} sub-steps a cycle{said}"
            found += _rows(library, rounds, said, PLANT) + _rows(library, rounds, quick, QUICK)[1:]
    said = subprocess.run([cc, "--version"], capture_output=True, text=True, check=True).stdout.splitlines()[0]
    return found, f"C: {said}, {' '.join(FLAGS[:3])}, the same arithmetic to 1e-9, noise drawn by NumPy on both sides."


def _rows(library: ctypes.CDLL, rounds: int, said: str, plant: Bench) -> list[Row]:
    frequency, limit = plant.servo.natural_frequency, plant.dynamics().plant.servo.acceleration_limit
    numbers = NUMBERS | {"natural_frequency": frequency, "acceleration_limit": limit}
    parameters = Parameters(**numbers, delay=plant.delay, substeps=plant.substeps, cycles=CYCLES)
    pointer = ctypes.byref(parameters)

    def c_program(normals: Array) -> tuple[Array, Array, Array]:
        inputs, edges, block = np.empty((5, CYCLES)), np.empty((2, CYCLES + 1)), np.empty((ROWS, CYCLES))
        _lasted(library.run(pointer, *map(_at, (normals, inputs, edges, block[:RECORD], block[RECORD:]))))
        return inputs, edges, block

    def package() -> Trace:
        return simulate(plant, LAW, REFERENCE, duration=DURATION, seed=SEED)

    noise = np.random.default_rng(SEED).standard_normal((CYCLES, 2))
    inputs, edges, block = c_program(noise)
    difference = _difference(package(), inputs, block)
    if not difference <= 1e-9:
        raise RuntimeError(f"C and package differ by {difference:g}: not the same work")
    references, (widths, slopes) = inputs[1:4].copy(), edges
    record, states = np.empty((RECORD, CYCLES)), np.empty((ROWS - RECORD, CYCLES))
    c_arguments = [_at(values) for values in (references, widths, slopes, noise, record, states)]
    ours = _loop(plant, references, widths, slopes, noise)
    timings = by_turns(
        rounds,
        simulate=package,
        c_program=lambda: c_program(np.random.default_rng(SEED).standard_normal((CYCLES, 2))),
        loop=lambda: _lasted(ours()),
        c_loop=lambda: _lasted(library.loop(pointer, *c_arguments)),
    )
    return [
        Row(f"{what}{said}", timings[mine], timings[peer], f"{timings[mine].over(timings[peer])} × C", "≤ 0.9")
        for what, mine, peer in (
            ("a minute of the adaptive loop against C: `simulate`", "simulate", "c_program"),
            ("the same: the compiled loop alone", "loop", "c_loop"),
        )
    ]


def _loop(plant: Bench, references: Array, widths: Array, slopes: Array, normals: Array) -> Callable[[], int]:
    """Our compiled loop alone, ready to be called."""
    dynamics, cycles = plant.dynamics(), references.shape[1]
    record, states = np.empty((RECORD, cycles)), np.empty((ROWS - RECORD, cycles))
    sheath = SheathPath(np.full(cycles + 1, plant.sheath.bend), widths, slopes)
    settings = (LAW.gains, LAW.conditioning, TABLE.settings, dynamics.plant)
    arguments = (*settings, references, sheath, normals, 0.0, plant.sample_time)
    loop = compiled_loop(dynamics, LAW)
    return lambda: loop(*arguments, plant.delay, record, states, 0.0, np.empty((2, 0)), np.inf)


def _difference(trace: Trace, inputs: Array, block: Array) -> float:
    """Largest difference over the columns of the trace."""
    names = [*RECORDED, *DYNAMICS.columns, *LAW.columns(), *CONDITIONED]
    theirs = dict(zip(("time", "reference", "reference_velocity"), inputs[:3], strict=True)) | {"slope": inputs[4]}
    theirs |= dict(zip(names, block, strict=True))
    return max(float(np.max(np.abs(trace[name] - values))) for name, values in theirs.items())


@contextmanager
def _built(cc: str, flags: tuple[str, ...]) -> Iterator[ctypes.CDLL]:
    source = Path(__file__).parent / "c" / "closed_loop.c"
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "closed_loop.so"
        subprocess.run([cc, *flags, "-o", str(target), str(source), "-lm"], check=True)
        library = ctypes.CDLL(str(target))
        library.run.restype = library.loop.restype = ctypes.c_long
        yield library


def _at(values: Array) -> Any:
    return ctypes.c_void_p(values.ctypes.data)


def _lasted(cycles: int) -> None:
    if cycles != CYCLES:
        raise RuntimeError(f"the run ended after {cycles} of {CYCLES} cycles")
