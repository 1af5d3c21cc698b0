"""Names that are guessed: an unknown one is answered in one line with the likely one."""

import difflib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import FrozenInstanceError
from functools import wraps
from inspect import Parameter, signature
from typing import TYPE_CHECKING, Any, TypeVar

from bowden.core.errors import BowdenError, ParameterError
from bowden.core.quantity import declared

Kind = TypeVar("Kind", bound=type)
Meant = Callable[[Any, str], str]


class UnknownArgumentError(ParameterError, TypeError):
    """An argument that a function does not have, or one that is missing; also a `TypeError`, as Python's own."""


def answer(owner: str, name: str, known: Iterable[str], guesses: Mapping[str, str]) -> str:
    """Message about a name that is not there.

    Args:
        owner: what does not have it.
        name: that was asked for.
        known: names that there are.
        guesses: name that is often guessed → what to write.

    >>> answer("Rig", "load", [], {"load": "Rig.read(path)"})
    "Rig has no 'load': Rig.read(path)"
    >>> answer("Rig", "cabel", ["cable", "plant"], {})
    "Rig has no 'cabel': did you mean cable?"
    >>> answer("Metrics", "rmse", ["peak_deg", "rmse_after_10s_deg", "rmse_deg"], {})
    "Metrics has no 'rmse': did you mean rmse_deg?"
    """
    public = [one for one in known if not one.startswith("_")]
    alike = difflib.get_close_matches(name, [*guesses, *public], 1, 0.75)
    alike = alike or sorted((one for one in public if one.startswith(f"{name}_")), key=len)  # the same, with its unit
    if alike:
        return f"{owner} has no {name!r}: {guesses.get(alike[0]) or f'did you mean {alike[0]}?'}"
    words = set(name.split("_"))
    kin = [one for one in public if words & set(one.split("_"))] if len(public) > _MANY else []
    rest = f" and {len(public) - len(kin)} others" if kin else ""
    return f"{owner} has no {name!r}; it has {', '.join(kin or public)}{rest}"


class Answering(type):
    """The class of a class that is asked for names, too: ``Rig.load``."""

    if not TYPE_CHECKING:  # to a type checker a class has the names that it has

        def __getattr__(cls, name: str) -> Any:
            if name.startswith("_"):
                raise AttributeError(f"type object {cls.__name__!r} has no attribute {name!r}")
            raise AttributeError(answer(cls.__name__, name, dir(cls), cls.__dict__.get("_guesses", {})))


def answering(guesses: Mapping[str, str], change: str, meant: Meant = lambda one, name: "") -> Callable[[Kind], Kind]:
    """Let the objects of a frozen dataclass answer a name that they do not have, and an assignment.

    Args:
        guesses: name that is often guessed → what to write.
        change: how another one is made, with ``{name}`` and ``{value}``.
        meant: what to write for a name of one object, such as a column; empty where it has none either.
    """

    def decorated(kind: Kind) -> Kind:
        made: Any = kind
        made._guesses = guesses

        def missing(self: Any, name: str) -> Any:
            if name.startswith("_") or hasattr(kind, name):  # a property that failed says so itself
                return object.__getattribute__(self, name)
            found = meant(self, name)
            said = f"{kind.__name__} has no {name!r}: {found}" if found else ""
            raise AttributeError(said or answer(kind.__name__, name, dir(self), guesses))

        def refused(self: Any, name: str, *value: Any) -> None:
            if not hasattr(self, name):
                getattr(self, name)
            given = repr(value[0]) if value else "…"
            how = change.format(name=name, value=given if len(given) < _LONG else "…")
            raise FrozenInstanceError(f"a {kind.__name__} does not change: {how}")

        made.__getattr__, made.__setattr__, made.__delattr__ = missing, refused, refused
        return kind

    return decorated


def answering_fields(kind: Kind) -> Kind:
    """Let a NamedTuple or dataclass of declared fields answer a name that it does not have, such as a file's key.

    >>> from bowden.safety.limits import Limits
    >>> Limits().joint_high_deg
    Traceback (most recent call last):
    ...
    AttributeError: Limits has no 'joint_high_deg': joint_high, in rad
    """
    made: Any = kind

    def missing(self: Any, name: str) -> Any:
        if name.startswith("_") or hasattr(kind, name):
            return object.__getattribute__(self, name)
        keys = {one.quantity.named(one.name): f"{one.name}, in {one.quantity.unit}" for one in declared(kind)}
        units = {key: said for key, said in keys.items() if key not in made.__annotations__}
        raise AttributeError(answer(kind.__name__, name, made.__annotations__, units))

    made.__getattr__ = missing
    return kind


_MANY = 20
"""Of more names than these only those are said that share a word."""
_LONG = 40
"""A value with more characters is not repeated."""


def public(function: Callable[..., Any], guesses: Mapping[str, str]) -> Callable[..., Any]:
    """A function that answers an argument that it does not have, and whose errors are one line without a chain.

    Args:
        function: of the package's face.
        guesses: argument that is often guessed → what to write.
    """
    form = signature(function)
    any_name = any(one.kind is Parameter.VAR_KEYWORD for one in form.parameters.values())

    @wraps(function)
    def called(*given: Any, **named: Any) -> Any:
        for name in named:
            if name not in form.parameters and not any_name:
                raise UnknownArgumentError(answer(function.__name__, name, form.parameters, guesses))
        try:
            form.bind(*given, **named)
        except TypeError as error:
            raise UnknownArgumentError(
                f"{function.__name__}: {error}", expected=f"{function.__name__}{_names(form.parameters)}"
            ) from None
        try:
            return function(*given, **named)
        except BowdenError as error:
            raise error from None

    called.__module__ = "bowden"  # where it is found again, by another process too
    return called


def _names(parameters: Iterable[str]) -> str:
    return f"({', '.join(parameters)})"
