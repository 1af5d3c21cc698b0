"""Checks of a user's arguments: every refusal names the argument, what was given, and what to give."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import ParameterError, article

Array = NDArray[np.float64]


def format_value(value: Any) -> str:
    """A value in a message, cut short.

    >>> format_value("x"), format_value(np.zeros(3)), format_value(int)
    ("'x'", 'an array of shape (3,)', 'the class int')
    """
    if isinstance(value, np.ndarray):
        return f"an array of shape {value.shape}"
    if isinstance(value, type):
        return f"the class {value.__name__}"
    words = " ".join(repr(value).split())
    return words if len(words) <= 60 else f"{article(type(value).__name__)}: {words[:50]}…"


def signal(value: Any, what: str) -> Array:
    """One signal as an array (n,) of numbers.

    Args:
        value: as it was given.
        what: function and argument, for messages.

    Raises:
        ParameterError: text, or anything but a row of numbers.
    """
    try:
        found = np.asarray(value)
        if found.dtype.kind not in "biuf":
            bad = next((one for one in np.ravel(found).tolist() if not isinstance(one, int | float)), value)
            do = "convert it first: numpy.asarray(x, float)"
            raise ParameterError(f"{what} holds {format_value(bad)}", expected="numbers only", do=do)
        found = np.asarray(found, dtype=np.float64)
    except ValueError as error:  # rows of different lengths
        said = f"{what} is no row of numbers: {error}"
        raise ParameterError(said, expected="an array (n,)", do="pass one signal") from None
    if found.ndim != 1:
        do = "pass one signal, for example x[:, 0]" if found.ndim else "pass the samples of a log"
        raise _refused(found if found.ndim else value, what, "an array of shape (n,)", do)
    return np.ascontiguousarray(found)


def one_length(signals: dict[str, Array], where: str) -> None:
    """Refuse signals that are not of one length.

    Raises:
        ParameterError: they are not.
    """
    if len({len(values) for values in signals.values()}) > 1:
        found = ", ".join(f"{name} has {len(values)} samples" for name, values in signals.items())
        raise ParameterError(f"{where}: {found}", expected="one length", do="take them from the same rows")


def _refused(value: Any, what: str, expected: str, do: str) -> ParameterError:
    return ParameterError(f"{what} is {format_value(value)}", expected=expected, do=do)


def path_of(value: Any, what: str, kind: str = "file") -> Path:
    """The path of a file, or of another `kind`.

    Raises:
        ParameterError: something else.
    """
    if not isinstance(value, str | Path):
        raise _refused(value, what, f"the path of a {kind}", 'write it in quotation marks: "…"')
    return Path(value)


def flag(value: Any, what: str) -> bool:
    """True or False.

    Raises:
        ParameterError: something else.
    """
    if not isinstance(value, bool | np.bool_):
        raise _refused(value, what, "True or False", "give one of them")
    return bool(value)


def whole(value: Any, what: str, least: int) -> int:
    """A whole number, `least` or above.

    Raises:
        ParameterError: something else.
    """
    if isinstance(value, bool | np.bool_) or not isinstance(value, int | np.integer) or value < least:
        raise _refused(value, what, f"a whole number from {least} on", "give such a number")
    return int(value)


def text(value: Any, what: str, expected: str) -> str:
    """Text.

    Raises:
        ParameterError: something else.
    """
    if not isinstance(value, str):
        raise _refused(value, what, expected, "write it in quotation marks")
    return value


LARGEST_ANGLE = 4.0 * np.pi
"""Of a joint in either direction: two turns [rad]."""


def angle(value: Any, what: str) -> float:
    """An angle of a joint [rad].

    Raises:
        ParameterError: no finite number, or more than two turns, which degrees would be.
    """
    found = number(value, what, "an angle in radians")
    if abs(found) > LARGEST_ANGLE:
        raise ParameterError(
            f"{what} is {found:g} rad",
            expected=f"an angle within ±{LARGEST_ANGLE:.4g} rad",
            do=f"that looks like degrees: numpy.radians({found:g}) is {np.radians(found):.4g}",
        )
    return found


def number(value: Any, what: str, expected: str = "a finite number") -> float:
    """A finite number.

    Raises:
        ParameterError: something else.
    """
    try:
        if isinstance(value, str | bytes | bool):
            raise TypeError
        found = float(value)
    except (TypeError, ValueError):
        raise _refused(value, what, expected, "give a number") from None
    if not np.isfinite(found):
        raise ParameterError(f"{what} is {found}", expected=expected, do="give a finite number")
    return found
