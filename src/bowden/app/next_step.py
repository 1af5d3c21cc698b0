"""The last line of a command: the one that comes next, with the files that are there now.

From a log to a running law: identify, init, simulate, check, tune, run, export.
"""

import shlex
from pathlib import Path
from typing import TYPE_CHECKING

from typer import Exit

if TYPE_CHECKING:
    from bowden.plants.trust import Trust


def say_next(*words: str | Path, why: str = "") -> None:
    """Print the command that comes next.

    Args:
        words: after ``bowden``.
        why: what it does, where that is not plain.

    >>> say_next("simulate", "my rig.toml")
    Next: bowden simulate 'my rig.toml'
    """
    print(next_line(*words, why=why))


def next_line(*words: str | Path, why: str = "") -> str:
    """The line that `say_next` prints."""
    return f"Next: {shlex.join(['bowden', *map(str, words)])}{f'  # {why}' if why else ''}"


def free_name(path: Path) -> Path:
    """The path itself, or one with a number, under which nothing is."""
    found, count = path, 1
    while found.exists():
        count += 1
        found = path.with_name(f"{path.stem}-{count}{path.suffix}")
    return found


def after_model(model: Path, trust: "Trust | None" = None) -> None:
    """What comes after a model has been written.

    Raises:
        Exit: 1 where it is not to be trusted; a new log comes next.
    """
    if trust is not None and trust.level == "no":
        print(f"Next: correct the log, or record another, and identify it: {trust.reasons[0]}")
        raise Exit(1)
    rig = free_name(Path("rig.toml"))
    say_next("init", *([] if rig == Path("rig.toml") else [rig]), "--model", model)
