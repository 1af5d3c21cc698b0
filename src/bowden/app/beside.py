"""A process beside the command's own, which gets ready to draw while the command computes."""

import contextlib
import os
import pickle
import signal
import sys
from collections.abc import Callable, Iterator
from typing import Any


@contextlib.contextmanager
def beside(prepare: Callable[[], None], work: Callable[[Any], Any]) -> Iterator[Callable[[Any], Any]]:
    """`work`, done by another process that has called `prepare` meanwhile.

    It is a copy of this process, made before anything has threads; where it is too late for that (NumPy is there), on a
    single core or on Windows, the work is done here. What `work` is given and gives back is pickled.

    Raises:
        Exception: whatever `work` raises.
    """
    if "numpy" in sys.modules or not hasattr(os, "fork") or (os.cpu_count() or 1) < 2:
        yield work
        return
    (asked, asking), (answered, answering) = os.pipe(), os.pipe()
    child = os.fork()
    if not child:
        os.close(asking)
        os.close(answered)
        _answer(prepare, work, asked, answering)
    os.close(asked)
    os.close(answering)
    with open(asking, "wb") as question, open(answered, "rb") as answer:

        def ask(value: Any) -> Any:
            try:
                pickle.dump(value, question)
                question.close()
                done, found = pickle.load(answer)
            except (OSError, EOFError):  # it was killed
                return work(value)
            if not done:
                raise found
            return found

        try:
            yield ask
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)


def _answer(prepare: Callable[[], None], work: Callable[[Any], Any], asked: int, answering: int) -> None:
    """What the other process does; it ends here. An interruption is the parent's, which ends it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with open(asked, "rb") as question, open(answering, "wb") as answer:
            try:
                prepare()
                found = True, work(pickle.load(question))
            except Exception as error:
                found = False, error
            pickle.dump(found, answer)
    finally:
        os._exit(0)  # without what the parent will do at its end
