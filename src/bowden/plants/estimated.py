"""A plant whose joint has no encoder: its sensor, and the estimate that law and supervisor are shown in its place.

It stands round any other plant. The sensor shows the true joint `JointModel.delay` late, once a `period`, with noise, a
systematic error that bends over the range, and a drift of constant speed, either way; the estimate is
`bowden.sensing.joint_angle`'s, the same as in a live run.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.control.source import Measurement
from bowden.core.kernel import cos, kernel, placeholder, sin
from bowden.core.signals import Sample
from bowden.models.drive.encoder import Encoder
from bowden.plants.plant import Dynamics, SheathState, plain
from bowden.plants.settled_estimate import settled_estimate
from bowden.sensing.joint_angle import LENGTH, History, JointEstimate, JointModel, estimate_start, estimate_step

Array = NDArray[np.float64]

BENDS = 2.0
"""The systematic error's waves over the joint's angle [1/rad]."""
DRAWN = 4
"""Normal numbers of the sensor: noise in each cycle, and for a run two of the systematic error and the drift."""


@placeholder
def inner_rest(plant: Any, motor: float, sheath: SheathState) -> Any:
    """Placeholder for the plant's own ``rest``."""
    raise NotImplementedError  # always replaced


@placeholder
def inner_advance(plant: Any, body: Any, applied: float, sheath: SheathState, next_sheath: SheathState) -> Any:
    """Placeholder for the plant's own ``advance``."""
    raise NotImplementedError  # always replaced


@placeholder
def inner_observe(plant: Any, body: Any, normals: Array) -> tuple[Any, Measurement]:
    """Placeholder for the plant's own ``observe``."""
    raise NotImplementedError  # always replaced


@placeholder
def inner_effort(plant: Any, body: Any, sheath: SheathState) -> float:
    """Placeholder for the plant's own ``effort``."""
    raise NotImplementedError  # always replaced


@placeholder
def inner_look(plant: Any, body: Any) -> Any:
    """Placeholder for the plant's own ``look``."""
    raise NotImplementedError  # always replaced


class EstimatedStep(NamedTuple):
    """Argument of the kernels."""

    inner: Any
    """Of the plant's own."""
    model: JointModel
    dt: float
    """Length of a cycle [s]."""


class SensorRun(NamedTuple):
    """What the sensor has sampled."""

    cycles: float
    """Since the start."""
    sampled: History
    """The joint at its last samplings, the newest last [rad]."""


class EstimatedBody(NamedTuple):
    """The plant, its joint's sensor and the estimate."""

    inner: Any
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
def estimated_rest(plant: EstimatedStep, motor: float, sheath: SheathState) -> EstimatedBody:
    """See `bowden.plants.plant`."""
    inner = inner_rest(plant.inner, motor, sheath)
    joint = inner_look(plant.inner, inner).joint
    sampled = (joint, joint, joint, joint, joint, joint, joint, joint)
    return EstimatedBody(inner, SensorRun(0.0, sampled), estimate_start(plant.model, motor))


@kernel
def estimated_advance(
    plant: EstimatedStep, body: EstimatedBody, applied: float, sheath: SheathState, next_sheath: SheathState
) -> EstimatedBody:
    """See `bowden.plants.plant`."""
    inner = inner_advance(plant.inner, body.inner, applied, sheath, next_sheath)
    return EstimatedBody(inner, body.sensor, body.estimate)


@kernel
def estimated_observe(plant: EstimatedStep, body: EstimatedBody, normals: Array) -> tuple[EstimatedBody, Measurement]:
    """See `bowden.plants.plant`: the estimate in place of the joint's encoder."""
    inner, read = inner_observe(plant.inner, body.inner, normals)
    joint, own = inner_look(plant.inner, inner).joint, normals[normals.size - DRAWN :]
    sensor, value = sensor_step(plant.model, body.sensor, joint, own, plant.dt)
    estimate = estimate_step(plant.model, body.estimate, read.motor, value, plant.dt)
    measured = Measurement(estimate.angle, read.motor, read.current, read.load, estimate.age, estimate.std)
    return EstimatedBody(inner, sensor, estimate), measured


@kernel
def estimated_sample(measured: Measurement) -> Sample:
    """See `bowden.plants.plant.plant_sample`: the estimate, with its age and its standard deviation."""
    return Sample(measured.joint, measured.motor, measured.joint_age, measured.joint_std)


@kernel
def estimated_effort(plant: EstimatedStep, body: EstimatedBody, sheath: SheathState) -> float:
    """See `bowden.plants.plant`."""
    return inner_effort(plant.inner, body.inner, sheath)


@kernel
def estimated_look(plant: EstimatedStep, body: EstimatedBody) -> Any:
    """See `bowden.plants.plant`: the plant as it truly is."""
    return inner_look(plant.inner, body.inner)


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
        parts: dict[str, Callable[..., Any]] = {
            "inner_rest": own.rest,
            "inner_advance": own.advance,
            "inner_observe": own.observe,
            "inner_effort": own.effort,
            "inner_look": own.look,
            "plant_sample": estimated_sample,
        }
        return replace(
            own,
            name=f"estimated_{own.name}",
            plant=EstimatedStep(own.plant, self.model, self.inner.sample_time),
            rest=estimated_rest,
            advance=estimated_advance,
            observe=estimated_observe,
            effort=estimated_effort,
            look=estimated_look,
            parts={**own.parts, **parts},
            normals=own.normals + DRAWN,
        )

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
