"""Our law: a wide disturbance observer, what matters of the cable, and a watch over its own swing.

With s = 1/a₀, a₀ the given slope, a the learned one, φ the reference, F the observer's correction and J a jump:

    m = (φ + τ·φ̇ + ½·τ²·φ̈)/a + F + J                                   where the motor is to be
    command = m + 2ζ/ω·m' + m''/ω² − r·u + f                              what the servo must be asked for

ω, ζ are the servo's, τ the delay. Four parts, each with a file of its own: `observer` takes everything that moves the
joint for one disturbance and takes it away (F), `drive` knows by how much the motor falls short (u, f),
`deadzone` knows the dead zone (J) and learns a, `oscillation` slows the observer where the loop rings. In the feedback
stands a₀, in the plan a: what is learned must not be the loop's gain.

Derivation, stability and limits: ``docs/background/our_law.md``.
"""

import math
from typing import NamedTuple

from bowden.control.law_parts import Filtered, invert_servo
from bowden.control.our_law.deadzone import (
    TOUCH,
    TOUCH_SIGMAS,
    TURN,
    TURN_SIGMAS,
    UNSEEN,
    WIDEST,
    DeadzoneInput,
    DeadzoneState,
    deadzone_at_start,
    shortfall_at_joint,
    update_deadzone,
)
from bowden.control.our_law.drive import (
    MOST_FORWARD,
    ExpectedMotor,
    predict_motor,
    share_of_shortfall,
    tracking_shortfall,
)
from bowden.control.our_law.gains import BowdenGains
from bowden.control.our_law.observer import (
    FILTER_DELAY,
    LOAD_DAMPING,
    SLOW_PART,
    Observer,
    apply_shift,
    correct,
    derived_rates,
    largest_speed,
    observer_at_rest,
    propagate_correction,
)
from bowden.control.our_law.oscillation import (
    OscillationMonitor,
    is_step_disturbance,
    no_oscillation,
    time_of_load,
    update_oscillation_monitor,
)
from bowden.core.kernel import kernel
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
    """State of the law from one cycle to the next."""

    observer: Observer
    oscillation: OscillationMonitor
    deadzone: DeadzoneState
    drive: ExpectedMotor


@kernel
def start(gains: BowdenGains, sample: Sample) -> BowdenState:
    """Begin with the motor held where it is."""
    inverse, motor = 1.0 / abs(gains.slope), math.copysign(1.0, gains.slope) * sample.motor
    offset = motor - sample.joint * inverse
    deadzone = deadzone_at_start(sample.joint, offset, inverse, gains.width)
    return BowdenState(observer_at_rest(offset), no_oscillation(), deadzone, ExpectedMotor(motor, 0.0, 0.0, 0.0))


class ValidatedSample(NamedTuple):
    """Both accepted angles, in the direction in which the motor moves the joint on."""

    valid: bool
    """Both are numbers in range."""
    plausible: bool
    """And the joint went no further than a joint can."""
    joint: float
    """No further from the last answer than a joint can be [rad]."""
    motor: float
    """As measured; where it is not, that of a cable in contact [rad]."""


@kernel
def measured(gains: BowdenGains, cable: DeadzoneState, sample: Sample, dt: float) -> ValidatedSample:
    """A sample that is no number changes nothing, and one that jumps counts as the joint's fastest."""
    last = cable.answer_joint
    if not (abs(sample.joint) <= FURTHEST and abs(sample.motor) <= FURTHEST):
        return ValidatedSample(False, False, last, cable.contact + last * cable.inverse)
    most = FASTEST * dt + TOUCH + TOUCH_SIGMAS * gains.noise
    way = sample.joint - last
    joint = last + max(-most, min(most, way))
    return ValidatedSample(True, abs(way) <= most, joint, math.copysign(1.0, gains.slope) * sample.motor)


@kernel
def step(
    gains: BowdenGains, state: BowdenState, sample: Sample, reference: Reference, dt: float
) -> tuple[BowdenState, float]:
    """One cycle: watch, observe, jump, invert the servo.

    The motor is counted in the direction in which it moves the joint on, so that the slope is positive.
    """
    before, cable, inverse = state.observer, state.deadzone, 1.0 / abs(gains.slope)
    omega, delay, noise = gains.servo_frequency, gains.delay, gains.noise * inverse
    rates = derived_rates(gains, inverse, dt)
    now = measured(gains, cable, sample, dt)
    wanted = reference.position if abs(reference.position) <= FURTHEST else now.joint  # no NaN stays in the state

    # the correction at the joint
    load = time_of_load(state.oscillation)
    lag = gains.lag if load > 0.0 else gains.lag + UNKNOWN_LAG / omega
    late = gains.lag + 2.0 * LOAD_DAMPING * load
    in_reach = abs(before.requested - cable.answer_contact) < WIDEST  # of a dead zone
    step_disturbance = (
        is_step_disturbance(state.oscillation) and in_reach and late <= 0.0
    )  # a load that is tried is late
    fastest = largest_speed(rates.stopping, reference.velocity * inverse, step_disturbance)
    known = tracking_shortfall(state.drive, now.motor, dt * fastest, gains)
    shortfall = known if now.valid else state.drive.shortfall
    arrived = propagate_correction(before, shortfall_at_joint(cable, shortfall), delay, lag, load, fastest, dt)

    # d̂: what of the error the correction that has arrived does not explain
    disturbance = (now.joint - wanted) * inverse - arrived.position if now.plausible else -before.requested
    slow = disturbance if cable.furthest >= UNSEEN else before.slow_disturbance  # at the start all of it is slow
    slow = slow + (disturbance - slow) * (dt / (SLOW_PART + dt))

    # I and F, as fast as the watch allows
    oscillation = update_oscillation_monitor(state.oscillation, disturbance - slow, noise, rates.kappa, dt)
    kappa = oscillation.bandwidth_share * rates.kappa
    rests = abs(reference.velocity) * REST < TURN + TURN_SIGMAS * gains.noise
    least = IDLE + IDLE_SIGMAS * noise if rests else noise
    observer, acceleration = correct(before, disturbance, slow, arrived, kappa, rates, least, fastest, dt)

    # the cable
    given = DeadzoneInput(
        joint=now.joint,
        motor=now.motor,
        position=wanted,
        velocity=reference.velocity,
        acceleration=reference.acceleration,
        inverse=inverse,
        noise=gains.noise,
        omega=omega,
        delay=delay,
        lag=late,
        answer=1.0 / kappa + FILTER_DELAY / rates.quick + delay,
        rate=state.drive.velocity,
    )
    updated = update_deadzone(cable, given, before.requested, observer.requested, dt)
    observer, cable = apply_shift(observer, updated.requested, updated.shift), updated.state

    # where the motor is to be, and the servo's inverse of it
    position = reference.position + delay * (reference.velocity + 0.5 * delay * reference.acceleration)
    velocity = reference.velocity + delay * reference.acceleration
    motor = Filtered(
        position * cable.inverse + observer.sent + cable.jump,
        velocity * cable.inverse + observer.sent_rate + cable.jump_rate,
        reference.acceleration * cable.inverse + acceleration + cable.jump_acceleration,
    )
    command = invert_servo(motor, omega, gains.servo_damping)
    sane = command if abs(command) <= FURTHEST else state.drive.position
    drive = predict_motor(state.drive, sane, shortfall, gains, dt)
    asked = max(-MOST_FORWARD, min(MOST_FORWARD, drive.fed_forward - share_of_shortfall(gains) * shortfall))
    return BowdenState(observer, oscillation, cable, drive), math.copysign(1.0, gains.slope) * (command + asked)
