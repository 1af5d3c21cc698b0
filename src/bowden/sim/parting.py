"""How far two motors on one joint part, and how far they may: one rule, for the check and for the supervisor.

Each motor is to be where its own cable asks it to be, with the joint at q: m₁ = o₁ + q/σ₁ + c and m₂ = o₂ + q/σ₂ − c in
the joint's coordinate, the co-contraction c being no part of what is counted above the drive, o where the cable rests
with the joint at zero. What both are off by, each in the direction in which it pulls, half of it for each:

    p = ½·[(m₁ − o₁ − q/σ₁) − (m₂ − o₂ − q/σ₂)] = ½·[m₁ − m₂ − (o₁ − o₂) − (1/σ₁ − 1/σ₂)·q]

The cables' ends are then 2σ·(c + p) apart, which is what stretches them: at p = −c both hang slack, at p = c they pull
against each other twice as hard as they are to. So p is borne up to c, and as far as angles cannot show it. Those are
off by half of each cable's dead zone, and by the degree that a joint at rest may move.
"""

from typing import NamedTuple

from bowden.core.units import RADIANS
from bowden.plants.bench import Bench
from bowden.plants.cable_plant import CablePlant
from bowden.plants.transmission import transmission
from bowden.sim.pair import PairPlant, PairSide

Range = tuple[float, float]
"""Smallest and largest bend of one sheath, or ends of a stroke [rad]."""


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
    """How far each motor of a pair may be from where the joint asks it to be, at the motor."""

    most: float
    """Where the slopes of both cables are known [rad]."""
    bent: float
    """What comes on top where nobody knows how far the sheaths are bent just now: half of what their slopes between
    the ends of both bends make of it at the far end of the stroke [rad]."""
    offset: float
    """o₁ − o₂, likewise in the middle [rad]."""
    slope: float
    """1/σ₁ − 1/σ₂ of agonist and antagonist, each in the middle between the ends of its bends [rad/rad]."""
    lag: float
    """What comes on top of both for each speed of the motors, since one servo follows later than the other [s]."""


def asked_by(side: PairSide, bend: float, stroke: Range) -> TautLine:
    """Where a side's cable asks its motor to be: on a line through its rest in the middle of the stroke.

    Args:
        side: of a pair.
        bend: of its sheath [rad].
        stroke: ends of the joint's motion [rad].

    Raises:
        ParameterError: a cable that does not follow its motor.
    """
    middle = 0.5 * (stroke[0] + stroke[1])
    rest = side.sign * side.bench.resting_motor(side.sign * middle, bend)
    found = transmission(side.bench, bend, side.own_stroke(stroke))
    return TautLine(rest - middle / found.slope, 1.0 / found.slope, 0.5 * found.dead_zone / found.slope)


def parting_of(pair: PairPlant, bends: tuple[Range, Range], stroke: Range) -> Parting:
    """How far the motors of a pair may part.

    Args:
        pair: both sides.
        bends: smallest and largest of each sheath, the agonist's first [rad].
        stroke: ends of the joint's motion [rad].

    Raises:
        ParameterError: a cable that does not follow its motor.
    """
    found = [[asked_by(side, bend, stroke) for bend in own] for side, own in zip(pair.sides, bends, strict=True)]
    dead = sum(max(one.dead for one in ends) for ends in found)
    spread = sum(max(abs(low.at(end) - high.at(end)) for end in stroke) for low, high in found)
    offsets, ways = ([0.5 * (low[i] + high[i]) for low, high in found] for i in (0, 1))
    lags = [_lag(side.bench) for side in pair.sides]
    return Parting(
        most=abs(pair.co_contraction) + 0.5 * dead + RADIANS,
        bent=0.25 * spread,
        offset=offsets[0] - offsets[1],
        slope=ways[0] - ways[1],
        lag=0.5 * abs(lags[0] - lags[1]),
    )


def _lag(bench: Bench | CablePlant) -> float:
    """How much later than its target a motor is at a steady speed [s]."""
    servo = bench.servo
    return 2.0 * servo.damping / servo.natural_frequency + bench.delay * bench.sample_time
