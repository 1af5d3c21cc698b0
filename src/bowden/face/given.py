"""The rig and the laws that a function of the face was handed, whatever form they have."""

import contextlib
import difflib
import re
import sys
import warnings
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from bowden.control import Law, user_law
from bowden.core import arguments
from bowden.core.errors import BowdenError, ParameterError
from bowden.rig.rig import Rig

GivenRig = Rig | str | Path
"""A rig, the path of its rig.toml, or of the log of a run (``.mcap``), which holds its rig."""
GivenLaw = str | Path | Law
"""A key of `LAWS`, ``FILE.py:NAME`` of a user's own, or a `Law`."""


def rig_of(given: Any, function: str, *, several: bool = False, pair: bool = False) -> Rig:
    """The rig.

    Args:
        given: a `GivenRig`.
        function: of the face, for messages.
        several: whether one with several axes will do.
        pair: whether one whose axes are two motors on one joint, and no others, will do.

    Raises:
        ParameterError: it is none, or its file cannot be used.
        LogError: a log without a rig.
    """
    found = _rig_of(given, function)
    if found.axes and not (several or (pair and {one.name for one in found.axes} == {*found.pair.names})):
        names = ", ".join(one.name for one in found.axes)
        raise ParameterError(
            f"{function}: the rig has the axes {names}",
            expected="the rig of one",
            do=f'give that: rig.axis("{found.axes[0].name}")',
        )
    return found


def _rig_of(given: Any, function: str) -> Rig:
    if isinstance(given, Rig):
        return given
    if isinstance(given, str | Path):
        path = Path(given)
        if path.suffix == ".mcap":
            from bowden.live.log_rig import rig_of_log

            return rig_of_log(path)
        alike = _alike(path)
        if alike and not path.exists():
            raise ParameterError(f"{function}: there is no {path}", expected="a rig.toml", do=f"did you mean {alike}?")
        return Rig.read(path)
    do = "make one of it: Rig()" if given is Rig else "make one: bowden.init(fit).rig, bowden.Rig(…); or name its file"
    raise ParameterError(
        f"{function}: rig is {arguments.said(given)}", expected="a Rig or the path of a rig.toml", do=do
    )


def _alike(path: Path) -> str:
    """A rig's file beside a path whose name is like it; empty where there is none."""
    try:
        names = [one.name for one in path.parent.iterdir() if one.suffix in (".toml", ".mcap")]
    except OSError:
        return ""
    found = difflib.get_close_matches(path.name, names, 1)
    return str(path.parent / found[0]) if found else ""


def under(rig: Rig, law: Any, preset: Any, function: str) -> Rig:
    """The rig under a law; its own where none is given.

    Args:
        rig: to run it on.
        law: a `GivenLaw`, or None.
        preset: a named set of gains of that law, or None.
        function: of the face, for messages.

    Raises:
        ParameterError: no law, an unknown one, one that cannot be used, or a preset that it has not.
    """
    if preset is not None and not isinstance(preset, str):
        raise ParameterError(
            f"{function}: preset is {arguments.said(preset)}", expected="the name of a preset", do="give it as text"
        )
    if isinstance(law, Path):
        law = str(law)
    if law is not None and not isinstance(law, str | Law):
        do = "name one, or pass a Law: Law(name, Gains(), start, step, source)"
        raise ParameterError(
            f"{function}: law is {arguments.said(law)}", expected="a name, FILE.py:NAME or a Law", do=do
        )
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
        raise ParameterError("laws is empty", expected="a law or more", do="leave it out for the rig's own")
    return found


def numbered(names: Sequence[str]) -> list[str]:
    """Names that differ: laws of one name get a number.

    >>> numbered(["adaptive", "mine", "adaptive"])
    ['adaptive', 'mine', 'adaptive-2']
    """
    found: list[str] = []
    for name in names:
        number = 2
        new = name
        while new in found:
            new, number = f"{name}-{number}", number + 1
        found.append(new)
    return found


@contextlib.contextmanager
def in_words_of_python() -> Iterator[None]:
    """Name arguments as Python has them, where a message names them as the command line does."""
    try:
        yield
    except BowdenError as error:
        words = [_in_python(part) for part in (error.what, error.expected, error.do)]
        if words == [error.what, error.expected, error.do]:
            raise error from None
        raise type(error)(words[0], expected=words[1], do=words[2]) from None


_SWITCH = re.compile(r"(?<![\w-])--([a-z][a-z-]*)(?: (\d+)\b)?")
_ARGUMENTS = {"force": "force=True", "to": "folder", "emg": "rig.with_emg(source)"}
"""Switch of a command → what it is in Python, where that is not its name."""


def _in_python(words: str) -> str:
    """A message with arguments in place of switches.

    >>> _in_python("or run it anyway with --force"), _in_python("compute with --workers 1")
    ('or run it anyway with force=True', 'compute with workers=1')
    """

    def argument(found: "re.Match[str]") -> str:
        name = _ARGUMENTS.get(found[1], found[1].replace("-", "_"))
        return f"{name}={found[2]}" if found[2] else name

    return _SWITCH.sub(argument, words)


def tell(notes: Iterable[str]) -> None:
    """Say what the user should know, as Python says it: a warning at the line that called the face."""
    frame, level = sys._getframe(1), 2
    while frame.f_back is not None and frame.f_globals.get("__name__", "").partition(".")[0] in (
        "bowden",
        "contextlib",
    ):
        frame, level = frame.f_back, level + 1
    for note in notes:
        warnings.warn(_in_python(note), stacklevel=level)
