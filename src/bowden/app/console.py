"""What every command says and where: results on standard output, progress on a terminal, time since the start."""

import contextlib
import json
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bowden.app import STARTED
from bowden.core.errors import OutputError

if TYPE_CHECKING:
    from bowden.plants.trust import Trust


@dataclass
class _Command:
    json: bool = False
    trust: "Trust | None" = None


_COMMAND = _Command()
"""The one that runs."""


def begin(arguments: Sequence[str]) -> None:
    """Take note of the command line that is run now."""
    _COMMAND.json, _COMMAND.trust = "--json" in arguments, None


def say_trust(trust: "Trust | None") -> None:
    """Say first of a cable's model that it is not to be trusted, or not without care; in its document with ``--json``.

    Args:
        trust: in the model of a rig's cable; None where nothing says it.
    """
    if trust is None or trust.level == "yes":
        return
    _COMMAND.trust = trust
    if not _COMMAND.json:
        print(f"Trust in the cable's model: {trust}")


def say_note(note: str) -> None:
    """Say on standard error what the user should know."""
    print(f"bowden: note: {note}", file=sys.stderr, flush=True)


def seconds() -> float:
    """Time since the command began, imports and compilation included [s]."""
    return round(time.perf_counter() - STARTED, 3)


def print_json(document: dict[str, Any]) -> None:
    """The one JSON document of a command; a number that does not exist must be None, never NaN."""
    document = document if _COMMAND.trust is None else {**document, "trust": _COMMAND.trust._asdict()}
    print(json.dumps(document, ensure_ascii=False, allow_nan=False, indent=2))


@contextlib.contextmanager
def progress_bar(quiet: bool = False) -> Iterator[Callable[[str, float], None]]:
    """A bar on standard error where that is a terminal; call what is given with what is done now and the share done."""
    if quiet or not sys.stderr.isatty():
        yield lambda what, share: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description:36}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("starting", total=1.0)
        yield lambda what, share: bar.update(task, description=what, completed=share)


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
