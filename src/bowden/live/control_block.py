"""The few words that the operator's process sends to the loop, in shared memory: a sign of life, requests, gains, the
end.

Words of int64, each written by one side alone, and whole.

A stop is never overwritten. All requests are numbered in the order in which they are asked. A stop has a word of its
own, which is its number and only grows; any other request has one word for its number and what it is. The loop takes a
stop first, drops any other request that it finds in the same cycle, and takes none that was asked before a stop. It
writes the number of the stop back.
"""

import struct
import threading
from pathlib import Path

from bowden.hardware import shared_memory
from bowden.safety.state import Request

WORDS = 8
"""Of the block."""
_HEARTBEAT, _REQUEST, _STOP, _STOP_TAKEN, _QUIT, _GAIN, _VALUE, _GAIN_NUMBER = range(WORDS)
_KIND = 8
"""The word of a request is its number times this, and the `Request`."""
_REQUESTS = (*Request, *[Request.NONE] * (_KIND - len(Request)))


class ControlBlock:
    """One process's view of the block.

    Raises:
        LogError: there is none.
    """

    def __init__(self, path: Path) -> None:
        memory = shared_memory.mapped(path, "control block", WORDS)
        self._words = memoryview(memory).cast("q")
        self._taken, self._gain_taken = 0, 0
        self._asking = threading.RLock()  # whoever is interrupted by a signal may ask again

    def beat(self, now: int) -> None:
        """The operator lives at `now` [ns]."""
        self._words[_HEARTBEAT] = now

    def ask(self, request: Request, stops: int | None = None) -> None:
        """The operator asks for something; any thread of its process may.

        Args:
            request: for what.
            stops: `stops` when this was decided on: nothing is asked if there was a stop since. Any will do by default.
        """
        with self._asking:
            last = self._words[_STOP]
            number = 1 + max(last, self._words[_REQUEST] // _KIND)
            if request == Request.STOP:
                self._words[_STOP] = number
            elif stops in (None, last):
                self._words[_REQUEST] = number * _KIND + request

    @property
    def stops(self) -> int:
        """Number of the last stop that was asked for; it only grows, and is 0 before the first."""
        return self._words[_STOP]

    @property
    def stop_waits(self) -> bool:
        """True if the loop has not taken the last stop yet."""
        return self._words[_STOP_TAKEN] != self._words[_STOP]

    def quit(self) -> None:
        """The operator wants the run to end, in a controlled release."""
        self._words[_QUIT] = 1

    def age(self, now: int) -> float:
        """Since the operator's last sign of life [s]."""
        return (now - self._words[_HEARTBEAT]) * 1e-9

    def take(self) -> Request:
        """The `Request` that came since the last call; for the loop."""
        asked, stop = self._words[_REQUEST], self._words[_STOP]
        new, self._taken = asked != self._taken, asked
        if stop != self._words[_STOP_TAKEN]:
            self._words[_STOP_TAKEN] = stop
            return Request.STOP
        return _REQUESTS[asked % _KIND] if new and asked // _KIND > stop else Request.NONE

    def ask_gain(self, which: int, value: float) -> None:
        """The operator wants another value of a gain, which has been checked; one after the other.

        Args:
            which: its place in `Law.live`.
            value: in the unit of the law.
        """
        self._words[_GAIN] = which
        self._words[_VALUE] = struct.unpack("q", struct.pack("d", value))[0]
        self._words[_GAIN_NUMBER] += 1

    @property
    def gain_waits(self) -> bool:
        """True if another value of a gain is wanted that has not been taken."""
        return self._words[_GAIN_NUMBER] != self._gain_taken

    def take_gain(self) -> tuple[int, float]:
        """The gain that waits, by its place in `Law.live`, and its value."""
        self._gain_taken = self._words[_GAIN_NUMBER]
        return self._words[_GAIN], struct.unpack("d", struct.pack("q", self._words[_VALUE]))[0]

    @property
    def quitting(self) -> bool:
        """True if the run is to end."""
        return self._words[_QUIT] != 0
