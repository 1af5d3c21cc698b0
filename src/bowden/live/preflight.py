"""Before a run: are the limits sensible, are the sensors alive, does a small motion of the motor move the joint?

The current must change in that motion, since it accelerates a motor and pulls a cable. And it must pull where the rig
says so: of the mean current out and back, inertia and Coulomb friction take as much away as they add. What is left is
the cable's load, which no cable has in the direction in which it is let out.

Where a load cell says what the cable pulls, its reading must rise as the motor pulls, by more than it changed at rest.
"""

import math
from collections.abc import Iterable
from enum import IntEnum
from typing import NamedTuple

from bowden.control.knowledge import WIDEST
from bowden.core.errors import SafetyError
from bowden.core.signals import DriveReading, DriveState
from bowden.core.units import RADIANS
from bowden.models.drive.encoder import Encoder
from bowden.models.minimum_jerk import minimum_jerk_share
from bowden.plants.suit_parts import Suit, spool_friction
from bowden.rig.consistent import Basis, contradictions
from bowden.safety.limits import Limits
from bowden.safety.state import PreflightResult


class Preflight(NamedTuple):
    """The settings of a preflight."""

    listen: float = 0.5
    """Time for which the sensors are observed before anything moves [s]."""
    first: float = 2.0 * RADIANS
    """First motion of the motor [rad]."""
    largest: float = 30.0 * RADIANS
    """Largest motion; the cable's whole play must lie within it [rad]."""
    speed: float = 20.0 * RADIANS
    """Mean speed of a motion [rad/s]."""
    moved: float = 0.5 * RADIANS
    """Motion of the joint that counts [rad]."""
    noise: float = 0.3 * RADIANS
    """Largest span of an angle at rest [rad]."""
    settle: float = 0.1
    """Wait after each motion [s]."""
    follows: float = 0.7
    """Share of its motion that the motor must have made [–]."""
    slope_sign: float = 1.0
    """Direction of the joint for a positive motion of the motor."""
    pull_sign: float = 1.0
    """Direction of the motor that pulls the cable: the motion goes there and comes back."""
    light: float = 0.3
    """Current below which the cable carries nothing [A]."""
    enable: float = 5.0
    """Longest time that the drive may take to enable [s]."""
    low: float = -math.inf
    """Smallest target of the motor: one that rests beyond, as a release may leave it, is brought there first [rad]."""
    high: float = math.inf
    """Largest [rad]."""
    tension: bool = False
    """True if the cable's tension is measured."""
    torque: bool = False
    """True if the joint's torque is measured."""
    load_sign: float = 1.0
    """−1 of a cable that is let out in this motion, since another one pulls the joint: its load falls."""

    def on_cable(self, basis: Basis, encoder: Encoder) -> "Preflight":
        """The motions on a cable.

        Args:
            basis: what of it there is to follow.
            encoder: the motor's, which has to show the first motion; where it holds, it holds to its counts.
        """
        counts = encoder.resolution + encoder.noise
        first = max(self.first / basis.slope, COUNTS * counts)
        dead = basis.width + 2.0 * self.moved / basis.flat
        largest = max(self.largest / basis.slope, 2.0 * max(first, dead))  # they double: the last is over half of it
        noise = self.noise + counts * basis.flat
        return self._replace(first=first, largest=largest, speed=self.speed / basis.slope, noise=noise)


COUNTS = 6.0
"""Counts and noise of the motor's encoder in the first motion, of which the motor must show a share, `follows`."""


FIRST, SETTLE = 8.0 * RADIANS, 0.6
"""First motion [rad], and the wait after each, in which the drive's integral works [s]."""

SOFT_FIRST, SOFT_FOLLOWS = 20.0 * RADIANS, 0.25
"""First motion of a drive without an integral [rad], and the share of it that the motor must make against friction and
cables [–]."""


