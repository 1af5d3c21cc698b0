"""MuJoCo's model of the suit on the arm: an oracle for geometry and elbow that knows none of our equations."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from bowden.control import LAWS
from bowden.control.reference import PeriodicMinimumJerk
from bowden.core.units import DEGREES, RADIANS
from bowden.models.minimum_jerk import minimum_jerk_share
from bowden.models.suit.arm import GRAVITY, Arm, arm_of, gravity_torque, passive_torque
from bowden.models.suit.geometry import (
    SuitGeometry,
    extensor_extension,
    extensor_moment_arm,
    flexor_extension,
    flexor_moment_arm,
)
from bowden.plants.presets.suit import suit
from bowden.plants.suit_parts import Suit
from bowden.records.trace import Trace
from bowden.sim.run import simulate
from support.mujoco_arm import MujocoArm, Tensions, replay
from support.wearers import WEARERS, resting_angle

Array = NDArray[np.float64]
PAPER = SuitGeometry()
ALLOWED = 0.5 * RADIANS
"""How far the elbow may be from ours at any time of a run of the suit [rad]."""


@pytest.fixture(scope="module", autouse=True)
def _mujoco() -> None:
    pytest.importorskip("mujoco", reason="needs the package mujoco")


@pytest.fixture(scope="module")
def run() -> Trace:
    return lifted(suit())


def lifted(suit: Suit) -> Trace:
    """The uncompensated suit, with a weak and trembling wearer, 0–90–0° in 8 s."""
    wearer, reference = WEARERS["weak"]._replace(tremor=0.2), PeriodicMinimumJerk(0.0, 0.5 * math.pi, 8.0)
    return simulate(suit._replace(wearer=wearer), LAWS["uncompensated"], reference, duration=8.0)


def differences(geometry: SuitGeometry) -> Array:
    """MuJoCo minus Eqs 1–2 over 0–90°, largest: excursion and moment arm of the flexor, and of the extensor [m]."""
    model, grid = MujocoArm(geometry, Arm()), np.linspace(0.0, 0.5 * math.pi, 46)
    lengths, arms = (np.array(part) for part in zip(*(model.cables(angle) for angle in grid), strict=True))
    ours = np.array([(flexor_extension(x, geometry), extensor_extension(x, geometry)) for x in grid])
    our_arms = np.array([(flexor_moment_arm(x, geometry), extensor_moment_arm(x, geometry)) for x in grid])
    found = np.abs([lengths - lengths[0] - (ours - ours[0]), arms - our_arms]).max(axis=1)
    return np.asarray(found.T.ravel())


@pytest.mark.parametrize(
    "geometry",
    [PAPER, SuitGeometry(0.045, 0.11, 0.05), SuitGeometry(0.03, 0.06, 0.03, flexor_length=0.7, extensor_length=0.6)],
)
def test_the_tendons_go_as_eqs_1_and_2_say(geometry: SuitGeometry) -> None:
    assert differences(geometry).max() < 1e-12  # asked for: 1e-4


def test_the_papers_travels_are_erratum_3s_and_not_the_papers() -> None:
    """MuJoCo's own tendons: the flexor moves more, not the extensor, and the mismatch is 20.7 mm, not 50."""
    model = MujocoArm(PAPER, Arm())
    travel = model.cables(0.5 * math.pi)[0] - model.cables(0.0)[0]
    np.testing.assert_allclose(travel, [-99.29e-3, 78.54e-3], atol=5e-6)


def test_the_extensor_leaves_its_cylinder_where_geometry_says() -> None:
    """Its tangent points meet where 2·atan(a/b) + 2·acos(R/√(a²+b²)) − φ = π: −21.2° with the paper's a, b, R."""
    a, b, radius = PAPER.half_width, PAPER.anchor_distance, PAPER.joint_radius
    leaves = 2.0 * math.atan2(a, b) + 2.0 * math.acos(radius / math.hypot(a, b)) - math.pi
    model = MujocoArm(PAPER, Arm())
    assert model.cables(leaves + 1e-3)[1][1] == pytest.approx(-radius, abs=1e-12)
    assert model.cables(leaves - 0.02)[1][1] < -radius - 1e-4  # straight, and farther from the joint
    assert leaves * DEGREES == pytest.approx(-21.15, abs=0.01)


def test_a_joint_thinner_than_the_arm_is_seen_to_break_eq_2() -> None:
    """With R = 31.4 mm, less than the half width, the extensor lies on nothing at the straight arm."""
    excursion, arm = differences(PAPER._replace(joint_radius=0.0314))[2:]
    assert excursion > 1e-4
    assert arm == pytest.approx(0.035 - 0.0314, abs=1e-6)  # at 0° it is straight, at the arm's width


