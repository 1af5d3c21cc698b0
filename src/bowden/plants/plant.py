"""Any plant, one control cycle at a time: what a run, a batch, the check and the twin need of it.

A plant is a value with its parts whose `dynamics` hands out kernels and the parameters that these are handed:

    rest(plant, motor, sheath) -> body                              at rest at a motor angle
    advance(plant, body, applied, sheath, next_sheath) -> body      one cycle later under a command
    observe(plant, body, normals) -> (body, reading)                what its sensors say; a sensor may remember
    effort(plant, body, sheath) -> current                          what the motor needs for it
    look(plant, body) -> columns                                    where it truly is

`body` is a NamedTuple of numbers, arrays and other NamedTuples; the columns are a NamedTuple of floats that begins with
the joint's angle, the motor's angle and the speed of the motor's spool. A loop's source calls the placeholders
`plant_rest` … `plant_look`, and `specialise` puts the plant's own kernels in their place, and those of a joint's sensor
that is no encoder in place of `joint_start` and `joint_sense`.
"""

import contextlib
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from bowden.control.source import Measurement
from bowden.core import user_file
from bowden.core.errors import ParameterError
from bowden.core.kernel import compiled, kernel, placeholder
from bowden.core.signals import Sample
from bowden.models.cable.sheath import Sheath
from bowden.models.cable.sheath import slope_factor as slope_factor_at
from bowden.models.cable.sheath import width as width_at
from bowden.models.drive.encoder import Encoder, reading
from bowden.models.drive.servo import Servo

Array = NDArray[np.float64]


class SheathState(NamedTuple):
    """The sheath at one instant."""

    bend: float
    """Total bend [rad]."""
    width: float
    """Factor on the hysteresis, see `bowden.models.cable.sheath` [–]."""
    slope_factor: float
    """Factor on the cable's slope [–]."""


class SheathPath(NamedTuple):
    """The sheath at the edges of a run's cycles; it goes straight from one to the next."""

    bends: Array  # (n + 1,) [rad]
    widths: Array  # (n + 1,) [–]
    slope_factors: Array  # (n + 1,) [–]


@kernel
def sheath_at(path: SheathPath, k: int) -> SheathState:
    """The sheath at the beginning of cycle k."""
    return SheathState(path.bends[k], path.widths[k], path.slope_factors[k])


@lru_cache(maxsize=16)  # a twin asks five times a cycle, mostly for the same bend
def sheath_state(sheath: Sheath, bend: float) -> SheathState:
    """A sheath at a total `bend` [rad]."""
    return SheathState(float(bend), float(width_at(bend, sheath)), float(slope_factor_at(bend, sheath)))


def sheath_path(sheath: Sheath, bends: Array) -> SheathPath:
    """A sheath at total `bends` (n + 1,) [rad]."""
    path = SheathPath(np.array(bends, dtype=np.float64), np.empty(len(bends)), np.empty(len(bends)))
    compiled(fill_sheath)(sheath, path)
    return path


@kernel
def fill_sheath(sheath: Sheath, path: SheathPath) -> None:
    """Widths and slope factors at a path's bends, in place."""
    for k in range(path.bends.size):
        path.widths[k] = width_at(path.bends[k], sheath)
        path.slope_factors[k] = slope_factor_at(path.bends[k], sheath)


@placeholder
def plant_rest(plant: Any, motor: float, sheath: SheathState) -> Any:
    """Placeholder for a plant's ``rest`` in a loop's source; `specialise` puts the plant's own in its place."""
    raise NotImplementedError  # always replaced


@placeholder
def plant_advance(plant: Any, body: Any, applied: float, sheath: SheathState, next_sheath: SheathState) -> Any:
    """Placeholder for a plant's ``advance``."""
    raise NotImplementedError  # always replaced


@placeholder
def plant_observe(plant: Any, body: Any, normals: Array) -> tuple[Any, Measurement]:
    """Placeholder for a plant's ``observe``."""
    raise NotImplementedError  # always replaced


@placeholder
def plant_effort(plant: Any, body: Any, sheath: SheathState) -> float:
    """Placeholder for a plant's ``effort``."""
    raise NotImplementedError  # always replaced


@placeholder
def plant_look(plant: Any, body: Any) -> Any:
    """Placeholder for a plant's ``look``."""
    raise NotImplementedError  # always replaced


@placeholder
def joint_start(sensing: Any, joint: float, motor: float) -> Any:
    """State of the joint's sensor with joint and motor at these angles [rad]; of an encoder nothing."""
    return 0.0


