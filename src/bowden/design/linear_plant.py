"""A plant as linear loops see it: motor and joint under a command, once for every slope that is to be expected.

Of a cable behind a motor it is the servo with its delay, and a slope from motor to joint. Of a suit it is the spool
and the arm that hangs in its springs (`bowden.plants.suit_linear`), at both ends of the stroke and in its middle, with
the extensor taut and slack.
"""

import itertools
import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from bowden.control.stability import Margins, StateSpace, frequencies, margins, response, servo_model, servo_response
from bowden.core.units import DEGREES
from bowden.design.estimate_model import behind_estimate
from bowden.design.linearise import LawModel
from bowden.models.cable.sheath import slope_factor
from bowden.models.drive.servo import Servo
from bowden.plants.estimated import Estimated, measured_plant
from bowden.plants.plant import Plant
from bowden.plants.settled_estimate import settled_estimate
from bowden.plants.suit_linear import linear_suit, without_friction
from bowden.plants.suit_parts import Suit
from bowden.plants.transmission import transmission

Complex = NDArray[np.complex128]

OF_A_SUIT = (
    "the linear loop is spool and arm in their springs; friction, play, the limits of the drive and the flex sensor's "
    "loop are in the trials alone, so these decide"
)
"""What the margins of a suit leave out."""


class OperatingPoint(NamedTuple):
    """Where a plant is taken as linear: an operating point."""

    bend: float
    """Of the sheath [rad]."""
    slope: float
    """Joint motion per motor motion [rad/rad]."""
    at: str = ""
    """What else, in words; empty where there is nothing else."""
    angle: float = math.nan
    """Of a suit's elbow [rad]."""
    taut: bool = True
    """Whether a suit's extensor is."""


class LinearPlant(NamedTuple):
    """A plant's linear loops: one for each point, and behind an estimate of the joint once for each of its gains."""

    plant: Plant
    points: tuple[OperatingPoint, ...]

    @property
    def places(self) -> tuple[OperatingPoint, ...]:
        """In the order in which `margins` has them."""
        return self.points * len(_gains(self.plant)) if isinstance(self.plant, Estimated) else self.points

    @property
    def leaves_out(self) -> str:
        """What the linear loops leave to the trials, where so much that they alone decide; else empty."""
        return OF_A_SUIT if isinstance(measured_plant(self.plant), Suit) else ""

    @property
    def alone(self) -> Plant | None:
        """A plant without all that, whose trial confirms or refutes a linear loop; None where nothing is left out."""
        measured = measured_plant(self.plant)
        if not isinstance(measured, Suit):
            return None
        alone = without_friction(measured)
        return cast(Plant, replace(self.plant, inner=alone)) if isinstance(self.plant, Estimated) else alone

    def margins(self, law: LawModel) -> Iterator[Margins]:
        """Of the loop at each place."""
        measured, laws = measured_plant(self.plant), laws_seen(self.plant, law)
        if isinstance(measured, Suit):
            for seen in laws:
                yield from _on_arms(measured, self.points, seen)
            return
        servo, dt, delay = measured.servo, measured.sample_time, measured.delay
        plant, answer = servo_model(servo, dt, delay, 1.0), _servo(servo, dt, delay)
        for seen, point in itertools.product(laws, self.points):
            yield margins(plant, seen.seen_through(point.slope), dt, answer)


def _on_arms(suit: Suit, places: Iterable[OperatingPoint], law: LawModel) -> Iterator[Margins]:
    """Of a suit on its arm."""
    dt = suit.sample_time
    of_joint, of_motor = (response(part, frequencies(dt), dt) for part in (law.by_joint, law.by_motor))
    for place in places:
        near = _on_arm(suit, place.angle, place.taut, place.bend)
        seen = law.b @ np.vstack([near.joint, near.motor])
        states, own = len(near.a), len(law.a)
        whole = np.zeros((states + own, states + own))
        whole[:states, :states], whole[states:, :states], whole[states:, states:] = near.a, seen, law.a
        through = np.hstack([law.d @ np.vstack([near.joint, near.motor]), law.c[0]])[None, :]
        loop = StateSpace(whole, np.vstack([near.b, np.zeros((own, 1))]), through, 0.0)
        yield margins(loop, _CLOSED, dt, near.joint_answer * of_joint + near.motor_answer * of_motor)


