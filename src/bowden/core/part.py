"""Classes that a user makes by hand, and that refuse at once what can be none of their values."""

from functools import wraps
from inspect import Signature, signature
from typing import Any, TypeVar

from bowden.core.arguments import format_value
from bowden.core.errors import ParameterError, near
from bowden.core.guesses import answering_fields
from bowden.core.quantity import declared

Kind = TypeVar("Kind", bound=type)

_NO_NUMBER = (str, bytes, list, dict, set, type, type(None))
"""Refused types: kernels are handed numbers, or arrays and symbols in their place."""


def signed(kind: Kind) -> Kind:
    """Let help and notebooks show the arguments of a dataclass whose ``__new__`` takes any, to refuse them itself."""
    made: Any = kind
    first, *others = signature(made.__init__).parameters.values()
    assert first.name == "self"
    made.__signature__ = Signature(others)
    return kind


def part(kind: Kind) -> Kind:
    """Let a NamedTuple of numbers refuse, when it is made, a name that it has not and a value that is no number.

    Ranges are looked at where a rig takes it (`bowden.rig.checked`), but of what has a hint (`Quantity.hint`). Compiled
    code makes it as before.

    >>> from bowden.models.drive.encoder import Encoder
    >>> Encoder(resolutoin=0.1)
    Traceback (most recent call last):
    ...
    bowden.core.errors.ParameterError: Encoder has no 'resolutoin'; expected resolution (did you mean this?) or noise; correct the name
    """  # noqa: E501  # as Python prints it
    made: Any = kind
    plain, fields = made.__new__, made._fields
    hinted = {one.name: one.quantity for one in declared(kind) if one.quantity.hint}

    @wraps(plain)
    def checked(cls: Any, *given: Any, **named: Any) -> Any:
        owner = kind.__name__
        for name in named:
            if name not in fields:
                raise ParameterError(f"{owner} has no {name!r}", expected=near(name, fields), do="correct the name")
        if len(given) > len(fields) or set(fields[: len(given)]) & named.keys():
            expected, values = f"{', '.join(fields)}, each at most once", len(given) + len(named)
            raise ParameterError(f"{owner} is given {values} values", expected=expected, do="give them by name")
        for name, value in (*zip(fields, given, strict=False), *named.items()):
            if isinstance(value, _NO_NUMBER):
                said = f"{owner}: {name} is {format_value(value)}"
                raise ParameterError(said, expected="a number, in SI and radians", do="give one")
            if name in hinted and isinstance(value, int | float) and value > hinted[name].ends[1]:
                quantity = hinted[name]
                said, expected = f"{owner}: {name} is {value:g} {quantity.unit}", f"a number {quantity.range}"
                raise ParameterError(said, expected=expected, do=quantity.hint.format(value=value))
        return plain(cls, *given, **named)

    made.__new__ = checked
    return answering_fields(kind)
