"""The suit on the arm as a model for MuJoCo: bodies, a hinge, two tendons; nothing of it comes from Eqs 1–2.

The upper arm stands still along z, the elbow is a hinge at the origin, and x points to the inside of the elbow, which
is forward where the upper arm hangs; for a raised one gravity is turned instead. Angle zero is the straight arm,
positive angles flex. Each cable runs between two anchors, one on each segment, both at the distance b from the joint
along the segment and the half-width a off its axis:

    flexor      a straight line, on the inside, from (+a, +b) to (+a, −b) as it is on the straight arm
    extensor    on the outside, from (−a, +b) to (−a, −b), round a cylinder of radius R about the joint

Source: Dinh et al. 2017, Section 2.2 and Fig. 2(B); for wrapping, MuJoCo's documentation of spatial tendons.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from bowden.models.suit.arm import GRAVITY, Arm
from bowden.models.suit.geometry import SuitGeometry, extensor_moment_arm, flexor_moment_arm
from bowden.records.trace import Trace

Array = NDArray[np.float64]

Tensions = Callable[[float], tuple[float, float]]
"""Time [s] → tension of flexor and extensor [N]."""


def arm_xml(geometry: SuitGeometry, arm: Arm, step: float = 1e-3, integrator: str = "RK4") -> str:
    """The model in MuJoCo's format (MJCF).

    Args:
        geometry: a, b and R of Eqs 1–2.
        arm: what hangs on the elbow; its passive spring and damper are the hinge's.
        step: MuJoCo's time step [s].
        integrator: as MuJoCo calls it: ``Euler``, ``implicit``, ``implicitfast`` or ``RK4``.
    """
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
    <site name="flexor_upper" pos={numbers(a, 0.0, b)}/>
    <site name="extensor_upper" pos={numbers(-a, 0.0, b)}/>
    <site name="outside" pos={numbers(-2.0 * radius, 0.0, 0.0)}/>
    <geom name="elbow" type="cylinder" size={numbers(radius, 0.014)} zaxis="0 1 0"/>
    <body name="forearm">
      <joint name="elbow" type="hinge" axis="0 -1 0" stiffness={numbers(arm.stiffness)}
             springref={numbers(arm.neutral)} damping={numbers(arm.damping)}/>
      <inertial pos={numbers(0.0, 0.0, -arm.centre)} mass={numbers(arm.mass)} diaginertia={numbers(own, own, own)}/>
      <site name="flexor_lower" pos={numbers(a, 0.0, -b)}/>
      <site name="extensor_lower" pos={numbers(-a, 0.0, -b)}/>
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
    """The compiled model, to be asked for lengths, moment arms and motion; arguments as `arm_xml`."""

    def __init__(self, geometry: SuitGeometry, arm: Arm, step: float = 1e-3, integrator: str = "RK4") -> None:
        self._mujoco = pytest.importorskip("mujoco", reason="needs the package mujoco")
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

    def move(self, start: tuple[float, float], tensions: Tensions, count: int, torque: Array | None = None) -> Array:
        """Let the arm go and integrate its motion.

        Args:
            start: angle [rad] and its rate [rad/s] at the beginning.
            tensions: of the cables; constant through a step, as they are in its middle, which is of second order.
            count: how many steps, of the model's own length.
            torque: further torque on the elbow in each step, the wearer's for instance, (count,) [N m].

        Returns:
            Angle at the beginning of each step, and at the end of the last, (count + 1,) [rad].
        """
        data = self._data
        self._mujoco.mj_resetData(self._model, data)
        data.qpos[0], data.qvel[0] = start
        angle = np.empty(count + 1)
        for k in range(count):
            angle[k] = data.qpos[0]
            data.ctrl[:] = tensions((k + 0.5) * self._step)
            data.qfrc_applied[0] = 0.0 if torque is None else torque[k]
            self._mujoco.mj_step(self._model, data)
        angle[count] = data.qpos[0]
        return angle


def replay(trace: Trace, heavier: float = 1.0, window: float = 2.0) -> Array:
    """The elbow of a run of the suit once more in MuJoCo (n,) [rad]; NaN where the trace's is at its stops.

    MuJoCo is given the trace's tensions, and as torques the wearer's muscles and what flesh and straps damp (the
    trace's interaction torque without the tensions' share). How a tension turns the elbow, weight, inertia and the
    passive elbow are MuJoCo's own. Under tensions that do not answer to it an elbow near the top runs off, as a pencil
    on its tip does, whichever model computes it. So MuJoCo starts again with the trace's angle and speed after each
    `window` [s].

    Args:
        trace: of `bowden.sim.run.simulate` on a suit.
        heavier: MuJoCo's mass over the trace's.
        window: how long MuJoCo goes on by itself [s].
    """
    plant = trace.settings["plant"]
    geometry, arm = SuitGeometry(**plant["geometry"]), Arm(**plant["arm"])
    time, joint = trace.time, trace["joint"]
    step = float(time[1] - time[0])
    tensions = np.stack([trace["flexor_tension"], trace["extensor_tension"]])
    arms = np.array([(flexor_moment_arm(x, geometry), extensor_moment_arm(x, geometry)) for x in joint.tolist()]).T
    other = trace["wearer_torque"] + trace["interaction_torque"] - (tensions * arms).sum(axis=0)
    pulled = 0.5 * (tensions[:, 1:] + tensions[:, :-1])  # in the middle of each step
    torque = 0.5 * (other[1:] + other[:-1])
    low, high = plant["stops"]
    edges = np.flatnonzero(np.diff(np.r_[False, (joint > low) & (joint < high), False].astype(int))).tolist()
    length = round(window / step)
    model, theirs = MujocoArm(geometry, arm._replace(mass=heavier * arm.mass), step), np.full(len(time), np.nan)
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        for first in range(begin, end - 1, length):
            last = min(first + length, end - 1)
            part = pulled[:, first:last]
            theirs[first : last + 1] = model.move(
                (float(joint[first]), float(trace["joint_velocity"][first])),
                lambda now, part=part: tuple(part[:, int(now / step)]),  # type: ignore[misc]
                last - first,
                torque[first:last],
            )
    return theirs
