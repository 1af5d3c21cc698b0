"""What values of kernels are in C: numbers, truths, enums, structs and rows, and how each is written."""

import math
import re
import typing
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import cache
from typing import Any

import numpy as np

from bowden.core.nested import Path, is_named

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
    """A NamedTuple with the kinds of its fields."""

    made: Any
    fields: tuple[tuple[str, Any], ...]


@dataclass(frozen=True)
class Row:
    """A tuple of values of one kind."""

    of: Any
    length: int


@dataclass(frozen=True)
class Several:
    """What a kernel returns beside one another, by the names that it has for them."""

    function: str
    fields: tuple[tuple[str, Any], ...]


Kind = Any
"""`float`, `int`, `bool`, a class of IntEnum, or one of the three above."""


def is_number(kind: Kind) -> bool:
    """Whether C has one number for it."""
    return isinstance(kind, type)


def is_enum(kind: Kind) -> bool:
    """True for a class of IntEnum."""
    return isinstance(kind, type) and issubclass(kind, IntEnum)


def is_tuple_class(of: Any) -> bool:
    """True for a class of NamedTuple."""
    return isinstance(of, type) and issubclass(of, tuple) and hasattr(of, "_fields")


def said(kind: Kind) -> str:
    """A kind in a message."""
    return str(getattr(kind, "__name__", "") or getattr(getattr(kind, "made", None), "__name__", "a tuple"))


def joined(a: Kind, b: Kind) -> Kind:
    """The kind of what is one or the other; None where there is none."""
    if a == b:
        return a
    if not (is_number(a) and is_number(b)):
        return None
    return float if float in (a, b) else int


def kind_of(value: Any) -> Kind:
    """The kind of a value; None where C has none."""
    if isinstance(value, bool | np.bool_):
        return bool
    if isinstance(value, IntEnum):
        return type(value)
    if isinstance(value, int | np.integer):
        return int
    if isinstance(value, float | np.floating):
        return float
    if is_named(value):
        made: Any = type(value)
        fields = [(name, field_kinds(made)[name] or kind_of(inner)) for name, inner in value._asdict().items()]
        return None if any(kind is None for _, kind in fields) else Struct(made, tuple(fields))
    if isinstance(value, tuple) and value:
        kinds = {kind_of(inner) for inner in value}
        return Row(kinds.pop(), len(value)) if len(kinds) == 1 and None not in kinds else None
    return None


def annotated(hint: Any) -> Kind:
    """The kind that an annotation says; None for `Any`, and where it leaves something open."""
    if typing.get_origin(hint) is typing.Annotated:
        return annotated(hint.__origin__)
    if hint in (float, int, bool) or is_enum(hint):
        return hint
    if is_tuple_class(hint):
        fields = tuple(field_kinds(hint).items())
        return None if any(kind is None for _, kind in fields) else Struct(hint, fields)
    if typing.get_origin(hint) is tuple:
        kinds = [annotated(inner) for inner in typing.get_args(hint)]
        return Row(kinds[0], len(kinds)) if None not in kinds and len(set(kinds)) == 1 else None
    return None


@cache
def hints_of(of: Any) -> dict[str, Any]:
    """Name → annotation of a class or function; empty where they cannot be looked up."""
    try:
        return typing.get_type_hints(of, include_extras=True)
    except (NameError, TypeError):
        return {}


@cache
def field_kinds(made: Any) -> dict[str, Kind]:
    """Field → kind of a NamedTuple, None where its annotation leaves it open."""
    hints = hints_of(made)
    return {name: annotated(hints.get(name)) for name in made._fields}


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


def reached(way: Path) -> str:
    """How C reaches a leaf of a struct: ``.past.at[2]``."""
    return "".join(f".at[{one}]" if isinstance(one, int) else f".{identifier(one)}" for one in way)


def snake_case(name: str) -> str:
    """The words of a class' name, with a stroke between them.

    >>> snake_case("LawState")
    'Law_State'
    """
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name)


def comment(text: str) -> str:
    """A text behind a line of C; nothing where there is none."""
    text = " ".join(text.replace("*/", "* /").replace("/*", "/ *").split())
    return f" /* {text} */" if text else ""


def comments(lines: Sequence[str], pad: str = "") -> list[str]:
    """Lines as a comment that stands alone; nothing where there are none."""
    rows = [one.replace("*/", "* /").replace("/*", "/ *").rstrip() for one in lines]
    rows = [f"{pad}{'/*' if k == 0 else ' *'} {one}".rstrip() for k, one in enumerate(rows)]
    return [*rows[:-1], f"{rows[-1]} */"] if rows else []


@dataclass(frozen=True)
class Style:
    """How numbers are written."""

    prefix: str
    """Of every name that other files see."""
    single: bool = False
    """float in place of double."""

    @property
    def real(self) -> str:
        """The type of a number."""
        return "float" if self.single else "double"

    def number(self, value: float) -> str:
        """A constant; its decimals are the shortest that give back the same bits.

        >>> Style("x").number(0.1), Style("x", single=True).number(-1e-300), Style("x").number(math.inf)
        ('0.1', '-0.0f', 'INFINITY')
        """
        if math.isnan(value):
            return "NAN"
        with np.errstate(over="ignore", under="ignore"):
            rounded = np.float32(value) if self.single else np.float64(value)
        if np.isinf(rounded):
            return "INFINITY" if value > 0.0 else "-INFINITY"
        text = str(rounded)
        return (text if "." in text or "e" in text else f"{text}.0") + ("f" if self.single else "")

    def libm(self, name: str) -> str:
        """A function of libm."""
        return f"{name}f" if self.single else name