_CLOSED = StateSpace(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), 1.0)
"""What closes a loop that has the law in it."""


def laws_seen(plant: Plant, law: LawModel) -> list[LawModel]:
    """A law near rest from the true joint on: as it is, or behind the estimate of the joint's angle."""
    if not isinstance(plant, Estimated):
        return [law]
    return [behind_estimate(law, plant.model, gains, plant.sample_time) for gains in _gains(plant)]


def _gains(plant: Estimated) -> tuple[tuple[float, float], ...]:
    return settled_estimate(plant.model, plant.sample_time).gains


def linear_plant(
    plant: Plant, bends: Iterable[float], stroke: tuple[float, float], *, reversals: bool = True
) -> LinearPlant:
    """The plant's linear loops.

    Args:
        plant: any.
        bends: of its sheath [rad].
        stroke: of the joint [rad].
        reversals: whether the slope after a reversal counts too, where it is steeper than the one with the play taken
            up. Of a suit neither is measured: its springs are known.

    Raises:
        ParameterError: a plant that does not follow its motor.
    """
    ends = tuple(dict.fromkeys(bends))
    if isinstance(plant, Estimated):
        return LinearPlant(plant, linear_plant(plant.inner, ends, stroke, reversals=reversals).points)
    if isinstance(plant, Suit):
        low, high = stroke
        corners = itertools.product(ends, (low, 0.5 * (low + high), high), (True, False))
        return LinearPlant(plant, tuple(_in_suit(plant, *corner) for corner in corners))
    each = ((bend, slope) for bend in ends for slope in slopes_of(plant, bend, stroke, reversals=reversals))
    return LinearPlant(plant, tuple(OperatingPoint(*one) for one in each))


def _in_suit(suit: Suit, bend: float, angle: float, taut: bool) -> OperatingPoint:
    at = f"elbow at {angle * DEGREES:.0f}°, extensor {'taut' if taut else 'slack'}"
    return OperatingPoint(bend, _on_arm(suit, angle, taut, bend).slope, at, angle, taut)


def slopes_of(plant: Plant, bend: float, stroke: tuple[float, float], *, reversals: bool = True) -> list[float]:
    """The slope with the play taken up and, if `reversals` count, the one after a reversal where it is steeper."""
    found = transmission(plant, bend, stroke)
    return [found.slope, found.steepest] if reversals and found.steepest > found.slope else [found.slope]


@lru_cache(8)
def _servo(servo: Servo, dt: float, delay: int) -> Complex:
    """From command to motor at the frequencies of `margins` (4000,); kept, since many laws are tried on one servo."""
    return servo_response(servo, dt, delay, frequencies(dt))


class _Near(NamedTuple):
    """A suit near rest."""

    a: NDArray[np.float64]
    b: NDArray[np.float64]
    joint: NDArray[np.float64]
    motor: NDArray[np.float64]
    slope: float
    joint_answer: Complex
    """From command to joint at the frequencies of `margins` (4000,)."""
    motor_answer: Complex
    """To the motor, likewise."""


@lru_cache(64)
def _on_arm(suit: Suit, angle: float, taut: bool, bend: float) -> _Near:
    """Kept, since many laws are tried on one suit."""
    factor = float(slope_factor(bend + suit.posture * angle, suit.sheath))
    found, dt = linear_suit(suit, angle, extensor=taut, slope_factor=factor), suit.sample_time
    answers = [response(StateSpace(found.a, found.b, row, 0.0), frequencies(dt), dt) for row in found[2:4]]
    joint = (1.0 + suit.joint_sensor.gain) * found.joint
    scaled = (1.0 + suit.joint_sensor.gain) * answers[0]
    return _Near(found.a, found.b, joint, found.motor, found.slope, scaled, answers[1])
