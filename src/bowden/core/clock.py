"""The only place that reads a clock: CLOCK_MONOTONIC, in whole nanoseconds, and waiting for an absolute deadline on it.

Whole nanoseconds because deadlines are added up for hours: a float loses 0.1 µs after a day, an integer never anything.
"""

import ctypes
import errno
import time
from typing import Protocol

SECOND = 1_000_000_000
"""Nanoseconds in a second."""

_TIMER_ABSTIME = 1


class TimeSource(Protocol):
    """Clock as the loop needs it; the tests have one of their own."""

    def now(self) -> int:
        """The time [ns], from an origin that stays."""
        ...

    def sleep_until(self, deadline: int) -> None:
        """Return at `deadline` [ns] or as soon after it as the machine can; at once where it has passed."""
        ...


class _Timespec(ctypes.Structure):
    _fields_ = (("tv_sec", ctypes.c_long), ("tv_nsec", ctypes.c_long))


class MonotonicClock:
    """CLOCK_MONOTONIC: never set, never back, the same in every process of the machine."""

    def __init__(self) -> None:
        self._sleep = ctypes.CDLL(None).clock_nanosleep
        self._until = _Timespec()
        self._pointer = ctypes.byref(self._until)

    def now(self) -> int:
        """See `TimeSource.now`."""
        return time.monotonic_ns()

    def sleep_until(self, deadline: int) -> None:
        """See `TimeSource.sleep_until`; a signal that arrives meanwhile does not shorten it."""
        self._until.tv_sec, self._until.tv_nsec = divmod(deadline, SECOND)
        while self._sleep(time.CLOCK_MONOTONIC, _TIMER_ABSTIME, self._pointer, None) == errno.EINTR:
            pass


def next_deadline(deadline: int, now: int, period: int) -> tuple[int, int]:
    """The deadline after `deadline`, and how many had to be skipped because `now` is past them; all in ns.

    Deadlines stay on the grid of the first one, so that lateness never adds up; those that have passed are left out,
    so that late cycles never follow one another in a burst.

    >>> next_deadline(1000, 1300, 1000), next_deadline(1000, 2000, 1000), next_deadline(1000, 4100, 1000)
    ((2000, 0), (3000, 1), (5000, 3))
    """
    skipped = max(0, (now - deadline) // period)
    return deadline + (skipped + 1) * period, skipped


def boot_seconds() -> tuple[str, float]:
    """Which start of this computer it is, and the time since, sleep included [s]: nobody can set it."""
    with open("/proc/sys/kernel/random/boot_id", encoding="ascii") as file:
        return file.read().strip(), time.clock_gettime(time.CLOCK_BOOTTIME)


def unix_seconds() -> float:
    """Wall-clock time [s since 1970], for the names of files and what a person is shown: it may jump."""
    return time.time()