@placeholder
def joint_sense(
    sensing: Any, sensor: Any, measured: Measurement, joint: float, normals: Array, dt: float
) -> tuple[Any, Measurement]:
    """One cycle of the joint's sensor: its state, and the readings with what it says; of an encoder as they are."""
    return sensor, Measurement(measured.joint, measured.motor, measured.current, measured.load, math.nan, math.nan)


@kernel
def sample_of(measured: Measurement) -> Sample:
    """What a law is shown of the readings."""
    return Sample(measured.joint, measured.motor, measured.joint_age, measured.joint_std)


@kernel
def measured_as(sample: Sample, measured: Measurement) -> Measurement:
    """The readings with the angles that a law is shown."""
    return Measurement(sample.joint, sample.motor, measured.current, measured.load, sample.joint_age, sample.joint_std)


@kernel
def body_as_it_is(plant: Any, body: Any) -> Any:
    """The ``look`` of a plant whose body is a flat NamedTuple that begins with joint, motor and motor_velocity."""
    return body


@kernel
def read_encoders(plant: Any, body: Any, normals: Array) -> tuple[Any, Measurement]:
    """The ``observe`` of a plant with an encoder at the joint and one at the motor, and nothing else."""
    joint = reading(body.joint, normals[0], plant.joint_encoder)
    motor = reading(body.motor.position, normals[1], plant.motor_encoder)
    return body, Measurement(joint, motor, np.nan, np.nan)


@dataclass(frozen=True)
class Dynamics:
    """A plant as a loop runs it: its kernels, and the parameters that they are handed."""

    name: str
    """Name of a loop round it; plants with the same kernels share the compiled code."""
    plant: Any
    """Parameters: a NamedTuple of numbers, arrays and other NamedTuples."""
    rest: Callable[[Any, float, SheathState], Any]
    advance: Callable[[Any, Any, float, SheathState, SheathState], Any]
    observe: Callable[[Any, Any, Array], tuple[Any, Measurement]]
    effort: Callable[[Any, Any, SheathState], float]
    columns: Mapping[str, str]
    """Fields of what ``look`` gives, in their order, each with its unit."""
    look: Callable[[Any, Any], Any] = body_as_it_is
    parts: Mapping[str, Callable[..., Any]] = field(default_factory=dict)
    """Further placeholders that these kernels call, and what is put in their place."""
    normals: int = 2
    """Standard normal numbers that ``observe`` takes each cycle."""
    sensing: Any = 0.0
    """Parameters of the joint's sensor, where that is no encoder of the plant's own."""
    file: str = ""
    """Of a user's own kernels, for messages."""
    begins_at_reference: bool = False
    """True if the motor is counted in the joint's coordinate: where no initial motor angle is given, a run then begins
    at its reference's first, and else at 0."""

    @contextlib.contextmanager
    def explained(self) -> Iterator[None]:
        """Turn what goes wrong in a user's own kernels into one line, with the line of their file.

        Raises:
            ParameterError: they cannot be compiled, or fail while they run.
        """
        if not self.file:
            yield
            return
        with user_file.explained(Path(self.file), f"the plant {self.name!r}", named=True):
            yield

    def kernels(self) -> dict[str, Callable[..., Any]]:
        """Kernels for the placeholders in a loop's source."""
        own: dict[str, Callable[..., Any]] = {
            "plant_rest": self.rest,
            "plant_advance": self.advance,
            "plant_observe": self.observe,
            "plant_effort": self.effort,
            "plant_look": self.look,
        }
        return own | dict(self.parts)


def refuse_no_number(dynamics: Dynamics, columns: Mapping[str, float], time: float) -> None:
    """Refuse what a user's own plant gave `time` [s] after its start, where it is no number.

    Raises:
        ParameterError: the first such column, with the plant's file.
    """
    for name, value in columns.items():
        if dynamics.file and not math.isfinite(value):
            reads = name.endswith("_measured")
            own = dynamics.observe if reads else dynamics.advance
            own = dynamics.parts.get("own_observe" if reads else "own_advance", own)  # of one that is turned round
            if user_file.is_package(Path(own.__code__.co_filename)):  # encoders are read by ours
                own = dynamics.parts.get("own_advance", dynamics.advance)
            where = user_file.line(own, Path(dynamics.file))
            raise ParameterError(
                f"{where}: the plant {dynamics.name!r} gave {value} for {name} at t = {time:.6g} s",
                expected="a finite number",
                do="correct the plant there",
            )


