"""An interruption that is not lost where Python cannot raise it."""

import contextlib
import signal
import sys
import threading
from collections.abc import Iterator
from types import FrameType
from typing import Any

AGAIN = 0.05
"""Time after which a lost interruption is sent again [s]: mostly the callback has returned by then."""


_LLVM = ("llvmlite", "numba/core/codegen.py")
"""Files in whose functions LLVM is at work, or calls back."""


@contextlib.contextmanager
def delivered() -> Iterator[None]:
    """Let an interruption wait where it could only do harm, and send it again.

    While Numba compiles, LLVM calls back into Python; an exception cannot pass through it. Ctrl-C there would print a
    warning and leave a kernel half made, or end the process. So it would in a ``__del__``: what Python ignores it hands
    to ``sys.unraisablehook``.

    Raises:
        KeyboardInterrupt: one that had to wait, at the latest when what is inside is done or has failed by it.
    """
    hook_before, handler_before = sys.unraisablehook, signal.getsignal(signal.SIGINT)
    ours = handler_before is signal.default_int_handler and threading.current_thread() is threading.main_thread()
    waiting: list[_Again] = []
    closing, late = False, list[int]()

    def wait() -> None:
        waiting.append(_Again(until_raised=ours))
        waiting[-1].start()

    def hook(lost: Any) -> None:
        if lost.exc_type is not None and issubclass(lost.exc_type, KeyboardInterrupt):
            wait()
        else:
            hook_before(lost)

    def handler(number: int, frame: FrameType | None) -> None:
        if closing:
            late.append(number)
            return
        here, waits = frame, False
        while here is not None:
            if here.f_code is wait.__code__:  # it is about to send the next
                return
            waits |= here.f_code is hook.__code__ or any(part in here.f_code.co_filename for part in _LLVM)
            here = here.f_back
        if not waits:
            for one in waiting:
                one.end()
            signal.default_int_handler(number, frame)
        elif not any(map(_Again.pending, waiting)):
            wait()

    sys.unraisablehook = hook
    if ours:
        signal.signal(signal.SIGINT, handler)
    try:
        yield
    except Exception as error:
        if any(map(_Again.pending, waiting)):
            raise KeyboardInterrupt from error
        raise
    else:
        if any(map(_Again.pending, waiting)):
            raise KeyboardInterrupt
    finally:
        closing = True
        for one in waiting:
            one.end()
            one.join()
        sys.unraisablehook = hook_before
        if ours:
            signal.signal(signal.SIGINT, handler_before)
        if late:
            raise KeyboardInterrupt


class _Again(threading.Thread):
    """An interruption that is sent every `AGAIN` until somebody has raised it; once where nobody says so."""

    def __init__(self, until_raised: bool) -> None:
        super().__init__(daemon=True)
        self._until_raised, self._over, self._sending = until_raised, threading.Event(), threading.RLock()

    def run(self) -> None:
        while not self._over.wait(AGAIN):
            with self._sending:
                if not self.pending():
                    return
                if not self._until_raised:
                    self._over.set()
                _interrupt()

    def pending(self) -> bool:
        """True if it still has to be raised."""
        return not self._over.is_set()

    def end(self) -> None:
        """It has been raised; no other is sent from now on."""
        with self._sending:
            self._over.set()


def _interrupt() -> None:
    main = threading.main_thread().ident
    if hasattr(signal, "pthread_kill") and main is not None:  # a true signal also ends a wait
        signal.pthread_kill(main, signal.SIGINT)
    else:
        signal.raise_signal(signal.SIGINT)
