"""Operations as functions of ``import bowden``: arguments checked by annotation, notes as warnings."""

import sys
import warnings
from collections.abc import Callable, Iterable
from functools import wraps
from inspect import signature
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

from bowden.core import arguments, guesses
from bowden.core.errors import ParameterError
from bowden.operations.support import operation
from bowden.operations.support.results import Result, doubt, trusted

Given = ParamSpec("Given")
Value = TypeVar("Value")

_GUESSES = {
    "gains": "rig.replace(gains={…}), or a law with them: bowden.LAWS[name].with_gains(…)",
    "gain": "rig.with_gain(name, value)",
    "laws": "law=, which takes a list too",
    "units": "unit=",
    "fs": "rate=, in Hz",
    "dt": "rate=, in Hz; of a rig its sample_time",
    "sample_time": "rig.replace(sample_time=…)",
    "reference": "rig.replace(reference=…)",
    "delay": "rig.replace(delay=…)",
    **dict.fromkeys(("out", "to", "path"), "folder="),
    **dict.fromkeys(("T", "time", "length"), "duration=, in s"),
    "verbose": "progress=True, where a function has it",
}
"""Argument that is often guessed → what to write."""


def public(function: Callable[Given, Result[Value]]) -> Callable[Given, Value]:
    """An operation as a function: it returns the value of its result, and its errors are one line without a chain.

    An unknown argument is refused with the likely one.
    """
    form, known = signature(function), operation.parameters(function)

    @wraps(function)
    def called(*given: Given.args, **named: Given.kwargs) -> Value:
        bound = form.bind(*given, **named)
        for one, value in bound.arguments.items():
            if one in known:
                bound.arguments[one] = _checked(known[one], value, function.__name__)
        found: Any = function(*bound.args, **bound.kwargs)
        rigs = [bound.arguments[one] for one, kind in known.items() if kind.is_rig and one in bound.arguments]
        if not isinstance(found, Result):  # a new rig, or a run that has yet to begin
            own = getattr(found, "cable_trust", None)
            tell(filter(None, [doubt(trusted(Result[Any](cable_trust=own), rigs), rigs)]))
            return found
        found = trusted(found, rigs)
        tell(filter(None, (*found.notes, doubt(found, rigs))))
        if found.interrupted:
            raise found.interruption()
        return found.value

    answering: Any = guesses.public(called, _GUESSES)
    return answering


def _checked(one: operation.OperationParameter, value: Any, function: str) -> Any:
    """A value that is of its parameter's kind.

    Raises:
        ParameterError: it is not; the message names function and argument.
    """
    if value is one.default:
        return value
    if one.is_rig:
        from bowden.operations.support.given import rig_of

        try:
            return rig_of(value)
        except ParameterError as error:
            if isinstance(value, str | Path) and not error.what.startswith("there is no"):
                raise
            raise ParameterError(f"{function}: {error.what}", expected=error.expected, do=error.do) from None
    if one.kind is operation.Role.PROGRESS:
        from bowden.operations.support.progress import check_progress

        check_progress(value, function)
    what = f"{function}: {one.name}"
    if one.plain is bool:
        return arguments.flag(value, what)
    if one.plain is float:
        return arguments.number(value, what)
    if one.plain is int and (one.switch.least is not None or not isinstance(value, int)):
        return arguments.whole(value, what, int(one.switch.least or 0))
    if one.plain is str:
        return arguments.text(value, what, "text")
    return arguments.path_of(value, what, "folder" if one.is_folder else "file") if one.plain is Path else value


def tell(notes: Iterable[str]) -> None:
    """Say what the user should know, as Python says it: a warning at the line that called the package."""
    frame, level = sys._getframe(1), 2
    while frame.f_back is not None and frame.f_globals.get("__name__", "").partition(".")[0] in (
        "bowden",
        "contextlib",
    ):
        frame, level = frame.f_back, level + 1
    for note in notes:
        warnings.warn(note, stacklevel=level)
