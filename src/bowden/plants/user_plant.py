"""A user's own plant, from a Python file.

The file either defines a `UserPlant` object, or the parts of one: a NamedTuple ``Parameters`` with a default for every
field, and two kernels,

    rest(plant, motor, sheath) -> body
    advance(plant, body, applied, sheath, next_sheath) -> body

where `body` is a NamedTuple of floats that begins with ``joint``, ``motor`` and ``motor_velocity`` (the true angles and
the speed of the spool), and `plant` has ``parameters``, ``dt``, and the motor and the encoders that it is used with.
``observe`` and ``effort`` (`bowden.plants.plant`) may be there too; without them each angle is read by an encoder, and
the motor's current is not known. Of a plant whose joint falls where its motor rises the motor is counted the other way
round wherever it is used (`bowden.plants.turned`): laws take it that the joint follows the motor.

What it defines is tried for a few cycles, interpreted, before anything is compiled, because Python's messages name the
line and a compiler's rarely do.
"""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.control.source import Measurement
from bowden.core import user_file
from bowden.core.errors import ParameterError
from bowden.core.kernel import kernel
from bowden.core.own_file import OwnFile
from bowden.models.cable.sheath import Sheath
from bowden.models.drive.encoder import Encoder, reading
from bowden.models.drive.motor import Motor
from bowden.models.drive.servo import Servo
from bowden.plants.plant import (
    Dynamics,
    SheathPath,
    SheathState,
    check_numbers,
    draw_for_encoders,
    motor_for,
    plain,
    sheath_state,
)
from bowden.plants.turned import turned_round

Array = NDArray[np.float64]

_CORRECT = "correct the plant there"
_TRIAL_CYCLES = 20
_ASIDE = 0.5
"""Motor angle to both sides at which is seen which way the joint goes [rad]."""
_FIRST = ("joint", "motor", "motor_velocity")


class UserParameters(NamedTuple):
    """Argument `plant` of a user's kernels."""

    parameters: Any
    """Their own."""
    dt: float
    """One control cycle [s]."""
    motor: Motor
    joint_encoder: Encoder
    motor_encoder: Encoder


@kernel
def read_both(plant: UserParameters, body: Any, normals: Array) -> tuple[Any, Measurement]:
    """The ``observe`` of a plant that has none: an encoder at the joint and one at the motor."""
    joint = reading(body.joint, normals[0], plant.joint_encoder)
    return body, Measurement(joint, reading(body.motor, normals[1], plant.motor_encoder), np.nan, np.nan)


@kernel
def effort_unknown(plant: UserParameters, body: Any, sheath: SheathState) -> float:
    """The ``effort`` of a plant that has none: no number, so that power and energy do not exist."""
    return np.nan


