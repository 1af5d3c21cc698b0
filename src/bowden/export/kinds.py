"""What values of kernels are in C: numbers, truths, enums, structs and rows; their names, and comments."""

import re
import typing
import unicodedata
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import cache
from typing import Any

import numpy as np

_WORDS = """
auto break case char const continue default do double else enum extern float for goto if inline int long register
restrict return short signed sizeof static struct switch typedef union unsigned void volatile while bool true false
and catch class delete explicit export friend mutable namespace new not operator or private protected public
template this throw try typename using virtual xor main errno assert min max
acos asin atan cbrt ceil cos cosh erf exp fabs floor fmax fmin fmod gamma hypot j0 j1 jn ldexp log pow remainder rint
round signbit sin sinh sqrt tan tanh tgamma trunc y0 y1 yn INFINITY NAN isnan isfinite
"""
_RESERVED = frozenset(_WORDS.split())
"""Of C, of C++, whose compilers may have to read the header, and of the headers that the code needs."""


@dataclass(frozen=True)
class Struct:
    """A NamedTuple with the kinds of its fields, or what a kernel returns beside one another."""

    name: str
    fields: tuple[tuple[str, Any], ...]
    made: Any = None
    """The class of NamedTuple; None for results beside one another."""


@dataclass(frozen=True)
class Row:
    """A tuple of values of one kind."""

    of: Any
    length: int
    name = "a tuple"


Kind = Any
"""`float`, `int`, `bool`, a class of IntEnum, or one of the two above; None where it is not known."""


def is_number(kind: Kind) -> bool:
    """Whether C has one number for it."""
    return isinstance(kind, type)


def is_enum(kind: Kind) -> bool:
    """True for a class of IntEnum."""
    return isinstance(kind, type) and issubclass(kind, IntEnum)


def said(kind: Kind) -> str:
    """A kind in a message."""
    return str(kind.__name__ if is_number(kind) else getattr(kind, "name", "of no kind"))


def joined(a: Kind, b: Kind) -> Kind:
    """The kind of what is one or the other; None where there is none."""
    if a == b:
        return a
    if not (is_number(a) and is_number(b)):
        return None
    return float if float in (a, b) else int


def kind_of(value: Any = None, hint: Any = None) -> Kind:
    """The kind that an annotation says, or that a value has where it leaves something open; None where C has none."""
    made = hint if isinstance(hint, type) and hint is not Any else type(value)
    if hasattr(made, "_fields"):
        hints = hints_of(made)
        fields = tuple((name, kind_of(getattr(value, name, None), hints.get(name))) for name in made._fields)
        return None if any(kind is None for _, kind in fields) else Struct(made.__name__, fields, made)
    for kind, types in (made, IntEnum), (bool, bool | np.bool_), (int, int | np.integer), (float, float | np.floating):
        if issubclass(made, types):
            return kind
    said = [kind_of(hint=one) for one in typing.get_args(hint)] if typing.get_origin(hint) is tuple else []
    for kinds in said, [kind_of(one) for one in value] if isinstance(value, tuple) else []:
        if len(set(kinds)) == 1 and kinds[0] is not None:
            return Row(kinds[0], len(kinds))
    return None


@cache
def hints_of(of: Any) -> dict[str, Any]:
    """Name → annotation of a class or function; empty where they cannot be looked up."""
    try:
        return typing.get_type_hints(of)
    except (NameError, TypeError):
        return {}


def identifier(name: str) -> str:
    """A name as C takes it: letters beyond ASCII by their names, and no word that C has.

    >>> identifier("κ_gain"), identifier("default"), identifier("_bounded")
    ('kappa_gain', 'default_', 'bounded_')
    """
    plain = "".join(c if c.isascii() else unicodedata.name(c, "x").split()[-1].lower() for c in name)
    plain = re.sub(r"\W", "_", plain)
    if plain.startswith("_"):  # such names are C's own
        plain = f"{plain.lstrip('_')}_"
    if not plain or plain[0].isdigit():
        plain = f"n{plain}"
    return f"{plain}_" if plain in _RESERVED else plain


def within(kind: Kind, way: str = "") -> Iterator[tuple[str, Kind]]:
    """A value and each part of it, from the outside: how C reaches that, ``.past.at[2]``, and its kind."""
    yield way, kind
    parts = [(f"at[{k}]", kind.of) for k in range(kind.length)] if isinstance(kind, Row) else []
    for name, inner in parts or [(identifier(name), inner) for name, inner in getattr(kind, "fields", ())]:
        yield from within(inner, f"{way}.{name}")


def numbers(kind: Kind, way: str = "") -> list[tuple[str, Kind]]:
    """Each number of a value: how C reaches it, and its kind."""
    return [(place, one) for place, one in within(kind, way) if is_number(one)]


def snake_case(name: str) -> str:
    """The words of a class' name, with a stroke between them.

    >>> snake_case("LawState")
    'Law_State'
    """
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name)


def comments(lines: Sequence[str]) -> list[str]:
    """Lines as a comment; nothing where there are none."""
    rows = [one.replace("*/", "* /").replace("/*", "/ *").rstrip() for one in lines]
    rows = [f"{' *' if k else '/*'} {one}".rstrip() for k, one in enumerate(rows)]
    return [*rows[:-1], f"{rows[-1]} */"] if rows else []


def comment(text: str) -> str:
    """A text behind a line of C; nothing where there is none."""
    return "".join(f" {one}" for one in comments([" ".join(text.split())] if text.strip() else []))
