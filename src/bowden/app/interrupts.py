"""An interruption that is not lost where Python cannot raise it."""

import contextlib
import signal
import sys
import threading
from collections.abc import Iterator
from typing import Any

AGAIN = 0.05
"""How long after it was lost an interruption is sent again [s]: the callback has returned by then."""


@contextlib.contextmanager
def delivered() -> Iterator[None]:
    """Send an interruption again that came where it could only be ignored.

    While Numba compiles, LLVM calls back into Python; an exception cannot pass through it, and Ctrl-C there would print
    a warning and change nothing. So it is in a ``__del__``. Python hands what it ignores to ``sys.unraisablehook``.

    Raises:
        KeyboardInterrupt: one that was lost, at the latest when what is inside is done.
    """
    before = sys.unraisablehook
    waiting: list[threading.Timer] = []

    def hook(lost: Any) -> None:
        if lost.exc_type is not None and issubclass(lost.exc_type, KeyboardInterrupt):
            waiting.append(threading.Timer(AGAIN, _interrupt))
            waiting[-1].start()
        else:
            before(lost)

    sys.unraisablehook = hook
    try:
        yield
    finally:
        sys.unraisablehook = before
        late = any(timer.is_alive() for timer in waiting)
        for timer in waiting:
            timer.cancel()
            timer.join()
    if late:
        raise KeyboardInterrupt


def _interrupt() -> None:
    main = threading.main_thread().ident
    if hasattr(signal, "pthread_kill") and main is not None:  # a true signal also ends a wait
        signal.pthread_kill(main, signal.SIGINT)
    else:
        signal.raise_signal(signal.SIGINT)