def on_suit(checks: Preflight, suit: Suit) -> Preflight:
    """Preflight settings of a suit: of its gears, which friction holds at first, and of its flex sensor, which is
    less still.

    No more of the current counts than the gears' friction takes: a drive that holds against it, and a wearer who
    does not keep still, load the motor either way.
    """
    noise = checks.noise + 8.0 * suit.joint_sensor.noise + suit.joint_sensor.resolution
    friction = spool_friction(suit) / (suit.motor.gear * suit.motor.torque_constant)
    checks = checks._replace(first=FIRST, settle=SETTLE, noise=noise, light=max(checks.light, friction))
    return checks if suit.motor.integral > 0.0 else checks._replace(first=SOFT_FIRST, follows=SOFT_FOLLOWS)


class Step(IntEnum):
    """Where a preflight is."""

    ENABLE = 0
    LISTEN = 1
    OUT = 2
    BACK = 3
    DONE = 4


class Reason(IntEnum):
    """Result of a preflight."""

    NONE = 0
    NOT_ENABLED = 1
    SENSORS = 2
    RESTLESS = 3
    MOTOR_STILL = 4
    MOTOR_WRONG_WAY = 5
    JOINT_STILL = 6
    JOINT_WRONG_WAY = 7
    CURRENT_STILL = 8
    SLACK_WRONG_WAY = 9
    LOAD_MISSING = 10
    LOAD_STILL = 11
    LOAD_WRONG_WAY = 12


REASONS = {
    Reason.NONE: "",
    Reason.NOT_ENABLED: "the drive does not enable; check its supply, enable input and STO",
    Reason.SENSORS: "an angle is missing; check the encoders' plugs and the drive's PDOs",
    Reason.RESTLESS: "an angle changes while the motor holds; keep the limb still, check for interference",
    Reason.MOTOR_STILL: "the motor does not make a small motion; check for a jam and the motor encoder",
    Reason.MOTOR_WRONG_WAY: "the motor's angle goes the wrong way; change the sign of its direction in rig.toml",
    Reason.JOINT_STILL: "the joint does not follow the motor; check for a slack or broken cable, tighten it",
    Reason.JOINT_WRONG_WAY: "the joint goes the wrong way; change the sign of its encoder's direction in rig.toml",
    Reason.CURRENT_STILL: "the drive reports an unchanging current while the motor turns; check 6077h and its PDO",
    Reason.SLACK_WRONG_WAY: "the cable pulls where it should be let out, as slack_sign of [limits] has it; turn that "
    "round, or the direction of the motor; and keep the limb still",
    Reason.LOAD_MISSING: "the load cell says nothing; check its plug, its supply and [load_cell]",
    Reason.LOAD_STILL: "the load cell does not change while the cable is pulled; check that the cable goes through it, "
    "its amplifier, and tighten the cable",
    Reason.LOAD_WRONG_WAY: "the load cell falls while the cable is pulled; change the sign of its scale in rig.toml",
}
"""Meaning and remedy of each reason."""


class PreflightState(NamedTuple):
    """Where it is, and what it has seen."""

    step: Step
    since: float
    """Since the step began [s]."""
    motor: float
    """Where the motor began, or the nearest place that it may be sent to [rad]."""
    joint: float
    """Where the joint began [rad]."""
    low: float
    """Smallest angle of the joint while it was listened to [rad]."""
    high: float
    """Largest [rad]."""
    motor_low: float
    """The same of the motor [rad]."""
    motor_high: float
    """[rad]"""
    amplitude: float
    """Of this motion [rad]."""
    far_motor: float
    """Where the motor was at the far end [rad]."""
    far_joint: float
    """Where the joint was [rad]."""
    current_low: float
    """Smallest current since the drive is enabled [A]."""
    current_high: float
    """Largest [A]."""
    charge: float
    """Current over time in this motion, out and back [A·s]."""
    load: float
    """What the load cell said last at rest, 0 where there is none [N or N·m]."""
    load_low: float
    """Its smallest reading while it was listened to."""
    load_high: float
    """Its largest."""
    far_load: float
    """What it said at the far end."""
    reason: Reason


class PreflightOutcome(NamedTuple):
    """Output of a preflight in a cycle."""

    result: PreflightResult
    reason: Reason


def begin(settings: Preflight, reading: DriveReading) -> PreflightState:
    """Before the first cycle."""
    return _at(Step.ENABLE, settings, settings.first, reading)


