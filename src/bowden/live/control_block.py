"""The few words that the operator's process sends to the loop, in shared memory: a sign of life, requests, the end.

Words of int64, each written by the operator's side alone. There is nothing to lock: a word is written whole, and a
request is distinguished from the one before by its number.
"""

from pathlib import Path

from bowden.core import shared_memory

WORDS = 8
"""Of the block."""
_HEARTBEAT, _REQUEST, _NUMBER, _QUIT = range(4)


class ControlBlock:
    """One process's view of the block.

    Raises:
        LogError: there is none.
    """

    def __init__(self, path: Path) -> None:
        memory = shared_memory.mapped(path, WORDS, "control block")
        self._words = memoryview(memory).cast("q")
        self._taken = 0

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

    @property
    def quitting(self) -> bool:
        """Whether the run is to end."""
        return self._words[_QUIT] != 0
