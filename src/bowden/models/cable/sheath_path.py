"""How the sheath is bent over time: constant, scripted, or a random smooth path."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import ParameterError
from bowden.models.minimum_jerk import minimum_jerk_over

BendPath = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""Time (n,) [s] → total bend angle of the sheath (n,) [rad]."""


def constant_bend(bend: float) -> BendPath:
    """A sheath that is not moved [rad]."""
    return lambda time: np.full(len(time), bend)


def scripted_bend(times: Sequence[float], bends: Sequence[float]) -> BendPath:
    """A sheath moved through way points, with minimum-jerk motion from each to the next, and held outside them.

    Args:
        times: increasing (k,) [s].
        bends: total bend angle at each time (k,) [rad].

    Raises:
        ParameterError: lengths that differ, fewer than two points, times that do not increase, a bend that is not
            positive.
    """
    at, to = np.asarray(times, dtype=float), np.asarray(bends, dtype=float)
    if at.shape != to.shape or at.ndim != 1 or len(at) < 2 or not np.all(np.diff(at) > 0) or not np.all(to > 0):
        raise ParameterError(
            f"sheath path: times {list(times)}, bends {list(bends)}",
            expected="two lists of one length (two points or more), times increasing, bends above 0",
        )

    def path(time: NDArray[np.float64]) -> NDArray[np.float64]:
        t = np.clip(time, at[0], at[-1])
        i = np.clip(np.searchsorted(at, t, side="right") - 1, 0, len(at) - 2)
        return minimum_jerk_over(to[i], to[i + 1], at[i + 1] - at[i], t - at[i])[0]

    return path


def random_bend(low: float, high: float, fastest: float, duration: float, seed: int) -> BendPath:
    """A random smooth path: minimum-jerk moves between random bends at random times.

    Args:
        low: smallest bend [rad].
        high: largest bend [rad].
        fastest: shortest time of one move; moves take between this and three times as long [s].
        duration: how long the path lasts [s].
        seed: of the random numbers.

    Raises:
        ParameterError: a range that is empty or not positive, a time that is not positive.
    """
    if not (0.0 < low < high and fastest > 0.0 and duration > 0.0):
        raise ParameterError(
            f"random sheath path: low {low}, high {high}, fastest {fastest}, duration {duration}",
            expected="0 < low < high, fastest > 0, duration > 0",
        )
    random = np.random.default_rng(seed)
    count = 2 + int(duration / fastest)
    times = np.concatenate([[0.0], np.cumsum(random.uniform(fastest, 3.0 * fastest, count))])
    return scripted_bend(times.tolist(), random.uniform(low, high, count + 1).tolist())
