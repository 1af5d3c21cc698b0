"""The rig and the laws that an operation was handed, whatever form they have."""

import difflib
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from bowden.control import Law, user_law
from bowden.core import arguments
from bowden.core.caller import argument
from bowden.core.errors import ParameterError
from bowden.operations.support.operation import Progress
from bowden.rig.rig import Rig

Run = TypeVar("Run")


def rig_of(given: Any) -> Rig:
    """The rig.

    Raises:
        ParameterError: it is none, or its file cannot be used.
        LogError: a log without a rig.
    """
    if isinstance(given, Rig):
        return given
    if isinstance(given, str | Path):
        path = Path(given)
        if path.suffix == ".mcap":
            from bowden.live.log_rig import rig_of_log

            return rig_of_log(path)
        if path.suffix.lower() in _LOGS:
            raise ParameterError(
                f"{path} is a log, not a rig",
                expected="a rig.toml",
                do=f"identify it first: bowden identify {path}, then bowden init --model out/identify/model.toml",
            )
        alike = _alike(path)
        if alike and not path.exists():
            raise ParameterError(f"there is no {path}", expected="a rig.toml", do=f"did you mean {alike}?")
        return Rig.read(path)
    do = "make one of it: Rig()" if given is Rig else "make one: bowden.init(fit).rig, bowden.Rig(…); or name its file"
    raise ParameterError(f"rig is {arguments.format_value(given)}", expected="a Rig or the path of a rig.toml", do=do)


_LOGS = (".csv", ".tsv", ".txt", ".npz", ".mat", ".parquet", ".xlsx", ".tdms")


def _alike(path: Path) -> str:
    """A rig's file beside a path whose name is like it; empty where there is none."""
    try:
        names = [one.name for one in path.parent.iterdir() if one.suffix in (".toml", ".mcap")]
    except OSError:
        return ""
    found = difflib.get_close_matches(path.name, names, 1)
    return str(path.parent / found[0]) if found else ""


def of_motor(rig: Rig, motor: str | None) -> Rig:
    """The rig with all its motors, or of the one that is named."""
    return rig if motor is None else rig.only(motor)


def under(rig: Rig, law: Any, preset: str | None) -> Rig:
    """The rig under a law; its own where none is given.

    Raises:
        ParameterError: no law, an unknown one, one that cannot be used, or a preset that it has not.
    """
    law = str(law) if isinstance(law, Path) else law
    if law is not None and not isinstance(law, str | Law):
        do = "name one, or pass a Law: Law(name, Gains(), start, step, source)"
        raise ParameterError(f"law is {arguments.format_value(law)}", expected="a name, FILE.py:NAME or a Law", do=do)
    if isinstance(law, Law):
        user_law.check_law(law)
    return rig.with_law(law, preset)


def name_of(rig: Rig) -> str:
    """A rig in messages: its file's name, where it has one."""
    return Path(rig.origin).name if Path(rig.origin).suffix else "this rig"


def several(laws: Any) -> Sequence[Any] | None:
    """The laws of a list; None where one law, or none, was given."""
    if laws is None or isinstance(laws, str | Path | Law | type) or not isinstance(laws, Iterable):
        return None
    found = list(laws)
    if not found:
        raise ParameterError("law is empty", expected="a law or more", do="leave it out for the rig's own")
    return found


def notes_of(rig: Rig) -> tuple[str, ...]:
    """What is odd about a rig, each with the motor that it is of."""
    return tuple(f"motor {one.name}: {note}" if one.name else note for one in rig.parts for note in one.rig.notes)


class LawRuns(NamedTuple):
    """What came of laws that ran one after the other."""

    runs: dict[str, Any]
    """Name of the law → its run; laws of one name get a number."""
    interrupted: bool
    """True if an interruption ended it before the last law was done."""


def in_turn(laws: Sequence[Law], run: Callable[[int], Any], progress: Progress) -> LawRuns:
    """Run laws one after the other, until an interruption; one before the first is done passes through.

    Args:
        laws: in their order.
        run: what comes of the law at that place.
        progress: called with what is being done and the share of the work that is behind.

    Raises:
        ParameterError: a law of the user's own failed; with its file and line.
    """
    found = dict[str, Any]()
    for i, (law, name) in enumerate(zip(laws, numbered([law.name for law in laws]), strict=True)):
        progress(f"simulating {name}", 0.1 + 0.7 * i / len(laws))
        try:
            with user_law.explained(law):
                found[name] = run(i)
        except KeyboardInterrupt:
            if not found:
                raise
            return LawRuns(found, True)
    return LawRuns(found, False)


def numbered(names: Sequence[str]) -> Iterator[str]:
    """Names that differ: laws of one name get a number.

    >>> list(numbered(["adaptive", "mine", "adaptive"]))
    ['adaptive', 'mine', 'adaptive-2']
    """
    before: set[str] = set()
    for name in names:
        number, new = 2, name
        while new in before:
            new, number = f"{name}-{number}", number + 1
        before.add(new)
        yield new


def check_number(name: str, value: float, least: float, most: float) -> float:
    """A number within limits.

    Raises:
        ParameterError: it is not; named as its caller has it.
    """
    if not least <= value <= most:
        given = argument(name).rstrip("=")
        raise ParameterError(f"{given} is {value:g}", expected=f"a number from {least:g} to {most:g}", do="correct it")
    return value
