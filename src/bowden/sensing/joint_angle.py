"""Estimate of a joint's angle where no encoder measures it: from the motor through the cable's model, and a sensor.

The cable's model is a play: with s = αφ·(motor − zero), its joint z stays within s ± w and moves only where it must.
The joint is

    joint = z + f + b

f is the model's error that changes on the way (a turn of the motor, a load), a Gauss–Markov process over travel and
time; b is the one that stays (a sheath that was moved). A sensor shows, a `delay` late,

    value = joint(t − delay) + d + noise

where d is its own systematic error and drift. A Kalman filter of (f, b, d) takes each value that comes as it compares
with the prediction of that time. One further off than `GATE` of the standard deviations with which the last one was
taken is left out. Without values the prediction goes on, and its standard deviation grows.

Source: R. E. Kalman, "A new approach to linear filtering and prediction problems", J. Basic Eng. 82 (1960).
"""

import math
from typing import Annotated, NamedTuple

from bowden.core.kernel import exp, floor, kernel, sqrt
from bowden.core.quantity import Quantity
from bowden.core.units import RADIANS

GATE = 5.0
"""Standard deviations beyond which a value is not taken [–]."""
CREDIBLE = 3.0
"""Standard deviations of the model's error by which a sensor may correct it; what goes beyond is doubt: a sensor that
stands still, or is off, is accepted step by step, each of which is small [–]."""
STAYS = 0.5
"""Share of the model's variance that stays, b; the rest changes on the way, f [–]."""
TRAVEL = 30.0 * RADIANS
"""Of the joint, over which f is forgotten: the way from one side of a usual stroke's loop to the other [rad]."""
CHANGES, CREEPS = 10.0, 600.0
"""Times over which f and b are forgotten at rest [s]."""
LATE = 5.0
"""Periods of the sensor without a value after which it counts as silent [–]."""
UNSEEN = 10.0 * RADIANS
"""Growth of the standard deviation while a sensor is silent: how fast a limb may go where nothing shows it [rad/s]."""
LENGTH = 8
"""Predictions that are remembered."""
MISSED = 100
"""Cycles that one step makes up for at most."""

History = tuple[float, float, float, float, float, float, float, float]


class JointModel(NamedTuple):
    """Knowledge of cable and sensor."""

    slope: float
    """αφ, joint motion per motor motion [rad/rad]."""
    zero: float
    """Motor angle at which the joint is at zero [rad]."""
    play: float
    """w, half of what the joint loses at a reversal [rad]."""
    error: float
    """Standard deviation of the model's joint [rad]."""
    period: float = 0.0
    """Between two values of the sensor; 0 without one [s]."""
    delay: float = 0.0
    """Age of a value when it comes [s]."""
    noise: float = 0.0
    """Standard deviation of a value's noise [rad]."""
    offset: float = 0.0
    """Standard deviation of the sensor's systematic error [rad]."""
    drift: float = 0.0
    """Speed with which that error may grow [rad/s]."""


class Covariance(NamedTuple):
    """Of the errors f, b and d [rad²]."""

    ff: float
    fb: float
    fd: float
    bb: float
    bd: float
    dd: float


class JointEstimate(NamedTuple):
    """The joint's angle with its standard deviation, and the filter's state."""

    angle: Annotated[float, Quantity("of the joint", "rad")]
    std: Annotated[float, Quantity("standard deviation of the angle", "rad")]
    age: Annotated[float, Quantity("since the sensor's last value that was taken", "s")]
    cable: Annotated[float, Quantity("z, the cable model's joint", "rad")]
    shown: Annotated[float, Quantity("f + b as it is shown: a correction is spread over the sensor's period", "rad")]
    changing: Annotated[float, Quantity("f", "rad")]
    staying: Annotated[float, Quantity("b", "rad")]
    sensor: Annotated[float, Quantity("d", "rad")]
    covariance: Covariance
    expected: Annotated[float, Quantity("variance of a value, when the last one was taken", "rad²")]
    refused: Annotated[float, Quantity("values left out, less those taken since")]
    history: History
    """z, the newest last, `stride` apart [rad]."""
    since: Annotated[float, Quantity("cycles since the history's newest")]


