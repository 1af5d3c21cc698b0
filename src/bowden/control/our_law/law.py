"""Our law: a wide disturbance observer, what matters of the cable, and a watch over its own swing.

With s = 1/a₀, a₀ the given slope, a the learned one, φ the reference, F the observer's correction and J a jump:

    m = (φ + τ·φ̇ + ½·τ²·φ̈)/a + F + J                                   where the motor is to be
    command = m + 2ζ/ω·m' + m''/ω²                                       what the servo must be asked for

ω, ζ are the servo's, τ the delay. Four parts, each with a file of its own: `observer` takes everything that moves the
joint for one disturbance and takes it away (F), `drive` knows what of the command the motor did not do, `crossing`
knows the dead zone (J) and learns a, `swing` slows the observer where the loop rings. In the feedback stands a₀, in the
plan a: what is learned must not be the loop's gain.

Derivation, stability and limits: ``docs/background/our_law.md``. Portable subset.
"""

from typing import NamedTuple

import numpy as np

from bowden.control.law_parts import Filtered, through_servo
from bowden.control.our_law.crossing import (
    TOUCH,
    TOUCH_SIGMAS,
    TURN,
    TURN_SIGMAS,
    UNSEEN,
    WIDEST,
    Crossing,
    Known,
    at_start,
    crossed,
    missing,
)
from bowden.control.our_law.drive import ExpectedMotor, missed, moves_on
from bowden.control.our_law.gains import BowdenGains
from bowden.control.our_law.observer import (
    FILTER_DELAY,
    LOAD_DAMPING,
    SLOW_PART,
    Observer,
    arrives,
    at_rest,
    corrected,
    fastest,
    pace_of,
    shifted,
)
from bowden.control.our_law.swing import Swing, leaps, load_time, no_swing, watched
from bowden.core.extremes import larger, smaller
from bowden.core.kernel import kernel, sel
from bowden.core.signals import Reference, Sample

UNKNOWN_LAG = 0.35
"""Lag of the joint that the observer expects beside the one that is known, over 1/ω, until it has found a load that
swings: most joints follow a little late. Too much of it costs a slower answer, too little a loop that rings [–]."""

FURTHEST = 1e6
"""Angles beyond it are none; a motor may have made many turns [rad]."""

FASTEST = 30.0
"""A joint is no faster; a reading that jumps further is no news, and is taken for the joint's no faster [rad/s]."""

REST = 0.3
"""Time within which a reference that rests does not go as far as a turn [s]."""

IDLE, IDLE_SIGMAS = 0.002, 3.0
"""Innovation that is no news while the reference rests: within a dead zone whose joint first runs the wrong way the
feedback drives itself, and grows from nothing; and the same in standard deviations of the noise [rad, –]."""


class BowdenState(NamedTuple):
    """What the law remembers."""

    observer: Observer
    swing: Swing
    crossing: Crossing
    drive: ExpectedMotor


@kernel
def start(gains: BowdenGains, sample: Sample) -> BowdenState:
    """Begin with the motor held where it is."""
    inverse = 1.0 / np.abs(gains.slope)
    offset = np.sign(gains.slope) * sample.motor - sample.joint * inverse
    crossing = at_start(sample.joint, offset, inverse, gains.width)
    return BowdenState(at_rest(offset), no_swing(), crossing, ExpectedMotor(np.sign(gains.slope) * sample.motor, 0.0))


@kernel
def step(
    gains: BowdenGains, state: BowdenState, sample: Sample, reference: Reference, dt: float
) -> tuple[BowdenState, float]:
    """One cycle: watch, observe, jump, invert the servo. A sample that is no number changes nothing.

    The motor is counted in the direction in which it moves the joint on, so that the slope is positive.
    """
    before, known, sign, inverse = state.observer, state.crossing, np.sign(gains.slope), 1.0 / np.abs(gains.slope)
    omega, delay = gains.servo_frequency, gains.delay
    seen = (np.abs(sample.joint) <= FURTHEST) * (np.abs(sample.motor) <= FURTHEST) > 0.0
    pace = pace_of(gains, inverse, dt)
    noise = gains.noise * inverse

    # d̂: what of the error the correction that has arrived does not explain
    time = load_time(state.swing)
    lag = gains.lag + sel(time > 0.0, 0.0, UNKNOWN_LAG / omega)
    short = missing(known, sel(seen, missed(state.drive, sign * sample.motor, gains), 0.0))
    late = gains.lag + 2.0 * LOAD_DAMPING * time
    in_reach = np.abs(before.asked - known.answer_contact) < WIDEST  # of a dead zone
    leaping = leaps(state.swing) * in_reach * (late <= 0.0)  # in a trial a load is tried, which is late
    fast = fastest(pace.stopping, reference.velocity * inverse, leaping)
    arrived = arrives(before, short, delay, lag, time, fast, dt)
    most = FASTEST * dt + TOUCH + TOUCH_SIGMAS * gains.noise
    way = sample.joint - known.answer_joint
    joint = known.answer_joint + sel(seen, larger(smaller(way, most), -most), 0.0)
    there = sel(np.abs(reference.position) <= FURTHEST, reference.position, joint)  # no NaN stays in the state
    error = joint - there
    disturbance = sel(seen * (np.abs(way) <= most) > 0.0, error * inverse - arrived.position, -before.asked)
    slow = sel(known.furthest >= UNSEEN, disturbance, before.slow)  # at the start all of it is slow
    slow = slow + (disturbance - slow) * (dt / (SLOW_PART + dt))

    # I and F, as fast as the watch allows
    swing = watched(state.swing, disturbance - slow, noise, pace.kappa, dt)

    kappa = swing.share * pace.kappa
    rests = np.abs(reference.velocity) * REST < TURN + TURN_SIGMAS * gains.noise
    least = sel(rests, IDLE + IDLE_SIGMAS * noise, noise)
    observer, acceleration = corrected(before, disturbance, slow, arrived, kappa, pace, least, fast, dt)

    # the cable
    answer = 1.0 / kappa + FILTER_DELAY / pace.quick + delay
    motor = sel(seen, sign * sample.motor, known.contact + joint * known.inverse)
    given = Known(
        joint,
        motor,
        there,
        reference.velocity,
        reference.acceleration,
        inverse,
        gains.noise,
        omega,
        delay,
        late,
        answer,
        state.drive.velocity,
    )
    after = crossed(known, given, before.asked, observer.asked, dt)
    observer = shifted(observer, after.asked, after.shift)
    cable = after.crossing

    # where the motor is to be, and the servo's inverse of it
    position = (
        reference.position + delay * (reference.velocity + 0.5 * delay * reference.acceleration)
    ) * cable.inverse
    velocity = (reference.velocity + delay * reference.acceleration) * cable.inverse
    wanted = Filtered(
        position + observer.sent + cable.jump,
        velocity + observer.rate + cable.jump_rate,
        reference.acceleration * cable.inverse + acceleration + cable.jump_bend,
    )
    command = through_servo(wanted, omega, gains.servo_damping)
    sane = sel(np.abs(command) <= FURTHEST, command, state.drive.position)
    drive = moves_on(state.drive, sane, omega, gains.servo_damping, dt)
    return BowdenState(observer, swing, cable, drive), sign * command