def step(
    settings: Preflight, state: PreflightState, reading: DriveReading, dt: float
) -> tuple[PreflightState, float, PreflightOutcome]:
    """One cycle: wait for the drive, listen, then move out and back, minimum jerk, further until the joint follows.

    Args:
        settings: the preflight's.
        state: from the cycle before.
        reading: of the drive.
        dt: cycle time [s].

    Returns:
        The state, the motor's requested target [rad], what came of it.
    """
    since = state.since + dt
    seen = math.isfinite(reading.motor) and math.isfinite(reading.joint)
    load = _load(settings, reading)
    if state.step == Step.DONE:
        return _answer(state, state.motor)
    state = state._replace(since=since)
    if not seen and state.step <= Step.LISTEN:  # in motion, a gap is the supervisor's to bridge
        return _fail(state, Reason.SENSORS) if since > settings.listen else _answer(state, state.motor)
    if not math.isfinite(load) and state.step == Step.LISTEN and since > settings.listen:
        return _fail(state, Reason.LOAD_MISSING)
    if state.step == Step.ENABLE:
        if reading.drive_state == DriveState.OPERATION_ENABLED:
            state = _at(Step.LISTEN, settings, state.amplitude, reading)
        elif since > settings.enable:
            return _fail(state, Reason.NOT_ENABLED)
        return _answer(state, _within(settings, reading.motor))
    state = state._replace(
        current_low=min(state.current_low, reading.current), current_high=max(state.current_high, reading.current)
    )
    if state.step == Step.LISTEN:
        coming = settings.settle if state.motor != state.far_motor else 0.0
        if since < coming:
            return _answer(_hearing(state, reading, load), state.motor)
        state = state._replace(
            low=min(state.low, reading.joint),
            high=max(state.high, reading.joint),
            motor_low=min(state.motor_low, reading.motor),
            motor_high=max(state.motor_high, reading.motor),
            load=load,
            load_low=load if math.isnan(state.load_low) else min(state.load_low, load),
            load_high=load if math.isnan(state.load_high) else max(state.load_high, load),
        )
        if since < coming + settings.listen:
            return _answer(state, state.motor)
        if state.high - state.low > settings.noise or state.motor_high - state.motor_low > settings.noise:
            return _fail(state, Reason.RESTLESS)
        return _answer(state._replace(step=Step.OUT, since=0.0), state.motor)

    duration = state.amplitude / settings.speed
    way = float(minimum_jerk_share(since / duration))
    out = settings.pull_sign * state.amplitude
    requested_target = state.motor + out * (way if state.step == Step.OUT else 1.0 - way)
    if since <= duration + settings.settle:
        state = state._replace(charge=state.charge + dt * reading.current)
    if since < duration + settings.settle or not seen:
        return _answer(state, requested_target)
    if state.step == Step.OUT:
        went = (reading.motor - state.motor) * settings.pull_sign
        if went < -0.3 * state.amplitude:
            return _fail(state, Reason.MOTOR_WRONG_WAY)
        if went < settings.follows * state.amplitude:
            return _fail(state, Reason.MOTOR_STILL)
        state = state._replace(far_motor=reading.motor, far_joint=reading.joint, far_load=load)
        return _answer(state._replace(step=Step.BACK, since=0.0), requested_target)
    still = state.current_low == state.current_high  # or changed by less than a count, in a motion as small as this
    if settings.pull_sign * state.charge < -2.0 * settings.light * (duration + settings.settle):
        return _fail(state, Reason.SLACK_WRONG_WAY)
    moved = (state.far_joint - state.joint) * settings.pull_sign * settings.slope_sign
    # a torque has the joint's sign, a tension that of no direction
    way = settings.pull_sign * settings.slope_sign if settings.torque else settings.load_sign
    risen = (state.far_load - state.load) * way
    span = state.load_high - state.load_low
    watched = settings.tension or settings.torque
    if watched and risen < -span and moved >= settings.moved:
        return _fail(state, Reason.LOAD_WRONG_WAY)
    mute = watched and not risen > span
    if moved >= settings.moved and not still and not mute:
        return _answer(state._replace(step=Step.DONE), state.motor)
    if moved <= -settings.moved:
        return _fail(state, Reason.JOINT_WRONG_WAY)
    larger = 2.0 * state.amplitude
    if larger > settings.largest:
        why = Reason.CURRENT_STILL if still else Reason.JOINT_STILL
        return _fail(state, Reason.LOAD_STILL if mute and moved >= settings.moved and not still else why)
    return _answer(state._replace(step=Step.OUT, since=0.0, amplitude=larger, charge=0.0), state.motor)


