"""Whether a sensor's reading can be used: whether it can be, and whether it can follow the one before."""

from typing import Annotated, NamedTuple

import numpy as np

from bowden.core.kernel import kernel, sel
from bowden.core.quantity import Quantity


class Followed(NamedTuple):
    """A sensor's last good reading."""

    value: Annotated[float, Quantity("the reading", "rad")]
    speed: Annotated[float, Quantity("of the good readings, through a filter of the first order", "rad/s")]
    age: Annotated[float, Quantity("time since the last good one", "s")]


@kernel
def outside(x: float, low: float, high: float) -> float:
    """0 where low ≤ x ≤ high, else 1: so for what is not a number."""
    return sel((x >= low) * (x <= high), 0.0, 1.0)


@kernel
def beyond(x: float, high: float) -> float:
    """0 where x ≤ high, else 1: so for what is not a number."""
    return sel(x <= high, 0.0, 1.0)


@kernel
def lasting(condition: float, before: float, time: float) -> float:
    """For how long a condition of 0 or 1 has held [s], after `before`."""
    return sel(condition > 0.0, before + time, 0.0)


@kernel
def follow(
    before: Followed, value: float, came: float, time: float, span: float, jump: float, fastest: float, smoothing: float
) -> tuple[Followed, float, float]:
    """The sensor after a reading `time` [s] later, which is used as it is or not at all.

    A reading that did not come and is still the last one says nothing of the time since: neither that all stood
    still, nor how fast what comes next has moved.

    Args:
        before: the last good reading.
        value: the reading, or NaN [rad].
        came: 1 where it came in this cycle, 0 where it is an older one.
        time: from the sample of the reading before to that of this one [s].
        span: largest |value| that can be [rad].
        jump: change that noise explains [rad].
        fastest: speed that motion explains [rad/s].
        smoothing: time constant of the speed's filter [s].

    Returns:
        The sensor; 1 if there was no reading that can be, else 0; 1 if it jumped, else 0.
    """
    age = before.age + time
    lost = outside(value, -span, span)
    now = sel(lost > 0.0, before.value, value)
    change = now - before.value
    jumped = beyond(np.abs(change), jump + fastest * age)
    good = (np.fmax(lost, jumped) == 0.0) * (1.0 - (came == 0.0) * (change == 0.0)) > 0.0
    speed = before.speed + (change - before.speed * age) / (smoothing + age)
    return Followed(sel(good, now, before.value), sel(good, speed, before.speed), sel(good, 0.0, age)), lost, jumped
