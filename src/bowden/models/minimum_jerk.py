"""The motion of minimum jerk: the one place of its polynomial and of its derivatives.

Of all motions that go from rest to rest in a given time, it has the least ∫ jerk² dt. Source: Flash and Hogan, Journal
of Neuroscience 5(7), 1985.
"""

from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from bowden.core.kernel import kernel
from bowden.core.signals import Reference

Array = NDArray[np.float64]

PEAK_SPEED = 1.875
"""Largest speed over the mean one, 15/8 [–]."""


@kernel
def minimum_jerk(start: float, end: float, duration: float, time: float) -> Reference:
    """The motion of minimum jerk from `start` to `end` [rad], resting before and after it; times in seconds.

        φ = start + (end − start)·(10x³ − 15x⁴ + 6x⁵),  x = time/duration

    >>> [float(v) for v in minimum_jerk(0.0, 2.0, 4.0, 2.0)]
    [1.0, 0.9375, 0.0]
    """
    return rest_to_rest(start, end, duration, max(0.0, min(1.0, time / duration)))


@kernel
def rest_to_rest(start: float, end: float, duration: float, x: float) -> Reference:
    """`minimum_jerk` at the share x of its time, 0…1. Arithmetic alone, so that arrays pass through."""
    span, speed = end - start, 1.0 / duration
    return Reference(
        start + span * x * x * x * (10.0 + x * (6.0 * x - 15.0)),
        span * speed * 30.0 * x * x * (1.0 + x * (x - 2.0)),
        span * speed * speed * 60.0 * x * (1.0 + x * (2.0 * x - 3.0)),
    )


@kernel
def minimum_jerk_share(phase: float) -> float:
    """Share of the way that is behind at a `phase` of the time, 0 before it and 1 after it.

    >>> float(minimum_jerk_share(0.5))
    0.5
    """
    return minimum_jerk(0.0, 1.0, 1.0, phase).position


@kernel
def minimum_jerk_from(begin: Reference, end: float, duration: float, time: float) -> Reference:
    """The quintic from `begin`, which may move, to rest at `end` [rad] in a `duration` > 0; at rest afterwards.

    Where `begin` rests it is `minimum_jerk`.

    >>> [float(value) for value in minimum_jerk_from(Reference(0.0, 0.0, 0.0), 1.0, 2.0, 1.0)]
    [0.5, 0.9375, 0.0]
    """
    if time >= duration:
        return Reference(end, 0.0, 0.0)
    s = max(0.0, min(1.0, time / duration))
    way, speed, bend = begin.position - end, begin.velocity * duration, begin.acceleration * duration * duration
    third = -10.0 * way - 6.0 * speed - 1.5 * bend
    fourth = 15.0 * way + 8.0 * speed + 1.5 * bend
    fifth = -6.0 * way - 3.0 * speed - 0.5 * bend
    position = end + way + s * (speed + s * (0.5 * bend + s * (third + s * (fourth + s * fifth))))
    velocity = speed + s * (bend + s * (3.0 * third + s * (4.0 * fourth + s * 5.0 * fifth)))
    acceleration = bend + s * (6.0 * third + s * (12.0 * fourth + s * 20.0 * fifth))
    return Reference(position, velocity / duration, acceleration / (duration * duration))


def minimum_jerk_over(
    start: float | Array, end: float | Array, duration: float | Array, time: Array
) -> tuple[Array, Array, Array]:
    """`minimum_jerk` over arrays: position, velocity and acceleration, each of the shape of `time`."""
    over: Any = rest_to_rest
    x = np.clip(np.nan_to_num(time / duration, nan=1.0), 0.0, 1.0)  # 0/0: a motion that takes no time is over
    return cast(tuple[Array, Array, Array], tuple(over(start, end, duration, x)))