class MotorReach(NamedTuple):
    """How far a motor can go between two readings."""

    speed: float
    """[rad/s]"""
    jump: float
    """Beyond that [rad]."""
    span: float
    """Largest angle [rad]."""


class TrackedJoint(NamedTuple):
    """The estimate, and which readings of the motor it believes."""

    estimate: JointEstimate
    motor: Annotated[float, Quantity("last one that was new and accepted", "rad")]
    since: Annotated[float, Quantity("time since that", "s")]
    suspect: Annotated[float, Quantity("the one just before, where it was not accepted", "rad")]


@kernel
def track_start(model: JointModel) -> TrackedJoint:
    """Before the motor's first reading: there is no angle yet."""
    return TrackedJoint(estimate_start(model, math.nan), math.nan, 0.0, math.nan)


@kernel
def track_step(
    model: JointModel,
    reach: MotorReach,
    state: TrackedJoint,
    motor: float,
    age: float,
    value: float,
    elapsed: float,
    dt: float,
) -> TrackedJoint:
    """One cycle of a loop later, which may be late.

    A reading that no motor can have reached would move the joint's estimate with it, and is left out; a second one
    beside it is accepted: the first of all may have been the spike.

    Args:
        model: of cable and sensor.
        reach: of the motor.
        state: before.
        motor: measured angle; NaN where it is missing [rad].
        age: of that reading; 0 of a new one [cycles].
        value: of the sensor; NaN where none came in this cycle [rad].
        elapsed: time since the last step [s].
        dt: length of a cycle [s].
    """
    accepted, last, since, suspect = motor, state.motor, state.since + elapsed, state.suspect
    if not abs(motor) <= reach.span:
        accepted = math.nan
    elif abs(motor - last) > reach.jump + reach.speed * since and not (
        abs(motor - suspect) <= reach.jump + reach.speed * dt
    ):
        accepted, suspect = math.nan, motor
    else:
        suspect = math.nan
        if age == 0.0:
            last, since = motor, 0.0
    estimate = state.estimate
    if math.isnan(estimate.cable) and not math.isnan(accepted):
        estimate = estimate_start(model, accepted)
    missed = floor(elapsed / dt + 0.5)
    for k in range(1, MISSED):
        if k < missed:
            estimate = estimate_step(model, estimate, accepted, math.nan, dt)
    return TrackedJoint(estimate_step(model, estimate, accepted, value, dt), last, since, suspect)


@kernel
def estimate_start(model: JointModel, motor: float) -> JointEstimate:
    """The joint where the cable has it at a motor angle [rad], in the middle of its play; no value has come yet."""
    cable, variance = model.slope * (motor - model.zero), model.error * model.error
    covariance = Covariance((1.0 - STAYS) * variance, 0.0, 0.0, STAYS * variance, 0.0, model.offset * model.offset)
    history = (cable, cable, cable, cable, cable, cable, cable, cable)
    std = model.error if model.period == 0.0 else math.inf
    expected = variance + model.offset * model.offset + model.noise * model.noise
    return JointEstimate(cable, std, math.inf, cable, 0.0, 0.0, 0.0, 0.0, covariance, expected, 0.0, history, 0.0)


