"""The joint sensor of a rig (`settings.JointSensor`): what it may be, where it sends, its model for the estimate."""

import math

from bowden.core.errors import ParameterError
from bowden.core.units import RADIANS
from bowden.rig.settings import JointSensor
from bowden.safety.limits import Limits
from bowden.sensing.joint_angle import LENGTH, JointModel, MotorReach

STREAMS = {
    "udp": "udp:PORT (from this computer alone), udp:0.0.0.0:PORT (from others too), udp:ADDRESS:PORT",
    "serial": "serial:DEVICE (at 115200 baud), serial:DEVICE@BAUD",
    "can": "can:CHANNEL@IDENTIFIER (socketcan)",
    "lsl": "lsl:NAME",
}
"""Kind of a stream → how it is named."""
BAUD = "115200"
"""Of a serial line of which none is said."""


def model_of(sensor: JointSensor, slope: float, zero: float, play: float) -> JointModel:
    """Model for the estimate, round a cable.

    Args:
        sensor: of the rig.
        slope: joint motion per motor motion [rad/rad].
        zero: motor angle at which the joint is at zero [rad].
        play: half of what the joint loses at a reversal [rad].
    """
    if not sensor.sensed:
        return JointModel(slope, zero, play, sensor.cable_error)
    drift = sensor.drift if sensor.source == "imu" else 0.0
    known = sensor.period, sensor.delay, sensor.noise, sensor.offset, drift
    return JointModel(slope, zero, play, sensor.cable_error, *known)


def motor_reach(limits: Limits) -> MotorReach:
    """What the estimate believes of a motor's readings."""
    return MotorReach(limits.motor_speed, limits.jump, limits.sensor_span)


def address_of(sensor: JointSensor) -> tuple[str, tuple[str, int]]:
    """Kind of its stream, with name or address, and port, baud rate or identifier; 0 for none."""
    kind, _, rest = (sensor.stream or "").partition(":")
    if kind in ("serial", "can"):
        device, _, said = rest.partition("@")
        try:
            return kind, (device, int(said or (BAUD if kind == "serial" else "0"), 0))
        except ValueError:
            return kind, (device, 0)
    if kind != "udp":
        return kind, (rest, 0)
    host, _, port = rest.rpartition(":")
    return kind, (host or "127.0.0.1", int(port) if port.isdecimal() else 0)


def check(sensor: JointSensor, sample_time: float, joint_std: float) -> None:
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
    if not joint_std > 0.0:
        raise ParameterError(
            "limits.joint_std_deg is 0",
            expected="more: no estimate is that sure",
            do="correct it in [limits], or leave it out",
        )
    if not sensor.sensed:
        return
    kind, where = address_of(sensor)
    stretch, curve = sensor.source == "stretch", len(sensor.curve_values)
    steps = [b - a for a, b in zip(sensor.curve_values, sensor.curve_values[1:], strict=False)]
    rises = [b - a for a, b in zip(sensor.curve_angles, sensor.curve_angles[1:], strict=False)]
    length, turn = math.hypot(*sensor.axis), math.hypot(*sensor.zero)
    rules = (
        ("stream", kind in STREAMS and bool(where[0]), " or ".join(STREAMS.values())),
        ("stream", kind != "udp" or 1024 <= where[1] <= 65535, "a port from 1024 to 65535"),
        ("stream", kind != "serial" or where[1] >= 1200, "a baud rate from 1200 behind @"),
        ("stream", kind != "can" or 1 <= where[1] < 0x1FFF_FFFF, "an identifier such as 0x321 behind @"),
        (
            "gives",
            kind != "can" or sensor.gives != "inertial",
            '"angle" or "quaternion" over CAN, whose frames are short',
        ),
        ("gives", not stretch or sensor.gives == "angle", '"angle" of a stretch sensor, or leave it out'),
        ("bodies", sensor.bodies == 1 or sensor.gives == "quaternion", '1, or gives = "quaternion"'),  # one heading
        ("axis", len(sensor.axis) == 3 and abs(length - 1.0) < 0.01, "three numbers, a vector of length 1"),
        ("zero", len(sensor.zero) == 4 and abs(turn - 1.0) < 0.01, "four numbers, a quaternion of length 1"),
        ("curve_values", not stretch or curve >= 2, "two readings at least; bowden calibrate joint writes them"),
        ("curve_angles_deg", not stretch or len(sensor.curve_angles) == curve, f"as many as curve_values, {curve}"),
        ("curve_values", not stretch or _one_way(steps), "readings that only rise, or only fall"),
        ("curve_angles_deg", not stretch or _one_way(rises), "angles that only rise, or only fall"),
        ("period_ms", sensor.period >= sample_time, f"at least one cycle, {1e3 * sample_time:g}"),
        ("delay_ms", sensor.delay < (LENGTH - 1) * sensor.period, f"less than {LENGTH - 1} of its periods"),
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
