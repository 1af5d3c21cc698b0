"""What every command says and where: results on standard output, progress on a terminal, time since the start."""

import contextlib
import json
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from bowden.app import STARTED
from bowden.core.errors import BowdenError, OutputError
from bowden.core.files import printable

Made = TypeVar("Made")


def seconds() -> float:
    """Time since the command began, imports and compilation included [s]."""
    return round(time.perf_counter() - STARTED, 3)


def print_json(document: dict[str, Any]) -> None:
    """The one JSON document of a command; a number that does not exist must be None, never NaN."""
    print(json.dumps(document, ensure_ascii=False, allow_nan=False, indent=2))


class ProgressBar:
    """A bar on standard error where that is a terminal, from the first thing that is done until all of it is.

    Args:
        quiet: show nothing.
    """

    def __init__(self, quiet: bool = False) -> None:
        self._shown = not quiet and sys.stderr.isatty()
        self._stack = contextlib.ExitStack()
        self._bar: Any = None

    def __call__(self, what: str, share: float) -> None:
        """Show what is done now and the share that is done; the bar goes with a share of 1."""
        if not self._shown:
            return
        if share >= 1.0:
            self.close()
            return
        if self._bar is None:
            from rich.console import Console
            from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

            columns = (TextColumn("{task.description:36}"), BarColumn(), TimeElapsedColumn())
            console = Console(stderr=True)
            bar = self._stack.enter_context(Progress(*columns, console=console, transient=True, redirect_stdout=False))
            self._bar = partial(bar.update, bar.add_task("starting", total=1.0))
        self._bar(description=what, completed=share)

    def close(self) -> None:
        """Take it from the screen."""
        self._stack.close()
        self._bar = None


class InterruptedPartway(Exception):
    """The user interrupted a command that had results already, and they are written; says which and where."""


def folder_argument(given: str | Path, option: str = "--out") -> Path:
    """The value of ``--out``, or of another option, as a path.

    Raises:
        OutputError: it is empty (which pathlib would take for the current folder), or no path at all.
    """
    if not str(given).strip() or "\0" in str(given):
        raise OutputError(
            f"{option} is {str(given)!r}", expected="the name of a folder", do=f"use {option} . for this one"
        )
    return Path(given)


def trusting(made: Callable[[], Made], *, unasked: bool = False) -> Made:
    """What is made of a log; a program that comes with it runs once the user says that it may.

    Args:
        made: makes it.
        unasked: whether the user has said so already.

    Raises:
        UnknownCodeError: the user does not, or there is no terminal to ask.
    """
    try:
        return made()
    except BowdenError as error:
        from bowden.live.log_rig import UnknownCodeError, trust

        if not isinstance(error, UnknownCodeError):
            raise
        if not unasked:
            if not (sys.stdin.isatty() and sys.stderr.isatty()):
                raise
            what = printable(error.what)
            print(f"bowden: {what}. It can do everything that you can do. Run it? [y/N] ", end="", file=sys.stderr)
            sys.stderr.flush()
            if sys.stdin.readline().strip().lower() not in ("y", "yes"):
                raise
        trust(error.files)
        return made()
