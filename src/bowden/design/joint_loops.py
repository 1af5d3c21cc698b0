"""Laws on one joint as one linear loop: the margins of its joint, and the poles of what the joint does not show.

With Gᵢ servo, delay and hold of motor i, C₁ᵢ and C₂ᵢ its law from joint and from its own motor to minus its command, σᵢ
its cable's slope and wᵢ by how much the joint moves for that cable's end (`bowden.models.cable.shared_joint.shares`),
the loop is opened at all commands:

    Lᵢⱼ = (C₁ᵢ·wⱼ·σⱼ + δᵢⱼ·C₂ᵢ)·Gⱼ

A gain, phase or delay that comes upon all commands alike makes the loop unstable where an eigenvalue of L passes −1
(generalised Nyquist: MacFarlane and Postlethwaite, 1977). Of the eigenvalues the one is taken whose motion the joint
shows. In the others motors go against each other, the joint stands, and with it goes the co-contraction: no law
feeds that back, so that laws with an integral or a model of their cable have a pole there at one or beyond it. How far
the motors really part, a trial says.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.control.stability import Margins, frequencies, margins_of, response, servo_model, servo_response
from bowden.design.linearise import LawModel
from bowden.models.cable.shared_joint import JointLoad, shares
from bowden.models.drive.servo import Servo

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

APART = 0.1
"""Motion of the joint, over that which it makes where the cables' ends move alike, up to which a mode is one of motors
against each other [–]."""
Taut = tuple[bool, ...]
"""Which cables pull."""


class MotorLoop(NamedTuple):
    """One motor with its cable near rest, in the joint's coordinate."""

    servo: Servo
    delay: int
    """[cycles]"""
    slope: float
    """Motion of the cable's end per motor motion [rad/rad]."""
    law: LawModel


class JointMargins(NamedTuple):
    """What linear analysis says of a joint and its motors."""

    joint: Margins
    """Of the loop that the joint shows."""
    apart: float
    """Largest magnitude of a pole with which motors part while the joint stands; 0 of none [–]."""


def cases(count: int) -> tuple[Taut, ...]:
    """All cables taut, then each alone."""
    return (True,) * count, *(tuple(i == j for j in range(count)) for i in range(count))


def reaches(motors: Sequence[MotorLoop], load: JointLoad, taut: Taut) -> Array:
    """By how much the joint moves for each motor (n,) [rad/rad]."""
    return shares(load, taut) * np.array([one.slope for one in motors])


def joint_margins(motors: Sequence[MotorLoop], load: JointLoad, taut: Taut, dt: float) -> JointMargins:
    """Margins of the joint.

    Args:
        motors: that pull at it.
        load: what they pull at.
        taut: which cables do.
        dt: sample time [s].
    """
    reach, omega = reaches(motors, load, taut), frequencies(dt)
    moved = np.column_stack([servo_response(one.servo, dt, one.delay, omega) for one in motors])
    by_joint = np.column_stack([response(one.law.by_joint, omega, dt) for one in motors])
    by_motor = np.column_stack([response(one.law.by_motor, omega, dt) for one in motors])
    loop = (by_joint[:, :, None] * reach + np.eye(len(motors)) * by_motor[:, :, None]) * moved[:, None, :]
    values, vectors = np.linalg.eig(loop)
    shows = np.abs(np.einsum("nj,njk->nk", moved * reach, vectors))
    seen = values[np.arange(len(omega)), np.argmax(shows, axis=1)]
    poles, apart = joint_poles(motors, reach, dt)
    return JointMargins(margins_of(seen, poles[~apart], dt), float(np.max(np.abs(poles[apart]), initial=0.0)))


def joint_poles(motors: Sequence[MotorLoop], reach: Array, dt: float) -> tuple[Complex, NDArray[np.bool_]]:
    """Poles of the closed loop of all motors, and which of them are of motors against each other.

    Args:
        motors: that pull at the joint.
        reach: see `reaches`.
        dt: sample time [s].
    """
    count = len(motors)
    servos = [servo_model(one.servo, dt, one.delay, 1.0) for one in motors]
    ends = np.cumsum([0, *(len(one.a) for one in servos), *(len(one.law.a) for one in motors)])
    place = [slice(ends[k], ends[k + 1]) for k in range(2 * count)]
    whole, angles = np.zeros((ends[-1], ends[-1])), np.zeros((count, ends[-1]))
    for i, servo in enumerate(servos):
        angles[i, place[i]] = servo.c[0]
    joint = reach @ angles
    for i, (one, servo) in enumerate(zip(motors, servos, strict=True)):
        law, seen = place[count + i], np.vstack([joint, angles[i]])
        whole[law] = one.law.b @ seen
        whole[law, law] += one.law.a
        asked = one.law.d[None, :] @ seen  # minus the command
        asked[:, law] += one.law.c
        whole[place[i]] = -servo.b @ asked
        whole[place[i], place[i]] += servo.a
    poles, modes = np.linalg.eig(whole)
    slopes = np.array([one.slope for one in motors])
    alike = np.sum(reach / slopes) * np.max(np.abs(slopes[:, None] * (angles @ modes)), axis=0)
    return poles, np.abs(joint @ modes) < APART * alike
