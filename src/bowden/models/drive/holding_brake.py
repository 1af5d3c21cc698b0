"""A holding brake on the motor's shaft, and when it is engaged: at rest, in place of the current that holds the load.

The common type of the field is taken: a spring or a magnet holds it engaged without current, a coil releases it. The
other type, a clutch that needs current to hold, is the same with its two powers exchanged.

    free ──target and motor at rest──▶ engaging ──engage_delay──▶ held ──motion──▶ releasing ──release_delay──▶ free

The motor has its current until the brake holds, and again from the moment that it is to be released. What is sent as
its target stands still from `engaging` to the end of `releasing`, so that motion waits until the shaft is free; then it
catches up. A shaft that slips under the load, and a run that may not be held, release it.
"""

from enum import IntEnum
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.kernel import kernel
from bowden.core.quantity import Quantity
from bowden.core.units import RADIANS

Array = NDArray[np.float64]


class HoldingBrake(NamedTuple):
    """A holding brake of the drive, engaged while the motor rests; a suit may have one.

    The defaults are those of a small brake that holds without current.
    """

    holding_torque: Annotated[
        float,
        Quantity("at the motor's shaft; beyond it the shaft slips; 0: there is no brake", "N·m", ge=0.0, le=100.0),
    ] = 0.0
    engage_delay: Annotated[float, Quantity("from the order until it holds", "s", shown="ms", ge=0.0, le=1000.0)] = (
        10e-3
    )
    release_delay: Annotated[
        float, Quantity("from the order until the shaft is free", "s", shown="ms", ge=0.0, le=1000.0)
    ] = 40e-3
    released_power: Annotated[float, Quantity("that the brake takes while it is released", "W", ge=0.0, le=1e3)] = 10.0
    engaged_power: Annotated[float, Quantity("that it takes while it is engaged", "W", ge=0.0, le=1e3)] = 0.0
    rest_time: Annotated[
        float, Quantity("for which target and motor have been at rest when it engages", "s", gt=0.0, le=1e3)
    ] = 0.3
    still: Annotated[
        float, Quantity("a target or a motor within this of where it was is at rest", "rad", gt=0.0, le=10.0)
    ] = 0.5 * RADIANS

    @property
    def enabled(self) -> bool:
        """True if there is one."""
        return self.holding_torque > 0.0


class BrakePhase(IntEnum):
    """Phase of the brake."""

    FREE = 0
    ENGAGING = 1
    """It is ordered to hold and does not yet; the motor has its current."""
    HELD = 2
    """It holds; the motor has no current."""
    RELEASING = 3
    """It is ordered to release and still holds; the motor has its current again."""


FREE, ENGAGING, HELD, RELEASING = BrakePhase


class BrakeState(NamedTuple):
    """State of the policy."""

    phase: BrakePhase
    since: float
    """Time in that phase; while it is free, at rest [s]."""
    target: float
    """The target where it came to rest [rad]."""
    motor: float
    """The motor where it came to rest [rad]."""
    sent: float
    """Target sent to the drive [rad]."""


@kernel
def brake_begin(motor: float) -> BrakeState:
    """Free, at rest at a `motor` angle [rad]."""
    return BrakeState(FREE, 0.0, motor, motor, motor)


@kernel
def brake_step(
    brake: HoldingBrake, state: BrakeState, target: float, motor: float, may_hold: bool, speed: float, dt: float
) -> BrakeState:
    """The policy one cycle later.

    Args:
        brake: its settings.
        state: before.
        target: where the motor is to go [rad].
        motor: where it is [rad].
        may_hold: False in a release, a stop and a preflight: the brake is then released before anything else.
        speed: at which the target that is sent catches up with the one that is asked for [rad/s].
        dt: length of the cycle [s].
    """
    phase, since, sent = state.phase, state.since + dt, state.sent
    rests = abs(target - state.target) <= brake.still and abs(motor - state.motor) <= brake.still  # no number does not
    moved = not rests
    if phase == RELEASING:
        if since >= brake.release_delay:
            return BrakeState(FREE, 0.0, target, motor, sent)
        return BrakeState(phase, since, state.target, state.motor, sent)
    if phase != FREE:
        if moved or not may_hold:
            return BrakeState(RELEASING, 0.0, target, motor, sent)
        if phase == ENGAGING and since >= brake.engage_delay:
            return BrakeState(HELD, 0.0, state.target, state.motor, sent)
        return BrakeState(phase, since, state.target, state.motor, sent)
    sent = max(sent - speed * dt, min(sent + speed * dt, target))
    if moved or not may_hold:
        return BrakeState(phase, 0.0, target, motor, sent)
    if since >= brake.rest_time and sent == target:
        return BrakeState(ENGAGING, 0.0, state.target, state.motor, sent)
    return BrakeState(phase, since, state.target, state.motor, sent)


@kernel
def grips(state: BrakeState) -> bool:
    """True if the shaft is held; an engaging brake does not hold yet, a releasing one still does."""
    return state.phase == HELD or state.phase == RELEASING


def brake_power(brake: HoldingBrake, phase: Array) -> Array:
    """Power that the brake itself takes in each phase of a run [W]."""
    engaged = (phase == ENGAGING) | (phase == HELD)
    return np.where(engaged, brake.engaged_power, brake.released_power)
