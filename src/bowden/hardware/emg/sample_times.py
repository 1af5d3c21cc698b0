"""When samples were taken, from how many came and when: evenly spaced, causal, increasing, following a clock's drift.

A sender takes samples evenly; what is known of each lot is a time that is too late by a delay that is never negative,
small as a rule and large at times: the sender's own stamp, or the arrival. So the least delay in a window is believed,
and a loop of second order follows it in phase and rate. Within a window times are a straight line over the samples.
"""

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_WINDOW = 1.0
"""The least delay is looked for in this time; in less at the start [s]."""
_GROWING = 4
"""The first windows double; the fourth is whole."""
_PHASE, _RATE = 0.3, 0.04
"""Shares of a window's least delay that go into phase and rate: nearly critical damping."""
_MISSED = 0.03
"""Delays of more throughout a window are samples that never came [s]."""
_TURNED = 0.5
"""Times this much too early are of a clock that was turned back: the count goes on from the last time [s]."""
_SLOWEST = 0.5
"""Least period that the loop may take to get back, as a share of it."""
_CLOSEST = 1e-9
"""Least time between two samples, where those that would lie in the future are packed [s]."""
LONGEST_FILL = 1.0
"""Of a gap, at most its last this many seconds are filled with missing samples [s]."""


class SampleTimes:
    """Times of the samples of one stream of `rate` samples a second.

    >>> times = SampleTimes(1000.0)
    >>> times.next(3, 5.0)
    array([4.998, 4.999, 5.   ])
    >>> times.next(2, 5.002)
    array([5.001, 5.002])
    """

    def __init__(self, rate: float) -> None:
        self._nominal = 1.0 / rate
        self.missed = 0.0
        """Time in which samples were taken that never came, as far as it shows [s]."""
        self.last = -math.inf
        """Time of the last sample [s]."""
        self.restart()

    def restart(self) -> None:
        """Forget phase and rate, as after a gap; times stay increasing."""
        self._period = self._nominal
        self._slope = self._nominal
        self._windows = 0
        self._least, self._until = math.inf, -math.inf
        self._locked = False
        self._time = self.last
        """Where the loop has the last sample, if it is in the future as well [s]."""

    def gap(self, first: float, now: float = math.inf) -> Array:
        """Times of missing samples before one that was taken at `first` [s], after a silence; then `restart`.

        None of them is later than `now` [s].
        """
        first = min(first, now)
        count = round((first - self.last) / self._nominal) - 1 if math.isfinite(self.last) else 0
        count = max(0, min(count, round(LONGEST_FILL / self._nominal)))
        self.restart()
        filled: Array = first - self._nominal * np.arange(count, 0, -1, dtype=np.float64)
        filled = filled[filled > self.last]
        if len(filled):
            self.last = float(filled[-1])
        return filled

    def next(self, count: int, latest: float, now: float = math.inf) -> Array:
        """Times of the next `count` samples.

        Args:
            count: at least 1.
            latest: when the last of them was taken, or later [s].
            now: the time that it is [s]; none of them was taken later.
        """
        late = latest - (self._time + count * self._slope)
        if self._locked and late < -_TURNED:
            self.restart()
        if not self._locked:
            self._locked = True
            self._time = max(min(latest, now) - count * self._nominal, self.last)
            self._until = latest + 0.1 * _WINDOW
        else:
            self._look(late, latest)
        start = max(self.last, min(self._time, now))
        self._time += count * self._slope
        end = max(min(self._time, now), start + count * _CLOSEST)
        self.last = end
        times: Array = start + (end - start) / count * np.arange(1, count + 1, dtype=np.float64)
        return times

    def _look(self, late: float, latest: float) -> None:
        """Take note of one lot's delay, and at the end of a window draw the conclusion."""
        self._least = min(self._least, late)
        if latest < self._until:
            return
        self._windows += 1
        window = min(_WINDOW, 0.1 * _WINDOW * 2.0 ** min(self._windows, _GROWING))
        if self._least > _MISSED:
            self.missed += self._least
            self._time += self._least
            self._slope = self._period
        else:
            phase = max(_PHASE, 1.0 / self._windows)
            if self._windows > 3:
                self._period *= 1.0 + _RATE * self._least / _WINDOW
            self._slope = self._period * (1.0 + phase * self._least / window)
            self._slope = max(_SLOWEST * self._period, self._slope)
        self._least, self._until = math.inf, latest + window
