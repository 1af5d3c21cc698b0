"""What a pair of files of C is made of: kinds of values, names, types, constants and functions."""

import inspect
import re
import textwrap
import typing
import unicodedata
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from bowden.core.errors import ParameterError
from bowden.core.kernel_content import Parts
from bowden.core.quantity import meanings
from bowden.export.source import comment, comments, origin

LONGEST = 112
"""Of a line of C, where it can be broken."""

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


def kind_name(kind: Kind) -> str:
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
    hinted = [kind_of(hint=one) for one in typing.get_args(hint)] if typing.get_origin(hint) is tuple else []
    for kinds in hinted, [kind_of(one) for one in value] if isinstance(value, tuple) else []:
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


@dataclass(frozen=True)
class Module:
    """What belongs in one pair of files."""

    prefix: str
    """Of every name that others see, and the files' own."""
    title: str
    functions: Mapping[str, tuple[Callable[..., Any], str]]
    """Name → a kernel that other files of C call as ``PREFIX_name``, and its results in their order: ``state`` for the
    argument that it reads and writes, ``return`` for what it returns, other names for pointers to it."""
    constants: Mapping[str, tuple[Any, str]] = field(default_factory=dict)
    """Argument → the value that is written into the code in its place, and what it is."""
    state: Any = None
    """An example of the argument ``state``, where its annotation leaves something open."""
    parts: Parts = ()
    """What stands for the placeholders that the kernels reach."""
    units: Mapping[str, str] = field(default_factory=dict)
    """Field → unit, where its class does not say."""
    enums: Sequence[type[IntEnum]] = ()
    """Whose members a caller needs."""

    def arguments(self, function: Callable[..., Any]) -> dict[str, Kind]:
        """Argument of a kernel → its kind; what C has none for is refused."""
        found, hints = {}, hints_of(function)
        for name in inspect.signature(function).parameters:
            value, _ = self.constants.get(name, (self.state if name == "state" else None, ""))
            if (found_kind := kind_of(value, hints.get(name))) is None:
                expected, do = "numbers, and NamedTuples of numbers", "take texts and arrays out of it"
                raise ParameterError(f"{name} is {value!r}", expected=expected, do=do)
            found[name] = found_kind
        return found


