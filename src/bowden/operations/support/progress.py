"""`progress=True`: how far a long call has come, on one line that changes."""

import contextlib
import sys
from collections.abc import Callable, Iterator
from importlib import import_module
from typing import Any

from bowden.core import arguments
from bowden.core.errors import ParameterError
from bowden.operations.support.operation import Progress


@contextlib.contextmanager
def reported(progress: Any, function: str) -> Iterator[Progress]:
    """What a long call calls to say how far it has come.

    Args:
        progress: a `GivenProgress`.
        function: of the package, for the line.
    """
    if progress is None or progress is False:
        yield lambda what, share: None
    elif progress is True:
        line = _notebook_line() or _terminal_line()
        try:
            yield lambda what, share: line(f"{function}: {100.0 * share:3.0f} %  {what}")
            line(f"{function}: done")
        finally:  # what follows, an error too, begins on a line of its own
            line("")
    else:
        yield progress


def check_progress(progress: Any, function: str) -> None:
    """Refuse what is neither a bool nor a callback.

    Raises:
        ParameterError: it is neither.
    """
    if not (progress is None or isinstance(progress, bool) or callable(progress)):
        raise ParameterError(
            f"{function}: progress is {arguments.format_value(progress)}",
            expected="True, or a function of what is being done and the share that is behind",
            do="write progress=True, or leave it out",
        )


def _notebook_line() -> Callable[[str], None] | None:
    """A line of a notebook's output; None outside of a notebook."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    if shell is None or not hasattr(shell, "kernel"):
        return None
    display = import_module("IPython.display").display  # of the notebook: the package does not depend on it
    handle = display({"text/plain": ""}, raw=True, display_id=True)

    def show(text: str) -> None:
        if text:
            handle.update({"text/plain": text}, raw=True)

    return show


def _terminal_line() -> Callable[[str], None]:
    """The last line of standard error; nothing is written to a file."""
    widest = 0

    def show(text: str) -> None:
        nonlocal widest
        if sys.stderr.isatty():
            widest = max(widest, len(text))
            print(f"\r{text:<{widest}}" if text else "", end="" if text else "\n", file=sys.stderr, flush=True)

    return show
