"""Our law: a wide disturbance observer, what matters of the cable, and a watch over its own swing.

    motor wanted = (φ + τ·φ̇ + ½·τ²·φ̈)/a + F + J              φ the reference, a the slope as learned, J a jump
    d̂ = s·(joint − φ) − y                                     what the joint would do without the correction; s = 1/a₀
    T²·ÿ + (lag + 0.5·T)·ẏ + y = F − τ·F' + u                 y, the correction at the joint; u the motor's shortfall
    x' = q·(d̂ + I − x)                                        the innovation: what of d̂ is not yet in −I
    I' = −κ·x·x²/(x² + σ₀²),  |I'| ≤ V = v + s·|φ̇|            the correction asked for
    F'' = q²·(I − F) − 2q·F'                                  the correction sent, twice differentiable
    command = the servo's inverse of it, + f                  f' = −r·(u' + u/(2T_s)), for what the drive leaves

Everything that moves the joint is one disturbance, which is taken away. The law's own correction cancels in d̂: where
servo, delay, slope and load are as modelled nothing is fed back. In the feedback stands a₀, in the plan a: what is
learned must not be the loop's gain. `deadzone` jumps and learns, `oscillation` slows the observer where the loop rings,
`update_drive` has f jump where a motor that sticks is to turn.

Derivation, stability, limits, and the whole law on a page: ``docs/background/our_law.md``. Backward Euler.
"""

import math
from typing import Annotated, NamedTuple

from bowden.control.law_parts import Filtered, invert_servo
from bowden.control.our_law.deadzone import FURTHEST, WIDEST, DeadzoneState, no_news, update_deadzone
from bowden.control.our_law.gains import BowdenGains
from bowden.control.our_law.oscillation import LOAD_DAMPING, SLOWEST, OscillationMonitor, time_of_load, watch
from bowden.core.kernel import kernel, sqrt
from bowden.core.quantity import Quantity
from bowden.core.signals import Reference, Sample

DELAYS = 1.5
"""Delays that weigh as much as 1/ω in κ: the delay itself and half of it for the sample before [–]."""
COMMAND_NOISE = 0.007
"""n, bound on F''/ω² in the command from the joint's noise alone, standard deviation. x and F have three poles, all at
q, and so are 3/q late; with two of less damping the loop bears less of a wrong slope [rad]."""
STOPPED, LEAST_SPEED = 0.05, 1.0
"""v is the way within which servo and delay can stop, over T_s, and a speed beside it [rad, rad/s]."""
UNKNOWN_LAG = 0.35
"""Lag of the joint that the observer expects beside the one that is known, over 1/ω, until it has found a load that
swings: most joints follow a little late. Too much of it costs a slower answer, too little a loop that rings [–]."""
EXPECTED = 0.01
"""Deviation of the motor that says nothing: counts, friction, a step of the plan [rad]."""
SERVO_DOUBT = 0.5
"""How wrong the servo's time constants may be, as a share of them: f is as much slower, so as not to ring [–]."""
QUIET = 1e-9
"""Noise of a joint's reading that is said to have none [rad]."""
FASTEST = 30.0
"""A joint is no faster; a reading that jumps further is no news, and is taken for the joint's no faster [rad/s]."""


class Observer(NamedTuple):
    """State of the observer."""

    requested: Annotated[float, Quantity("I, the correction asked for", "rad")]
    innovation: Annotated[float, Quantity("x, what of the disturbance is not yet corrected", "rad")]
    sent: Annotated[float, Quantity("F, the correction as sent", "rad")]
    sent_rate: Annotated[float, Quantity("its rate", "rad/s")]
    at_joint: Annotated[float, Quantity("y, the correction that has arrived at the joint", "rad")]
    at_joint_rate: Annotated[float, Quantity("its rate", "rad/s")]
    slow_disturbance: Annotated[float, Quantity("the disturbance's slow part", "rad")]


