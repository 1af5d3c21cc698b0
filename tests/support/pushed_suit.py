"""A suit that moves by its wearer's push: stable against whom, and how little of the suit one feels.

**Stability.** A wearer of some stiffness and damping wants the elbow at 45° while the suit begins at 60°. The run
counts as stable where the elbow has come to rest: its speed over the last two seconds is below `QUIET` RMS.

**Transparency.** A wearer moves the elbow as a sine of 0.5 Hz; the figures are those of `bowden.design.felt`. A stiff
wearer (`FIRM`) makes the same motion whatever the suit does, so that the figures compare.
"""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from bowden.control.admittance.push import push_source
from bowden.control.admittance.virtual_elbow import Admittance
from bowden.control.law import Law
from bowden.control.reference import PointToPoint
from bowden.core.units import RADIANS
from bowden.models.suit.arm import Wearer
from bowden.plants.pushing import push_of
from bowden.plants.suit_parts import Suit
from bowden.records.trace import Trace
from bowden.sim.run import simulate

MIDDLE = 45.0 * RADIANS
"""Of the elbow's range [rad]."""
FIRM = (100.0, 3.0)
"""Stiffness [N·m/rad] and damping [N·m·s/rad] of a wearer who makes the motion that they want."""
QUIET = 0.02
"""Speed of an elbow that counts as at rest [rad/s]."""
_BEGIN = 60.0 * RADIANS
_TAIL = 2.0


ADMITTANCE = Admittance()
"""The default virtual elbow."""


@dataclass(frozen=True)
class PushedReference:
    """How the reference is made of the wearer's push."""

    law: Law
    admittance: Admittance = ADMITTANCE
    estimated: bool = False
    carried: float = 0.0
    """Share of the arm's weight that the suit holds up; the wearer holds the rest [–]."""


def swinging(
    amplitude: float, *, frequency: float = 0.5, firmness: tuple[float, float] = FIRM, share: float = 1.0
) -> Wearer:
    """A wearer who moves the elbow about its middle.

    Args:
        amplitude: [rad].
        frequency: [Hz].
        firmness: stiffness and damping behind the motion.
        share: of the arm's weight that the wearer carries.
    """
    return Wearer(
        share=share,
        stiffness=firmness[0],
        damping=firmness[1],
        centre=MIDDLE,
        swing=amplitude,
        swing_frequency=frequency,
    )


def back_driven(suit: Suit, law: Law, wearer: Wearer, *, powered: bool = False, duration: float = 12.0) -> Trace:
    """The suit without admittance: its drive switched off, or holding the middle."""
    hold = PointToPoint((0.0, 1e6), (MIDDLE, MIDDLE))
    return simulate(suit._replace(wearer=wearer, powered=powered), law, hold, duration=duration)


def pushed(
    suit: Suit,
    how: PushedReference,
    wearer: Wearer,
    *,
    believed: Suit | None = None,
    duration: float = 12.0,
    begin: float = MIDDLE,
    seed: int = 0,
) -> Trace:
    """The suit with admittance.

    Args:
        suit: as it is.
        how: the reference is made.
        wearer: what they do.
        believed: the suit as the source believes it to be; as it is, where it is not given.
        duration: [s].
        begin: motor angle before the start [rad].
        seed: of the sensors.
    """
    source = push_source(
        push_of(believed or suit, how.law, how.admittance, estimated=how.estimated, carried=how.carried)
    )
    hold = PointToPoint((0.0, 1e6), (begin, begin))
    return simulate(suit._replace(wearer=wearer), how.law, hold, duration=duration, source=source, seed=seed)


@dataclass(frozen=True)
class Settled:
    """One wearer of the sweep."""

    stiffness: float
    """[N·m/rad]"""
    damping: float
    """[N·m·s/rad]"""
    speed: float
    """RMS of the elbow's speed over the last two seconds; infinite where the run ran away [rad/s]."""

    @property
    def stable(self) -> bool:
        """Whether the elbow has come to rest."""
        return self.speed < QUIET


def sweep(
    suit: Suit,
    how: PushedReference,
    stiffnesses: Sequence[float],
    dampings: Sequence[float],
    *,
    believed: Suit | None = None,
    duration: float = 8.0,
    seed: int = 0,
) -> Iterator[Settled]:
    """Every stiffness with every damping; the wearer carries what the suit does not."""
    for stiffness, damping in itertools.product(stiffnesses, dampings):
        wearer = Wearer(share=1.0 - how.carried, stiffness=stiffness, damping=damping, centre=MIDDLE)
        run = pushed(suit, how, wearer, believed=believed, duration=duration, begin=_BEGIN, seed=seed)
        tail = run.time >= duration - _TAIL
        speed = float(np.sqrt(np.mean(np.square(run["joint_velocity"][tail])))) if run.ended else np.inf
        yield Settled(stiffness, damping, speed)


def misjudged(suit: Suit) -> Suit:
    """A suit that is not what its source believes: each part off by as much as one may expect.

    Cables 20 % stiffer, play 20 % narrower, drive's friction 10 % less, flex sensor 0.4° and 1 % off.
    """
    cable = suit.flexor._replace(stiffness=1.2 * suit.flexor.stiffness, half_width=0.8 * suit.flexor.half_width)
    return suit._replace(
        flexor=cable,
        extensor=cable,
        motor=suit.motor._replace(friction=0.9 * suit.motor.friction),
        joint_sensor=suit.joint_sensor._replace(offset=0.4 * RADIANS, gain=0.01),
    )
