"""Errors that carry evidence: what was given, what was expected, what to do."""

import contextlib
import difflib
import math
import sys
from collections.abc import Iterable, Iterator


class BowdenError(Exception):
    """An error that the user can correct; the command line prints it as one line and exits with code 2.

    >>> str(BowdenError("gain λ is -1", expected="a number above 0", do="correct [control.gains] in rig.toml"))
    'gain λ is -1; expected a number above 0; correct [control.gains] in rig.toml'
    """

    def __init__(self, what: str, *, expected: str = "", do: str = "") -> None:
        self.what, self.expected, self.do = what, expected, do
        super().__init__("; ".join(part for part in (what, f"expected {expected}" if expected else "", do) if part))


class LogError(BowdenError):
    """A recorded log that cannot be used."""


class ParameterError(BowdenError):
    """A parameter, setting or key that is unknown, missing or out of its range."""


class MissingExtraError(BowdenError):
    """A package that only some of the work needs, and that is not installed."""


class UnknownNameError(ParameterError, KeyError):
    """A name that a mapping does not have; also a `KeyError`, as every mapping's is."""

    __str__ = Exception.__str__


class OutputError(BowdenError):
    """A result that cannot be written where it was asked for."""


class DriveError(BowdenError):
    """A bus or a drive that cannot be used, or does not do what is asked of it."""


class StreamError(BowdenError):
    """A live stream of signals that is not there, is not what was asked for, or cannot be made."""


class SafetyError(BowdenError):
    """A run that must not begin, or not go on: limits that contradict one another, a verdict that is broken."""


def article(noun: str) -> str:
    """A noun with its article.

    >>> article("Encoder"), article("UserPlant")
    ('an Encoder', 'a UserPlant')
    """
    low = noun.lower()
    vowel = low[:1] in tuple("aeiou") and not low.startswith(("eu", "uni", "use"))
    return f"{'an' if vowel else 'a'} {noun}"


def counted(number: int, noun: str) -> str:
    """How many of something there are.

    >>> counted(1, "channel"), counted(2, "channel")
    ('1 channel', '2 channels')
    """
    return f"{number} {noun}{'' if number == 1 else 's'}"


_MOST_NAMES = 20


def near(name: str, known: Iterable[str]) -> str:
    """The known names, with the likely meaning first.

    >>> near("dampng", ["damping", "gear"])
    'damping (did you mean this?) or gear'
    """
    names = list(known)
    alike = difflib.get_close_matches(name, names, 1, 0.6)
    ordered = [f"{alike[0]} (did you mean this?)", *(other for other in names if other != alike[0])] if alike else names
    if len(ordered) > _MOST_NAMES:
        ordered = [*ordered[: _MOST_NAMES - 1], f"{len(ordered) - _MOST_NAMES + 1} others"]
    return " or ".join(part for part in (", ".join(ordered[:-1]), ordered[-1]) if part) if ordered else "nothing"


@contextlib.contextmanager
def error_context(key: str) -> Iterator[None]:
    """Say which file, and which of its keys, led to a failure; nothing for an empty one."""
    try:
        yield
    except BowdenError as error:
        if not key:
            raise
        do = error.do or "correct it there"
        raise type(error)(f"{key}: {error.what}", expected=error.expected, do=do) from None


def note(text: str) -> None:
    """Say on standard error what the user should know."""
    print(f"bowden: note: {text}", file=sys.stderr)


def check_positive(what: str, **values: float) -> None:
    """Refuse numbers that are not above zero and finite.

    Raises:
        ParameterError: one is not.
    """
    for name, value in values.items():
        if not (value > 0.0 and math.isfinite(value)):
            raise ParameterError(f"{what}: {name} is {value}", expected="a number above 0", do="correct it")
