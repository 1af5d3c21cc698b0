"""The few words that the operator's process sends to the loop, in shared memory: a sign of life, requests, gains, the
end.

Words of int64, each written by the operator's side alone. There is nothing to lock: a word is written whole, and a
request is distinguished from the one before by its number.
"""

import struct
from pathlib import Path

from bowden.core import shared_memory

WORDS = 8
"""Of the block."""
_HEARTBEAT, _REQUEST, _NUMBER, _QUIT, _GAIN, _VALUE, _GAIN_NUMBER = range(7)


class ControlBlock:
    """One process's view of the block.

    Raises:
        LogError: there is none.
    """

    def __init__(self, path: Path) -> None:
        memory = shared_memory.mapped(path, WORDS, "control block")
        self._words = memoryview(memory).cast("q")
        self._taken, self._gain_taken = 0, 0

    def beat(self, now: int) -> None:
        """The operator lives at `now` [ns]."""
        self._words[_HEARTBEAT] = now

    def ask(self, request: int) -> None:
        """The operator asks for a `safety.supervisor.Request`."""
        self._words[_REQUEST] = request
        self._words[_NUMBER] += 1

    def quit(self) -> None:
        """The operator wants the run to end, in a controlled release."""
        self._words[_QUIT] = 1

    def age(self, now: int) -> float:
        """Since the operator's last sign of life [s]."""
        return (now - self._words[_HEARTBEAT]) * 1e-9

    def take(self) -> int:
        """The request that came since the last call, 0 for none."""
        number = self._words[_NUMBER]
        if number == self._taken:
            return 0
        self._taken = number
        return self._words[_REQUEST]

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
        """Whether another value of a gain is wanted that has not been taken."""
        return self._words[_GAIN_NUMBER] != self._gain_taken

    def take_gain(self) -> tuple[int, float]:
        """The gain that waits, by its place in `Law.live`, and its value."""
        self._gain_taken = self._words[_GAIN_NUMBER]
        return self._words[_GAIN], struct.unpack("d", struct.pack("q", self._words[_VALUE]))[0]

    @property
    def quitting(self) -> bool:
        """Whether the run is to end."""
        return self._words[_QUIT] != 0
