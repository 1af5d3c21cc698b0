"""Two laws on one joint as one linear loop: the margins of its joint, and the poles of what the joint does not show.

With Gᵢ servo, delay and hold of side i, C₁ᵢ and C₂ᵢ its law from joint and from its own motor to minus its command, σᵢ
its cable's slope and wᵢ by how much the joint moves for that cable's end (`bowden.models.cable.shared_joint.shares`),
the loop is opened at both commands:

    Lᵢⱼ = (C₁ᵢ·wⱼ·σⱼ + δᵢⱼ·C₂ᵢ)·Gⱼ

A gain, phase or delay that comes upon both commands alike makes the loop unstable where an eigenvalue of L passes −1
(generalised Nyquist: MacFarlane and Postlethwaite, 1977). Of both eigenvalues the one is taken whose motion the joint
shows. In the other the motors go against each other, the joint stands, and with it goes the co-contraction: no law
feeds that back, so that laws with an integral or a model of their cable have a pole there at one or beyond it. How far
the motors really part, a trial says.
"""

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


class SideLoop(NamedTuple):
    """One side near rest, in the joint's coordinate."""

    servo: Servo
    delay: int
    """[cycles]"""
    slope: float
    """Motion of the cable's end per motor motion [rad/rad]."""
    law: LawModel


class Taut(NamedTuple):
    """Which cables pull."""

    up: bool
    down: bool


BOTH, UP_ALONE, DOWN_ALONE = Taut(True, True), Taut(True, False), Taut(False, True)


def reaches(up: SideLoop, down: SideLoop, load: JointLoad, taut: Taut) -> Array:
    """By how much the joint moves for each motor (2,) [rad/rad]."""
    share = shares(load, taut.up, taut.down)
    return np.array([share.up * up.slope, share.down * down.slope])


class PairMargins(NamedTuple):
    """What linear analysis says of a pair."""

    joint: Margins
    """Of the loop that the joint shows."""
    apart: float
    """Largest magnitude of a pole with which the motors part while the joint stands; 0 of none [–]."""


def pair_margins(up: SideLoop, down: SideLoop, load: JointLoad, taut: Taut, dt: float) -> PairMargins:
    """Margins of the pair.

    Args:
        up: the side that pulls the joint up.
        down: the other.
        load: what they pull at.
        taut: which cables do.
        dt: sample time [s].
    """
    sides, reach, omega = (up, down), reaches(up, down, load, taut), frequencies(dt)
    moved = [servo_response(side.servo, dt, side.delay, omega) for side in sides]
    by_joint = [response(side.law.by_joint, omega, dt) for side in sides]
    by_motor = [response(side.law.by_motor, omega, dt) for side in sides]
    loop = np.empty((len(omega), 2, 2), np.complex128)
    for i in (0, 1):
        for j in (0, 1):
            loop[:, i, j] = (by_joint[i] * reach[j] + (i == j) * by_motor[i]) * moved[j]
    values, vectors = np.linalg.eig(loop)
    shows = np.abs(np.einsum("nj,njk->nk", np.column_stack(moved) * reach, vectors))
    seen = values[np.arange(len(omega)), np.argmax(shows, axis=1)]
    poles, apart = pair_poles(up, down, reach, dt)
    return PairMargins(margins_of(seen, poles[~apart], dt), float(np.max(np.abs(poles[apart]), initial=0.0)))


def pair_poles(up: SideLoop, down: SideLoop, reach: Array, dt: float) -> tuple[Complex, NDArray[np.bool_]]:
    """Poles of the closed loop of both sides, and which of them are of the motors against each other.

    Args:
        up: the side that pulls the joint up.
        down: the other.
        reach: see `reaches`.
        dt: sample time [s].
    """
    sides = (up, down)
    motors = [servo_model(side.servo, dt, side.delay, 1.0) for side in sides]
    ends = np.cumsum([0, len(motors[0].a), len(motors[1].a), len(up.law.a), len(down.law.a)])
    place = [slice(ends[k], ends[k + 1]) for k in range(4)]
    whole, angles = np.zeros((ends[-1], ends[-1])), np.zeros((2, ends[-1]))
    for i in (0, 1):
        angles[i, place[i]] = motors[i].c[0]
    joint = reach @ angles
    for i, side in enumerate(sides):
        law, seen = place[2 + i], np.vstack([joint, angles[i]])
        whole[law] = side.law.b @ seen
        whole[law, law] += side.law.a
        asked = side.law.d[None, :] @ seen  # minus the command
        asked[:, law] += side.law.c
        whole[place[i]] = -motors[i].b @ asked
        whole[place[i], place[i]] += motors[i].a
    poles, modes = np.linalg.eig(whole)
    slopes = np.array([side.slope for side in sides])
    alike = np.sum(reach / slopes) * np.max(np.abs(slopes[:, None] * (angles @ modes)), axis=0)
    return poles, np.abs(joint @ modes) < APART * alike
