"""`calibrate joint`: a joint's sensor from known poses, and of an IMU a free motion, by hand and without power."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from bowden.operations.support.operation import Operation, Switch
from bowden.operations.support.results import Result, degrees

if TYPE_CHECKING:
    from collections.abc import Sequence

    from bowden.hardware.joint_stream import JointSamples
    from bowden.rig.settings import JointSensor

HELD, MOVED = 2.0, 10.0
"""How long a pose is looked at, and a free motion [s]."""


@dataclass(frozen=True)
class JointCalibration(Result["JointSensor"]):
    """A joint's sensor as it is mounted."""

    source: str
    """imu or stretch."""
    poses_deg: tuple[float, ...]
    """Angles at which the joint was held."""
    noise_deg: float
    """Standard deviation of a sample at rest."""


def calibrate_joint(
    rig: Annotated[Path, Switch(metavar="RIG")], *, pose_deg: Annotated[list[float] | None, Switch(list[float])] = None
) -> JointCalibration:
    """Calibrate a joint's sensor by hand, and write [joint_sensor].

    The joint is held at each pose for two seconds; an IMU is then moved freely for ten, about the joint alone.
    Goniometer and terminal are needed, the drive is not.

    Args:
        rig: the rig.toml, with source and stream in [joint_sensor].
        pose_deg: known angles of the joint, two or three; 0 and 90 by default [°].

    Raises:
        ParameterError: no terminal, a rig without such a sensor, or readings that do not go with the poses.
        StreamError: its stream cannot be opened, or nothing comes.

    Examples:
        bowden calibrate joint rig.toml
        bowden calibrate joint rig.toml --pose-deg 0 --pose-deg 45
    """
    from bowden.core.errors import ParameterError
    from bowden.core.files import whole_file
    from bowden.core.toml_text import with_keys
    from bowden.core.units import RADIANS
    from bowden.hardware.joint_stream import JointSamples
    from bowden.identify.joint_sensor import Pose, calibrated, keys_of
    from bowden.sensing.joint_sample import Quaternion

    angles = [0.0, 90.0] if pose_deg is None else list(pose_deg)
    sensor = _uncalibrated(rig)
    if not sys.stdin.isatty():
        raise ParameterError("there is no terminal to say when a pose is held", do="run it at a terminal")
    samples = JointSamples(sensor)
    try:
        samples.wait()
        poses = [Pose(angle * RADIANS, _looked(samples, f"hold the joint at {angle:g}°", HELD)) for angle in angles]
        motion: list[Quaternion] = []
        if sensor.source == "imu":
            moved = _looked(samples, "be ready to move this joint alone, to and fro", MOVED)
            motion = [Quaternion(*one) for one in moved]
    finally:
        samples.close()
    found = calibrated(sensor, poses, motion)
    text = with_keys(rig.read_text(encoding="utf-8"), "joint_sensor", keys_of(found), str(rig))
    with whole_file(rig) as part:
        part.write_text(text, encoding="utf-8")
    return JointCalibration(sensor.source, tuple(angles), degrees(found.noise), made=found)


def _uncalibrated(path: Path) -> "JointSensor":
    """The sensor of a rig that may have no curve yet.

    Raises:
        ParameterError: a rig that cannot be read, or has nothing to calibrate.
    """
    from bowden.core.errors import ParameterError
    from bowden.rig.config import read_toml
    from bowden.rig.rig import Rig

    tree = read_toml(path)
    given = tree.get("joint_sensor")
    if isinstance(given, dict) and given.get("source") == "stretch":
        tree["joint_sensor"] = {"curve_values": [0.0, 1.0], "curve_angles_deg": [0.0, 1.0], **given}
    sensor = Rig.of_tree(tree, path).only().joint_sensor
    if not sensor.sensed or (sensor.source == "imu" and sensor.gives == "angle"):
        what = "gives the joint's angle already" if sensor.sensed else f"is {sensor.source!r}, which has no sensor"
        raise ParameterError(
            f"joint_sensor.source of {path} {what}",
            expected='a stretch sensor, or an IMU with gives = "quaternion" or "inertial"',
            do="correct it, or run without a calibration",
        )
    return sensor


def _looked(samples: "JointSamples", what: str, lasting: float) -> "Sequence[Sequence[float]]":
    """What comes while a pose is held, or the joint is moved."""
    from bowden.core.clock import SECOND, MonotonicClock

    print(f"{what[0].upper()}{what[1:]}, then press Enter; it takes {lasting:g} s.", file=sys.stderr)
    sys.stdin.readline()
    clock, found = MonotonicClock(), []
    while samples.raw():  # of before
        pass
    end = clock.now() + round(lasting * SECOND)
    while clock.now() < end:
        clock.sleep_until(clock.now() + SECOND // 200)
        found += samples.raw()
    return found


GROUP = "Calibrate sensors of the joint by hand."
OPERATIONS = (Operation("calibrate joint", calibrate_joint, 44),)