def moved(arm: Arm, start: float, tensions: Tensions, duration: float, step: float = 1e-3) -> tuple[Array, Array]:
    """The elbow let go at `start` [rad], by our equation and SciPy, and by MuJoCo, (n,) each [rad]."""

    def rate(now: float, state: Array) -> tuple[float, float]:
        angle, velocity = state
        flexor, extensor = tensions(now)
        torque = gravity_torque(arm, angle) + passive_torque(arm, angle, velocity)
        torque += flexor * flexor_moment_arm(angle, PAPER) + extensor * extensor_moment_arm(angle, PAPER)
        return velocity, torque / arm.inertia

    count = round(duration / step)
    time = step * np.arange(count + 1)
    ours = solve_ivp(rate, (0.0, time[-1]), (start, 0.0), "DOP853", time, rtol=1e-11, atol=1e-12, max_step=0.05)
    return ours.y[0], MujocoArm(PAPER, arm, step).move((start, 0.0), tensions, count)


@pytest.mark.parametrize("arm", [arm_of(), arm_of(45.0, 1.5), arm_of(120.0, 1.9, load=2.0), arm_of(elevation=0.7)])
def test_the_elbow_moves_as_ours(arm: Arm) -> None:
    """A free swing; and a lift to 50° by the flexor, against which the extensor pulls from 5 s on."""
    rest, high = resting_angle(arm), 50.0 * RADIANS
    flexor = max(-gravity_torque(arm, high) - passive_torque(arm, high, 0.0), 0.5) / flexor_moment_arm(high, PAPER)

    def pulled(now: float) -> tuple[float, float]:
        return flexor * minimum_jerk_share(now / 6.0), 0.3 * flexor * minimum_jerk_share((now - 5.0) / 2.0)

    for start, tensions in ((rest + 70.0 * RADIANS, lambda now: (0.0, 0.0)), (rest, pulled)):
        ours, theirs = moved(arm, start, tensions, 9.0)
        assert np.abs(ours - theirs).max() < 1e-3 * ALLOWED
        assert np.ptp(theirs) > 15.0 * RADIANS  # it did move


def test_the_error_falls_with_mujocos_step_as_its_integrator_does() -> None:
    """RK4: fourth order in a free swing, so that the difference is MuJoCo's step and no difference of equations."""
    errors = []
    for step in (8e-3, 1e-3):
        ours, theirs = moved(Arm(), 1.3, lambda now: (0.0, 0.0), 4.0, step)
        errors.append(float(np.abs(ours - theirs).max()))
    assert math.log(errors[0] / errors[1]) / math.log(8.0) == pytest.approx(4.0, abs=0.25)


def test_an_arm_without_friction_keeps_its_energy_and_hangs_where_it_should() -> None:
    loose = Arm()._replace(stiffness=0.0, damping=0.0)
    angle = MujocoArm(PAPER, loose).move((1.0, 0.0), lambda time: (0.0, 0.0), 5000)
    rate = np.gradient(angle, 1e-3)
    energy = 0.5 * loose.inertia * rate**2 - loose.mass * GRAVITY * loose.centre * np.cos(angle)
    assert np.ptp(energy[5:-5]) < 1e-4 * np.abs(energy).max()
    damped = Arm()._replace(damping=1.0)
    settled = MujocoArm(PAPER, damped).move((0.0, 0.0), lambda time: (0.0, 0.0), 8000)
    assert settled[-1] == pytest.approx(resting_angle(damped), abs=1e-4)


def error(run: Trace, heavier: float = 1.0) -> float:
    """Largest difference of the elbow [rad]."""
    return float(np.nanmax(np.abs(replay(run, heavier) - run["joint"])))


def test_a_run_of_the_suit_is_the_same_in_mujoco(run: Trace) -> None:
    assert np.ptp(replay(run)) > 30.0 * RADIANS
    assert error(run) < ALLOWED
    assert error(run, heavier=1.05) > ALLOWED  # 80 g more are seen


def test_the_suits_difference_from_mujoco_is_its_own_sub_step(run: Trace) -> None:
    """Sub-steps of the suit are of first order: a quarter of their length leaves a quarter of the difference."""
    fine = error(lifted(suit()._replace(substeps=4 * suit().substeps)))
    assert fine == pytest.approx(0.25 * error(run), rel=0.1)
    assert fine < 0.15 * ALLOWED