class Unit:
    """What is written of a module, in double or in float."""

    def __init__(self, module: Module, *, single: bool) -> None:
        self.module, self.single, self.prefix = module, single, module.prefix
        self.real = "float" if single else "double"
        self.types: dict[str, str] = {}
        self.constants: dict[str, str] = {}
        self.helpers: dict[str, dict[str, Any]] = {}
        """Name → what the template of the file writes it from."""
        self.functions: dict[str, str] = {}
        self.made: dict[Any, tuple[str, Kind] | None] = {}
        """Kernel, kinds of its arguments and parts → its name and the kind of its result; None while it is written."""
        self._origins: dict[tuple[str, str], str] = {}
        self._names: dict[Any, str] = {float: self.real, int: "int64_t", bool: "bool"}

    def type(self, kind: Kind) -> str:
        """The type of a kind; it is defined if it is new."""
        if kind in self._names:
            return self._names[kind]
        rows: list[str] = []
        if isinstance(kind, Row):
            of = "" if kind.of is float else f"{self.type(kind.of).removeprefix(f'{self.prefix}_').removesuffix('_t')}_"
            name, rows = f"{of}row{kind.length}", [f"    {self.type(kind.of)} at[{kind.length}];"]
        elif isinstance(kind, Struct):
            texts = meanings(kind.made) if kind.made else {}
            name, rows = kind.name, [self._field(*one, texts.get(one[0], "")) for one in kind.fields]
        else:
            name = kind.__name__
        several = isinstance(kind, Struct) and not kind.made
        self._names[kind] = name = unused(name if several else f"{self.prefix}_{identifier(name)}", self.types)
        if is_enum(kind):
            rows = [f"    {self.value(one, kind)} = {one.value},{comment(getattr(one, 'meaning', ''))}" for one in kind]
            rows[-1] = rows[-1].replace(",", "", 1)
        self.types[name] = "\n".join([f"typedef {'enum' if is_enum(kind) else 'struct'} {{", *rows, f"}} {name};"])
        return name

    def _field(self, field: str, kind: Kind, text: str) -> str:
        unit = self.module.units.get(field, "")
        if unit and "[" not in text:
            text = f"{text} [{'–' if unit == '1' else unit}]".strip()
        return f"    {self.type(kind)} {identifier(field)};{comment(text)}"

    def number(self, value: float) -> str:
        """A number; its decimals are the shortest that give back the same bits.

        >>> [Unit(Module("x", "", {}), single=one).number(-1e-300) for one in (False, True)]
        ['-1e-300', '-0.0f']
        """
        with np.errstate(over="ignore", under="ignore"):
            rounded = np.float32(value) if self.single else np.float64(value)
        if not np.isfinite(rounded):
            return str(rounded).upper().replace("INF", "INFINITY")
        return f"{rounded!s}{'f' * self.single}"

    def value(self, value: Any, kind: Kind) -> str:
        """A value, as it initialises a constant."""
        if isinstance(kind, Row):
            inner = "0" if not any(value) else ", ".join(self.value(one, kind.of) for one in value)
            return f"{{{{{inner}}}}}"
        if isinstance(kind, Struct):
            return f"{{{', '.join(self._fields(value, kind))}}}"
        if is_enum(kind):
            return f"{snake_case(self.type(kind))}_{kind(value).name}".upper()
        if kind is float:
            return self.number(float(value))
        if kind is bool:
            return "true" if value else "false"
        return str(int(value)) if abs(value) < 2**31 else f"INT64_C({int(value)})"

    def _fields(self, value: Any, kind: Struct) -> list[str]:
        """What sets each field to its value."""
        rows = zip(kind.fields, value, strict=True)
        return [f".{identifier(name)} = {self.value(one, inner)}" for (name, inner), one in rows]

    def literal(self, value: Any, kind: Kind) -> str:
        """A value, as it stands in an expression."""
        text = self.value(value, kind)
        return text if is_number(kind) else f"({self.type(kind)}){text}"

    def constant(self, file: str, name: str, value: Any, meaning: str = "") -> str:
        """The name of a constant of a module; of no file, one that a public function hands on."""
        if file:
            file, meaning = origin(file, name)
        if (file, name) not in self._origins:
            called = identifier(name)
            if called in self.constants and file:
                called = f"{Path(file).stem}_{called}".upper()
            self._origins[file, name] = called = unused(called, self.constants)
            self.constants[called] = self._constant(called, value, kind_of(value), meaning)
        return self._origins[file, name]

    def _constant(self, called: str, value: Any, kind: Kind, meaning: str) -> str:
        head, above = f"static const {self.type(kind)} {called} =", comments(textwrap.wrap(meaning, 108))
        if isinstance(kind, Struct) and len(kind.fields) <= 24:
            texts = (comment(meanings(kind.made).get(name, "")) for name, _ in kind.fields)
            rows = [f"    {text},{behind}" for text, behind in zip(self._fields(value, kind), texts, strict=True)]
            return "\n".join([*above, f"{head} {{", *rows, "};"])
        line = f"{head} {self.value(value, kind)};"
        return f"{line}{comment(meaning)}" if len(line) + len(meaning) < LONGEST else "\n".join([*above, line])

    def helper(self, name: str, **words: Any) -> str:
        """The name of a function that the file's template writes: Python's `min` or `max`, or a shift."""
        self.helpers[name] = words
        return name


def unused(name: str, taken: Any) -> str:
    """A name that nothing else has."""
    return unused(f"{name}_", taken) if name in taken else name
