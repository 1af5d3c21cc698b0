"""Our geometry and our elbow against MuJoCo's model of the same arm: excursions, moment arms, motion, time step.

What is compared, and what comes from where:

    Eqs 1–2            `bowden.models.suit.geometry`        lengths of MuJoCo's tendons
    moment arms        their derivatives, by hand      the Jacobian of MuJoCo's tendons
    I·d²φ/dt² = …      `bowden.models.suit.arm`, by SciPy   MuJoCo's motion of the body, its spring and its damper

SciPy's eighth-order Runge–Kutta with a relative tolerance of 1e-11 takes no step from MuJoCo, and MuJoCo no equation
from us; both are given the same a, b, R, masses and tensions.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.extras import extra_module
from bowden.core.units import RADIANS
from bowden.models.minimum_jerk import minimum_jerk_share
from bowden.models.suit.arm import Arm, gravity_torque, passive_torque, resting_angle
from bowden.models.suit.geometry import (
    ELBOW_RANGE,
    SuitGeometry,
    extensor_extension,
    extensor_moment_arm,
    flexor_extension,
    flexor_moment_arm,
)
from bowden.sim.mujoco_arm import MujocoArm, Tensions

Array = NDArray[np.float64]

EXCURSION_LIMIT = 1e-4
"""How far a cable's excursion may be from Eqs 1–2 [m]."""

MOMENT_ARM_LIMIT = 1e-4
"""How far a moment arm may be from ours [m]."""

MOTION_LIMIT = 0.5 * RADIANS
"""How far the elbow may be from ours at any time of a motion [rad]."""

STEPS = (8e-3, 4e-3, 2e-3, 1e-3)
"""Time steps over which convergence is shown [s]."""

INTEGRATORS = ("Euler", "RK4")
"""MuJoCo's own default, and the one of the check."""


class Cables(NamedTuple):
    """Excursions and moment arms over the elbow's range: largest differences, MuJoCo minus ours, as absolute values."""

    flexor: float
    """Excursion against Eq. 1 [m]."""
    extensor: float
    """Excursion against Eq. 2 [m]."""
    flexor_arm: float
    """Moment arm against −dh1/dφ [m]."""
    extensor_arm: float
    """Moment arm against −dh2/dφ [m]."""
    flexor_travel: float
    """From one end of the range to the other, as MuJoCo has it; negative where the cable shortens [m]."""
    extensor_travel: float
    """Likewise [m]."""
    lowest: float
    """Least angle from which on, up to the range's high end, Eq. 2 holds within `EXCURSION_LIMIT` [rad]."""


class ArmMotion(NamedTuple):
    """One motion by both."""

    name: str
    time: Array  # (n,)
    ours: Array  # (n,)
    """Elbow by `bowden.models.suit.arm` [rad]."""
    mujoco: Array  # (n,)
    """Elbow by MuJoCo [rad]; NaN where it does not know."""

    @property
    def error(self) -> float:
        """Largest difference [rad]."""
        return float(np.nanmax(np.abs(self.mujoco - self.ours)))


class ArmCase(NamedTuple):
    """A motion to be made."""

    name: str
    start: float
    """Angle from which the arm is let go, at rest [rad]."""
    tensions: Tensions
    duration: float
    """[s]."""


class Convergence(NamedTuple):
    """Largest error of a motion over MuJoCo's time step."""

    integrator: str
    steps: tuple[float, ...]
    """[s]."""
    errors: tuple[float, ...]
    """[rad]."""

    @property
    def order(self) -> float:
        """Slope of the error over the step, both as logarithms, from the largest step to the smallest."""
        return math.log(self.errors[0] / self.errors[-1]) / math.log(self.steps[0] / self.steps[-1])


def compare_cables(geometry: SuitGeometry, angles: tuple[float, float] = ELBOW_RANGE, count: int = 181) -> Cables:
    """Excursions and moment arms over a range of the elbow, from its low end, at `count` angles.

    Raises:
        BowdenError: MuJoCo is not installed.
        ParameterError: the geometry cannot be built.
    """
    model = MujocoArm(geometry, Arm())
    low, high = angles
    grid = np.linspace(low, high, count)
    lengths, arms = (np.array(part) for part in zip(*(model.cables(angle) for angle in grid), strict=True))
    ours = np.array([(flexor_extension(x, geometry), extensor_extension(x, geometry)) for x in grid])
    our_arms = np.array([(flexor_moment_arm(x, geometry), extensor_moment_arm(x, geometry)) for x in grid])
    travels = lengths - lengths[0]
    excursion = np.abs(travels - (ours - ours[0])).max(axis=0)
    arm = np.abs(arms - our_arms).max(axis=0)
    return Cables(
        flexor=float(excursion[0]),
        extensor=float(excursion[1]),
        flexor_arm=float(arm[0]),
        extensor_arm=float(arm[1]),
        flexor_travel=float(travels[-1, 0]),
        extensor_travel=float(travels[-1, 1]),
        lowest=_lowest(model, geometry, high),
    )


