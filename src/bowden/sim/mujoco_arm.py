"""The suit on the arm as a model for MuJoCo: bodies, a hinge, two tendons; nothing of it comes from Eqs 1–2.

The upper arm stands still along z, the elbow is a hinge at the origin, and x points to the inside of the elbow, which
is forward where the upper arm hangs; for a raised one gravity is turned instead. Angle zero is the straight arm,
positive angles flex. Each cable runs between two anchors, one on each segment, both at the distance b from the joint
along the segment and the half-width a off its axis:

    flexor      a straight line, on the inside, from (+a, +b) to (+a, −b) as it is on the straight arm
    extensor    on the outside, from (−a, +b) to (−a, −b), round a cylinder of radius R about the joint

That the straight line has the length of Eq. 1, and the way round the cylinder that of Eq. 2, is for MuJoCo to say: it
is given points, cylinder, masses and gravity, and computes lengths, moment arms and motion by itself.

Needs the extra ``bowden[mujoco]``. Source: Dinh et al. 2017, Section 2.2 and Fig. 2(B); for wrapping, MuJoCo's
documentation of spatial tendons.
"""

import math
from collections.abc import Callable
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import BowdenError, ParameterError
from bowden.models.suit.arm import GRAVITY, Arm
from bowden.models.suit.geometry import SuitGeometry

Array = NDArray[np.float64]

Tensions = Callable[[float], tuple[float, float]]
"""Time [s] → tension of flexor and extensor [N]."""


def load_mujoco() -> ModuleType:
    """MuJoCo's Python package, imported when it is first needed.

    Raises:
        BowdenError: it is not installed.
    """
    try:
        import mujoco
    except ImportError as error:
        raise BowdenError(
            f"the arm's model needs the package mujoco ({error})", do='pip install "bowden[mujoco]"'
        ) from error
    return mujoco


def arm_xml(geometry: SuitGeometry, arm: Arm, step: float = 1e-3, integrator: str = "RK4") -> str:
    """The model in MuJoCo's format (MJCF).

    Args:
        geometry: a, b and R of Eqs 1–2.
        arm: what hangs on the elbow; its passive spring and damper are the hinge's.
        step: MuJoCo's time step [s].
        integrator: as MuJoCo calls it: ``Euler``, ``implicit``, ``implicitfast`` or ``RK4``.

    Raises:
        ParameterError: a length, mass or step that is not above 0, an inertia that no body of that mass and centre
            has, a stiffness or damping below 0, or anchors inside the extensor's cylinder.
    """
    _check(geometry, arm, step)
    a, b, radius = geometry.half_width, geometry.anchor_distance, geometry.joint_radius
    own = arm.inertia - arm.mass * arm.centre**2  # about the centre of mass
    gravity = (-GRAVITY * math.sin(arm.elevation), 0.0, -GRAVITY * math.cos(arm.elevation))

    def numbers(*values: float) -> str:  # every digit
        return '"' + " ".join(f"{value:.17g}" for value in values) + '"'

    return f"""<mujoco model="suit on an arm">
  <compiler angle="radian" inertiafromgeom="false"/>
  <option timestep={numbers(step)} integrator="{integrator}" gravity={numbers(*gravity)}>
    <flag contact="disable"/>
  </option>
  <worldbody>
    <site name="flexor_upper" pos={numbers(a, 0.0, b)} size="0.003"/>
    <site name="extensor_upper" pos={numbers(-a, 0.0, b)} size="0.003"/>
    <site name="outside" pos={numbers(-2.0 * radius, 0.0, 0.0)} size="0.003"/>
    <geom name="elbow" type="cylinder" size={numbers(radius, 0.014)} zaxis="0 1 0"/>
    <body name="forearm">
      <joint name="elbow" type="hinge" axis="0 -1 0" stiffness={numbers(arm.stiffness)}
             springref={numbers(arm.neutral)} damping={numbers(arm.damping)}/>
      <inertial pos={numbers(0.0, 0.0, -arm.centre)} mass={numbers(arm.mass)} diaginertia={numbers(own, own, own)}/>
      <site name="flexor_lower" pos={numbers(a, 0.0, -b)} size="0.003"/>
      <site name="extensor_lower" pos={numbers(-a, 0.0, -b)} size="0.003"/>
    </body>
  </worldbody>
  <tendon>
    <spatial name="flexor"><site site="flexor_upper"/><site site="flexor_lower"/></spatial>
    <spatial name="extensor">
      <site site="extensor_upper"/><geom geom="elbow" sidesite="outside"/><site site="extensor_lower"/>
    </spatial>
  </tendon>
  <actuator>
    <motor name="flexor" tendon="flexor" gear="-1"/>
    <motor name="extensor" tendon="extensor" gear="-1"/>
  </actuator>
</mujoco>
"""