class ExpectedMotor(NamedTuple):
    """The motor as the servo should move it, a delay ahead, what it has lacked, and what it takes to turn it."""

    position: Annotated[float, Quantity("p, the motor a delay later", "rad")]
    velocity: Annotated[float, Quantity("its rate", "rad/s")]
    shortfall: Annotated[float, Quantity("u, by which the motor falls short", "rad")]
    fed_forward: Annotated[float, Quantity("f, what is added to the command for it", "rad")]
    pending: Annotated[float, Quantity("part of a jump of f that is still to come", "rad")]
    side: Annotated[float, Quantity("sign of the reference's way", "1")]
    sticks: Annotated[bool, Quantity("the motor has not moved since the reference turned")]
    place: Annotated[float, Quantity("the motor furthest on the old side since then", "rad")]
    lacked: Annotated[float, Quantity("what was added to the command then", "rad")]
    stick: Annotated[float, Quantity("b, what more it took to move the motor upward the last time", "rad")]
    stick_back: Annotated[float, Quantity("the same downward", "rad")]


class BowdenState(NamedTuple):
    """State of the law from one cycle to the next."""

    observer: Observer
    oscillation: OscillationMonitor
    deadzone: DeadzoneState
    drive: ExpectedMotor


@kernel
def servo_time(gains: BowdenGains) -> float:
    """T_s, by which the motor follows a steady motion late [s]."""
    return 2.0 * gains.servo_damping / gains.servo_frequency + gains.delay


@kernel
def observer_rate(gains: BowdenGains) -> float:
    """κ, whole [1/s]."""
    return gains.bandwidth / (1.0 / gains.servo_frequency + DELAYS * gains.delay)


@kernel
def share_in(rate: float, dt: float) -> float:
    """Share of its way that a first-order lag of this `rate` [1/s] goes in a cycle, 1 − e^(−rate·dt) [–]."""
    z = rate * dt
    return z / (1.0 + z * (0.5 + z / 12.0))


@kernel
def filter_rate(gains: BowdenGains, dt: float) -> float:
    """q [rad/s]."""
    through = gains.noise / abs(gains.slope) * sqrt(share_in(observer_rate(gains), dt)) + QUIET
    return min(1.0 / dt, gains.servo_frequency * sqrt(COMMAND_NOISE / through))


@kernel
def tracking_shortfall(gains: BowdenGains, drive: ExpectedMotor, motor: float, most: float) -> float:
    """u, motor tracking shortfall (stiction or saturation); a reading that jumps is hardly counted: `most` [rad]."""
    off = motor - drive.position + gains.delay * drive.velocity
    tolerance = EXPECTED + SERVO_DOUBT * servo_time(gains) * abs(drive.velocity)
    shortfall = math.copysign(max(0.0, abs(off) - tolerance), off)
    return drive.shortfall + max(-most, min(most, shortfall - drive.shortfall))


@kernel
def update_drive(
    gains: BowdenGains, before: ExpectedMotor, command: float, shortfall: float, motor: float, side: float, dt: float
) -> ExpectedMotor:
    """One cycle of the servo as known, moved by the plan's `command`, and of f.

    Friction that the drive does not make up for by itself changes its sign where the reference turns to this `side`: f
    jumps by b, and back where the reference turns again before the motor has moved.
    """
    omega, late, most, jump = gains.servo_frequency, servo_time(gains), 4.0 * WIDEST, 0.0
    sticks, place, lacked, added = before.sticks, before.place, before.lacked, before.fed_forward
    stick, back = before.stick, before.stick_back
    if side * before.side < 0.0:
        jump = lacked - added - before.pending if sticks else side * (back if side < 0.0 else stick)
        sticks, place, lacked = not sticks, motor, added
    elif sticks:
        place = side * min(side * place, side * motor)
        if side * (motor - place) > EXPECTED:
            took = max(0.0, min(most, side * (added - lacked)))
            stick, back = stick if side < 0.0 else took, took if side < 0.0 else back
            sticks, jump = False, -before.pending
    pending = (before.pending + jump) * late / (late + dt)
    share = max(0.0, 1.0 - late / SERVO_DOUBT * gains.servo_integral)  # r: the drive's integral makes up for the rest
    lacks = share * (shortfall - before.shortfall + dt * SERVO_DOUBT / late * shortfall)
    forward = max(-most, min(most, added + dt / late * pending - lacks))
    stiff = omega * omega * dt
    slower = 1.0 + dt * (2.0 * gains.servo_damping * omega + stiff)
    velocity = (before.velocity + stiff * (command - before.position)) / slower
    position = before.position + dt * velocity
    return ExpectedMotor(position, velocity, shortfall, forward, pending, side, sticks, place, lacked, stick, back)


