"""One pair of files of C: what is to be in it, and its types, constants and functions so far, by their names."""

import inspect
import textwrap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from pathlib import Path
from typing import Any

import numpy as np

from bowden.core.errors import ParameterError
from bowden.core.kernel_content import Parts
from bowden.core.quantity import meanings
from bowden.export.kinds import (
    Kind,
    Row,
    Struct,
    comment,
    comments,
    hints_of,
    identifier,
    is_enum,
    is_number,
    kind_of,
    snake_case,
)
from bowden.export.source import origin

LONGEST = 112
"""Of a line of C, where it can be broken."""


@dataclass(frozen=True)
class Constant:
    """A value that is written into the code in place of an argument."""

    value: Any
    said: str = ""
    """What it is."""


@dataclass(frozen=True)
class Public:
    """A kernel that other files of C call, as ``PREFIX_name``.

    Its arguments have the kernel's names; the one called ``state`` is what the function reads and writes.
    """

    name: str
    kernel: Callable[..., Any]
    results: tuple[str, ...]
    """In the kernel's order: ``state``, ``return`` for what the function returns, other names for pointers to it."""
    summary: str
    given: Mapping[str, Any] = field(default_factory=dict)
    """Argument → its `Constant`, or an example where its annotation leaves something open."""

    @property
    def kinds(self) -> dict[str, Kind]:
        """Argument → its kind; what C has none for is refused."""
        found, hints = {}, hints_of(self.kernel)
        for name in inspect.signature(self.kernel).parameters:
            value = self.given.get(name)
            value = value.value if isinstance(value, Constant) else value
            if (kind := kind_of(value, hints.get(name))) is None:
                expected, do = "numbers, and NamedTuples of numbers", "take texts and arrays out of it"
                raise ParameterError(f"{name} is {value!r}", expected=expected, do=do)
            found[name] = kind
        return found


@dataclass(frozen=True)
class Module:
    """What belongs in one pair of files."""

    prefix: str
    """Of every name that others see, and the files' own."""
    title: str
    functions: Sequence[Public]
    parts: Parts = ()
    """What stands for the placeholders that the kernels reach."""
    units: dict[str, str] = field(default_factory=dict)
    """Field → unit, where its class does not say."""
    enums: Sequence[type[IntEnum]] = ()
    """Whose members a caller needs."""
    numbers: dict[str, tuple[float, str]] = field(default_factory=dict)
    """Name → another number that a caller needs, and what it means."""


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
            said = meanings(kind.made) if kind.made else {}
            name, rows = kind.name, [self._field(*one, said.get(one[0], "")) for one in kind.fields]
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

        >>> [Unit(Module("x", "", ()), single=one).number(-1e-300) for one in (False, True)]
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

    def constant(self, file: str, name: str, value: Any, said: str = "") -> str:
        """The name of a constant of a module; of no file, one that a public function hands on."""
        if file:
            file, said = origin(file, name)
        if (file, name) not in self._origins:
            called = identifier(name)
            if called in self.constants and file:
                called = f"{Path(file).stem}_{called}".upper()
            self._origins[file, name] = called = unused(called, self.constants)
            self.constants[called] = self._constant(called, value, kind_of(value), said)
        return self._origins[file, name]

    def _constant(self, called: str, value: Any, kind: Kind, said: str) -> str:
        head, above = f"static const {self.type(kind)} {called} =", comments(textwrap.wrap(said, 108))
        if isinstance(kind, Struct) and len(kind.fields) <= 24:
            meant = (comment(meanings(kind.made).get(name, "")) for name, _ in kind.fields)
            rows = [f"    {text},{behind}" for text, behind in zip(self._fields(value, kind), meant, strict=True)]
            return "\n".join([*above, f"{head} {{", *rows, "};"])
        line = f"{head} {self.value(value, kind)};"
        return f"{line}{comment(said)}" if len(line) + len(said) < LONGEST else "\n".join([*above, line])

    def extreme(self, name: str, kind: Kind) -> str:
        """Python's `min` or `max` by its rule for NaN."""
        called = name if kind is float else f"{name}_int"
        self.helpers[called] = {"type": self.type(kind), "sign": "<" if name == "min" else ">"}
        return called

    def shifted(self, kind: Row) -> str:
        """A function that moves a row on by one place."""
        name = f"{self.type(kind)}_shifted"
        self.helpers[name] = {"type": self.type(kind), "item": self.type(kind.of), "length": kind.length}
        return name


def unused(name: str, taken: Any) -> str:
    """A name that nothing else has."""
    return unused(f"{name}_", taken) if name in taken else name
