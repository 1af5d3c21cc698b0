"""The rig that a command is given: a rig.toml, or the log of a run."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from bowden.app.console import say_trust
from bowden.core.files import printable

if TYPE_CHECKING:
    from bowden.rig.rig import Rig

Result = TypeVar("Result")


def read_given(path: Path, axis: str | None = None, *, several: bool = False) -> "Rig":
    """The rig of a rig.toml, or of a log (``.mcap``), which holds the one that it ran with.

    Args:
        path: of the file.
        axis: one of its axes alone.
        several: whether a rig with all its axes is taken, where none is named.

    Raises:
        ParameterError: a file, key or value that cannot be used.
        LogError: a log without a rig.
    """
    found = _read(path)
    return found if several and axis is None else found.axis(axis)


def read_alone(path: Path) -> "Rig":
    """The rig of a rig.toml or a log with one motor, for a command that has no option for an axis.

    Args:
        path: of the file.

    Raises:
        ParameterError: as `read_given`, or a rig with several axes.
        LogError: a log without a rig.
    """
    from bowden.rig.config import one_motor

    found = _read(path)
    if found.axes:
        raise one_motor(path)
    return found


def _read(path: Path) -> "Rig":
    from bowden.rig.rig import Rig

    if path.suffix == ".mcap":
        from bowden.live.log_rig import rig_of_log

        found = trusting(lambda: rig_of_log(path))
    else:
        found = Rig.read(path)
    for one in [axis.rig for axis in found.axes] or [found]:
        say_trust(getattr(one.cable, "trust", None))
    return found


def trusting(made: Callable[[], Result], *, unasked: bool = False) -> Result:
    """What is made of a log; a program that comes with it runs once the user says that it may.

    Args:
        made: makes it.
        unasked: whether the user has said so already.

    Raises:
        UnknownCodeError: the user does not, or there is no terminal to ask.
    """
    from bowden.live.log_rig import UnknownCodeError, trust

    try:
        return made()
    except UnknownCodeError as error:
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


def shortened(rig: "Rig", duration: float | None, seed: int | None = None) -> "Rig":
    """The rig with what the command line says in place of its own."""
    changes = {"duration": duration, "seed": seed}
    given = {name: value for name, value in changes.items() if value is not None}
    return rig.replace(**given) if given else rig
