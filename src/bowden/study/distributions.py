"""Distributions of a campaign's parameters, each a function of one number that is even on [0, 1).

A run draws one such number for each parameter, so that what is added behind the others leaves their values as they
were.
"""

import math
import statistics
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from bowden.core.errors import ParameterError

Value = float | int | str


@dataclass(frozen=True)
class Distribution:
    """Distribution of a parameter over the runs."""

    kind: str
    """A key of `KINDS`."""
    given: tuple[Value, ...]
    """Its numbers as they stand in the file; of a normal one with both bounds."""
    value: Callable[[float], Value]
    """A number from [0, 1) → the parameter's value."""
    ends: tuple[Value, ...]
    """The smallest and the largest value; of a choice, all values."""


def distribution(kind: str, given: Sequence[Value]) -> Distribution:
    """One distribution.

    Args:
        kind: a key of `KINDS`.
        given: its numbers.

    Raises:
        ParameterError: an unknown kind, or numbers that make no distribution.
    """
    if kind not in KINDS:
        raise ParameterError(f"there is no distribution {kind!r}", expected=" or ".join(KINDS))
    made = KINDS[kind](tuple(given))
    if made is None:
        raise ParameterError(f"{kind} is {list(given)}", expected=WANTED[kind])
    return Distribution(kind, tuple(given), *made)


_Made = tuple[Callable[[float], Value], tuple[Value, ...]] | None


def _numbers(given: tuple[Value, ...], count: int) -> tuple[float, ...] | None:
    """The numbers, if there are this many and all are finite."""
    fine = len(given) == count and all(
        isinstance(one, int | float) and not isinstance(one, bool) and math.isfinite(one) for one in given
    )
    return tuple(float(one) for one in given) if fine else None


def _uniform(given: tuple[Value, ...]) -> _Made:
    found = _numbers(given, 2)
    if found is None or not found[0] < found[1]:
        return None
    low, high = found
    return lambda u: min(low + (high - low) * u, high), (low, high)


def _log_uniform(given: tuple[Value, ...]) -> _Made:
    found = _numbers(given, 2)
    if found is None or not 0.0 < found[0] < found[1]:
        return None
    low, high = found
    span = math.log(high / low)
    return lambda u: min(max(low * math.exp(span * u), low), high), (low, high)


_NORMAL = statistics.NormalDist()


def _normal(given: tuple[Value, ...]) -> _Made:
    found = _numbers(given, 4)
    if found is None or not (found[1] > 0.0 and found[2] < found[3]):
        return None
    mean, deviation, low, high = found
    # seen from the side on which the numbers are small, where their differences are exact
    side = 1.0 if low + high <= 2.0 * mean else -1.0
    ends = sorted(side * (end - mean) / deviation for end in (low, high))
    least, most = (0.5 * math.erfc(-end / math.sqrt(2.0)) for end in ends)
    if most - least < 1e-12:
        return None

    def value(u: float) -> float:
        share = u if side > 0.0 else 1.0 - u
        below = least + (most - least) * share
        if not 0.0 < below < 1.0:  # so far out that it has no share of its own
            return low if (below <= 0.0) == (side > 0.0) else high
        return min(max(mean + side * deviation * _NORMAL.inv_cdf(below), low), high)

    return value, (low, high)


def _integer(given: tuple[Value, ...]) -> _Made:
    if len(given) != 2 or any(type(one) is not int for one in given) or not given[0] <= given[1]:  # type: ignore[operator]
        return None
    low, high = int(given[0]), int(given[1])
    return lambda u: min(low + int(u * (high - low + 1)), high), (low, high)


def _choice(given: tuple[Value, ...]) -> _Made:
    if not given or any(isinstance(one, bool) for one in given):
        return None
    if any(isinstance(one, float) and not math.isfinite(one) for one in given):
        return None
    return lambda u: given[min(int(u * len(given)), len(given) - 1)], given


def _fixed(given: tuple[Value, ...]) -> _Made:
    made = _choice(given)
    return made if len(given) == 1 else None


KINDS: dict[str, Callable[[tuple[Value, ...]], _Made]] = {
    "uniform": _uniform,
    "log_uniform": _log_uniform,
    "normal": _normal,
    "integer": _integer,
    "choice": _choice,
    "fixed": _fixed,
}
"""The kinds by their names."""

WANTED: dict[str, str] = {
    "uniform": "[low, high] with low below high",
    "log_uniform": "[low, high] with 0 < low < high",
    "normal": "[mean, deviation] with a deviation above 0, and low and high between which a draw can fall",
    "integer": "[low, high], whole numbers, low not above high",
    "choice": "a list with one value or more",
    "fixed": "one number",
}
"""Parameters of each of them."""


def describe(one: Distribution) -> dict[str, Any]:
    """A distribution as JSON values."""
    return {one.kind: list(one.given)}
