"""What C has of one module so far: its types, constants, helpers and functions, by their names."""

import math
import textwrap
from pathlib import Path
from typing import Any

import numpy as np

from bowden.core.quantity import meanings
from bowden.export.kinds import (
    Kind,
    Row,
    Struct,
    comment,
    comments,
    identifier,
    is_enum,
    is_number,
    kind_of,
    snake_case,
)
from bowden.export.module import Module
from bowden.export.source import origin

LONGEST = 112
"""Of a line of C, where it can be broken."""
_EXTREME = """
static inline {type} {name}(const {type} a, const {type} b)
{{
    return b {sign} a ? b : a;
}}"""
_SHIFTED = """
/* the newest first, and what was there one place on */
static inline {row} {name}({item} newest, const {row} *past)
{{
    {row} moved;

    moved.at[0] = newest;
    for (int i = 1; i < {length}; ++i) {{
        moved.at[i] = past->at[i - 1];
    }}
    return moved;
}}"""


class Unit:
    """What is written of one pair of files.

    Args:
        module: what is to be in it.
        single: float in place of double.
    """

    def __init__(self, module: Module, *, single: bool) -> None:
        self.module, self.single, self.prefix = module, single, module.prefix
        self.real = "float" if single else "double"
        self.types: dict[str, str] = {}
        self.constants: dict[str, str] = {}
        self.helpers: dict[str, str] = {}
        self.functions: dict[str, str] = {}
        self.made: dict[Any, tuple[str, Kind] | None] = {}
        """Kernel, kinds of its arguments and parts → its name and the kind of its result; None while it is written."""
        self._origins: dict[tuple[str, str], str] = {}
        self._names: dict[Any, str] = {float: self.real, int: "int64_t", bool: "bool"}

    def type(self, kind: Kind) -> str:
        """The type of a kind; it is defined if it is new."""
        if kind not in self._names:
            self._define(kind)
        return self._names[kind]

    def _define(self, kind: Kind) -> None:
        """The text of a struct, a row or an enum, under a name that no other type has."""
        made = getattr(kind, "made", None)
        if isinstance(kind, Row):
            of = "" if kind.of is float else f"{self.type(kind.of).removeprefix(f'{self.prefix}_').removesuffix('_t')}_"
            name, rows = f"{of}row{kind.length}", [f"    {self.type(kind.of)} at[{kind.length}];"]
        elif isinstance(kind, Struct):
            said = meanings(made) if made else {}
            name, rows = identifier(kind.name), [self._field(*one, said.get(one[0], "")) for one in kind.fields]
        else:
            name, rows = identifier(kind.__name__), []
        name = name if isinstance(kind, Struct) and not made else f"{self.prefix}_{name}"
        self._names[kind] = name = unused(name, self.types)
        if is_enum(kind):
            meant = {one: comment(getattr(one, "meaning", "")) for one in kind}
            rows = [f"    {self.value(one, kind)} = {one.value},{text}" for one, text in meant.items()]
            rows[-1] = rows[-1].replace(",", "", 1)
        self.types[name] = "\n".join([f"typedef {'enum' if is_enum(kind) else 'struct'} {{", *rows, f"}} {name};"])

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
        if math.isnan(value):
            return "NAN"
        with np.errstate(over="ignore", under="ignore"):
            rounded = np.float32(value) if self.single else np.float64(value)
        if np.isinf(rounded):
            return "INFINITY" if value > 0.0 else "-INFINITY"
        text = str(rounded)
        return (text if "." in text or "e" in text else f"{text}.0") + ("f" if self.single else "")

    def value(self, value: Any, kind: Kind) -> str:
        """A value, as it initialises a constant."""
        if isinstance(kind, Row):
            inner = "0" if not any(value) else ", ".join(self.value(one, kind.of) for one in value)
            return f"{{{{{inner}}}}}"
        if isinstance(kind, Struct):
            return f"{{{', '.join(self._fields(value, kind).values())}}}"
        if is_enum(kind):
            return f"{snake_case(self.type(kind))}_{kind(value).name}".upper()
        if kind is float:
            return self.number(float(value))
        if kind is bool:
            return "true" if value else "false"
        return str(int(value)) if abs(value) < 2**31 else f"INT64_C({int(value)})"

    def _fields(self, value: Any, kind: Struct) -> dict[str, str]:
        """Field → what sets it to its value."""
        rows = zip(kind.fields, value, strict=True)
        return {name: f".{identifier(name)} = {self.value(one, inner)}" for (name, inner), one in rows}

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
            meant = meanings(kind.made)
            rows = [f"    {text},{comment(meant.get(name, ''))}" for name, text in self._fields(value, kind).items()]
            return "\n".join([*above, f"{head} {{", *rows, "};"])
        line = f"{head} {self.value(value, kind)};"
        return f"{line}{comment(said)}" if len(line) + len(said) < LONGEST else "\n".join([*above, line])

    def extreme(self, name: str, kind: Kind) -> str:
        """Python's `min` or `max` by its rule for NaN."""
        called, sign = name if kind is float else f"{name}_int", "<" if name == "min" else ">"
        self.helpers[called] = _EXTREME.format(type=self.type(kind), name=called, sign=sign).strip()
        return called

    def shifted(self, kind: Row) -> str:
        """A function that moves a row on by one place."""
        row, item = self.type(kind), self.type(kind.of)
        name = f"{row}_shifted"
        self.helpers[name] = _SHIFTED.format(row=row, item=item, name=name, length=kind.length).strip()
        return name


def unused(name: str, taken: Any) -> str:
    """A name that nothing else has."""
    return unused(f"{name}_", taken) if name in taken else name
