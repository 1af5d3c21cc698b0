"""Values that are handed to a rig in Python: of the right type, finite, in their range, and plain numbers."""

import math
import numbers
import operator
from collections.abc import Iterable, Iterator, Mapping
from functools import cache, lru_cache
from typing import Annotated, Any, Literal, TypeVar, cast, get_args, get_origin

from pydantic import TypeAdapter, ValidationError

from bowden.core.errors import ParameterError, article, near
from bowden.core.quantity import Quantity, has_size, optional
from bowden.core.units import DEGREES
from bowden.rig.declaration import STRICT, at, items_of, key_of, replaced

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
        right = checked_value(given, item.kind, item.quantity, ".".join((name, *item.path)).lstrip("."))
        if right is not given and hasattr(value, "_fields"):
            changed = replaced(changed, item.path, right)
    return changed


def _like(kind: type, name: str, default: Any) -> str:
    """How one is written: by its fields where they may be given alone, for which nothing is imported."""
    first = next(iter(items_of(kind)), None)
    if first and hasattr(default, "_fields"):
        return f"Rig({name}={{'{first.path[0]}': …}})"
    return f"{kind.__name__}({first.path[0]}=…)" if first else kind.__name__


def checked_value(value: Any, kind: Any, quantity: Quantity, name: str) -> Any:
    """One field of a rig, as a plain number where it is one: checked as the key of a file is, in the file's unit.

    Raises:
        ParameterError: of the wrong type or out of its range.
    """
    given = _plain(value, kind)
    if quantity.follows and isinstance(given, float) and math.isnan(given):
        return math.nan  # the one object, so that equal rigs are equal
    absent = given is None and optional(kind) is None  # which a file may leave out, where a limit follows
    if absent or (isinstance(given, float) and not has_size(given)):  # sizes as of a file, when it is read
        raise _refused(given, optional(kind) or kind, quantity, name)
    try:
        _type_of(kind, quantity).validate_python(_in_file(given, quantity.factor))
    except ValidationError as error:
        first = error.errors()[0]
        place = next((one for one in first["loc"] if isinstance(one, int)), None)
        wrong, inner = (given, optional(kind) or kind) if place is None else (given[place], float)
        raise _refused(wrong, inner, quantity, name if place is None else f"{name}[{place}]") from None
    return given


@cache
def _type_of(kind: Any, quantity: Quantity) -> TypeAdapter[Any]:
    annotation, field = key_of(kind, quantity, None)
    checks: Any = Annotated[annotation, field]
    return TypeAdapter(checks, config=STRICT)


def _plain(value: Any, kind: Any) -> Any:
    """A number of Python's where it is one of another kind, NumPy's for one; of several a tuple."""
    if get_origin(kind) is tuple and isinstance(value, Iterable) and not isinstance(value, str):
        found = tuple(_plain(one, float) for one in value)
        return value if value == found and all(map(operator.is_, value, found)) and type(value) is tuple else found
    if type(value) in (bool, float, str) or not isinstance(value, numbers.Real):
        return value
    if isinstance(value, numbers.Integral) and kind not in (float, float | None):
        return value if isinstance(value, int) else int(value)
    return float(value)


def _in_file(value: Any, factor: float) -> Any:
    """In the file's unit, but for the last digits, which a change of unit may cost."""
    if isinstance(value, tuple):
        return [_in_file(one, factor) for one in value]
    return float(f"{value / factor:.13g}") if isinstance(value, float) and factor != 1.0 else value


def _refused(value: Any, kind: Any, quantity: Quantity, name: str) -> ParameterError:
    """What pydantic refused, in the unit inside."""
    said = shown(value)
    if get_origin(kind) is Literal:
        return ParameterError(f"Rig: {name} is {said}", expected=near(str(value), map(str, get_args(kind))), do=_GIVE)
    if get_origin(kind) is tuple:
        return ParameterError(f"Rig: {name} is {said}", expected="several numbers", do="for example [0.0, 1.0]")
    if kind in (float, int) and (isinstance(value, float) or (type(value) is int and kind is int)):
        return ParameterError(
            f"Rig: {name} is {value:g}", expected=_expected(kind, quantity), do=_in_degrees(value, quantity)
        )
    return ParameterError(f"Rig: {name} is {said}", expected=_expected(kind, quantity), do=_GIVE)


def _expected(kind: Any, quantity: Quantity) -> str:
    unit = "" if quantity.unit == "–" else f" in {quantity.unit}"
    said = f" {quantity.range}" if quantity.range else ""
    return f"{_WORDS[kind]}{said}{unit}" if kind in (float, int) else _WORDS[kind]


def _in_degrees(number: float, quantity: Quantity) -> str:
    """What to do; with a hint where an angle is too large to be in radians, and would be right in degrees."""
    angle = quantity.unit == "rad" and quantity.file_unit == "°" and math.isfinite(number)
    like = angle and quantity.holds(number / DEGREES)
    return f"that looks like degrees: np.radians({number:g})" if like else quantity.hint.format(value=number) or _GIVE


def shown(value: Any) -> str:
    """A value in a message, cut short."""
    text = " ".join(repr(value).split())
    return text if len(text) <= 60 else f"{text[:57]}..."
