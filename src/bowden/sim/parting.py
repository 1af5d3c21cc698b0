"""How far two motors on one joint part, and how far they may: one rule, for the check and for the supervisor.

Each motor is to be where its own cable asks it to be, with the joint at q: m₁ = q/σ₁ + c and m₂ = q/σ₂ − c in the
joint's coordinate, the co-contraction c being no part of what is counted above the drive. What both are off by, each in
the direction in which it pulls, half of it for each:

    p = ½·[(m₁ − q/σ₁) − (m₂ − q/σ₂)] = ½·[m₁ − m₂ − (1/σ₁ − 1/σ₂)·q]

The cables' ends are then 2σ·(c + p) apart, which is what stretches them: at p = −c both hang slack, at p = c they pull
against each other twice as hard as they are to. So p is borne up to c, and as far as angles cannot show it. Those are
off by half of each cable's dead zone, and by the degree that a joint at rest may move.
"""

from typing import NamedTuple

from bowden.core.units import RADIANS
from bowden.plants.bench import Bench
from bowden.plants.cable_plant import CablePlant
from bowden.plants.transmission import transmission
from bowden.sim.pair import PairPlant

Range = tuple[float, float]
"""Smallest and largest bend of one sheath, or ends of a stroke [rad]."""


class Parting(NamedTuple):
    """How far each motor of a pair may be from where the joint asks it to be, at the motor."""

    most: float
    """Where the slopes of both cables are known [rad]."""
    bent: float
    """What comes on top where nobody knows how far the sheaths are bent just now: half of what their slopes between
    the ends of both bends make of it at the far end of the stroke [rad]."""
    slope: float
    """1/σ₁ − 1/σ₂ of agonist and antagonist, each in the middle between the ends of its bends [rad/rad]."""
    lag: float
    """What comes on top of both for each speed of the motors, since one servo follows later than the other [s]."""


def parting_of(pair: PairPlant, bends: tuple[Range, Range], stroke: Range) -> Parting:
    """How far the motors of a pair may part.

    Args:
        pair: both sides.
        bends: smallest and largest of each sheath, the agonist's first [rad].
        stroke: ends of the joint's motion [rad].

    Raises:
        ParameterError: a cable that does not follow its motor.
    """
    found = [
        [transmission(side.bench, bend, side.own_stroke(stroke)) for bend in own]
        for side, own in zip(pair.sides, bends, strict=True)
    ]
    dead = sum(max(0.5 * one.dead_zone / one.slope for one in ends) for ends in found)
    ways = [[1.0 / one.slope for one in ends] for ends in found]
    spread = sum(abs(low - high) for low, high in ways)
    middle = [0.5 * (low + high) for low, high in ways]
    lags = [_lag(side.bench) for side in pair.sides]
    return Parting(
        most=abs(pair.co_contraction) + 0.5 * dead + RADIANS,
        bent=0.25 * spread * max(abs(end) for end in stroke),
        slope=middle[0] - middle[1],
        lag=0.5 * abs(lags[0] - lags[1]),
    )


def _lag(bench: Bench | CablePlant) -> float:
    """How much later than its target a motor is at a steady speed [s]."""
    servo = bench.servo
    return 2.0 * servo.damping / servo.natural_frequency + bench.delay * bench.sample_time
