"""A rig whose joint has no encoder: its file, its simulation, and the supervisor's limit."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bowden import Rig
from bowden.control.source import Measurement
from bowden.core.errors import ParameterError, SafetyError
from bowden.core.signals import Sample
from bowden.core.units import RADIANS
from bowden.design.objections import objections
from bowden.design.power import require_power
from bowden.live.by_hand import require_confirmed
from bowden.live.joint_estimate import LiveEstimate
from bowden.live.row import NOTHING_READ
from bowden.plants.bench import Bench
from bowden.plants.estimated import BENDS, Estimated, SensorRun, sensor_step
from bowden.safety.detectors import joint_unsure
from bowden.safety.evidence import joint_doubt
from bowden.safety.limits import Limits
from bowden.sensing.joint_angle import JointModel, estimate_step
from bowden.sim.rig_runs import run_of
from support.sensors import PAPER_ENCODER

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
        (IMU | {"stream": "serial:/dev/ttyACM0@fast"}, "a baud rate"),
        (IMU | {"stream": "can:can0"}, "an identifier"),
        (IMU | {"stream": "can:can0@321x"}, "an identifier"),
        (IMU | {"stream": "can:can0@0x321", "gives": "inertial"}, "over CAN"),
        (IMU | {"axis": (1.0, 1.0, 0.0)}, "length 1"),
        (IMU | {"bodies": 2}, "quaternion"),
        (IMU | {"bodies": 2, "gives": "inertial"}, "quaternion"),
        (STRETCH | {"curve_values": (1.0,), "curve_angles": (0.0,)}, "two readings"),
        (STRETCH | {"curve_values": (1.0, 3.0, 2.0), "curve_angles": (0.0, 1.0, 2.0)}, "only rise"),
        (IMU | {"delay": 0.09}, "its periods"),
        ({"source": "motor", "cable_error": 10.0 * RADIANS}, "joint_std_deg"),
    ],
)
def test_what_makes_no_sense_is_refused(given: dict[str, Any], said: str) -> None:
    with pytest.raises(ParameterError, match=said):
        Rig(joint_sensor=given)


@given(st.integers(2, 30), st.floats(0.0, 6.5), st.tuples(*[st.floats(-2.0, 2.0)] * 4))
def test_a_value_is_the_joint_a_delay_ago_once_a_period_with_the_sensor_s_errors(
    half_period: int, late: float, normals: tuple[float, float, float, float]
) -> None:
    """Noise, a systematic error that bends over the range, and a drift of one speed since the start."""
    period, dt, joint = 0.5 * half_period, 1e-3, np.sin(0.01 * np.arange(150))  # the period in cycles
    delay = round(late * period)
    model = JointModel(1.0, 0.0, 0.0, 0.1, period * dt, delay * dt, noise=0.1, offset=0.2, drift=3.0)
    sampled, state = {math.ceil(period * k) for k in range(200)}, SensorRun(0.0, (0.0,) * 8)
    for k, angle in enumerate(joint):
        state, value = sensor_step(model, state, angle, np.array(normals), dt)
        assert math.isnan(value) == (k - delay not in sampled)
        if not math.isnan(value):
            true = joint[k - delay]
            error = 0.1 * normals[0] + math.copysign(3.0, normals[3]) * k * dt
            error += 0.2 * (normals[1] * math.cos(BENDS * true) + normals[2] * math.sin(BENDS * true))
            assert value == pytest.approx(true + error)
    assert math.isnan(sensor_step(model._replace(period=0.0), state, 0.1, np.array(normals), dt)[1])


def test_the_sensor_draws_its_noise_in_each_cycle_and_its_other_errors_once_a_run_beside_the_plant_s_own() -> None:
    inner = Bench(joint_encoder=PAPER_ENCODER)
    plant = Estimated(inner, JointModel(1.0, 0.0, 0.0, 0.1))
    own, out, other = np.empty((4000, 2)), np.empty((4000, plant.dynamics().normals)), np.empty((4000, 6))
    inner.draw(3, own)
    plant.draw(3, out)
    plant.draw(4, other)
    np.testing.assert_array_equal(out[:, :2], own)
    assert np.ptp(out[:, 3:], axis=0).tolist() == [0.0] * 3
    assert len({*out[0, 3:], *other[0, 3:]}) == 6
    assert (out[:, 2].mean(), out[:, 2].std()) == pytest.approx((0.0, 1.0), abs=0.06)
    assert np.corrcoef(out[:, :3], rowvar=False) == pytest.approx(np.eye(3), abs=0.06)


def test_an_estimated_plant_reads_its_sensor_by_the_last_of_its_numbers() -> None:
    model = JointModel(1.0, 0.0, 0.0, 0.1, period=1e-3, noise=0.1)
    run, numbers = Estimated(Bench(), model).dynamics(), np.array([9.0, 9.0, 0.3, 0.0, 0.0, 0.5])
    begun = run.parts["joint_start"](run.sensing, 0.4, 0.5)
    after, seen = run.parts["joint_sense"](run.sensing, begun, Measurement(9.0, 0.5, 1.0, 2.0), 0.4, numbers, 1e-3)
    sensor, value = sensor_step(model, begun.sensor, 0.4, numbers[2:], 1e-3)
    assert value == pytest.approx(0.4 + 0.1 * 0.3)
    assert after == (sensor, estimate_step(model, begun.estimate, 0.5, value, 1e-3))
    assert seen[:4] == (after.estimate.angle, 0.5, 1.0, 2.0)


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


def test_a_limit_of_no_uncertainty_is_refused() -> None:
    with pytest.raises(ParameterError, match="joint_std_deg is 0"):
        Rig(joint_sensor=IMU, limits=Limits(joint_std=0.0))


@pytest.mark.parametrize(
    ("sensor", "more", "said"),
    [
        (IMU, {}, "no angle has been confirmed"),
        (IMU | {"gives": "quaternion"}, {}, "bowden calibrate joint"),
        (IMU | {"gives": "quaternion", "axis": (0.0, 1.0, 0.0)}, {}, "no angle has been confirmed"),
        ({"source": "motor"}, {}, "nobody has said that no limb"),
        ({"source": "motor"}, {"suit": {"worn": True}}, "a suit means a limb"),
    ],
)
def test_a_real_drive_gets_power_once_its_joint_s_angle_is_calibrated_and_confirmed(
    sensor: dict[str, Any], more: dict[str, Any], said: str
) -> None:
    rig = Rig(joint_sensor=sensor, **more)
    real = rig.replace(drive={"interface": "socketcan", "channel": "can0"})
    for one in (require_power, require_confirmed):
        one(rig)  # there is a twin
    known = said != "no angle has been confirmed"
    with pytest.raises(SafetyError, match=said):
        (require_power if known else require_confirmed)(real)
    assert any(said in one for one in objections(real)) is known, "what check says"


def motors_of(angles: list[float], ages: list[float] | None = None) -> list[float]:
    """The joint, by a live estimate from the motor alone, over cycles of 1 ms."""
    estimate = LiveEstimate(Rig(joint_sensor={"source": "motor"}, limits=Limits(motor_speed=16.0, jump=0.02)))
    ages = ages or [0.0] * len(angles)
    return [
        estimate.shown(NOTHING_READ._replace(motor=angle, motor_age=age), 1e-3 * k).joint
        for k, (angle, age) in enumerate(zip(angles, ages, strict=True))
    ]


@pytest.mark.parametrize("spike", [0.5, -0.5, 1e6, math.nan])
def test_one_angle_that_no_motor_reaches_does_not_move_the_joint(spike: float) -> None:
    """As the first of all it is believed until two others agree: then the joint is within its play again."""
    assert motors_of([0.0] * 5 + [spike] + [0.0] * 5)[-1] == pytest.approx(0.0, abs=1e-9)
    assert motors_of([spike] + [0.0] * 10)[-1] == pytest.approx(0.0, abs=Rig().joint_model.play)


def test_a_motor_that_moved_on_while_it_was_not_heard_is_believed_at_once() -> None:
    """The same angle again and again, older each time, is no word of it."""
    speed = 14.0 * 1e-3
    way = [k * speed for k in range(100)]
    heard = [*way[:50], *[way[49]] * 20, *way[70:]]
    ages = [0.0] * 50 + [float(k + 1) for k in range(20)] + [0.0] * 30
    whole, lost = motors_of(way), motors_of(heard, ages)
    assert lost[70:] == pytest.approx(whole[70:], abs=0.05)
