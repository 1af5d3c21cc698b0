"""`bowden check` of a joint without an encoder: the estimate as a part of the linear loop, and in the trials."""

import numpy as np
import pytest

from bowden import LAWS, Rig
from bowden.control.knowledge import configured
from bowden.control.stability import frequencies, response
from bowden.core.kernel import compiled
from bowden.core.units import RADIANS
from bowden.design.check import check
from bowden.design.estimate_model import behind_estimate
from bowden.design.linearise import LawModel, linearise
from bowden.plants.estimated import measured_plant
from bowden.plants.settled_estimate import settled_estimate
from bowden.sensing.joint_angle import JointModel, estimate_start, estimate_step
from bowden.sim import ranges

DT = 1e-3
MODEL = JointModel(0.9, 0.1, 0.05, 4.0 * RADIANS, 0.01, 0.02, 2.0 * RADIANS)
SHOWN = LawModel(np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((1, 0)), np.array([1.0, 0.0]))
"""A law whose command is minus the joint that it is shown."""


def law_model(name: str) -> LawModel:
    return linearise(configured(LAWS[name], Rig().knowledge), DT)


@pytest.mark.parametrize("name", ["adaptive", "bowden"])
def test_where_the_cable_is_as_its_model_says_the_estimate_changes_nothing(name: str) -> None:
    """Then there is nothing to correct, whatever the sensor's delay is."""
    omega, law = frequencies(DT), law_model(name)
    seen = behind_estimate(law, MODEL, (0.5, 0.1), DT).seen_through(MODEL.slope)
    assert response(seen, omega, DT) == pytest.approx(response(law.seen_through(MODEL.slope), omega, DT), rel=1e-5)


def test_without_gains_the_law_sees_the_motor_alone() -> None:
    seen = behind_estimate(SHOWN, MODEL, (0.0, 0.0), DT)
    assert (seen.d.tolist(), len(seen.a)) == ([0.0, MODEL.slope], 2)


@pytest.mark.parametrize("frequency", [0.2, 1.0, 4.0])
def test_the_estimate_follows_a_slow_joint_and_leaves_out_a_quick_one_as_its_filter_does(frequency: float) -> None:
    """The linear model against the estimate itself, of a joint that swings while the motor stands."""
    time, model = DT * np.arange(40_000), MODEL._replace(error=0.5 * RADIANS)
    joint, step = 0.2 * RADIANS * np.sin(2.0 * np.pi * frequency * time), compiled(estimate_step)
    state, shown = estimate_start(model, model.zero), []
    for k in range(len(time)):
        state = step(model, state, model.zero, joint[k - 20] if k % 10 == 0 and k >= 20 else np.nan, DT)
        shown.append(state.angle)
    own = state.covariance
    sums = own.ff + 2.0 * own.fb + own.bb + own.fd + own.bd, own.fd + own.bd + own.dd
    gains = (sums[0] / model.noise**2, sums[1] / model.noise**2)
    late = time > 30.0
    wave = np.exp(-2j * np.pi * frequency * time[late])
    measured = np.sum(np.array(shown)[late] * wave) / np.sum(joint[late] * wave)
    linear = behind_estimate(SHOWN, model, gains, DT).by_joint
    assert measured == pytest.approx(response(linear, np.array([2.0 * np.pi * frequency]), DT)[0], abs=0.03)


def test_gains_are_largest_on_a_motion_and_none_without_a_sensor() -> None:
    moving, resting = settled_estimate(MODEL, DT).gains
    assert moving[0] > resting[0] > 0.0
    assert settled_estimate(MODEL._replace(period=0.0), DT).span == 0.0
    assert settled_estimate(MODEL._replace(noise=1.0 * RADIANS), DT).span < settled_estimate(MODEL, DT).span


@pytest.mark.parametrize("source", ["imu", "motor"])
def test_a_rig_is_judged_with_its_estimate(source: str) -> None:
    """It has no more margin with the sensor, and errs more."""
    stream = None if source == "motor" else "udp:5005"
    rig = Rig(law="bowden", joint_sensor={"source": source, "stream": stream})
    plant, encoder = ranges.judged(rig), ranges.judged(Rig(law="bowden"))
    assert measured_plant(plant) == encoder
    law = rig.fitted()
    found, usual = (check(one, law, stroke=ranges.stroke(rig)) for one in (plant, encoder))
    assert found.gain_margin_db <= usual.gain_margin_db + 1e-6
    assert found.peak > usual.peak
