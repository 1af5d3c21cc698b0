"""Keys of [joint_sensor] from a sensor's readings in known poses of the joint, and an IMU's in a free motion."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import ParameterError
from bowden.core.units import DEGREES, RADIANS
from bowden.rig.settings import JointSensor
from bowden.sensing.joint_sample import Quaternion, angle_about, axis_of, on_curve

Array = NDArray[np.float64]

ONE_AXIS = 0.9
"""Share of a free motion that is about one axis, at least [–]."""
AGREES = 0.2
"""How far the turn from pose to pose may differ from what was said, over that [–]."""
LEAST_NOISE = 0.05 * RADIANS
"""Readings at rest say no less of the noise in motion [rad]."""


class Pose(NamedTuple):
    """The joint held still."""

    angle: float
    """As it is known [rad]."""
    samples: Sequence[Sequence[float]]
    """A reading each of a stretch sensor, an orientation of an IMU."""


def calibrated(sensor: JointSensor, poses: Sequence[Pose], motion: Sequence[Quaternion] = ()) -> JointSensor:
    """The sensor with curve, or axis and zero, and noise.

    Args:
        sensor: as the rig has it.
        poses: two at least, of different angles.
        motion: orientations of an IMU while the joint alone moves.

    Raises:
        ParameterError: too few poses, or readings that do not go with them.
    """
    if len({pose.angle for pose in poses if math.isfinite(pose.angle)}) < max(2, len(poses)):
        raise ParameterError(
            f"poses at {', '.join(f'{pose.angle * DEGREES:g}°' for pose in poses)}",
            expected="two different known angles, or more",
            do="hold the joint at each once",
        )
    if any(len(pose.samples) < 2 for pose in poses):
        raise ParameterError("the sensor sent less than two samples in a pose", do="look at its rate and its stream")
    ordered = sorted(poses)
    return _curve(sensor, ordered) if sensor.source == "stretch" else _mounted(sensor, ordered, motion)


def _curve(sensor: JointSensor, poses: Sequence[Pose]) -> JointSensor:
    readings = [np.array([one[0] for one in pose.samples]) for pose in poses]
    values, angles = tuple(float(one.mean()) for one in readings), tuple(pose.angle for pose in poses)
    steps = np.diff(values)
    if not (np.all(steps > 0.0) or np.all(steps < 0.0)):
        raise ParameterError(
            f"the readings of the poses, in the order of their angles, are {', '.join(f'{one:.6g}' for one in values)}",
            expected="readings that only rise, or only fall, with the angle",
            do="look at the sensor's mounting; leave out poses where it is slack or at its end",
        )
    spread = [np.std([on_curve(float(x), values, angles) for x in one]) for one in readings]
    return sensor._replace(curve_values=values, curve_angles=angles, noise=_noise(spread))


def _mounted(sensor: JointSensor, poses: Sequence[Pose], motion: Sequence[Quaternion]) -> JointSensor:
    if len(motion) < 10:
        raise ParameterError("the sensor sent less than ten samples of the free motion", do="look at its stream")
    axis, share = axis_of(motion)
    if share < ONE_AXIS:
        raise ParameterError(
            f"{100.0 * share:.0f} % of the free motion were about one axis",
            expected=f"{100.0 * ONE_AXIS:g} % at least, the joint's",
            do="move this joint alone, and fix the sensor on its limb; of one body the other limb must rest",
        )
    means = [_mean(pose.samples) for pose in poses]
    turned, said = angle_about(means[-1], means[0], axis), poses[-1].angle - poses[0].angle
    if turned < 0.0:
        axis, turned = (-axis[0], -axis[1], -axis[2]), -turned
    if abs(turned - said) > AGREES * said:
        raise ParameterError(
            f"from {poses[0].angle * DEGREES:g}° to {poses[-1].angle * DEGREES:g}° the sensor turned by "
            f"{turned * DEGREES:.1f}° about its axis",
            expected=f"about {said * DEGREES:g}°",
            do="look whether it slipped, whether the joint was at these angles, and at bodies of [joint_sensor]",
        )
    back = -0.5 * poses[0].angle
    zero = Quaternion(math.cos(back), *(math.sin(back) * one for one in axis)).times(means[0])
    spread = [
        np.std([angle_about(Quaternion(*one), mean, axis) for one in pose.samples])
        for pose, mean in zip(poses, means, strict=True)
    ]
    return sensor._replace(axis=axis, zero=tuple(zero), noise=_noise(spread))


def _noise(spread: Sequence[Any]) -> float:
    return max(LEAST_NOISE, float(np.sqrt(np.mean(np.square(spread)))))


def _mean(samples: Sequence[Sequence[float]]) -> Quaternion:
    """Mean of orientations near one another, whichever sign each has."""
    rows = np.array(samples)
    mean = (rows * np.where(rows @ rows[0] < 0.0, -1.0, 1.0)[:, None]).mean(axis=0)
    return Quaternion(*(mean / np.linalg.norm(mean)).tolist())


def keys_of(sensor: JointSensor) -> dict[str, str]:
    """Keys of [joint_sensor] that a calibration gives, as TOML has them."""

    def listed(values: Sequence[float], digits: int) -> str:
        return f"[{', '.join(repr(round(one, digits)) for one in values)}]"

    noise = {"noise_deg": repr(round(sensor.noise * DEGREES, 3))}
    if sensor.source == "stretch":
        angles = listed([one * DEGREES for one in sensor.curve_angles], 3)
        readings = f"[{', '.join(repr(float(f'{one:.9g}')) for one in sensor.curve_values)}]"
        return {"curve_values": readings, "curve_angles_deg": angles, **noise}
    return {"axis": listed(sensor.axis, 6), "zero": listed(sensor.zero, 6), **noise}
