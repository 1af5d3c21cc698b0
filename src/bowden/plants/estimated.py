"""A plant whose joint has no encoder: its sensor, and the estimate that law and supervisor are shown in its place.

It stands round any other plant. The sensor shows the true joint `JointModel.delay` late, once a `period`, with noise, a
systematic error that bends over the range, and a drift of constant speed, either way; the estimate is
`bowden.sensing.joint_angle`'s, the same as in a live run.
"""

import math
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.control.source import Measurement
from bowden.core.kernel import cos, kernel, sin
from bowden.models.drive.encoder import Encoder
from bowden.plants.plant import Dynamics, plain
from bowden.plants.settled_estimate import settled_estimate
from bowden.sensing.joint_angle import LENGTH, History, JointEstimate, JointModel, estimate_start, estimate_step

Array = NDArray[np.float64]

BENDS = 2.0
"""The systematic error's waves over the joint's angle [1/rad]."""
DRAWN = 4
"""Normal numbers of the sensor: noise in each cycle, and for a run two of the systematic error and the drift."""


class SensorRun(NamedTuple):
    """What the sensor has sampled."""

    cycles: float
    """Since the start."""
    sampled: History
    """The joint at its last samplings, the newest last [rad]."""


class EstimateRun(NamedTuple):
    """The joint's sensor, and the estimate."""

    sensor: SensorRun
    estimate: JointEstimate


@kernel
def samplings(model: JointModel, cycles: float, dt: float) -> float:
    """How often the sensor has sampled within so many cycles after its first sample."""
    return math.floor(cycles * dt / model.period + 1e-9)


@kernel
def sensor_step(
    model: JointModel, before: SensorRun, joint: float, normals: Array, dt: float
) -> tuple[SensorRun, float]:
    """One cycle of the sensor, and its value; NaN where none comes in this cycle [rad].

    Args:
        model: of the sensor.
        before: its state.
        joint: the true angle [rad].
        normals: `DRAWN` numbers.
        dt: length of a cycle [s].
    """
    k, h = before.cycles, before.sampled
    if model.period == 0.0:
        return before, math.nan
    if k == 0.0 or samplings(model, k, dt) > samplings(model, k - 1.0, dt):
        h = (h[1], h[2], h[3], h[4], h[5], h[6], h[7], joint)
    value, came = math.nan, k - math.floor(model.delay / dt + 0.5)
    if came == 0.0 or (came > 0.0 and samplings(model, came, dt) > samplings(model, came - 1.0, dt)):
        true = h[LENGTH - 1 - int(samplings(model, k, dt) - samplings(model, came, dt))]
        wrong = model.offset * (normals[1] * cos(BENDS * true) + normals[2] * sin(BENDS * true))
        value = true + model.noise * normals[0] + wrong + math.copysign(model.drift, normals[3]) * k * dt
    return SensorRun(k + 1.0, h), value


@kernel
def estimated_start(model: JointModel, joint: float, motor: float) -> EstimateRun:
    """See `bowden.plants.plant.joint_start`."""
    sampled = (joint, joint, joint, joint, joint, joint, joint, joint)
    return EstimateRun(SensorRun(0.0, sampled), estimate_start(model, motor))


@kernel
def estimated_sense(
    model: JointModel, before: EstimateRun, read: Measurement, joint: float, normals: Array, dt: float
) -> tuple[EstimateRun, Measurement]:
    """See `bowden.plants.plant.joint_sense`: the estimate in place of the joint's encoder."""
    sensor, value = sensor_step(model, before.sensor, joint, normals[normals.size - DRAWN :], dt)
    estimate = estimate_step(model, before.estimate, read.motor, value, dt)
    measured = Measurement(estimate.angle, read.motor, read.current, read.load, estimate.age, estimate.std)
    return EstimateRun(sensor, estimate), measured


@dataclass(frozen=True)
class Estimated:
    """A plant round another one, `inner`; all else is that one's."""

    inner: Any
    model: JointModel

    @property
    def joint_encoder(self) -> Encoder:
        """See `Plant.joint_encoder`: a count is by how much the sensor's noise moves the estimate in a cycle."""
        return settled_estimate(self.model, self.inner.sample_time).step

    def _replace(self, **changes: Any) -> "Estimated":
        return replace(self, inner=self.inner._replace(**changes))

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") or name == "inner":
            raise AttributeError(name)
        return getattr(self.inner, name)

    def dynamics(self) -> Dynamics:
        """See `Plant.dynamics`."""
        own: Dynamics = self.inner.dynamics()
        parts: dict[str, Any] = {**own.parts, "joint_start": estimated_start, "joint_sense": estimated_sense}
        name, normals = f"estimated_{own.name}", own.normals + DRAWN
        return replace(own, name=name, sensing=self.model, parts=parts, normals=normals)

    def draw(self, seed: int, out: Array) -> None:
        """See `Plant.draw`."""
        own = np.empty((len(out), out.shape[1] - DRAWN))
        self.inner.draw(seed, own)
        random = np.random.default_rng((seed, DRAWN))
        out[:, :-DRAWN] = own
        out[:, -DRAWN] = random.standard_normal(len(out))
        out[:, 1 - DRAWN :] = random.standard_normal(DRAWN - 1)

    def describe(self) -> dict[str, Any]:
        """See `Plant.describe`."""
        return {**self.inner.describe(), "joint_model": plain(self.model)}


def measured_plant(plant: Any) -> Any:
    """The plant as if an encoder measured its joint."""
    return plant.inner if isinstance(plant, Estimated) else plant