class UserPlant(NamedTuple):
    """A plant of one's own; see the module."""

    name: str
    parameters: Any
    """NamedTuple of numbers and arrays."""
    rest: Callable[[Any, float, SheathState], Any]
    advance: Callable[[Any, Any, float, SheathState, SheathState], Any]
    observe: Callable[[Any, Any, Array], tuple[Any, Measurement]] = read_both
    effort: Callable[[Any, Any, SheathState], float] = effort_unknown
    sheath: Sheath = Sheath()
    servo: Servo = Servo()
    """As linear analysis takes the motor under its position loop, and as a law knows it."""
    motor: Motor = Motor()
    joint_encoder: Encoder = Encoder()
    motor_encoder: Encoder = Encoder()
    sample_time: float = 1e-3
    """Ts, one control cycle [s]."""
    delay: int = 1
    """Cycles between a sample and the moment its command reaches the servo [–]."""

    def dynamics(self) -> Dynamics:
        """See `Plant.dynamics`.

        Raises:
            ParameterError: a number that is none, or a kernel that does not do what is asked of it, with its line.
        """
        check_numbers(self.parameters, f"plant {self.name}")
        for part in ("servo", "motor", "joint_encoder", "motor_encoder", "sheath"):
            check_numbers(getattr(self, part), f"plant {self.name}.{part}")
        body = self._tried()
        found = Dynamics(
            self.name,
            self._handed,
            self.rest,
            self.advance,
            self.observe,
            self.effort,
            dict.fromkeys(body._fields, "1") | {"joint": "rad", "motor": "rad", "motor_velocity": "rad/s"},
            file=str(self.path),
        )
        return turned_round(found) if self.turned else found

    @property
    def turned(self) -> bool:
        """True if its joint falls where its motor rises, and its motor is therefore counted the other way round.

        Raises:
            ParameterError: ``rest`` fails, with its line.
        """
        still = sheath_state(self.sheath, self.sheath.bend)
        try:
            below, above = (float(self.rest(self._handed, motor, still).joint) for motor in (-_ASIDE, _ASIDE))
        except Exception as error:
            raise user_file.mistake(error, self.path) from error
        return above < below

    @property
    def _handed(self) -> UserParameters:
        dt = float(self.sample_time)
        return UserParameters(self.parameters, dt, self.motor, self.joint_encoder, self.motor_encoder)

    @property
    def slope(self) -> float:
        """Joint motion per motor motion as it is used: its parameter ``slope``, NaN without one [rad/rad]."""
        found = getattr(self.parameters, "slope", math.nan)
        return (-found if self.turned else found) if isinstance(found, float) else math.nan

    @property
    def path(self) -> Path:
        """Of the file in which its motion stands."""
        return Path(self.advance.__code__.co_filename)

    def draw(self, seed: int, out: Array) -> None:
        """See `Plant.draw`."""
        draw_for_encoders((self.joint_encoder, self.motor_encoder), seed, out)

    def sheath_columns(self, joint: Array, path: SheathPath) -> dict[str, Array]:
        """See `Plant.sheath_columns`: of the slope only the sheath's factor is known."""
        return {"width": path.widths[:-1], "slope": path.slope_factors[:-1].copy()}

    def resting_motor(self, joint: float, bend: float | None = None) -> float:
        """See `Plant.resting_motor`.

        Raises:
            ParameterError: it has its joint there at no motor angle, or fails, with file and line.
        """
        sheath = sheath_state(self.sheath, self.sheath.bend if bend is None else bend)
        handed, way = self._handed, -1.0 if self.turned else 1.0
        with user_file.explained(self.path, f"the plant {self.name!r}"):
            return motor_for(
                joint, lambda motor: float(self.rest(handed, way * motor, sheath).joint), joint + 1e-3, self.name
            )

    def describe(self) -> dict[str, Any]:
        """See `Plant.describe`."""
        parts = ("sheath", "servo", "motor", "joint_encoder", "motor_encoder", "sample_time", "delay")
        return {
            "kind": self.name,
            "file": self.path.name,
            "parameters": plain(self.parameters),
            **{name: plain(getattr(self, name)) for name in parts},
        }

    def _tried(self) -> Any:
        """The body after a few cycles, interpreted, as the loop will call the kernels.

        Raises:
            ParameterError: what is wrong, with file and line.
        """
        path, handed = self.path, self._handed
        user_file.check_kernels((self.rest, self.advance, self.observe, self.effort), path)
        still, moved = sheath_state(self.sheath, self.sheath.bend), sheath_state(self.sheath, 1.1 * self.sheath.bend)
        try:
            body = self.rest(handed, 0.1, still)
            where = user_file.line(self.rest, path)
            _check_body(body, "rest", where)
            kind = _form(body)
            for k in range(_TRIAL_CYCLES):
                where = user_file.line(self.observe, path)
                answer = self.observe(handed, body, np.zeros(2))
                if not (isinstance(answer, tuple) and len(answer) == 2 and isinstance(answer[1], Measurement)):
                    raise ParameterError(
                        f"{where}: observe returns {answer!r}", expected="a pair, body and Measurement", do=_CORRECT
                    )
                body, measured = answer
                _check_number(measured.joint, "the joint's reading", where)
                _check_number(measured.motor, "the motor's reading", where)
                effort = self.effort(handed, body, still)
                if not isinstance(effort, float):
                    line = user_file.line(self.effort, path)
                    raise ParameterError(f"{line}: effort returns {effort!r}", expected="a float", do=_CORRECT)
                where = user_file.line(self.advance, path)
                body = self.advance(handed, body, 0.1 + 0.01 * k, still, moved if k % 2 else still)
                _check_body(body, "advance", where)
                if _form(body) != kind:
                    raise ParameterError(
                        f"{where}: advance changes the body's shape to {_form(body)}",
                        expected=f"{kind}, as from rest",
                        do=_CORRECT,
                    )
        except ParameterError:
            raise
        except Exception as error:
            raise user_file.mistake(error, path) from error
        return body


def load_file(file: OwnFile) -> UserPlant:
    """The plant in a file that has been read, by its name there; the only one if it has none.

    Raises:
        ParameterError: no such name, a mistake in the file (with its line), or something that is no plant.
    """
    plant, names = user_file.defined(file, UserPlant, ("Parameters", "rest", "advance"))
    if plant is None:
        others = {part: names[part] for part in ("observe", "effort") if part in names}
        plant = UserPlant(Path(file.path).stem, names["Parameters"], names["rest"], names["advance"], **others)
    found: UserPlant = plant
    found.dynamics()
    return found


def same_values(one: Any, other: Any) -> bool:
    """True if two parameters are the same; of arrays, in every number."""
    if isinstance(one, np.ndarray) or isinstance(other, np.ndarray):
        return np.array_equal(one, other)
    return type(one).__name__ == type(other).__name__ and bool(one == other)


def _form(body: Any) -> str:
    """Type and fields of a body."""
    if hasattr(body, "_asdict"):
        parts = ", ".join(f"{name}: {_form(value)}" for name, value in body._asdict().items())
        return f"{type(body).__name__}({parts})"
    return "float" if isinstance(body, float) else type(body).__name__


def _check_body(body: Any, kernel_name: str, where: str) -> None:
    if not hasattr(body, "_asdict") or body._fields[:3] != _FIRST:
        raise ParameterError(
            f"{where}: {kernel_name} returns {body!r}",
            expected=f"a NamedTuple of floats that begins with {', '.join(_FIRST)}",
            do=_CORRECT,
        )
    for name, value in body._asdict().items():
        _check_number(value, f"{name} from {kernel_name}", where)


def _check_number(value: Any, what: str, where: str) -> None:
    if not isinstance(value, float):
        raise ParameterError(f"{where}: {what} is {value!r}", expected="a float, such as 0.0", do=_CORRECT)
    if not math.isfinite(value):
        raise ParameterError(f"{where}: {what} is {value}", expected="a finite number", do=_CORRECT)
