"""Distributions of a campaign's parameters, each a function of one number that is even on [0, 1).

A run draws one such number for each parameter, so that what is added behind the others leaves their values as they
were.
"""

import math
import statistics
from collections.abc import Mapping
from dataclasses import dataclass

from bowden.core.errors import ParameterError

Value = float | int | str

KINDS: Mapping[str, str] = {
    "uniform": "[low, high] with low below high",
    "log_uniform": "[low, high] with 0 < low < high",
    "normal": "[mean, deviation] with a deviation above 0, and low and high between which a draw can fall",
    "integer": "[low, high], whole numbers, low not above high",
    "choice": "a list with one value or more",
    "fixed": "one number",
}
"""Kinds of a distribution, and the parameters of each."""
_NORMAL = statistics.NormalDist()


@dataclass(frozen=True)
class Distribution:
    """Distribution of a parameter over the runs.

    Raises:
        ParameterError: an unknown kind, or numbers that make no distribution.
    """

    kind: str
    """A key of `KINDS`."""
    given: tuple[Value, ...]
    """Its numbers as they stand in the file; of a normal one with both bounds."""

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ParameterError(f"there is no distribution {self.kind!r}", expected=" or ".join(KINDS))
        if not self._can_be():
            raise ParameterError(f"{self.kind} is {list(self.given)}", expected=KINDS[self.kind])

    def _can_be(self) -> bool:
        given = self.given
        if any(isinstance(one, bool) or (isinstance(one, float) and not math.isfinite(one)) for one in given):
            return False
        if self.kind == "choice":
            return len(given) > 0
        if self.kind == "fixed":
            return len(given) == 1
        numbers = [one for one in given if not isinstance(one, str)]
        if len(numbers) != len(given) or len(given) != (4 if self.kind == "normal" else 2):
            return False
        low, high = numbers[-2:]
        if self.kind == "integer":
            return all(isinstance(one, int) for one in numbers) and low <= high
        if self.kind == "normal":
            return numbers[1] > 0.0 and low < high and self._shares[1] - self._shares[0] >= 1e-12
        return low < high and (self.kind == "uniform" or low > 0.0)

    @property
    def ends(self) -> tuple[Value, ...]:
        """The smallest and the largest value; of a choice, all values."""
        if self.kind in ("uniform", "log_uniform", "normal"):
            return tuple(map(float, self.given[-2:]))
        return self.given

    def value(self, u: float) -> Value:
        """The parameter's value of a number from [0, 1)."""
        if self.kind in ("choice", "fixed"):
            return self.given[min(int(u * len(self.given)), len(self.given) - 1)]
        if self.kind == "integer":
            first, last = map(int, self.given)
            return min(first + int(u * (last - first + 1)), last)
        low, high = map(float, self.given[-2:])
        if self.kind == "uniform":
            return min(low + (high - low) * u, high)
        if self.kind == "log_uniform":
            return min(max(low * math.exp(math.log(high / low) * u), low), high)
        mean, deviation, (least, most), side = *map(float, self.given[:2]), self._shares, self._side
        below = least + (most - least) * (u if side > 0.0 else 1.0 - u)
        if not 0.0 < below < 1.0:  # so far out that it has no share of its own
            return low if (below <= 0.0) == (side > 0.0) else high
        return min(max(mean + side * deviation * _NORMAL.inv_cdf(below), low), high)

    @property
    def _side(self) -> float:
        """From which a normal one is looked at: there shares are small, and their differences exact."""
        mean, _, low, high = map(float, self.given)
        return 1.0 if low + high <= 2.0 * mean else -1.0

    @property
    def _shares(self) -> tuple[float, float]:
        """Of a whole normal distribution, those below both bounds, seen from its `_side`."""
        mean, deviation, low, high = map(float, self.given)
        ends = sorted(self._side * (end - mean) / deviation for end in (low, high))
        least, most = (0.5 * math.erfc(-end / math.sqrt(2.0)) for end in ends)
        return least, most