@kernel
def estimate_step(model: JointModel, state: JointEstimate, motor: float, value: float, dt: float) -> JointEstimate:
    """One cycle later.

    Args:
        model: of cable and sensor.
        state: before.
        motor: measured angle; where it is missing the prediction stands still [rad].
        value: of the sensor, an angle of the joint `delay` ago; NaN where none came in this cycle [rad].
        dt: length of a cycle [s].
    """
    middle = state.cable if math.isnan(motor) else model.slope * (motor - model.zero)
    cable = max(middle - model.play, min(middle + model.play, state.cable))
    changing, staying, sensor, covariance = predicted(model, state, abs(cable - state.cable), dt)
    history, since = remembered(model, state, cable, dt)
    age, expected, refused = state.age + dt, state.expected, state.refused
    if not math.isnan(value):
        error = value - cable_then(model, history, since, cable, dt) - changing - staying - sensor
        f = covariance.ff + covariance.fb + covariance.fd
        b = covariance.fb + covariance.bb + covariance.bd
        d = covariance.fd + covariance.bd + covariance.dd
        total = f + b + d + model.noise * model.noise
        if error * error <= GATE * GATE * expected:
            part, expected, refused = 1.0 / total, total, max(0.0, refused - 1.0)
            if refused == 0.0 or not math.isfinite(age):  # one taken among many left out is no sign of life
                age = 0.0
            changing, staying, sensor = (
                changing + f * part * error,
                staying + b * part * error,
                sensor + d * part * error,
            )
            covariance = Covariance(
                covariance.ff - part * f * f,
                covariance.fb - part * f * b,
                covariance.fd - part * f * d,
                covariance.bb - part * b * b,
                covariance.bd - part * b * d,
                covariance.dd - part * d * d,
            )
        else:
            refused += 1.0
    shown = state.shown + (changing + staying - state.shown) * dt / max(dt, model.period)
    std = deviation(model, covariance, age, changing + staying)
    return JointEstimate(
        cable + shown, std, age, cable, shown, changing, staying, sensor, covariance, expected, refused, history, since
    )


@kernel
def predicted(
    model: JointModel, state: JointEstimate, travel: float, dt: float
) -> tuple[float, float, float, Covariance]:
    """The errors f, b, d and their covariance one cycle later, after a `travel` of the cable's joint [rad]."""
    keeps, stays = exp(-travel / TRAVEL - dt / CHANGES), exp(-dt / CREEPS)
    variance, before = model.error * model.error, state.covariance
    grown = sqrt(max(0.0, before.dd)) + model.drift * dt
    covariance = Covariance(
        keeps * keeps * before.ff + (1.0 - keeps * keeps) * (1.0 - STAYS) * variance,
        keeps * stays * before.fb,
        keeps * before.fd,
        stays * stays * before.bb + (1.0 - stays * stays) * STAYS * variance,
        stays * before.bd,
        grown * grown,
    )
    return keeps * state.changing, stays * state.staying, state.sensor, covariance


@kernel
def deviation(model: JointModel, covariance: Covariance, age: float, correction: float) -> float:
    """Standard deviation of the joint's angle; without a first value of a sensor there is none, and it is infinite.

    Args:
        model: of cable and sensor.
        covariance: of the errors.
        age: since the sensor's last value [s].
        correction: by which the sensor has moved the model's joint, f + b [rad].
    """
    known = sqrt(max(0.0, covariance.ff + 2.0 * covariance.fb + covariance.bb))
    known += max(0.0, abs(correction) - CREDIBLE * model.error)
    return known if model.period == 0.0 else known + UNSEEN * max(0.0, age - LATE * model.period)


@kernel
def stride(model: JointModel, dt: float) -> float:
    """Cycles from one prediction that is remembered to the next: all together reach back over the delay."""
    return max(1.0, -floor(-model.delay / (dt * (LENGTH - 2))))


@kernel
def remembered(model: JointModel, state: JointEstimate, cable: float, dt: float) -> tuple[History, float]:
    """The history with the newest prediction, once it is due, and the cycles since its newest."""
    since, h = state.since + 1.0, state.history
    if since < stride(model, dt):
        return h, since
    return (h[1], h[2], h[3], h[4], h[5], h[6], h[7], cable), 0.0


@kernel
def cable_then(model: JointModel, history: History, since: float, cable: float, dt: float) -> float:
    """The cable model's joint a `delay` ago, on a line between the predictions that are remembered [rad]."""
    back = model.delay / dt
    if back <= since:
        return cable if since == 0.0 else cable + (history[LENGTH - 1] - cable) * back / since
    place = max(0.0, (LENGTH - 1) - (back - since) / stride(model, dt))
    then = history[0]
    for k in range(LENGTH - 1):
        if k <= place:
            then = history[k] + (history[k + 1] - history[k]) * (place - k)
    return then
