"""A process beside the command's own, which gets ready to draw while the command computes."""

import contextlib
import os
import pickle
import signal
import sys
from collections.abc import Callable, Iterator
from typing import IO, Any


@contextlib.contextmanager
def beside(prepare: Callable[[], Any], work: Callable[[Any, Any], Any]) -> Iterator[Callable[[Any], Any]]:
    """`work`, done by another process that has called `prepare` meanwhile and hands over what that gave.

    It is a copy of this process, made before anything has threads; where it is too late for that (NumPy is there), on a
    single core, on Windows or where no process is left, all is done here. What `work` is asked and answers is pickled.

    Raises:
        Exception: whatever `work` raises.
    """
    if "numpy" in sys.modules or not hasattr(os, "fork") or (os.cpu_count() or 1) < 2:
        yield lambda value: work(prepare(), value)
        return
    pipes = (asked, asking), (answered, answering) = os.pipe(), os.pipe()
    try:
        child = os.fork()
    except OSError:  # no process is left
        for end in (*pipes[0], *pipes[1]):
            os.close(end)
        yield lambda value: work(prepare(), value)
        return
    if not child:
        os.close(asking)
        os.close(answered)
        _answer(prepare, work, asked, answering)
    os.close(asked)
    os.close(answering)
    with open(asking, "wb", buffering=0) as question, open(answered, "rb") as answer:

        def ask(value: Any) -> Any:
            try:
                whole = memoryview(pickle.dumps(value))
                while whole:
                    whole = whole[question.write(whole) :]
                question.close()
            except OSError:  # it was killed
                pass
            done, found = _told(answer)
            return found if done else work(prepare(), value)  # which raises what the other one has raised

        try:
            yield ask
        finally:
            with contextlib.suppress(ProcessLookupError, ChildProcessError):
                os.kill(child, signal.SIGKILL)
                os.waitpid(child, 0)


def both(first: Callable[[], Any], second: Callable[[], Any]) -> tuple[Any, Any]:
    """What two functions give back; in the other process of `beside` a copy of it does the first one meanwhile.

    Raises:
        Exception: whatever one of them raises.
    """
    if not _BESIDE:
        return first(), second()
    answered, answering = os.pipe()
    child = os.fork()
    if not child:
        os.close(answered)
        with open(answering, "wb") as answer:
            _tell(answer, first)
        os._exit(0)
    os.close(answering)
    later = second()
    with open(answered, "rb") as answer:
        done, found = _told(answer)
    os.waitpid(child, 0)
    return (found if done else first()), later


_BESIDE: list[bool] = []
"""Holds something in the other process of `beside`, which has one thread and can be copied."""


def _answer(prepare: Callable[[], Any], work: Callable[[Any, Any], Any], asked: int, answering: int) -> None:
    """What the other process does; it ends here. An interruption is the parent's, which ends it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _BESIDE.append(True)
    try:
        with open(asked, "rb") as question, open(answering, "wb") as answer:
            _tell(answer, lambda: work(prepare(), pickle.load(question)))
    finally:
        os._exit(0)  # without what the parent will do at its end


def _tell(answer: IO[bytes], work: Callable[[], Any]) -> None:
    """Write what a function gives back. Where it raises, who asked does the work again, for the traceback."""
    try:
        found = True, work()
    except Exception:
        found = False, None
    pickle.dump(found, answer)


def _told(answer: IO[bytes]) -> tuple[bool, Any]:
    """What `_tell` wrote: whether it was done, and what was found."""
    try:
        done, found = pickle.load(answer)
    except (OSError, EOFError, pickle.UnpicklingError):  # it was killed
        return False, None
    return done, found