@kernel
def shortfall_at_joint(cable: DeadzoneState, shortfall: float) -> float:
    """Part of the motor's `shortfall` that the joint lacks: nothing within a dead zone that is being crossed [rad]."""
    if cable.crossing and cable.side * shortfall < 0.0:
        width = cable.width_back if cable.side < 0.0 else cable.width
        return cable.side * min(0.0, cable.side * shortfall + width)
    return shortfall


@kernel
def propagate_correction(
    gains: BowdenGains, before: Observer, shortfall: float, load: float, most: float, dt: float
) -> tuple[float, float]:
    """y and its rate, at most `most`, V, behind a load of T = `load` [s]; 0 of none [rad, rad/s]."""
    late = before.sent - gains.delay * before.sent_rate + shortfall
    unknown = 2.0 * LOAD_DAMPING * load if load > 0.0 else UNKNOWN_LAG / gains.servo_frequency
    inertia = load * load
    rate = inertia * before.at_joint_rate + dt * (late - before.at_joint)
    rate = max(-most, min(most, rate / (inertia + dt * (gains.lag + unknown + dt))))
    return before.at_joint + dt * rate, rate


@kernel
def request(
    before: Observer, disturbance: float, kappa: float, quick: float, least: float, most: float, dt: float
) -> tuple[float, float]:
    """I and x, of d̂; `least` is the innovation that is no news, `most` is V [rad, rad]."""
    z = quick * dt
    x = before.innovation + (disturbance + before.requested - before.innovation) * (z / (1.0 + z))
    step = share_in(kappa, dt) * x * x * x / (x * x + least * least + 1e-30)
    return before.requested - max(-most * dt, min(most * dt, step)), x


@kernel
def send(before: Observer, requested: float, quick: float, dt: float) -> tuple[float, float, float]:
    """F, its rate and its acceleration: `requested` through two poles at `quick`, q [rad, rad/s, rad/s²]."""
    pull = quick * (quick * (requested - before.sent - dt * before.sent_rate) - 2.0 * before.sent_rate)
    acceleration = pull / ((1.0 + quick * dt) * (1.0 + quick * dt))
    rate = before.sent_rate + dt * acceleration
    return before.sent + dt * rate, rate, acceleration


@kernel
def start(gains: BowdenGains, sample: Sample) -> BowdenState:
    """Begin with the motor held where it is."""
    motor = math.copysign(1.0, gains.slope) * sample.motor
    joint, inverse, width = sample.joint, 1.0 / abs(gains.slope), gains.width
    o = motor - joint * inverse
    observer = Observer(o, 0.0, o, 0.0, o, 0.0, -o)
    monitor = OscillationMonitor(0.0, 0.0, 0.0, 0.1, 0.0, 1.0, 0.0, 0.0)
    cable = DeadzoneState(0.0, False, FURTHEST, 0.0, 0.0, 0.0, width, width, o, joint, inverse, joint, o)
    drive = ExpectedMotor(motor, 0.0, 0.0, 0.0, 0.0, 0.0, False, motor, 0.0, 0.0, 0.0)
    return BowdenState(observer, monitor, cable, drive)