def require(
    limits: Limits,
    dt: float,
    verdict: str,
    *,
    opposed: bool = False,
    given: Limits | None = None,
    mismatches: Iterable[str] = (),
) -> None:
    """Refuse a run whose limits contradict one another or its rig, or whose gains do not hold.

    Args:
        limits: the supervisor's.
        dt: cycle time [s].
        verdict: of `bowden check` on these gains (`design.check.VerdictName`).
        opposed: see `contradictions`.
        given: likewise.
        mismatches: of the rig (`rig.objections`).

    Raises:
        SafetyError: with every contradiction, or the verdict.
    """
    if found := contradictions(limits, dt, opposed=opposed, given=given):
        raise SafetyError(f"limits contradict one another: {'; '.join(found)}", do="correct those in rig.toml")
    if found := [*mismatches]:
        raise SafetyError("; ".join(found))
    if verdict not in ("holds", "little_margin", "limit_cycle"):
        raise SafetyError(f"`bowden check` says {verdict!r}", expected="gains that hold", do="run `bowden tune`")


def _within(settings: Preflight, motor: float) -> float:
    """The nearest place that a motor may be sent to [rad]; NaN for NaN."""
    return motor if math.isnan(motor) else min(max(motor, settings.low), settings.high)


def _at(where: Step, settings: Preflight, amplitude: float, reading: DriveReading) -> PreflightState:
    motor, joint, current, start = reading.motor, reading.joint, reading.current, _within(settings, reading.motor)
    ends = (joint, joint, motor, motor)
    load = _load(settings, reading)
    return PreflightState(
        *(where, 0.0, start, joint, *ends, amplitude, motor, joint, current, current, 0.0),
        *(load, load, load, load, Reason.NONE),
    )


def _load(settings: Preflight, reading: DriveReading) -> float:
    """What the load cell says; 0 where there is none."""
    if settings.tension:
        return reading.tension
    return reading.joint_torque if settings.torque else 0.0


def _hearing(state: PreflightState, reading: DriveReading, load: float) -> PreflightState:
    """Begin again to measure how still both angles are, and the load cell."""
    motor, joint = reading.motor, reading.joint
    still = state._replace(joint=joint, low=joint, high=joint, motor_low=motor, motor_high=motor)
    return still._replace(load=load, load_low=load, load_high=load)


def _answer(state: PreflightState, requested_target: float) -> tuple[PreflightState, float, PreflightOutcome]:
    result = PreflightResult.PENDING
    if state.step == Step.DONE:
        result = PreflightResult.PASSED if state.reason == Reason.NONE else PreflightResult.FAILED
    return state, requested_target, PreflightOutcome(result, state.reason)


def _fail(state: PreflightState, reason: Reason) -> tuple[PreflightState, float, PreflightOutcome]:
    return _answer(state._replace(step=Step.DONE, reason=reason), state.motor)


def dead_zone(checked: PreflightState, reading: DriveReading, slope: float) -> float:
    """Width of the cable's dead zone in motor angle, as the last motion shows it, for the record; NaN where an angle is
    missing [rad].

    The motor goes out until the joint follows and comes back by as much; there the cable crosses its dead zone once:

        width = motor's way back − joint's way back/slope

    It is that of a small stroke, and a lower bound where the joint has not come back at all. No law gets it: our law's
    first strokes are 3 % better with it and its next ones 2 % worse (docs/background/live.md).

    Args:
        checked: of the preflight, as it passed.
        reading: at its end.
        slope: about what the joint moves by per motor angle beyond the dead zone, positive [rad/rad].
    """
    back, returned = abs(checked.far_motor - reading.motor), abs(checked.far_joint - reading.joint)
    width = back - returned / slope
    return max(0.0, min(WIDEST, width)) if math.isfinite(width) else math.nan