def _lowest(model: MujocoArm, geometry: SuitGeometry, high: float) -> float:
    """Where, going down from `high`, the extensor's excursion leaves Eq. 2; −180° where it does not."""
    end = model.cables(high)[0][1]
    for angle in np.arange(high, -math.pi, -0.1 * RADIANS):
        if abs(model.cables(angle)[0][1] - end - geometry.joint_radius * (angle - high)) > EXCURSION_LIMIT:
            return float(angle + 0.1 * RADIANS)
    return -math.pi


def cases(geometry: SuitGeometry, arm: Arm) -> list[ArmCase]:
    """The motions of the check: a free swing, a slow lift and descent, and both cables pulling against one another.

    Under a given tension an elbow above some 65° runs off: gravity's lever then shrinks, and the flexor's grows. So the
    lift ends at 60°, for an upper arm that hangs.
    """
    rest, high, low = resting_angle(arm), 60.0 * RADIANS, 30.0 * RADIANS
    flexor = max(_held(arm, high), 0.5) / flexor_moment_arm(high, geometry)
    surplus = flexor * flexor_moment_arm(low, geometry) - _held(arm, low)
    extensor = max(surplus, 0.5) / geometry.joint_radius

    def lift(time: float) -> tuple[float, float]:
        return flexor * (minimum_jerk_share(time / 8.0) - minimum_jerk_share((time - 10.0) / 6.0)), 0.0

    def both(time: float) -> tuple[float, float]:
        return flexor * minimum_jerk_share(time / 6.0), extensor * minimum_jerk_share((time - 7.0) / 2.0)

    return [
        ArmCase("free swing", rest + 70.0 * RADIANS, lambda time: (0.0, 0.0), 8.0),
        ArmCase("slow lift", rest, lift, 16.0),
        ArmCase("both cables", rest, both, 12.0),
    ]


def _held(arm: Arm, angle: float) -> float:
    """Torque of the cables that holds the arm at an angle [N m]."""
    return -(gravity_torque(arm, angle) + passive_torque(arm, angle, 0.0))


def compare_motion(geometry: SuitGeometry, arm: Arm, case: ArmCase) -> ArmMotion:
    """One motion by both, MuJoCo's by RK4 at the least of `STEPS`.

    Raises:
        BowdenError: MuJoCo is not installed.
        ParameterError: geometry or arm cannot be built.
    """
    step = min(STEPS)
    count = round(case.duration / step)
    time: Array = step * np.arange(count + 1, dtype=np.float64)
    theirs = MujocoArm(geometry, arm, step, "RK4").move((case.start, 0.0), case.tensions, count)
    return ArmMotion(case.name, time, our_motion(geometry, arm, case, time), theirs)


def our_motion(geometry: SuitGeometry, arm: Arm, case: ArmCase, time: Array) -> Array:
    """The elbow by the equation of `bowden.models.suit.arm`, at those times (n,) [s], (n,) [rad]."""
    integrate = extra_module("scipy.integrate", "mujoco", "the check of the arm")

    def rate(now: float, state: Array) -> tuple[float, float]:
        angle, velocity = state
        flexor, extensor = case.tensions(now)
        torque = gravity_torque(arm, angle) + passive_torque(arm, angle, velocity)
        torque += flexor * flexor_moment_arm(angle, geometry) + extensor * extensor_moment_arm(angle, geometry)
        return velocity, torque / arm.inertia

    found = integrate.solve_ivp(
        rate, (0.0, float(time[-1])), (case.start, 0.0), "DOP853", time, rtol=1e-11, atol=1e-12, max_step=0.05
    )
    angle: Array = found.y[0]
    return angle


def convergence(geometry: SuitGeometry, arm: Arm, case: ArmCase, motion: ArmMotion, integrator: str) -> Convergence:
    """The largest error of a motion at each of `STEPS`.

    Args:
        geometry: the suit's.
        arm: the wearer's.
        case: the motion.
        motion: of that case, by `compare_motion`; ours is taken from it.
        integrator: MuJoCo's.

    Raises:
        BowdenError: MuJoCo is not installed.
        ParameterError: geometry or arm cannot be built.
    """
    errors = []
    for step in STEPS:
        every = round(step / min(STEPS))
        count = (len(motion.time) - 1) // every
        theirs = MujocoArm(geometry, arm, step, integrator).move((case.start, 0.0), case.tensions, count)
        errors.append(float(np.abs(theirs - motion.ours[::every][: count + 1]).max()))
    return Convergence(integrator, STEPS, tuple(errors))
