"""`bowden calibrate joint`: a sensor's mounting from known poses, and an IMU's axis from a free motion."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bowden import Rig
from bowden.core.errors import ParameterError
from bowden.core.units import RADIANS
from bowden.identify.joint_sensor import Pose, calibrated, keys_of
from bowden.operations import calibrate
from bowden.rig.settings import JointSensor
from bowden.sensing.joint_sample import Quaternion, angle_about, on_curve

AXIS = np.array([0.36, -0.48, 0.8])
MOUNTED = Quaternion(0.5, -0.5, 0.5, 0.5)
IMU = JointSensor(source="imu", stream="udp:5005", gives="quaternion")
STRETCH = JointSensor(source="stretch", stream="udp:5005")


def at(angle: float, axis: Any = AXIS) -> Quaternion:
    """The orientation of an IMU whose joint is at an angle [rad]."""
    return Quaternion(math.cos(0.5 * angle), *(math.sin(0.5 * angle) * axis).tolist()).times(MOUNTED)


def poses(*angles_deg: float, said: tuple[float, ...] = ()) -> list[Pose]:
    each = zip(said or angles_deg, angles_deg, strict=True)
    return [Pose(told * RADIANS, [at(true * RADIANS)] * 5) for told, true in each]


MOTION = [at(0.6 + 0.8 * math.sin(0.1 * k)) for k in range(100)]


@pytest.mark.parametrize("angle", [-0.3, 0.0, 1.0, 2.0])
def test_an_imu_says_the_joint_s_angle_however_it_is_mounted(angle: float) -> None:
    found = calibrated(IMU, poses(10.0, 80.0), MOTION)
    assert found.axis == pytest.approx(AXIS, abs=1e-9)
    assert angle_about(at(angle), found.zero, found.axis) == pytest.approx(angle, abs=1e-9)


def test_an_imu_mounted_upside_down_has_the_other_axis() -> None:
    """Its poses say which way flexes, whatever the free motion began with."""
    found = calibrated(IMU, poses(-10.0, -80.0, said=(10.0, 80.0)), MOTION)
    assert found.axis == pytest.approx(-AXIS, abs=1e-9)


@pytest.mark.parametrize(
    ("held", "motion", "said"),
    [
        (poses(10.0), MOTION, "two different"),
        (poses(10.0, 10.0), MOTION, "two different"),
        (poses(10.0, 40.0, said=(10.0, 80.0)), MOTION, "turned by 30"),
        (poses(10.0, 80.0), MOTION[:5], "ten samples"),
        (
            poses(10.0, 80.0),
            [*MOTION[:50], *(at(0.1 * k % 1.0, np.array([1.0, 0.0, 0.0])) for k in range(50))],
            "about one axis",
        ),
    ],
)
def test_an_axis_that_is_not_the_joint_s_is_refused(held: list[Pose], motion: list[Quaternion], said: str) -> None:
    with pytest.raises(ParameterError, match=said):
        calibrated(IMU, held, motion)


def test_a_stretch_sensor_has_its_curve_and_its_noise() -> None:
    held = [Pose(angle, [(900.0 - 400.0 * angle + noise,) for noise in (-4.0, 4.0)]) for angle in (1.5, 0.0, 0.7)]
    found = calibrated(STRETCH, held)
    assert on_curve(700.0, found.curve_values, found.curve_angles) == pytest.approx(0.5)
    assert found.noise == pytest.approx(0.01)
    with pytest.raises(ParameterError, match="only rise"):
        calibrated(STRETCH, [Pose(0.0, [(1.0,)] * 2), Pose(1.0, [(3.0,)] * 2), Pose(2.0, [(2.0,)] * 2)])


def test_the_command_writes_the_rig_s_section_and_nothing_else(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A stretch sensor without a curve, which no run takes yet."""
    rig = tmp_path / "rig.toml"
    rig.write_text('# mine\n[joint_sensor]  # on the sleeve\nsource = "stretch"\nstream = "udp:5005"\n')
    with pytest.raises(ParameterError, match="two readings"):
        Rig.read(rig)
    with pytest.raises(ParameterError, match="no terminal"):
        calibrate.calibrate_joint(rig)
    keys = keys_of(STRETCH._replace(curve_values=(1.0, 3.0), curve_angles=(0.0, 1.5), noise=0.01))
    monkeypatch.setattr("sys.stdin.isatty", lambda: True)
    monkeypatch.setattr("bowden.hardware.joint_stream.JointSamples.wait", lambda self: None)
    readings = iter([[(1.0,)] * 3, [(3.0,)] * 3])
    monkeypatch.setattr(calibrate, "_looked", lambda *given: next(readings))
    found = calibrate.calibrate_joint(rig, pose_deg=[0.0, 1.5 / RADIANS])
    assert rig.read_text().startswith("# mine\n[joint_sensor]  # on the sleeve\n")
    assert f"curve_values = {keys['curve_values']}" in rig.read_text()
    assert Rig.read(rig).joint_sensor.curve_angles == pytest.approx((0.0, 1.5), abs=1e-4)
    assert found.poses_deg[0] == 0.0


@pytest.mark.parametrize("given", ['source = "motor"', 'source = "imu"\nstream = "udp:5005"'])
def test_what_has_nothing_to_calibrate_is_refused(given: str, tmp_path: Path) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text(f"[joint_sensor]\n{given}\n")
    with pytest.raises(ParameterError, match=r"joint_sensor\.source"):
        calibrate.calibrate_joint(rig)
