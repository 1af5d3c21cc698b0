"""The words in which a message names an argument: those of Python, of the command line, or of a page.

A message is made where something is wrong, far from the call. It names the parameter, `argument` writes it as whoever
called wrote it, and so the same code serves them all.
"""

import contextlib
import shlex
from collections.abc import Callable, Iterator
from typing import Any

Words = Callable[[str, Any], str]
"""Name of a parameter and its value (None for the name alone) → what is written in a message."""


def in_python(name: str, value: Any) -> str:
    """``force=True``, or ``folder=`` without a value."""
    return f"{name}={'' if value is None else repr(value)}"


def in_commands(name: str, value: Any) -> str:
    """``--force``, ``--law bowden``, or ``--to`` without a value."""
    switch = f"--{name.replace('_', '-')}"
    return switch if value is None or value is True else f"{switch} {shlex.quote(str(value))}"


def on_a_page(name: str, value: Any) -> str:
    """``force``, or ``law bowden``."""
    return name.replace("_", " ") if value is None or value is True else f"{name.replace('_', ' ')} {value}"


_WORDS: list[Words] = [in_python]


@contextlib.contextmanager
def speaking(words: Words) -> Iterator[None]:
    """Write arguments in these words meanwhile, in every thread."""
    _WORDS.append(words)
    try:
        yield
    finally:
        _WORDS.remove(words)


def argument(name: str, value: Any = None) -> str:
    """A parameter of an operation, as its caller writes it.

    Args:
        name: of the parameter, as the function has it.
        value: what it is to be; None for the name alone.

    >>> argument("force", True), argument("out")
    ('force=True', 'out=')
    >>> with speaking(in_commands):
    ...     argument("force", True), argument("counts_per_turn", 8192), argument("out")
    ('--force', '--counts-per-turn 8192', '--out')
    """
    return _WORDS[-1](name, value)
