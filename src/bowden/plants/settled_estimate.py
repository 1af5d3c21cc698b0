"""How an estimate of a joint's angle settles: its gains on a motion and at rest, and what its sensor's noise does."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.kernel import compiled, kernel
from bowden.core.units import RADIANS
from bowden.models.drive.encoder import Encoder
from bowden.sensing.joint_angle import JointModel, estimate_start, estimate_step

Array = NDArray[np.float64]

_BEGUN, _MOVING, _PERIOD, _REST = 4.0, 24.0, 8.0, 10.0
"""From when on gains count, how long the joint moves, the period of its motion, and the rest after it [s]."""
_STROKE = 60.0 * RADIANS
"""Of that motion [rad]."""


class SettledEstimate(NamedTuple):
    """What an estimate comes to on a motion and at rest."""

    gains: tuple[tuple[float, float], ...]
    """Of the model's errors f + b and of the sensor's d for a value: the largest, and those at the rest's end [–]."""
    span: float
    """Of the angle over the rest, by the sensor's noise and drift [rad]."""
    step: Encoder
    """As an encoder: by how much its noise moves the estimate in a cycle."""


@kernel
def walk_estimate(model: JointModel, motor: Array, normals: Array, every: int, dt: float, out: Array) -> None:
    """Fill `out` (3, n) with the angle, and the covariances of f + b and of d with a value, of a joint that goes as the
    cable's model does, with a sample each so many cycles."""
    state = estimate_start(model, motor[0])
    for k in range(motor.size):
        value = state.cable + model.noise * normals[k] if k % every == 0 else np.nan
        state = estimate_step(model, state, motor[k], value, dt)
        own = state.covariance
        out[0, k], out[1, k] = state.angle, own.ff + 2.0 * own.fb + own.bb + own.fd + own.bd
        out[2, k] = own.fd + own.bd + own.dd


@lru_cache(16)
def settled_estimate(model: JointModel, dt: float) -> SettledEstimate:
    """Gains, noise and wander of an estimate in cycles of `dt` [s]."""
    if model.period == 0.0:
        return SettledEstimate(((0.0, 0.0),), 0.0, Encoder())
    time = dt * np.arange(round((_MOVING + _REST) / dt))
    share = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.minimum(time, _MOVING) / _PERIOD)
    motor = model.zero + _STROKE * share / model.slope
    every, out = max(1, round(model.period / dt)), np.empty((3, len(time)))
    normals = np.random.default_rng(1).standard_normal(len(time))
    compiled(walk_estimate)(model, motor, normals, every, dt, out)
    gains = out[1:, ::every] / model.noise**2  # of Kalman's, P·h/R after the value
    largest = round(_BEGUN / (every * dt)) + int(np.argmax(gains[0, round(_BEGUN / (every * dt)) :]))
    each = tuple((float(own), float(sensor)) for own, sensor in gains[:, [largest, -1]].T)
    span = float(np.ptp(out[0, time >= _MOVING])) + model.drift * _REST
    return SettledEstimate(each, span, Encoder(each[0][0] * model.noise * min(1.0, dt / model.period)))
