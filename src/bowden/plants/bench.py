"""The bench as one plant: servo, any cable in its sheath, and the distal spring, which may lag (Fig. 7A)."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import ParameterError
from bowden.models.cable.bouc_wen import BoucWen
from bowden.models.cable.sheath import Sheath, slope_factor
from bowden.models.drive.encoder import Encoder
from bowden.models.drive.motor import Motor, acceleration_limit
from bowden.models.drive.servo import Servo, prepare_steps
from bowden.plants.bench_body import (
    BENCH_COLUMNS,
    Moving,
    bench_columns,
    bench_moved,
    bench_rest,
    spring_current,
    torque_current,
)
from bowden.plants.cable import Cable, bouc_wen
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


class Bench(NamedTuple):
    """All that the bench is made of."""

    cable: BoucWen | Cable = BoucWen()
    """The paper's, of which laws and checks know formulas, or any other of `bowden.plants.cables`."""
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
    """Plant sub-steps in one cycle, where one exact step will not do [–]."""
    load_lag: float = 0.0
    """Time constant with which the joint follows the cable's end; 0 for none [s]."""

    @property
    def simulated_cable(self) -> Cable:
        """The cable with its kernels.

        Raises:
            ParameterError: one whose h has no bound.
        """
        return bouc_wen(self.cable) if isinstance(self.cable, BoucWen) else self.cable

    @property
    def formula(self) -> BoucWen | None:
        """The Bouc–Wen cable whose end the joint is, so that slopes and loop follow from its equations; else None."""
        return self.cable if isinstance(self.cable, BoucWen) and self.load_lag == 0.0 else None

    def dynamics(self) -> Dynamics:
        """See `Plant.dynamics`.

        Raises:
            ParameterError: a part that cannot be, or a sheath that loses what the cable itself loses.
        """
        cable = self.simulated_cable
        return Dynamics(
            cable.name,
            prepare_bench(self),
            bench_rest,
            bench_moved,
            read_encoders,
            torque_current if cable.physical else spring_current,
            BENCH_COLUMNS,
            bench_columns,
            {"cable_start": cable.start, "cable_advance": cable.advance, "cable_look": cable.look},
        )

    def draw(self, seed: int, out: Array) -> None:
        """See `Plant.draw`."""
        draw_for_encoders((self.joint_encoder, self.motor_encoder), seed, out)

    def sheath_columns(self, joint: Array, path: SheathPath) -> dict[str, Array]:
        """See `Plant.sheath_columns`."""
        return {"width": path.widths[:-1], "slope": path.slope_factors[:-1] * self.cable.slope}

    def resting_motor(self, joint: float, bend: float | None = None) -> float:
        """See `Plant.resting_motor`; of a Bouc–Wen cable with h = 0.

        Raises:
            ParameterError: a cable whose slope is 0, or that has its joint there at no motor angle.
        """
        bend = self.sheath.bend if bend is None else bend
        if isinstance(self.cable, BoucWen):
            slope = self.cable.slope * float(slope_factor(bend, self.sheath))
            if slope == 0.0:
                raise ParameterError("bench: the cable's slope is 0", expected="a cable that moves the joint")
            return (joint - self.cable.offset) / slope
        cable, sheath = self.cable, sheath_state(self.sheath, bend)

        def joint_at(motor: float) -> float:
            memory = cable.start(cable.prepared, motor, sheath.width, sheath.slope_factor)
            return float(cable.look(cable.prepared, memory, motor, sheath.width, sheath.slope_factor).joint)

        return motor_for(joint, joint_at, joint / (cable.slope * sheath.slope_factor) + 1e-3, cable.name)

    def describe(self) -> dict[str, Any]:
        """See `Plant.describe`."""
        found: dict[str, Any] = plain(self)
        if isinstance(self.cable, Cable):
            found["cable"] = {"kind": self.cable.name, **plain(self.cable.parameters)}
        return found


def prepare_bench(bench: Bench) -> Moving:
    """The bench ready to be moved; the servo's acceleration limit is the motor's current limit if that is lower.

    Raises:
        ParameterError: a part that cannot be, or a sheath that loses what the cable itself loses.
    """
    parameters = bench.cable if isinstance(bench.cable, BoucWen) else bench.cable.parameters
    check_numbers(bench._replace(cable=parameters), "bench")
    cable, slope = bench.simulated_cable, float(bench.cable.slope)
    if not (bench.load_lag >= 0.0 and bench.substeps >= 1 and math.isfinite(slope) and slope != 0.0):
        raise ParameterError(
            f"bench: load_lag {bench.load_lag}, substeps {bench.substeps}, slope of the cable {slope:g}",
            expected="not below 0, 1 or more, and a cable that moves the joint",
        )
    if cable.physical and bench.sheath.loss != 0.0:
        raise ParameterError(
            f"bench: the sheath's loss is {bench.sheath.loss} with a cable of the kind {cable.name!r}",
            expected="0, since that cable computes what its sheath loses",
        )
    limit = min(bench.servo.acceleration_limit, acceleration_limit(bench.motor))
    steps = prepare_steps(bench.servo._replace(acceleration_limit=limit), bench.sample_time, bench.substeps)
    encoders, lag = (bench.joint_encoder, bench.motor_encoder), float(bench.load_lag)
    return Moving(cable.prepared, steps, bench.sample_time, lag, slope, bench.motor, *encoders, bench.substeps)
