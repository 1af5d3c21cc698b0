"""Plausibility of a sensor's reading: its value, and its step from the one before."""

from typing import Annotated, NamedTuple

from bowden.core.kernel import kernel
from bowden.core.quantity import Quantity


class SensorState(NamedTuple):
    """A sensor's last good reading."""

    value: Annotated[float, Quantity("the reading", "rad")]
    speed: Annotated[float, Quantity("of the good readings, through a filter of the first order", "rad/s")]
    age: Annotated[float, Quantity("time since the last good one", "s")]


@kernel
def outside(x: float, low: float, high: float) -> bool:
    """False where low ≤ x ≤ high. True else, and so wherever one of the three is not a number: a limit refuses NaN."""
    return not (low <= x <= high)


@kernel
def beyond(x: float, high: float) -> bool:
    """False where x ≤ high. True else, and so wherever one of both is not a number."""
    return not (x <= high)


@kernel
def persistence_time(condition: bool, before: float, time: float) -> float:
    """For how long a condition has held without a break [s]: `time` more than `before` while it holds, else 0."""
    return before + time if condition else 0.0


class ReadingCheck(NamedTuple):
    """Verdict on a reading: it is used as it is, or not at all."""

    sensor: SensorState
    lost: bool
    """There was no reading that can be."""
    jumped: bool
    """It is further from the last good one than noise and motion explain."""


@kernel
def follow(
    before: SensorState,
    value: float,
    came: bool,
    time: float,
    span: float,
    jump: float,
    fastest: float,
    smoothing: float,
) -> ReadingCheck:
    """The sensor after a reading `time` [s] later.

    A reading that did not come and is still the last one says nothing of the time since: neither that all stood
    still, nor how fast what comes next has moved.

    Args:
        before: the last good reading.
        value: the reading, or NaN [rad].
        came: whether it came in this cycle, and is not an older one.
        time: from the sample of the reading before to that of this one [s].
        span: largest |value| that can be [rad].
        jump: change that noise explains [rad].
        fastest: speed that motion explains [rad/s].
        smoothing: time constant of the speed's filter [s].
    """
    age = before.age + time
    aged = SensorState(before.value, before.speed, age)
    if outside(value, -span, span):
        return ReadingCheck(aged, True, False)
    change = value - before.value
    if beyond(abs(change), jump + fastest * age):
        return ReadingCheck(aged, False, True)
    if not came and change == 0.0:
        return ReadingCheck(aged, False, False)
    speed = before.speed
    if smoothing + age > 0.0:  # two readings of one sample, without a filter, say nothing of the speed
        speed = before.speed + (change - before.speed * age) / (smoothing + age)
    return ReadingCheck(SensorState(value, speed, 0.0), False, False)
