"""What every command says and where: results on standard output, progress on a terminal, time since the start."""

import contextlib
import json
import os
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from bowden.app import STARTED
from bowden.core.errors import OutputError


def seconds() -> float:
    """Time since the command began, imports and compilation included [s]."""
    return round(time.perf_counter() - STARTED, 3)


def print_json(document: dict[str, Any]) -> None:
    """The one JSON document of a command; a number that does not exist must be None, never NaN."""
    print(json.dumps(document, ensure_ascii=False, allow_nan=False, indent=2))


@contextlib.contextmanager
def progress_bar(quiet: bool = False) -> Iterator[Callable[[str, float], None]]:
    """A bar on standard error where that is a terminal; call what is given with what is done now and the share done."""
    if quiet or not sys.stderr.isatty():
        yield lambda what, share: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description:30}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("starting", total=1.0)
        yield lambda what, share: bar.update(task, description=what, completed=share)


def output_folder(path: Path) -> Path:
    """`path`, known to be a folder that can be made and written; nothing is made yet.

    Raises:
        OutputError: something that is no folder stands in the way, or it may not be written.
    """
    nearest = next(folder for folder in (path.absolute(), *path.absolute().parents) if folder.exists())
    if not nearest.is_dir():
        raise OutputError(f"cannot write to {path}: {nearest} is not a folder", do="choose another one with --out")
    if not os.access(nearest, os.W_OK):
        raise OutputError(f"cannot write to {path}: {nearest} is read-only", do="choose another one with --out")
    return path


def make_folder(path: Path) -> Path:
    """Make a folder with its parents.

    Raises:
        OutputError: it cannot be made.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"cannot make the folder {path}: {error.strerror}", do="choose another one") from error
    return path
