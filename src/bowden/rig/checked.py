"""Values that are handed to a rig in Python: of the right type, finite, in their range, and plain numbers."""

import math
import numbers
from collections.abc import Iterator, Mapping
from functools import lru_cache
from typing import Any, Literal, TypeVar, cast, get_args, get_origin

from bowden.core.errors import ParameterError, article, near
from bowden.core.quantity import Quantity, optional
from bowden.core.units import DEGREES
from bowden.rig.declaration import at, items_of, replaced

Value = TypeVar("Value")

_GIVE = "give it another value"
_WORDS = {float: "a number", int: "a whole number", bool: "True or False", str: "text"}


class Gains(Mapping[str, float]):
    """Gains by name, which do not change."""

    def __init__(self, values: Mapping[str, float] | None = None) -> None:
        self._values = dict(values or {})

    def __getitem__(self, name: str) -> float:
        return self._values[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __hash__(self) -> int:
        return hash(frozenset(self._values.items()))

    def __repr__(self) -> str:
        return repr(self._values)


def checked(value: Any, kind: type[Value], name: str, default: Any = None) -> Value:
    """A NamedTuple or dataclass of a rig, with plain numbers in it.

    Args:
        value: what was given: one, or a mapping of its fields that differ from the default.
        kind: what it must be.
        name: of the argument.
        default: the rig's.

    Raises:
        ParameterError: it is another thing, or one of its fields is; with the field, what was given and expected.
    """
    if isinstance(value, Mapping) and hasattr(default, "_fields"):
        value = _of_mapping(value, default, name)
    if not isinstance(value, kind):
        raise ParameterError(
            f"Rig: {name} is {shown(value)}",
            expected=article(kind.__name__),
            do=f"make one: {_like(kind, name, default)}",
        )
    wanted: Any = kind
    try:
        return cast(Value, _looked_at(value, wanted, name, _types(value)))
    except TypeError:  # something in it is no number at all
        return cast(Value, _looked_at.__wrapped__(value, wanted, name, ()))


def _of_mapping(values: Mapping[str, Any], default: Any, name: str) -> Any:
    """A part of which some fields are named; the others are as in the default.

    Raises:
        ParameterError: a field that there is not.
    """
    for field in values:
        if field not in default._fields:
            raise ParameterError(
                f"Rig: {name} has no {field!r}", expected=near(str(field), default._fields), do="name one of them"
            )
    return default._replace(**values)


def _types(value: Any) -> tuple[Any, ...]:
    """The types of all that a value holds: 1 and True are equal, and have one hash."""
    inside = value if isinstance(value, tuple) else vars(value).values() if hasattr(value, "__dict__") else ()
    return type(value), *map(_types, inside)


@lru_cache(512)
def _looked_at(value: Any, kind: Any, name: str, types: tuple[Any, ...]) -> Any:
    """The value with plain numbers; most of a rig's are those of the rig before."""
    changed = value
    for item in items_of(kind):
        given = at(value, item.path)
        right = checked_number(given, item.kind, item.quantity, ".".join((name, *item.path)))
        if right is not given and hasattr(value, "_fields"):
            changed = replaced(changed, item.path, right)
    return changed


def _like(kind: type, name: str, default: Any) -> str:
    """How one is written: by its fields where they may be given alone, for which nothing is imported."""
    first = next(iter(items_of(kind)), None)
    if first and hasattr(default, "_fields"):
        return f"Rig({name}={{'{first.path[0]}': …}})"
    return f"{kind.__name__}({first.path[0]}=…)" if first else kind.__name__


def checked_number(value: Any, kind: Any, quantity: Quantity, name: str) -> Any:
    """One field of a rig, as a plain number where it is one.

    Raises:
        ParameterError: of the wrong type or out of its range.
    """
    inner = optional(kind)
    if inner is not None:
        return None if value is None else checked_number(value, inner, quantity, name)
    if get_origin(kind) is Literal:
        choices = get_args(kind)
        if value not in choices or isinstance(value, bool | float):  # true and 1.0 equal 1, and are no choice
            raise ParameterError(
                f"Rig: {name} is {shown(value)}", expected=near(str(value), map(str, choices)), do=_GIVE
            )
        return value
    if get_origin(kind) is tuple:
        if isinstance(value, str) or not hasattr(value, "__iter__"):
            raise ParameterError(
                f"Rig: {name} is {shown(value)}", expected="several numbers", do="for example [0.0, 1.0]"
            )
        found = tuple(checked_number(one, float, quantity, f"{name}[{i}]") for i, one in enumerate(value))
        return value if value == found and isinstance(value, tuple) and all(type(x) is float for x in value) else found
    if kind in (bool, str):
        if not isinstance(value, kind):
            raise ParameterError(f"Rig: {name} is {shown(value)}", expected=_WORDS[kind], do=_GIVE)
        return value
    needed = numbers.Integral if kind is int else numbers.Real
    if isinstance(value, bool) or not isinstance(value, needed):
        raise ParameterError(f"Rig: {name} is {shown(value)}", expected=_expected(kind, quantity), do=_GIVE)
    number = int(value) if isinstance(value, numbers.Integral) and kind is int else float(value)
    if quantity.follows and math.isnan(number):
        return math.nan  # the one object, so that equal rigs are equal
    if not quantity.holds(number):
        raise ParameterError(
            f"Rig: {name} is {number:g}", expected=_expected(kind, quantity), do=_in_degrees(number, quantity)
        )
    return value if type(value) is kind else number


def _expected(kind: Any, quantity: Quantity) -> str:
    unit = "" if quantity.unit == "–" else f" in {quantity.unit}"
    return f"{_WORDS[kind]}{f' {quantity.range}' if quantity.range else ''}{unit}"


def _in_degrees(number: float, quantity: Quantity) -> str:
    """What to do; with a hint where an angle is too large to be in radians, and would be right in degrees."""
    angle = quantity.unit == "rad" and quantity.file_unit == "°" and math.isfinite(number)
    like = angle and quantity.holds(number / DEGREES)
    return f"that looks like degrees: np.radians({number:g})" if like else quantity.hint.format(value=number) or _GIVE


def shown(value: Any) -> str:
    """A value in a message, cut short."""
    text = " ".join(repr(value).split())
    return text if len(text) <= 60 else f"{text[:57]}..."
