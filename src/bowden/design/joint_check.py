"""The motors that share a joint, as the check judges them: all as one.

They are one linear loop: the margins are of its joint, the poles also of what the joint does not show.

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

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.control.stability import Margins, frequencies, margins_of, response, servo_model, servo_response
from bowden.core.units import DEGREES, RADIANS
from bowden.design.check import Array, Bends, Complex, Laws, LinearLoop, Visited, check_motors, largest_change, usable
from bowden.design.check_result import Check, Point
from bowden.design.limit_cycle import AMPLITUDES, MEASURED, describing_function
from bowden.design.linear_plant import slopes_of
from bowden.design.linearise import LawModel, linearise
from bowden.design.trial import AFTER, Bounds, Trial, judged, motion
from bowden.models.cable.bouc_wen import BoucWen
from bowden.models.cable.shared_joint import JointLoad, shares
from bowden.models.drive.servo import Servo
from bowden.plants.plant import Plant, changed
from bowden.plants.transmission import transmission
from bowden.records.trace import Trace
from bowden.sim.joint import CabledJoint, Range, simulate_joint
from bowden.sim.parting import asked_by, parting_of

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


@dataclass(frozen=True)
class _SeveralMotors:
    """Several motors on one joint (`bowden.design.check.Subject`)."""

    joint: CabledJoint
    laws: Laws
    bends: Sequence[Range]
    stroke: Range

    @property
    def plants(self) -> Sequence[Plant]:
        return tuple(one.bench for one in self.joint.motors)

    def trial(self, bends: Bends, moving: float, later: int) -> tuple[Sequence[Trial], float]:
        motors = (one._replace(bench=changed(one.bench, delay=one.bench.delay + later)) for one in self.joint.motors)
        joint = self.joint._replace(motors=tuple(motors)) if later else self.joint
        traces = simulate_joint(
            joint.at_bends(bends),
            self.laws,
            motion(self.stroke, moving),
            duration=moving + AFTER,
            initial_motors=joint.resting_motors(self.stroke[0], bends),
        )
        length = abs(self.stroke[1] - self.stroke[0])
        bounds = Bounds(length, 2.0 * self.dead_zone(bends) + RADIANS, 0.0)
        return [judged(one, length, moving, bounds) for one in traces], _went_apart(joint, bends, self.stroke, traces)

    def linear(
        self, ends: Sequence[Bends], estimates: Sequence[Visited], width: float, *, reversals: bool
    ) -> list[LinearLoop]:
        motors, dt, found = self.joint.motors, self.joint.first.sample_time, list[LinearLoop]()
        said = ["all cables taut", *(f"{one.name} alone taut" for one in motors)]
        for values in estimates:
            models = [
                linearise(law, dt, width=width, estimates=one) for law, one in zip(self.laws, values, strict=True)
            ]
            jump = max(largest_change(model) for model in models) * self.joint.first.joint_encoder.resolution
            own = dict(values[0])
            for one, more in zip(motors[1:], values[1:], strict=True):
                own |= {f"{one.name}: {name}": value for name, value in more.items()}
            for bends in ends:
                others = " and ".join(f"{bend * DEGREES:.0f}°" for bend in bends[1:])
                beside = "" if len({*bends}) == 1 else f", with other bends of {others}"
                each = [
                    slopes_of(one.bench, bend, one.own_stroke(self.stroke))
                    for one, bend in zip(motors, bends, strict=True)
                ]
                for slopes in itertools.product(*each):
                    loops = [
                        MotorLoop(one.bench.servo, one.bench.delay, slope, model)
                        for one, slope, model in zip(motors, slopes, models, strict=True)
                    ]
                    for taut, at in zip(cases(len(motors)), said, strict=True):
                        margins = joint_margins(loops, self.joint.load, taut, dt)
                        reach = float(np.sum(reaches(loops, self.joint.load, taut)))
                        point = Point(bends[0], reach, own, margins.joint, at + beside, jump)
                        found.append(LinearLoop(point, bends, at, margins.apart))
        return found

    def response(self, bends: Bends) -> tuple[Array, Complex]:
        motors = self.joint.motors
        amplitudes = AMPLITUDES if all(isinstance(one.bench.cable, BoucWen) for one in motors) else MEASURED
        share = shares(self.joint.load, (True,) * len(motors))
        gains = sum(
            part * describing_function(one.bench, bend, one.own_stroke(self.stroke), amplitudes)[1]
            for part, one, bend in zip(share, motors, bends, strict=True)
        )
        return amplitudes, np.asarray(gains)  # what all motors make of it that go alike

    def dead_zone(self, bends: Bends) -> float:
        each = zip(self.joint.motors, bends, strict=True)
        found = [(one.sign, transmission(one.bench, bend, one.own_stroke(self.stroke))) for one, bend in each]
        ways = [max(one.slope for way, one in found if way == sign) for sign in (1.0, -1.0)]
        return max(one.dead_zone for _, one in found) + max(0.0, -self.joint.co_contraction) * sum(ways)

    def most_apart(self) -> float:
        each_two = itertools.combinations(range(len(self.laws)), 2)
        return min(parting_of(self.joint, self.bends, self.stroke, i, j).most for i, j in each_two)


def check_joint(joint: CabledJoint, laws: Laws, *, bends: Sequence[Range], stroke: Range, seed: int = 1) -> Check:
    """Judge laws on one joint: `check_motors` of all its motors.

    The linear loops of all motors are one (`bowden.design.joint_check`), for all cables taut and for each alone.

    Args:
        joint: with its motors.
        laws: of each motor.
        bends: smallest and largest of each motor's sheath [rad]; every one is tried with every one of the others, since
            it is where they differ most that the cables disagree most.
        stroke: ends of the trials' motion [rad].
        seed: of the encoders' noise.

    Raises:
        ParameterError: gains that are not finite, bends or a stroke that cannot be, motors that no one loop can have,
            or whose cables do not follow them.
    """
    each = [usable(law, own, stroke) for law, own in zip(laws, bends, strict=True)]
    return check_motors(_SeveralMotors(joint.seeded(seed), laws, bends, stroke), tuple(itertools.product(*each)))


def _went_apart(joint: CabledJoint, bends: Bends, stroke: Range, traces: Sequence[Trace]) -> float:
    """How much further, or less far, motors came to pull against each other than joint and co-contraction ask [rad].

    Each by its own cable (`bowden.sim.parting`): motors that go alike behind cables of two slopes pull ever further, or
    let go.
    """
    off = []
    for one, bend, trace in zip(joint.motors, bends, traces, strict=True):
        asked = asked_by(one, bend, stroke)
        off.append(trace["motor"] - asked.offset - asked.way * trace["joint"])
    apart = 0.5 * (np.max(off, axis=0) - np.min(off, axis=0))
    return float(np.max(apart, initial=0.0, where=np.isfinite(apart)))
