"""A plant round any cable: servo, motor, encoders, sample time and delay as on the bench, and a load that may lag."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import ParameterError
from bowden.core.nested import form_of, numbers_of
from bowden.models.cable.sheath import Sheath
from bowden.models.drive.encoder import Encoder
from bowden.models.drive.motor import Motor, acceleration_limit
from bowden.models.drive.servo import Servo, prepare_steps
from bowden.plants.bench import BENCH_COLUMNS
from bowden.plants.cable_body import (
    Moving,
    Seen,
    cable_columns,
    cable_moved,
    cable_rest,
    spring_current,
    torque_current,
)
from bowden.plants.plant import (
    Dynamics,
    SheathPath,
    check_numbers,
    draw_for_encoders,
    motor_for,
    plain,
    read_encoders,
    sheath_state,
)

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Cable:
    """Any cable, ready for `CablePlant`; `bowden.plants.cables` makes them. Equal to another that moves alike."""

    name: str
    """Its kind."""
    parameters: Any
    """A NamedTuple of what its maker was given; goes to the trace's settings."""
    prepared: Any
    """Argument `cable` of the kernels."""
    start: Callable[..., Any]
    """``start(cable, motor, width, slope_factor) -> memory``."""
    advance: Callable[..., Any]
    """``advance(cable, memory, before, after, width, slope_factor, dt) -> memory``."""
    look: Callable[..., Seen]
    """``look(cable, memory, motor, width, slope_factor) -> Seen``."""
    slope: float
    """Joint motion per motor motion once the play is taken up, at the identified bend [rad/rad]."""
    physical: bool = False
    """True if it computes the loss in its sheath; then the sheath's own `loss` must be 0."""

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Cable) and self._moves == other._moves

    def __hash__(self) -> int:
        return hash(self._moves)

    @property
    def _moves(self) -> tuple[Any, ...]:
        """All that its motion depends on, where arrays are numbers."""
        kernels = (self.start, self.advance, self.look)
        return (self.name, kernels, tuple(numbers_of(self.prepared)), form_of(self.prepared), self.slope, self.physical)


class CablePlant(NamedTuple):
    """All that a plant is made of; the same as the bench's but for the cable and the load."""

    cable: Cable
    sheath: Sheath = Sheath()
    servo: Servo = Servo()
    motor: Motor = Motor()
    joint_encoder: Encoder = Encoder()
    motor_encoder: Encoder = Encoder()
    sample_time: float = 1e-3
    """Ts, one control cycle [s]."""
    delay: int = 1
    """Cycles between a sample and the moment its command reaches the servo [–]."""
    substeps: int = 10
    """Servo sub-steps in one cycle, where one exact step will not do [–]."""
    load_lag: float = 0.0
    """Time constant with which the joint follows the cable's end; 0 for none [s]."""

    def dynamics(self) -> Dynamics:
        """See `Plant.dynamics`.

        Raises:
            ParameterError: a part that cannot be, or a sheath that loses what the cable itself loses.
        """
        cable = self.cable
        return Dynamics(
            cable.advance.__name__,
            prepare_plant(self),
            cable_rest,
            cable_moved,
            read_encoders,
            torque_current if cable.physical else spring_current,
            BENCH_COLUMNS,
            cable_columns,
            {"cable_start": cable.start, "cable_advance": cable.advance, "cable_look": cable.look},
        )

    def draw(self, seed: int, out: Array) -> None:
        """See `Plant.draw`."""
        draw_for_encoders((self.joint_encoder, self.motor_encoder), seed, out)

    def sheath_columns(self, joint: Array, path: SheathPath) -> dict[str, Array]:
        """See `Plant.sheath_columns`."""
        return {"width": path.widths[:-1], "slope": path.slope_factors[:-1] * self.cable.slope}

    def resting_motor(self, joint: float, bend: float | None = None) -> float:
        """See `Plant.resting_motor`.

        Raises:
            ParameterError: the cable has its joint there at no motor angle.
        """
        cable, sheath = self.cable, sheath_state(self.sheath, self.sheath.bend if bend is None else bend)

        def joint_at(motor: float) -> float:
            memory = cable.start(cable.prepared, motor, sheath.width, sheath.slope_factor)
            return float(cable.look(cable.prepared, memory, motor, sheath.width, sheath.slope_factor).joint)

        return motor_for(joint, joint_at, joint / (cable.slope * sheath.slope_factor) + 1e-3, cable.name)

    def describe(self) -> dict[str, Any]:
        """See `Plant.describe`."""
        parts = {name: plain(value) for name, value in self._asdict().items() if name != "cable"}
        return {"cable": {"kind": self.cable.name, **plain(self.cable.parameters)}, **parts}


def prepare_plant(plant: CablePlant) -> Moving:
    """The plant ready to be moved; the servo's acceleration limit is the motor's current limit if that is lower.

    Raises:
        ParameterError: a part that cannot be, or a sheath that loses what the cable itself loses.
    """
    cable = plant.cable
    for name, part in list(plant._asdict().items())[1:]:
        check_numbers(part, f"plant.{name}")
    check_numbers(cable.parameters, f"cable {cable.name}")
    if not (plant.load_lag >= 0.0 and plant.substeps >= 1 and np.isfinite(cable.slope) and cable.slope != 0.0):
        raise ParameterError(
            f"plant: load_lag {plant.load_lag}, substeps {plant.substeps}, slope of the cable {cable.slope:g}",
            expected="not below 0, 1 or more, and a cable that moves the joint",
        )
    if cable.physical and plant.sheath.loss != 0.0:
        raise ParameterError(
            f"plant: the sheath's loss is {plant.sheath.loss} with a cable of the kind {cable.name!r}",
            expected="0, since that cable computes what its sheath loses",
        )
    limit = min(plant.servo.acceleration_limit, acceleration_limit(plant.motor))
    steps = prepare_steps(plant.servo._replace(acceleration_limit=limit), plant.sample_time, plant.substeps)
    encoders = plant.joint_encoder, plant.motor_encoder
    lag, slope = float(plant.load_lag), float(cable.slope)
    return Moving(cable.prepared, steps, plant.sample_time, lag, slope, plant.motor, *encoders, plant.substeps)
