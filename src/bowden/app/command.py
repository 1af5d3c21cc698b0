"""What a command's file declares, and how it is found: no list of commands stands anywhere.

A file ``NAME_command.py`` of this folder ends with ``COMMANDS``, a tuple of what it adds to ``bowden``. Its name begins
with the first word of its commands (``emg_stream_command.py`` has ``emg stream`` and ``emg serve``), so that a command
line imports the files that its first word names and no others; ``bowden --help`` imports all. A file of a group says in
``GROUP`` what the group is.
"""

import importlib
import pkgutil
import re
from collections.abc import Callable
from typing import NamedTuple

from bowden import app

SUFFIX = "_command"
"""Of the files that declare commands."""


class Command(NamedTuple):
    """A command, as its file declares it."""

    words: str
    """What comes after ``bowden``: ``simulate``, or ``log info`` in a group."""
    function: Callable[..., None]
    """Its typer annotations are its arguments and options, its docstring its help."""
    summary: str
    """One line for ``bowden --help``."""
    examples: tuple[str, ...]
    """Whole lines to type."""
    place: int = 100
    """Where it stands in ``bowden --help``: in the order of what is done with a rig, and then of the names."""


class DeclaredCommands(NamedTuple):
    """What files declare."""

    commands: tuple[Command, ...]
    """In the order of ``bowden --help``."""
    groups: dict[str, str]
    """First word of a group's commands → what the group is."""


def files() -> tuple[str, ...]:
    """The modules that declare commands, by name; none is imported for it."""
    return tuple(sorted(one.name for one in pkgutil.iter_modules(app.__path__) if one.name.endswith(SUFFIX)))


def found(first_word: str = "") -> DeclaredCommands:
    """The commands that begin with a word and those that share its file's name, or all.

    Args:
        first_word: of the command line; all where it is empty, or where no file is named after it.
    """
    chosen = [name for name in files() if first_word and _stem(name) == _stem(first_word)]
    commands: list[Command] = []
    groups: dict[str, str] = {}
    for name in chosen or files():
        module = importlib.import_module(f"{app.__name__}.{name}")
        commands += module.COMMANDS
        if hasattr(module, "GROUP"):
            groups[_stem(name)] = module.GROUP
    return DeclaredCommands(tuple(sorted(commands, key=lambda one: (" " in one.words, one.place, one.words))), groups)


def _stem(name: str) -> str:
    """The first part of a file's or a command's name."""
    return re.split("[-_]", name)[0]
