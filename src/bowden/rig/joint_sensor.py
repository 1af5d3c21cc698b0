"""The joint's sensor, where it is no encoder, as a rig describes it."""

import math
from typing import Annotated, Literal, NamedTuple

from bowden.core.errors import ParameterError
from bowden.core.quantity import Quantity
from bowden.core.registry import resolve
from bowden.core.units import RADIANS

SENSED = ("imu", "stretch")
"""Sources with a sensor beside the motor's."""
STREAMS = {"udp": "udp:PORT (of this computer alone), udp:ADDRESS:PORT", "lsl": "lsl:NAME"}
"""Kind of a stream → how it is named."""


class JointSensor(NamedTuple):
    """Where the joint's angle comes from (docs/drives.md)."""

    source: Annotated[
        Literal["encoder", "imu", "stretch", "motor"],
        Quantity("encoder: by [drive]; imu, stretch: a sensor by stream; motor: the cable's model alone"),
    ] = "encoder"
    stream: Annotated[str | None, Quantity("udp:PORT, udp:ADDRESS:PORT or lsl:NAME", example="udp:5005")] = None
    gives: Annotated[
        Literal["angle", "quaternion", "inertial"],
        Quantity("imu: the angle in °; w, x, y, z; or rates [°/s] and accelerations [g]"),
    ] = "angle"
    bodies: Annotated[int, Quantity("imu: on how many", ge=1, le=2)] = 1
    axis: Annotated[
        tuple[float, ...], Quantity("imu: the joint's, in the first body's frame, flexing positive", ge=-1.0, le=1.0)
    ] = (0.0, 0.0, 1.0)
    zero: Annotated[tuple[float, ...], Quantity("imu: w, x, y, z at the joint's zero", ge=-1.0, le=1.0)] = (
        *(1.0, 0.0, 0.0, 0.0),
    )
    curve_values: Annotated[tuple[float, ...], Quantity("stretch: readings", ge=-1e9, le=1e9)] = ()
    curve_angles: Annotated[tuple[float, ...], Quantity("stretch: their angles", "rad", ge=-360.0, le=360.0)] = ()
    period: Annotated[float, Quantity("between samples", "s", shown="ms", ge=1.0, le=100.0)] = 0.010
    delay: Annotated[float, Quantity("age of a sample that comes", "s", shown="ms", ge=0.0, le=100.0)] = 0.010
    noise: Annotated[float, Quantity("of a sample, 1 σ", "rad", ge=0.01, le=20.0)] = 2.0 * RADIANS
    offset: Annotated[float, Quantity("lasting error, 1 σ", "rad", ge=0.0, le=20.0)] = 0.0
    drift: Annotated[float, Quantity("imu: its speed", "rad/s", ge=0.0, le=10.0)] = RADIANS / 60.0
    cable_error: Annotated[float, Quantity("of the cable's model, 1 σ", "rad", ge=0.1, le=30.0)] = 4.0 * RADIANS

    @property
    def estimated(self) -> bool:
        """True if the joint's angle is an estimate."""
        return self.source != "encoder"

    @property
    def sensed(self) -> bool:
        """True if a sensor corrects it."""
        return self.source in SENSED


def address_of(sensor: JointSensor) -> tuple[str, tuple[str, int]]:
    """Kind of its stream, with name or address, and port; 0 for none."""
    kind, _, rest = (sensor.stream or "").partition(":")
    if kind != "udp":
        return kind, (rest, 0)
    host, _, port = rest.rpartition(":")
    return kind, (host or "127.0.0.1", int(port) if port.isdecimal() else 0)


def check_joint_sensor(sensor: JointSensor, sample_time: float, joint_std: float) -> None:
    """Refuse what makes no sense, before anything is opened.

    Args:
        sensor: of the rig.
        sample_time: of a cycle [s].
        joint_std: of the supervisor's limits [rad].

    Raises:
        ParameterError: with the key and what was expected.
    """
    if sensor.source == "motor" and not sensor.cable_error < joint_std:
        raise ParameterError(
            f"joint_sensor.cable_error_deg is {sensor.cable_error / RADIANS:.4g}",
            expected=f"less than limits.joint_std_deg, {joint_std / RADIANS:.4g}: no sensor makes the angle surer",
            do="fit a sensor at the joint, or raise that limit, if the law and the wearer bear it",
        )
    if not sensor.sensed:
        return
    kind, where = address_of(sensor)
    stretch, curve = sensor.source == "stretch", len(sensor.curve_values)
    steps = [b - a for a, b in zip(sensor.curve_values, sensor.curve_values[1:], strict=False)]
    rises = [b - a for a, b in zip(sensor.curve_angles, sensor.curve_angles[1:], strict=False)]
    reach = resolve("sensing.joint_angle:LENGTH") - 1
    length, turn = math.hypot(*sensor.axis), math.hypot(*sensor.zero)
    rules = (
        ("stream", kind in STREAMS and bool(where[0]), " or ".join(STREAMS.values())),
        ("stream", kind != "udp" or 1024 <= where[1] <= 65535, "a port from 1024 to 65535"),
        ("gives", not stretch or sensor.gives == "angle", '"angle" of a stretch sensor, or leave it out'),
        ("bodies", sensor.bodies == 1 or sensor.gives != "angle", '1, or gives = "quaternion" or "inertial"'),
        ("axis", len(sensor.axis) == 3 and abs(length - 1.0) < 0.01, "three numbers, a vector of length 1"),
        ("zero", len(sensor.zero) == 4 and abs(turn - 1.0) < 0.01, "four numbers, a quaternion of length 1"),
        ("curve_values", not stretch or curve >= 2, "two readings at least; bowden calibrate joint writes them"),
        ("curve_angles_deg", not stretch or len(sensor.curve_angles) == curve, f"as many as curve_values, {curve}"),
        ("curve_values", not stretch or _one_way(steps), "readings that only rise, or only fall"),
        ("curve_angles_deg", not stretch or _one_way(rises), "angles that only rise, or only fall"),
        ("period_ms", sensor.period >= sample_time, f"at least one cycle, {1e3 * sample_time:g}"),
        ("delay_ms", sensor.delay < reach * sensor.period, f"less than {reach} of its periods"),
    )
    values = sensor._asdict()
    values |= {"curve_angles_deg": [angle / RADIANS for angle in sensor.curve_angles]}
    values |= {"period_ms": 1e3 * sensor.period, "delay_ms": 1e3 * sensor.delay}
    for key, fine, expected in rules:
        if not fine:
            raise ParameterError(
                f"joint_sensor.{key} is {values[key]!r}", expected=expected, do="correct it in [joint_sensor]"
            )


def _one_way(steps: list[float]) -> bool:
    """True if all go up, or all down."""
    return all(step > 0.0 for step in steps) or all(step < 0.0 for step in steps)
