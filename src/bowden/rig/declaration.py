"""From a declared NamedTuple to a section of a file and back: keys, defaults, pydantic's class, values in SI."""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import cache
from typing import Annotated, Any, Literal, NamedTuple, TypeVar, get_args, get_origin, get_type_hints

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, create_model
from pydantic_core import PydanticCustomError

from bowden.core.quantity import Quantity, declared, in_unit, optional

Value = TypeVar("Value")


STRICT = ConfigDict(allow_inf_nan=False, strict=True)
"""Of every value: a number in quotation marks, NaN and infinity are refused."""


class Section(BaseModel):
    """A table of a file; unknown keys are refused."""

    model_config = ConfigDict(**STRICT, extra="forbid", frozen=True)


class Item(NamedTuple):
    """One key of a section."""

    path: tuple[str, ...]
    """To the field of the value: its name, after those of the values that it is nested in."""
    key: str
    kind: Any
    """Type of the field."""
    quantity: Quantity


def items_of(kind: Any) -> tuple[Item, ...]:
    """The keys that a file has for a NamedTuple or dataclass, with those of NamedTuples inside it, in their order."""
    return _items(kind)


@cache
def _items(kind: Any) -> tuple[Item, ...]:
    return tuple(_looked_up(kind))


def _looked_up(kind: Any) -> Iterator[Item]:
    found = {one.name: one for one in declared(kind)}
    for name, hint in get_type_hints(kind).items():
        if name in found:
            quantity = found[name].quantity
            if quantity.key is not None:
                yield Item((name,), quantity.named(name), found[name].kind, quantity)
        elif isinstance(hint, type) and hasattr(hint, "_fields"):
            for path, key, inner, quantity in items_of(hint):
                yield Item((name, *path), f"{name}_{key}", inner, quantity)


def at(value: Any, path: tuple[str, ...]) -> Any:
    """The field of a value."""
    for name in path:
        value = getattr(value, name)
    return value


def in_file(value: Any, quantity: Quantity) -> Any:
    """A value of a field as a file has it."""
    if isinstance(value, tuple):
        return [in_unit(float(one), quantity.factor) for one in value]
    if quantity.follows and isinstance(value, float) and math.isnan(value):
        return None
    return in_unit(value, quantity.factor) if isinstance(value, float) else value


def from_file(value: Any, quantity: Quantity) -> Any:
    """The other way round."""
    if isinstance(value, list):
        return tuple(float(one) * quantity.factor for one in value)
    if value is None and quantity.follows:
        return math.nan
    number = isinstance(value, float | int) and not isinstance(value, bool)
    return value * quantity.factor if number and quantity.factor != 1.0 else value


def rounded(value: Value, digits: int) -> Value:
    """A value whose numbers are this many digits long where a file has them."""
    changed = value
    for item in items_of(type(value)):
        number = at(value, item.path)
        if isinstance(number, float):
            short = float(f"{number / item.quantity.factor:.{digits}g}") * item.quantity.factor
            changed = replaced(changed, item.path, short)
    return changed


def replaced(value: Any, path: tuple[str, ...], new: Any) -> Any:
    """A NamedTuple with another value of a field, which may lie in NamedTuples inside it."""
    name, *rest = path
    return value._replace(**{name: replaced(getattr(value, name), tuple(rest), new) if rest else new})


def tree_of(value: Any) -> dict[str, Any]:
    """A value as the section of a file: key → value in the file's unit, without those that are None."""
    pairs = ((item.key, in_file(at(value, item.path), item.quantity)) for item in items_of(type(value)))
    return {key: given for key, given in pairs if given is not None}


def value_of(kind: type[Value], section: Mapping[str, Any], default: Value | None = None) -> Value:
    """A value from a section of a file whose keys are all there; fields without a key are those of `default`."""
    flat: dict[str, Any] = {}
    nested: dict[str, dict[str, Any]] = {}
    for item in items_of(kind):
        given = from_file(section[item.key], item.quantity)
        if item.path[1:]:
            nested.setdefault(item.path[0], {})[item.path[1]] = given
        else:
            flat[item.path[0]] = given
    whole: Any = kind() if default is None and nested else default
    flat |= {name: getattr(whole, name)._replace(**inner) for name, inner in nested.items()}
    return kind(**flat) if default is None or not hasattr(kind, "_fields") else whole._replace(**flat)


def plain_key(default: Any, meaning: str, unit: str = "–", symbol: str = "", **rules: Any) -> Any:
    """A key that stands for no value of its own: its default, meaning, unit, symbol, and the rules of its value."""
    return Field(default, description=meaning, json_schema_extra={"unit": unit, "symbol": symbol}, **rules)


def section_of(
    name: str,
    text: str,
    kind: type,
    default: Any = None,
    *,
    tag: str = "",
    before: Mapping[str, Any] | None = None,
    after: Mapping[str, Any] | None = None,
) -> type[Section]:
    """Pydantic's class of a section.

    Args:
        name: of the class.
        text: what the section is, in a sentence.
        kind: declared NamedTuple or dataclass.
        default: a value of that kind; without one every key must be given that has no default of its own.
        tag: value of its key ``kind``, of a section that may be one of several.
        before: further keys as `create_model` takes them, before those of `kind`.
        after: likewise, after them; inner sections, say.
    """
    fields: dict[str, Any] = {"kind": (Literal[tag], tag)} if tag else dict(before or {})
    for item in items_of(kind):
        given = _own_default(kind, item) if default is None else at(default, item.path)
        fields[item.key] = key_of(item.kind, item.quantity, given)
    made: type[Section] = create_model(name, __base__=Section, __doc__=text, **(fields | dict(after or {})))
    return made


def _own_default(kind: Any, item: Item) -> Any:
    return kind._field_defaults.get(item.path[0], ...)


def key_of(kind: Any, quantity: Quantity, default: Any) -> tuple[Any, Any]:
    """Type and field of one key, as pydantic's `create_model` takes them; `default` is in SI, or ``...``."""
    if quantity.follows:  # left out, it follows; the example is what follows on the default bench
        quantity, kind, default = replace(quantity, example=default), kind | None, None
    inner: Any = optional(kind) or kind
    rules: dict[str, Any] = dict(quantity.rules)
    extra = {"unit": quantity.file_unit, "symbol": quantity.symbol}
    given = default if default is ... else in_file(default, quantity)
    about: dict[str, Any] = {"description": quantity.meaning, "json_schema_extra": extra}
    if quantity.example is not None:
        about["examples"] = [in_file(quantity.example, quantity)]
    if quantity.endless:
        rules = rules | {"allow_inf_nan": True}
    if get_origin(inner) is tuple:
        least: dict[str, Any] = {"min_length": quantity.least} if quantity.least else {}
        element: Any = Annotated[float, Field(**rules)] if rules else float
        return list[element], Field(given, **about, **least)
    if get_origin(inner) is Literal:
        return Annotated[kind, BeforeValidator(_one_of(get_args(inner)))], Field(given, **about, **rules)
    return kind if optional(kind) is None else inner | None, Field(given, **about, **rules)


def _one_of(choices: tuple[Any, ...]) -> Callable[[Any], Any]:
    """A validator that refuses what is equal to a choice and of another type: true or 1.0, where 1 is one."""

    def seen(value: Any) -> Any:
        if value in choices and type(value) not in map(type, choices):
            raise PydanticCustomError("literal_error", "{expected}", {"expected": " or ".join(map(str, choices))})
        return value

    return seen