class Plant(Protocol):
    """Any plant. A new one is a file: a class with these, and kernels; nothing lists them."""

    @property
    def sheath(self) -> Sheath:
        """How its hysteresis depends on the sheath's bend."""

    @property
    def servo(self) -> Servo:
        """The motor under its position loop, as linear analysis takes it and as a law knows it."""

    @property
    def motor(self) -> Any:
        """With ``resistance`` [Ω], ``torque_constant`` [N·m/A] and ``gear`` [–], for power and energy (Eq. 18)."""

    @property
    def joint_encoder(self) -> Any:
        """Sensor of the joint, with a ``resolution`` [rad]."""

    @property
    def sample_time(self) -> float:
        """Ts, one control cycle [s]."""

    @property
    def delay(self) -> int:
        """Cycles between a sample and the moment its command reaches the servo [–]."""

    def dynamics(self) -> Dynamics:
        """Its kernels and their parameters.

        Raises:
            ParameterError: parts that cannot be.
        """

    def draw(self, seed: int, out: Array) -> None:
        """Fill `out` (n, `Dynamics.normals`) with the normal numbers of a run: n cycles of one seed."""

    def sheath_columns(self, joint: Array, path: SheathPath) -> dict[str, Array]:
        """The columns ``width`` and ``slope`` of a trace (n,), and ``bend`` where the plant itself bends its sheath."""

    def resting_motor(self, joint: float, bend: float | None = None) -> float:
        """The motor angle at which it rests with its joint at `joint` [rad], in a sheath of a total `bend` [rad].

        The identified bend where it is not given.

        Raises:
            ParameterError: there is none.
        """

    def describe(self) -> dict[str, Any]:
        """All that it is made of, as JSON values, for a trace's settings."""


P = TypeVar("P", bound=Plant)


def changed(plant: P, **changes: Any) -> P:
    """The same plant with other parts: ``changed(plant, delay=3)``."""
    made: Any = plant
    other: P = made._replace(**changes)
    return other


def draw_for_encoders(encoders: tuple[Encoder, Encoder], seed: int, out: Array) -> None:
    """Normal numbers where one of two encoders is noisy, and else zeros: what `Plant.draw` does with two encoders."""
    if encoders[0].noise > 0.0 or encoders[1].noise > 0.0:
        if out.size <= _KEPT:
            out[:] = _normals(seed, *out.shape)
        else:
            np.random.default_rng(seed).standard_normal(out=out)
    else:
        out[:] = 0.0


_KEPT = 200_000
"""As many normal numbers are kept of the last runs: the check tries laws on the same ones."""


@lru_cache(2)
def _normals(seed: int, cycles: int, each: int) -> Array:
    return np.random.default_rng(seed).standard_normal((cycles, each))


def plain(value: Any) -> Any:
    """NamedTuples as objects, tuples and arrays as lists, for JSON."""
    if hasattr(value, "_asdict"):
        return {name: plain(part) for name, part in value._asdict().items()}
    if isinstance(value, tuple):
        return [plain(part) for part in value]
    return value.tolist() if isinstance(value, np.ndarray) else value


def check_numbers(value: Any, where: str) -> None:
    """Refuse parameters among which is not a number; only limits may be infinite.

    Raises:
        ParameterError: the first such number, by its name.
    """
    if isinstance(value, tuple):
        names = getattr(value, "_fields", [str(i) for i in range(len(value))])
        for name, part in zip(names, value, strict=True):
            check_numbers(part, f"{where}.{name}")
        return
    if isinstance(value, np.ndarray):
        if not np.isfinite(value).all():
            raise ParameterError(f"{where} holds {value[~np.isfinite(value)][0]}", expected="finite numbers")
    elif isinstance(value, float) and not (math.isfinite(value) or (value == math.inf and where.endswith("limit"))):
        raise ParameterError(f"{where} is {value:g}", expected="a finite number", do="correct the plant")


def motor_for(joint: float, joint_at: Callable[[float], float], guess: float, name: str) -> float:
    """The motor angle at which a plant that starts there has its joint at `joint` [rad], found by secant steps.

    Args:
        joint: wanted [rad].
        joint_at: where a plant that starts at a motor angle has its joint.
        guess: a motor angle near it [rad].
        name: of the plant, for messages.

    Raises:
        ParameterError: the plant has its joint there at no motor angle.
    """
    before, motor = 0.0, guess
    left, now = joint_at(before) - joint, joint_at(motor) - joint
    for _ in range(60):
        if abs(now) < 1e-13 or now == left:
            break
        before, motor, left = motor, motor - now * (motor - before) / (now - left), now
        now = joint_at(motor) - joint
    if not abs(now) < 1e-9:
        raise ParameterError(
            f"a {name!r} plant cannot rest with its joint at {joint:g} rad but at {joint + now:g} rad",
            expected="an angle that its load lets the joint take",
        )
    return motor
