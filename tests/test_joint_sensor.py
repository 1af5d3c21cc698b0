"""A rig whose joint has no encoder: its file, its simulation, and the supervisor's limit."""

import math
from typing import Any

import numpy as np
import pytest

from bowden import Rig
from bowden.core.errors import ParameterError, SafetyError
from bowden.core.signals import Sample
from bowden.core.units import RADIANS
from bowden.live.by_hand import require_confirmed
from bowden.plants.estimated import SensorRun, sensor_step
from bowden.rig.joint_sensor import model_of
from bowden.rig.settings import JointSensor
from bowden.safety.detectors import joint_unsure
from bowden.safety.evidence import joint_doubt
from bowden.safety.limits import Limits
from bowden.sim.rig_runs import run_of

IMU = {"source": "imu", "stream": "udp:5005"}
STRETCH = {"source": "stretch", "stream": "udp:5005", "curve_values": (100.0, 900.0), "curve_angles": (0.0, 1.5)}


@pytest.mark.parametrize("given", [IMU, STRETCH, {"source": "motor"}], ids=lambda given: given["source"])
def test_a_rig_keeps_its_joint_sensor(given: dict[str, Any], tmp_path: Any) -> None:
    rig = Rig(joint_sensor=given)
    rig.write(tmp_path / "rig.toml")
    again = Rig.read(tmp_path / "rig.toml")
    assert (again.joint_sensor, again.hash) == (rig.joint_sensor, rig.hash)
    assert again.hash != Rig().hash
    assert Rig.unpack(rig.pack()).hash == rig.hash


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"source": "imu"}, "stream"),
        (IMU | {"stream": "udp:x"}, "a port"),
        (IMU | {"axis": (1.0, 1.0, 0.0)}, "length 1"),
        (IMU | {"bodies": 2}, "quaternion"),
        (STRETCH | {"curve_values": (1.0,), "curve_angles": (0.0,)}, "two readings"),
        (STRETCH | {"curve_values": (1.0, 3.0, 2.0), "curve_angles": (0.0, 1.0, 2.0)}, "only rise"),
        (IMU | {"delay": 0.09}, "its periods"),
        ({"source": "motor", "cable_error": 10.0 * RADIANS}, "joint_std_deg"),
    ],
)
def test_what_makes_no_sense_is_refused(given: dict[str, Any], said: str) -> None:
    with pytest.raises(ParameterError, match=said):
        Rig(joint_sensor=given)


def test_the_simulated_sensor_is_late_and_has_its_rate() -> None:
    """Without noise and drift its values are the joint's a delay ago, once a period."""
    model = model_of(JointSensor(**IMU, noise=0.0, drift=0.0), 1.0, 0.0, 0.0)
    joint, dt = np.sin(0.01 * np.arange(100)), 1e-3
    state, values = SensorRun(0.0, (0.0,) * 8), []
    for angle in joint:
        state, value = sensor_step(model, state, angle, np.zeros(4), dt)
        values.append(value)
    came = np.flatnonzero(~np.isnan(values))
    assert came.tolist() == list(range(10, 100, 10))
    assert np.array(values)[came] == pytest.approx(joint[came - 10])


def test_a_law_follows_an_estimate() -> None:
    """With an IMU of 2° of noise the joint is a degree further off at most than with an encoder."""
    encoder, imu = (run_of(rig, rig.fitted()) for rig in (Rig(duration=10.0), Rig(duration=10.0, joint_sensor=IMU)))
    assert imu.metrics().rmse_deg < encoder.metrics().rmse_deg + 1.0
    estimate = imu["joint_measured"] - imu["joint"]
    assert 0.0 < np.sqrt(np.mean(estimate**2)) < 1.0 * RADIANS


def test_an_encoder_s_sample_has_no_age() -> None:
    assert math.isnan(Sample(0.1, 0.2).joint_std)
    assert math.isnan(Sample(0.1, 0.2).joint_age)


class _Seen:
    """Evidence with one reading."""

    def __init__(self, std: float) -> None:
        self.observed = self
        self.reading = self
        self.joint_std = std


@pytest.mark.parametrize(
    ("std", "found"), [(0.0, False), (0.15, False), (0.1501, True), (math.inf, True), (math.nan, True)]
)
def test_an_estimate_that_is_too_uncertain_is_a_fault(std: float, found: bool) -> None:
    """Of an encoder it never is."""
    seen: Any = _Seen(std)
    assert joint_unsure(Limits(estimates_joint=True, joint_std=0.15), seen) is found
    assert not joint_unsure(Limits(joint_std=0.15), seen)


def test_detectors_of_the_joint_allow_three_standard_deviations() -> None:
    seen: Any = _Seen(0.02)
    assert joint_doubt(Limits(estimates_joint=True), seen) == pytest.approx(0.06)
    assert joint_doubt(Limits(), seen) == 0.0


def test_an_estimated_joint_is_run_on_twins_alone() -> None:
    require_confirmed(Rig(joint_sensor=IMU))
    with pytest.raises(SafetyError, match="--twin"):
        require_confirmed(Rig(joint_sensor=IMU, drive={"interface": "socketcan", "channel": "can0"}))
