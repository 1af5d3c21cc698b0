"""Who controls a run from a page, since when, and whether there is a sign of life of that page. Pure: a clock is given.

The lease is a tab's, not a browser's: its name is made for one connection and dies with it, so that who comes back has
to take it anew. Once it is lost under power it is gone: a sign of life that comes late gives nothing back.

What a page has seen: stamps of the states that it was sent, so that what it asks for late is refused.

A request that gives power is an answer to what its sender saw. It may come late: a slow network, a browser that tries
again, an event loop that stood still. If a stop came in between, the sender did not know of it. So each state that is
sent carries a stamp, each such request carries the newest stamp that its page had, and one that is too old, or older
than the last stop, is refused.
"""

import secrets
import threading
from collections import deque
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


class Stamps:
    """Stamps that were issued, and when the last stop was. For any thread.

    Args:
        limit: age of a stamp that is still good [s].
    """

    def __init__(self, limit: float) -> None:
        self.limit = limit
        """[s]"""
        self._lock = threading.Lock()
        self._newest = secrets.randbelow(2**40)  # another console, or the one before this one, had others
        self._first = self._newest + 1
        self._issued: deque[tuple[int, int]] = deque()
        self._stopped = -1
        self.stops = 0
        """How many there were."""

    def issue(self, looked: int) -> int:
        """A new stamp; they grow.

        Args:
            looked: when the rig was looked at for the state that carries it, not when it is sent [ns].
        """
        with self._lock:
            self._newest += 1
            self._issued.append((self._newest, looked))
            while looked - self._issued[0][1] > self.limit * SECOND:
                self._issued.popleft()
            return self._newest

    def stop(self, now: int) -> None:
        """There was a stop at `now` [ns]: what was seen until then gives no power any more."""
        with self._lock:
            self._stopped = max(self._stopped, now)
            self.stops += 1

    def why_not(self, seen: object, now: int) -> str:
        """Why a request with this stamp, which comes at `now` [ns], does nothing; empty where it may."""
        if isinstance(seen, bool) or not isinstance(seen, int):
            return "the request does not say which state of the rig its page saw last: reload the page"
        with self._lock:
            if not self._first <= seen <= self._newest:
                return "the request's stamp is none of this console: reload the page"
            looked = next((at for stamp, at in self._issued if stamp == seen), None)
            if looked is None or now - looked > self.limit * SECOND:
                return f"the request came too late, more than {self.limit:g} s after what its page saw: press again"
            if looked <= self._stopped:
                return "there was a stop after what its page saw: look at the rig, then press again"
        return ""