class MujocoArm:
    """The compiled model, to be asked for lengths, moment arms and motion.

    Args:
        geometry: as `arm_xml`.
        arm: as `arm_xml`.
        step: as `arm_xml`.
        integrator: as `arm_xml`.

    Raises:
        BowdenError: MuJoCo is not installed.
        ParameterError: as `arm_xml`.
    """

    def __init__(self, geometry: SuitGeometry, arm: Arm, step: float = 1e-3, integrator: str = "RK4") -> None:
        self._mujoco = load_mujoco()
        self._step = step
        self._model: Any = self._mujoco.MjModel.from_xml_string(arm_xml(geometry, arm, step, integrator))
        self._data: Any = self._mujoco.MjData(self._model)

    def cables(self, angle: float) -> tuple[Array, Array]:
        """Flexor and extensor at an `angle` [rad].

        Returns:
            Lengths between the anchors (2,) [m], and moment arms, the torque that flexes the elbow per unit of
            tension, −d(length)/dφ, (2,) [m].
        """
        self._mujoco.mj_resetData(self._model, self._data)
        self._data.qpos[0] = angle
        self._mujoco.mj_forward(self._model, self._data)
        return self._data.ten_length.copy(), -np.ravel(self._data.ten_J)[:2]  # one joint: one entry a tendon

    def holding_torque(self, angle: float) -> float:
        """Torque that the cables must give, flexing positive, to hold the arm still at an `angle` [rad] [N m]."""
        self._mujoco.mj_resetData(self._model, self._data)
        self._data.qpos[0] = angle
        self._mujoco.mj_inverse(self._model, self._data)
        return float(self._data.qfrc_inverse[0])

    def move(self, start: tuple[float, float], tensions: Tensions, count: int, torque: Array | None = None) -> Array:
        """Let the arm go and integrate its motion.

        Args:
            start: angle [rad] and its rate [rad/s] at the beginning.
            tensions: of the cables; constant through a step, as they are in its middle, which is of second order.
            count: how many steps, of the model's own length.
            torque: further torque on the elbow in each step, the wearer's for instance, (count,) [N m].

        Returns:
            Angle at the beginning of each step, and at the end of the last, (count + 1,) [rad].

        Raises:
            ParameterError: a tension below 0 (a cable cannot push) or not finite.
        """
        data = self._data
        self._mujoco.mj_resetData(self._model, data)
        data.qpos[0], data.qvel[0] = start
        angle = np.empty(count + 1)
        for k in range(count):
            angle[k] = data.qpos[0]
            pulled = tensions((k + 0.5) * self._step)
            if not all(0.0 <= tension < math.inf for tension in pulled):
                raise ParameterError(
                    f"arm: tensions of {pulled[0]} and {pulled[1]} N at {k * self._step:g} s", expected="0 or more"
                )
            data.ctrl[:] = pulled
            data.qfrc_applied[0] = 0.0 if torque is None else torque[k]
            self._mujoco.mj_step(self._model, data)
        angle[count] = data.qpos[0]
        return angle


def _check(geometry: SuitGeometry, arm: Arm, step: float) -> None:
    positive = {
        "half_width": geometry.half_width,
        "anchor_distance": geometry.anchor_distance,
        "joint_radius": geometry.joint_radius,
        "mass": arm.mass,
        "centre": arm.centre,
        "step": step,
    }
    for name, value in positive.items():
        if not 0.0 < value < math.inf:
            raise ParameterError(f"arm: {name} is {value}", expected="a number above 0")
    for name, value in (("stiffness", arm.stiffness), ("damping", arm.damping)):
        if not 0.0 <= value < math.inf:
            raise ParameterError(f"arm: {name} is {value}", expected="a number of 0 or more")
    for name, value in (("neutral", arm.neutral), ("elevation", arm.elevation)):
        if not math.isfinite(value):
            raise ParameterError(f"arm: {name} is {value}", expected="an angle")
    least = arm.mass * arm.centre**2
    if not least < arm.inertia < math.inf:
        raise ParameterError(
            f"arm: inertia about the elbow is {arm.inertia} kg·m²",
            expected=f"more than the {least:.4g} kg·m² that mass and centre have alone",
        )
    distance = math.hypot(geometry.half_width, geometry.anchor_distance)
    if distance <= geometry.joint_radius:
        raise ParameterError(
            f"arm: anchors {distance:.4g} m from a joint of radius {geometry.joint_radius:.4g} m",
            expected="anchors outside the cylinder round which the extensor runs",
        )
