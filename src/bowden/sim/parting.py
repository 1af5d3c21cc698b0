"""How far motors on one joint part, and how far they may: one rule, for the check and for the supervisor.

Each motor is to be where its own cable asks it to be, with the joint at q: mᵢ = oᵢ + q/σᵢ + sᵢ·c in the joint's
coordinate, the co-contraction c being no part of what is counted above the drive, o where the cable rests with the
joint at zero. What two of them are off by against each other, half of it for each:

    pᵢⱼ = ½·[(mᵢ − oᵢ − q/σᵢ) − (mⱼ − oⱼ − q/σⱼ)] = ½·[mᵢ − mⱼ − (oᵢ − oⱼ) − (1/σᵢ − 1/σⱼ)·q]

The ends of cables that pull either way are then 2σ·(c + p) apart, which is what stretches them: at p = −c both hang
slack, at p = c they pull against each other twice as hard as they are to. So p is borne up to c, and as far as angles
cannot show it. Those are off by half of each cable's dead zone, and by the degree that a joint at rest may move.
"""

from collections.abc import Sequence
from typing import NamedTuple

from bowden.core.units import RADIANS
from bowden.plants.bench import Bench
from bowden.plants.transmission import transmission
from bowden.sim.joint import CabledJoint, JointMotor, Range


class TautLine(NamedTuple):
    """Where a cable asks its motor to be, co-contraction aside, in the joint's coordinate: offset + way·joint."""

    offset: float
    """[rad]"""
    way: float
    """1/σ [rad/rad]."""
    dead: float
    """Half of the cable's dead zone, at the motor [rad]."""

    def at(self, joint: float) -> float:
        """The motor with the joint there [rad]."""
        return self.offset + self.way * joint


class Parting(NamedTuple):
    """How far two motors of a joint may be from where the joint asks them to be, each, at the motor."""

    most: float
    """Where the slopes of both cables are known [rad]."""
    bent: float
    """What comes on top where nobody knows how far the sheaths are bent just now: half of what their slopes between
    the ends of both bends make of it at the far end of the stroke [rad]."""
    offset: float
    """oᵢ − oⱼ, likewise in the middle [rad]."""
    slope: float
    """1/σᵢ − 1/σⱼ, each in the middle between the ends of its bends [rad/rad]."""
    lag: float
    """What comes on top of both for each speed of the motors, since one servo follows later than the other [s]."""


def asked_by(motor: JointMotor, bend: float, stroke: Range) -> TautLine:
    """Where a cable asks its motor to be: on a line through its rest in the middle of the stroke.

    Args:
        motor: of a joint.
        bend: of its sheath [rad].
        stroke: ends of the joint's motion [rad].

    Raises:
        ParameterError: a cable that does not follow its motor.
    """
    middle = 0.5 * (stroke[0] + stroke[1])
    rest = motor.sign * motor.bench.resting_motor(motor.sign * middle, bend)
    found = transmission(motor.bench, bend, motor.own_stroke(stroke))
    return TautLine(rest - middle / found.slope, 1.0 / found.slope, 0.5 * found.dead_zone / found.slope)


def parting_of(joint: CabledJoint, bends: Sequence[Range], stroke: Range, i: int = 0, j: int = 1) -> Parting:
    """How far two motors of a joint may part.

    Args:
        joint: with its motors.
        bends: smallest and largest of each motor's sheath [rad].
        stroke: ends of the joint's motion [rad].
        i: place of the one.
        j: place of the other.

    Raises:
        ParameterError: a cable that does not follow its motor.
    """
    two = joint.motors[i], joint.motors[j]
    found = [[asked_by(one, bend, stroke) for bend in own] for one, own in zip(two, (bends[i], bends[j]), strict=True)]
    dead = sum(max(one.dead for one in ends) for ends in found)
    spread = sum(max(abs(low.at(end) - high.at(end)) for end in stroke) for low, high in found)
    offsets, ways = ([0.5 * (low[k] + high[k]) for low, high in found] for k in (0, 1))
    lags = [_lag(one.bench) for one in two]
    return Parting(
        most=abs(joint.co_contraction) + 0.5 * dead + RADIANS,
        bent=0.25 * spread,
        offset=offsets[0] - offsets[1],
        slope=ways[0] - ways[1],
        lag=0.5 * abs(lags[0] - lags[1]),
    )


def _lag(bench: Bench) -> float:
    """How much later than its target a motor is at a steady speed [s]."""
    servo = bench.servo
    return 2.0 * servo.damping / servo.natural_frequency + bench.delay * bench.sample_time
