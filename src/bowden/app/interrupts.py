"""An interruption that is not lost where Python cannot raise it."""

import contextlib
import signal
import sys
import threading
from collections.abc import Iterator
from types import FrameType
from typing import Any

AGAIN = 0.05
"""How long after it was lost an interruption is sent again [s]: the callback has returned by then."""


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
    waiting: list[threading.Timer] = []

    def wait() -> None:
        waiting.append(threading.Timer(AGAIN, _interrupt))
        waiting[-1].start()

    def hook(lost: Any) -> None:
        if lost.exc_type is not None and issubclass(lost.exc_type, KeyboardInterrupt):
            wait()
        else:
            hook_before(lost)

    def handler(number: int, frame: FrameType | None) -> None:
        here = frame
        while here is not None:
            if any(part in here.f_code.co_filename for part in _LLVM):
                return wait()
            here = here.f_back
        signal.default_int_handler(number, frame)

    ours = handler_before is signal.default_int_handler and threading.current_thread() is threading.main_thread()
    sys.unraisablehook = hook
    if ours:
        signal.signal(signal.SIGINT, handler)
    try:
        yield
    except Exception as error:
        if any(timer.is_alive() for timer in waiting):
            raise KeyboardInterrupt from error
        raise
    else:
        if any(timer.is_alive() for timer in waiting):
            raise KeyboardInterrupt
    finally:
        sys.unraisablehook = hook_before
        for timer in waiting:
            timer.cancel()
            timer.join()
        if ours:
            signal.signal(signal.SIGINT, handler_before)


def _interrupt() -> None:
    main = threading.main_thread().ident
    if hasattr(signal, "pthread_kill") and main is not None:  # a true signal also ends a wait
        signal.pthread_kill(main, signal.SIGINT)
    else:
        signal.raise_signal(signal.SIGINT)