@kernel
def step(
    gains: BowdenGains, state: BowdenState, sample: Sample, reference: Reference, dt: float
) -> tuple[BowdenState, float]:
    """One cycle: watch, observe, jump, invert the servo.

    The motor is counted in the direction in which it moves the joint on, so that the slope is positive.
    """
    before, cable = state.observer, state.deadzone
    inverse, way, delay = 1.0 / abs(gains.slope), math.copysign(1.0, gains.slope), gains.delay
    small, noise = no_news(gains), gains.noise * inverse

    # a sample that is no number changes nothing, and one that jumps counts as the joint's fastest
    valid = abs(sample.joint) <= FURTHEST and abs(sample.motor) <= FURTHEST
    off = sample.joint - cable.answer_joint if valid else 0.0
    most = FASTEST * dt + 2.0 * small
    plausible = valid and abs(off) <= most
    joint = cable.answer_joint + max(-most, min(most, off))
    motor = way * sample.motor if valid else cable.contact + joint * cable.inverse
    position = reference.position if abs(reference.position) <= FURTHEST else joint  # no NaN stays in the state
    speed = abs(reference.velocity) if abs(reference.velocity) <= FURTHEST else 0.0

    # the correction at the joint, and d̂: what of the error it does not explain
    fastest, load = LEAST_SPEED + STOPPED / servo_time(gains) + speed * inverse, time_of_load(state.oscillation)
    shortfall = tracking_shortfall(gains, state.drive, motor, dt * fastest) if valid else state.drive.shortfall
    lacked = shortfall_at_joint(cable, shortfall)
    at_joint, at_joint_rate = propagate_correction(gains, before, lacked, load, fastest, dt)
    disturbance = (joint - position) * inverse - at_joint if plausible else -before.requested
    slow = before.slow_disturbance + (disturbance - before.slow_disturbance) * (dt / (0.5 * SLOWEST + dt))

    # I, as fast as the watch allows; less news where the reference rests
    quick, kappa = filter_rate(gains, dt), observer_rate(gains)
    monitor = watch(state.oscillation, disturbance - slow, 2.0 * small * inverse, kappa, dt)
    kappa = monitor.bandwidth_share * kappa
    least = small * inverse if speed * SLOWEST < small else noise
    wanted, innovation = request(before, disturbance, kappa, quick, least, fastest, dt)

    # the cable, and F
    late = gains.lag + 2.0 * LOAD_DAMPING * load
    answer = 1.0 / kappa + 3.0 / quick + delay
    asked, rate = Reference(position, reference.velocity, reference.acceleration), state.drive.velocity
    cable, requested, shift = update_deadzone(
        gains, cable, joint, plausible, motor, asked, late, answer, rate, before.requested, wanted, dt
    )
    sent, sent_rate, acceleration = send(before, requested, quick, dt)
    observer = Observer(
        requested + shift, innovation, sent + shift, sent_rate, at_joint + shift, at_joint_rate, slow - shift
    )

    # where the motor is to be, and the servo's inverse of it
    ahead = reference.position + delay * (reference.velocity + 0.5 * delay * reference.acceleration)
    plan = Filtered(
        ahead * cable.inverse + observer.sent + cable.jump,
        (reference.velocity + delay * reference.acceleration) * cable.inverse + sent_rate + cable.jump_rate,
        reference.acceleration * cable.inverse + acceleration + cable.jump_acceleration,
    )
    command = invert_servo(plan, gains.servo_frequency, gains.servo_damping)
    sane = command if abs(command) <= FURTHEST else state.drive.position
    seen = motor if valid else state.drive.place
    drive = update_drive(gains, state.drive, sane, shortfall, seen, cable.side, dt)
    return BowdenState(observer, monitor, cable, drive), way * (command + drive.fed_forward)
