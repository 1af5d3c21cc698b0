"""How a plant's joint answers its motor: slopes, dead zone and describing function, known or measured in open loop.

Of the bench they are known by formula. Any other plant is moved slowly in simulation, under commands alone: up and down
through its stroke for the slopes and the dead zone, and to and fro about the stroke's middle, once for each amplitude,
for the describing function. A suit is moved by a drive without friction, whose motor goes where it is sent, through 0
to 90° at least, on a wearer who does not move of their own.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import ParameterError
from bowden.core.kernel import kernel, reached, specialise
from bowden.core.nested import form_of, numbers_of
from bowden.core.units import RADIANS
from bowden.models.cable.bouc_wen import saturation
from bowden.models.cable.sheath import slope_factor, width
from bowden.plants.bench import Bench
from bowden.plants.estimated import Estimated, measured_plant
from bowden.plants.plant import (
    Dynamics,
    Plant,
    SheathState,
    plant_advance,
    plant_look,
    plant_rest,
    refuse_no_number,
    sheath_state,
)
from bowden.plants.settled_estimate import settled_estimate
from bowden.plants.suit_parts import Suit

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

_STROKE_TIME = 5.0
"""Of the slow motion from one end to the other [s]."""
_SWING_TIME = 2.0
"""Period of the small motions [s]."""
_SWINGS = 3
_FLEXED = 90.0 * RADIANS
"""Angle of the elbow up to which a suit is moved at least [rad]."""
_MUCH = 1e4
"""Current [A] and voltage [V] that nothing of a suit asks for."""
_PARTS = 50
"""Stretches of the stroke whose slope is taken."""


class Transmission(NamedTuple):
    """From the motor's angle to the joint's, at one bend."""

    slope: float
    """With the play taken up [rad/rad]."""
    steepest: float
    """The largest anywhere on the loop [rad/rad]."""
    reversal: float
    """Right after the motor has turned; below 0 where the joint first moves the wrong way [rad/rad]."""
    dead_zone: float
    """Height of the loop: what the joint loses in a reversal [rad]."""


def transmission(plant: Plant, bend: float, stroke: tuple[float, float]) -> Transmission:
    """A plant's slopes and dead zone in a sheath of a total `bend` [rad], over a `stroke` of the joint [rad].

    Raises:
        ParameterError: a plant that cannot be moved through its stroke, or that does not follow its motor.
    """
    plant = measured_plant(plant)
    cable = plant.formula if isinstance(plant, Bench) else None
    if cable is not None:
        slope = cable.slope * float(slope_factor(bend, plant.sheath))
        steepest = 1.0 + float(saturation(cable)) ** cable.exponent  # of Eq. 7 over ρ, right after a reversal
        after = slope + cable.hysteresis_gain * cable.rate * steepest
        height = 2.0 * abs(cable.hysteresis_gain) * float(width(bend, plant.sheath)) * float(saturation(cable))
        return Transmission(slope, max(slope, after), cable.slope + cable.hysteresis_gain * cable.rate, height)
    if isinstance(plant, Suit):
        motor = plant.motor._replace(friction=0.0, efficiency=1.0, current_limit=_MUCH, supply=_MUCH)
        plant, stroke = _calm(plant)._replace(motor=motor), (min(0.0, *stroke), max(_FLEXED, *stroke))
    low, high = (plant.resting_motor(angle, bend) for angle in stroke)
    return _swept(_Key(plant, plant.dynamics(), sheath_state(plant.sheath, bend)), low, high)


def measured_response(plant: Plant, bend: float, stroke: tuple[float, float], amplitudes: Array) -> Complex:
    """The joint's answer to motor = A·sin about the stroke's middle, at the same frequency, for each amplitude (k,).

    Args:
        plant: any.
        bend: total bend of its sheath [rad].
        stroke: of the joint [rad].
        amplitudes: of the motor (k,) [rad].
    """
    plant = measured_plant(plant)
    key = _Key(plant, plant.dynamics(), sheath_state(plant.sheath, bend))
    return _swung(key, plant.resting_motor(0.5 * (stroke[0] + stroke[1]), bend), tuple(amplitudes.tolist()))


class Unrest(NamedTuple):
    """How far a joint is from where it is sent, with no law: what no trial can hold against one."""

    off: float
    """Largest distance between command and joint on a slow way through the stroke and back [rad]."""
    span: float
    """Of the joint while its motor is held [rad]."""


def unrest(plant: Plant, bend: float, stroke: tuple[float, float], held: float) -> Unrest:
    """Effect of a suit's friction and weight, of its wearer's own motion, and of what an estimated joint's sensor adds,
    with no law; none for any other plant.

    Args:
        plant: any.
        bend: total bend of its sheath [rad].
        stroke: of the joint [rad].
        held: how long the motor is held in the middle of the stroke [s].
    """
    span = settled_estimate(plant.model, plant.sample_time).span if isinstance(plant, Estimated) else 0.0
    plant = measured_plant(plant)
    if not isinstance(plant, Suit):
        return Unrest(0.0, span)
    sheath, calm, (low, high) = sheath_state(plant.sheath, bend), _calm(plant), stroke
    off = _carried(_Key(calm, calm.dynamics(), sheath), low, high)
    if calm != plant:
        key = _Key(plant, plant.dynamics(), sheath)
        span += _moved_by_wearer(key, 0.5 * (low + high), round(held / plant.sample_time))
    return Unrest(off, span)


def _calm(suit: Suit) -> Suit:
    """The suit on the same wearer, who neither trembles nor swings."""
    return suit._replace(wearer=suit.wearer._replace(tremor=0.0, swing=0.0))


class _Key:
    """A plant in a sheath, equal to another that moves alike: measurements are kept by it."""

    def __init__(self, plant: Plant, dynamics: Dynamics, sheath: SheathState) -> None:
        self.dynamics, self.sheath, self.dt = dynamics, sheath, plant.sample_time
        parameters = dynamics.plant
        kernels = tuple(dynamics.kernels().items())
        self._name = (kernels, tuple(numbers_of(parameters)), form_of(parameters), sheath, self.dt)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Key) and self._name == other._name

    def __hash__(self) -> int:
        return hash(self._name)

    def moved(self, commands: Array) -> Array:
        """Motor and joint under commands, from rest at the first (2, n) [rad]."""
        record = np.empty((2, len(commands)))
        loop = specialise(open_loop, self.dynamics.name, **reached(open_loop, self.dynamics.kernels()))
        with self.dynamics.explained():
            loop(self.dynamics.plant, self.sheath, commands, record)
        for k in np.flatnonzero(~np.isfinite(record).all(axis=0))[:1]:
            then = dict(zip(("motor", "joint"), record[:, k].tolist(), strict=True))
            refuse_no_number(self.dynamics, then, float(k * self.dt))
        return record


@kernel
def open_loop(plant: object, sheath: SheathState, commands: Array, record: Array) -> None:
    """Fill `record` (2, n) with the true motor and joint of a plant at rest at the first command, then under all."""
    body = plant_rest(plant, commands[0], sheath)
    for k in range(commands.size):
        seen = plant_look(plant, body)
        record[0, k], record[1, k] = seen.motor, seen.joint
        body = plant_advance(plant, body, commands[k], sheath, sheath)


@lru_cache(64)
def _swept(key: _Key, low: float, high: float) -> Transmission:
    """Down from the top of the second way up, and up again: two branches over the same motor angles."""
    count = round(_STROKE_TIME / key.dt)
    motor, joint = key.moved(_to_and_fro(low, high, count))
    ways = [slice(k * count, (k + 1) * count + 1) for k in (1, 2)]
    grid = np.linspace(motor[ways[1]].min(), motor[ways[1]].max(), _PARTS + 1)[1:-1]
    down, up = (_along(motor[way], joint[way], grid) for way in ways)
    slopes = [np.diff(branch) / np.diff(grid) for branch in (down, up)]
    third = len(slopes[0]) // 3
    taken_up = float(np.median(np.concatenate([slopes[0][:third], slopes[1][-third:]])))
    found = Transmission(
        slope=taken_up,
        steepest=max(taken_up, float(max(part.max() for part in slopes))),
        reversal=float(min(slopes[0][-1], slopes[1][0])),
        dead_zone=float(np.max(np.abs(down - up))),
    )
    if not (np.isfinite(found).all() and found.slope != 0.0):
        raise ParameterError(
            f"the plant {key.dynamics.name!r} does not follow its motor through its stroke: {found}",
            expected="a joint that moves with the motor",
        )
    return found


def _to_and_fro(low: float, high: float, count: int) -> Array:
    """Slowly from one end to the other and back, twice (4·count + 1,) [rad]."""
    turns = np.pi * np.arange(4 * count + 1) / count
    return np.asarray(0.5 * (low + high) - 0.5 * (high - low) * np.cos(turns))


@lru_cache(64)
def _carried(key: _Key, low: float, high: float) -> float:
    """`Unrest.off`: of a plant whose motor is counted in the joint's coordinate."""
    commands = _to_and_fro(low, high, round(_STROKE_TIME / key.dt))
    return float(np.max(np.abs(key.moved(commands)[1] - commands)))


@lru_cache(64)
def _moved_by_wearer(key: _Key, motor: float, cycles: int) -> float:
    """`Unrest.span`."""
    return float(np.ptp(key.moved(np.full(cycles, motor))[1]))


def _along(motor: Array, joint: Array, grid: Array) -> Array:
    """The joint at the grid's motor angles (k,), of a motion one way."""
    order = np.argsort(motor, kind="stable")
    return np.interp(grid, motor[order], joint[order])


@lru_cache(64)
def _swung(key: _Key, centre: float, amplitudes: tuple[float, ...]) -> Complex:
    count = round(_SWING_TIME / key.dt)
    phase = 2.0 * np.pi * np.arange(_SWINGS * count) / count
    last = np.exp(-1j * phase[-count:])
    gains = np.empty(len(amplitudes), np.complex128)
    for i, amplitude in enumerate(amplitudes):
        motor, joint = key.moved(centre + amplitude * np.sin(phase))[:, -count:]
        gains[i] = np.sum(joint * last) / np.sum(motor * last)
    return gains
