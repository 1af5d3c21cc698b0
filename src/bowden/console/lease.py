"""Who controls a run from a page, since when, and whether there is a sign of life of that page. Pure: a clock is given.

The lease is a tab's, not a browser's: its name is made for one connection and dies with it, so that who comes back has
to take it anew. Once it is lost under power it is gone: a sign of life that comes late gives nothing back.
"""

import threading
from typing import NamedTuple

from bowden.core.clock import SECOND


class LeaseView(NamedTuple):
    """State of the lease at one moment."""

    holder: str
    """Name of the tab that controls; empty where none does."""
    since: int
    """Time at which it took the lease [ns]."""
    fresh: bool
    """True if its last sign of life is young enough."""


class Lease:
    """Lease of the control: the connections' thread gives signs of life, the thread that holds the run checks them.

    Args:
        limit: age of a sign of life that is still good [s].
    """

    def __init__(self, limit: float) -> None:
        self.limit = limit
        """[s]"""
        self._lock = threading.Lock()
        self._holder, self._since, self._life, self._count = "", 0, 0, -1

    def take(self, tab: str, now: int) -> None:
        """Let a tab control from `now` [ns] on, whoever did before; taking it is its first sign of life."""
        with self._lock:
            if tab != self._holder:
                self._holder, self._since, self._count = tab, now, -1
            self._life = now

    def give_back(self, tab: str) -> bool:
        """A tab does not control any more; whether it did."""
        with self._lock:
            if not tab or tab != self._holder:
                return False
            self._holder = ""
            return True

    def sign(self, tab: str, count: int, now: int) -> None:
        """A sign of life that came at `now` [ns].

        Args:
            tab: whose; of another one than the holder's it counts for nothing.
            count: grows from sign to sign; one that does not is a repetition, and counts for nothing.
            now: when it came [ns].
        """
        with self._lock:
            if tab and tab == self._holder and count > self._count:
                self._life, self._count = now, count

    def look(self, now: int) -> LeaseView:
        """How it stands at `now` [ns]."""
        with self._lock:
            fresh = bool(self._holder) and now - self._life <= self.limit * SECOND
            return LeaseView(self._holder, self._since, fresh)

    def drop(self) -> None:
        """Nobody controls any more: the lease was lost."""
        with self._lock:
            self._holder = ""
