"""One header and one source file of C from kernels."""

import itertools
import re
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from pathlib import Path
from typing import Any

from bowden.core.errors import ParameterError
from bowden.core.kernel_content import Parts, reaching
from bowden.core.primitives import _tanh, half_to
from bowden.core.quantity import meanings
from bowden.export.function import ATOM, UNARY, Expression, Function
from bowden.export.kinds import Kind, Row, Several, Struct, Style, comment, comments, identifier, is_number, kind_of
from bowden.export.source import origin

LONGEST = 112
"""Of a line of C, where it can be broken."""


def template(name: str) -> str:
    """A file of C that stands beside this one; what is to be filled in stands between @."""
    return (Path(__file__).parent / "templates" / name).read_text(encoding="utf-8")


_HELPERS = template("helpers.c")
"""Python's `min` and `max`, by its rule for NaN, and others that have no kernel; two empty lines between them."""


@dataclass(frozen=True)
class Argument:
    """What a kernel is handed."""

    name: str
    example: Any
    """A value of the same structure; of a constant, its value."""
    constant: bool = False
    """Whether it is written into the code."""
    said: str = ""
    """What a constant is."""


@dataclass(frozen=True)
class Public:
    """A kernel that other files of C call, as ``PREFIX_name``."""

    name: str
    kernel: Callable[..., Any]
    arguments: tuple[Argument, ...]
    """In the kernel's order; the one called ``state`` is what the function reads and writes."""
    results: tuple[str, ...]
    """In the kernel's order: ``state``, ``return`` for what the function returns, other names for pointers to it."""
    summary: str


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
    begins: tuple[str, Any, Any, str] | None = None
    """Name, state, and what the function is: a function that sets a state which was worked out here, whose fields with
    the value of the second are those of its one argument."""


class Unit:
    """What is written of one pair of files so far.

    Args:
        style: of its numbers and names.
        module: what is to be in it.
    """

    def __init__(self, style: Style, module: Module) -> None:
        self.style, self.parts, self.units = style, module.parts, module.units
        self.public = {f"{style.prefix}_{one.name}" for one in module.functions}
        self.types: dict[str, str] = {}
        self.constants: dict[str, str] = {}
        self.helpers: dict[str, str] = {}
        self.functions: dict[str, str] = {}
        self._kinds: dict[Kind, str] = {}
        self._origins: dict[tuple[str, str], str] = {}
        self._made: dict[Any, tuple[str, Kind]] = {}
        self._begun: list[Any] = []

    # ---- types and numbers ----

    def type(self, kind: Kind) -> str:
        """The type of a kind; it is defined if it is new."""
        known = {float: self.style.real, int: "int64_t", bool: "bool"}.get(kind) if is_number(kind) else None
        known = known or self._kinds.get(kind)
        if known:
            return known
        word, rows = "struct", []
        if isinstance(kind, Row):
            inner = self.type(kind.of)
            stem = "" if kind.of is float else f"{inner.removeprefix(f'{self.style.prefix}_').removesuffix('_t')}_"
            name, rows = f"{self.style.prefix}_{stem}row{kind.length}", [f"    {inner} at[{kind.length}];"]
        elif isinstance(kind, Struct | Several):
            made = kind.made if isinstance(kind, Struct) else None
            name = f"{self.style.prefix}_{identifier(made.__name__)}" if made else ""
            name = name or f"{getattr(kind, 'function', '')}_result"
            meant = meanings(made) if made else {}
            rows = [self._field(field, one, meant) for field, one in kind.fields]
        else:
            name, word = f"{self.style.prefix}_{identifier(kind.__name__)}", "enum"
        while name in self.types:
            name = f"{name}_"
        self._kinds[kind] = name
        if word == "enum":
            ends = [*(",",) * (len(kind) - 1), ""]
            said = {one: comment(getattr(one, "meaning", "")) for one in kind}
            rows = [
                f"    {self.member(one).text} = {one.value}{end}{said[one]}"
                for one, end in zip(kind, ends, strict=True)
            ]
        self.types[name] = "\n".join([f"typedef {word} {{", *rows, f"}} {name};"])
        return name

    def _field(self, field: str, kind: Kind, said: Any) -> str:
        unit = self.units.get(field, "")
        text = said.get(field, "")
        text = text if "[" in text or not unit else f"{text} [{'–' if unit == '1' else unit}]".strip()
        return f"    {self.type(kind)} {identifier(field)};{comment(text)}"

    def member(self, member: IntEnum) -> Expression:
        """A member of an enum."""
        snake = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", self.type(type(member)))
        return Expression(f"{snake}_{member.name}".upper(), type(member))

    def number(self, value: Any) -> Expression:
        """A number as it stands."""
        kind = kind_of(value)
        text = self.braces(value, kind)
        return Expression(text, kind, UNARY if text.startswith("-") else ATOM)

    def braces(self, value: Any, kind: Kind) -> str:
        """A value, as it initialises a constant."""
        if isinstance(kind, Row):
            if all(inner == 0.0 for inner in value):
                return "{{0}}"
            return "{{" + ", ".join(self.braces(inner, kind.of) for inner in value) + "}}"
        if isinstance(kind, Struct):
            rows = zip(kind.fields, value, strict=True)
            return (
                "{" + ", ".join(f".{identifier(name)} = {self.braces(one, inner)}" for (name, inner), one in rows) + "}"
            )
        if kind is float:
            return self.style.number(float(value))
        if kind is bool:
            return "true" if value else "false"
        if isinstance(value, IntEnum) and kind is not int:
            return self.member(value).text
        return str(int(value)) if abs(value) < 2**31 else f"INT64_C({int(value)})"

    def literal(self, value: Any, kind: Kind) -> str:
        """A value, as it stands in an expression."""
        text = self.braces(value, kind)
        return text if is_number(kind) else f"({self.type(kind)}){text}"

    def constant(self, file: str, name: str, value: Any, said: str = "") -> Expression:
        """A constant of a module, by its name there; of no file, one that a public function hands on."""
        kind = kind_of(value)
        if file:
            file, said = origin(file, name)
        if (file, name) not in self._origins:
            called = identifier(name)
            if called in self.constants and file:
                called = f"{Path(file).stem}_{called}".upper()
            while called in self.constants:
                called = f"{called}_"
            self._origins[file, name] = called
            self.constants[called] = self._constant(called, value, kind, said)
        return Expression(self._origins[file, name], kind, place=True, fixed=True)

    def _constant(self, called: str, value: Any, kind: Kind, said: str) -> str:
        if not isinstance(kind, Struct) or len(kind.fields) > 24:
            line = f"static const {self.type(kind)} {called} = {self.braces(value, kind)};"
            if len(line) + len(said) < LONGEST:
                return f"{line}{comment(said)}"
            return "\n".join([*comments(textwrap.wrap(said, 108)), line])
        meant = meanings(kind.made)
        rows = [
            f"    .{identifier(name)} = {self.braces(one, inner)},{comment(meant.get(name, ''))}"
            for (name, inner), one in zip(kind.fields, value, strict=True)
        ]
        return "\n".join(
            [*comments(textwrap.wrap(said, 108)), f"static const {self.type(kind)} {called} = {{", *rows, "};"]
        )

    # ---- functions ----

    def helper(self, name: str, **words: str) -> str:
        """A function that has no kernel; `words` are put into its text."""
        own = next(one for one in (name, f"{name}_") if f" {one}(" in _HELPERS)
        (text,) = (one for one in _HELPERS.split("\n\n\n") if f" {own}(" in one)
        for word, value in {"double": self.style.real, **words}.items():
            text, own = re.sub(rf"\b{word}(?=\b|_)", value, text), own.replace(word, value)
        self.helpers[own] = text.strip()
        return own

    def shifted(self, kind: Row) -> str:
        """The function that moves a row on by one place."""
        return self.helper("ROW_shifted", ROW=self.type(kind), ITEM=self.type(kind.of), LENGTH=str(kind.length))

    def call(self, function: Any, kinds: tuple[Kind, ...], caller: Function | None = None) -> tuple[str, Kind]:
        """The name of a kernel for arguments of these kinds, and the kind of its result; it is written if it is new."""
        if function is half_to:
            return self.helper("half_to"), float
        if function is _tanh and self.style.single:
            return "tanhf", float
        parts = reaching(function, self.parts)
        key = function, kinds, parts
        if key in self._begun:
            code = function.__code__
            raise ParameterError(
                f"{code.co_filename}, line {code.co_firstlineno}: {function.__name__} calls itself",
                do="write it as a loop over a fixed range: for i in range(n)",
            )
        if key not in self._made:
            name = identifier(function.__name__)
            if name in self.functions or name in self.helpers:
                name = f"{function.__module__.rpartition('.')[2]}_{name}"
            while name in self.functions or name in self.public:
                name = f"{name}_"
            self.functions[name] = ""  # so that no other has it
            self._begun.append(key)
            made = Function(self, function, kinds, name, parts)
            text = made.written()
            self._begun.pop()
            del self.functions[name]
            self.functions[name] = text
            self._made[key] = name, made.result
        return self._made[key]


def files(module: Module, style: Style, preamble: str) -> dict[str, str]:
    """Name → text of both files.

    Raises:
        ParameterError: a kernel leaves the subset; the message names the line.
    """
    unit = Unit(style, module)
    for enum in module.enums:
        unit.type(enum)
    prototypes, bodies = zip(*(_public(unit, module, one) for one in module.functions), strict=True)
    if module.begins:
        prototype, body = _begins(unit, module)
        prototypes, bodies = (prototype, *prototypes), (body, *bodies)
    seen = _seen(unit, module)
    head = f"/* {module.title}\n *\n * {preamble}\n */"
    guard = f"{module.prefix.upper()}_H"
    numbers = [
        f"#define {identifier(f'{module.prefix}_{name}').upper()} {style.number(value)}{comment(said)}"
        for name, (value, said) in module.numbers.items()
    ]
    header = [
        head,
        f"#ifndef {guard}\n#define {guard}",
        "#include <stdbool.h>\n#include <stdint.h>",
        f"typedef {style.real} {module.prefix}_real;",
        "\n".join(numbers),
        *(text for name, text in unit.types.items() if name in seen),
        '#ifdef __cplusplus\nextern "C" {\n#endif',
        *prototypes,
        "#ifdef __cplusplus\n}\n#endif",
        "#endif",
    ]
    source = [
        head,
        f'#include <math.h>\n\n#include "{module.prefix}.h"',
        *(text for name, text in unit.types.items() if name not in seen),
        "\n\n".join(unit.constants.values()),
        *unit.helpers.values(),
        *unit.functions.values(),
        *bodies,
    ]
    return {
        f"{module.prefix}.h": _page(header),
        f"{module.prefix}.c": _page(source),
    }


def _page(parts: Sequence[str]) -> str:
    text = "\n\n".join(part.strip() for part in parts if part.strip())
    return "\n".join(row for line in text.split("\n") for row in broken(line)) + "\n"


def _seen(unit: Unit, module: Module) -> set[str]:
    """The types that the header needs."""
    todo = [kind_of(one.example) for public in module.functions for one in public.arguments if not one.constant]
    todo += [kind for public in module.functions for kind in results_of(unit, public)[1]]
    todo += [*module.enums]
    found: set[str] = set()
    while todo:
        kind = todo.pop()
        if kind in (float, int, bool):
            continue
        found.add(unit.type(kind))
        if isinstance(kind, Row):
            todo.append(kind.of)
        elif isinstance(kind, Struct):
            todo += [inner for _, inner in kind.fields]
    return found


def results_of(unit: Unit, one: Public) -> tuple[str, list[Kind], Kind]:
    """The kernel's name, and the kinds of its results, apart and as a whole."""
    kinds = []
    for argument in one.arguments:
        kind = kind_of(argument.example)
        if kind is None:
            raise ParameterError(
                f"{argument.name} of {one.name} is {argument.example!r}",
                expected="numbers, and NamedTuples of numbers",
                do="take texts and arrays out of it",
            )
        kinds.append(kind)
    name, result = unit.call(one.kernel, tuple(kinds))
    if len(one.results) > 1:
        assert isinstance(result, Several)
        return name, [kind for _, kind in result.fields], result
    return name, [result], result


def _public(unit: Unit, module: Module, one: Public) -> tuple[str, str]:
    """Prototype and text of a function that others call."""
    name, kinds, result = results_of(unit, one)
    texts: list[str] = []
    inputs: list[str] = []
    outputs: list[str] = []
    returned = "void"
    for argument in one.arguments:
        kind, called = kind_of(argument.example), identifier(argument.name)
        if argument.constant:
            called = unit.constant("", argument.name, argument.example, argument.said).text
            texts.append(called if is_number(kind) else f"&{called}")
            continue
        texts.append(called)
        if argument.name != "state":
            inputs.append(f"const {unit.type(kind)} {'' if is_number(kind) else '*'}{called}")
    for called, kind in zip(one.results, kinds, strict=True):
        if called == "return":
            returned = unit.type(kind)
        else:
            (outputs if called != "state" else inputs).insert(
                0 if called == "state" else len(outputs), f"{unit.type(kind)} *{called}"
            )
    signature = f"{returned} {module.prefix}_{one.name}({', '.join(inputs + outputs) or 'void'})"
    call = f"{name}({', '.join(texts)})"
    if not isinstance(result, Several):
        lines = [f"    return {call};" if one.results == ("return",) else f"    *{one.results[0]} = {call};"]
    else:
        lines = [f"    const {unit.type(result)} result = {call};", ""]
        rows = list(zip(one.results, result.fields, strict=True))
        for called, (field, kind) in rows:
            if called == "state":
                lines += [f"    state->{way} = result.{field}.{way};" for way in _leafs(kind)]
            elif called != "return":
                lines.append(f"    *{called} = result.{field};")
        lines += [f"    return result.{field};" for called, (field, _) in rows if called == "return"]
    prototype = f"/* {one.summary} */\n{signature};"
    return prototype, "\n".join([f"/* {one.summary} */", signature, "{", *lines, "}"])


def _leafs(kind: Kind) -> list[str]:
    """How C reaches each number of a struct."""
    if not isinstance(kind, Struct):
        return [""]
    return [f"{identifier(name)}.{way}".rstrip(".") for name, inner in kind.fields for way in _leafs(inner)]


def _begins(unit: Unit, module: Module) -> tuple[str, str]:
    """Prototype and text of a function that sets a state that was worked out here."""
    from bowden.core.nested import leaves

    assert module.begins
    name, state, marker, summary = module.begins
    kind = kind_of(state)
    unit.constants["BEGIN"] = unit._constant("BEGIN", state, kind, "a state before the first sample")
    ways = [".".join(map(str, path)) for path, value in leaves(state) if value == marker]
    signature = f"void {module.prefix}_{name}({unit.type(kind)} *state, const {unit.style.real} first)"
    lines = ["    *state = BEGIN;", *(f"    state->{way} = first;" for way in ways)]
    lines += [] if ways else ["    (void)first;"]
    return f"/* {summary} */\n{signature};", "\n".join([f"/* {summary} */", signature, "{", *lines, "}"])


def broken(line: str) -> list[str]:
    """A line of C as several, where it is too long and has brackets with commas in them."""
    if len(line) <= LONGEST or line.lstrip().startswith(("/*", "*", "#")):
        return [line]
    opened: list[tuple[int, list[int]]] = []
    groups = []
    for k, c in enumerate(line):
        if c in "({[":
            opened.append((k, []))
        elif c in ")}]" and opened:
            begin, commas = opened.pop()
            if commas and len(line) - k < 4:
                groups.append((k - begin, begin, k, commas))
        elif c == "," and opened:
            opened[-1][1].append(k)
    pad = line[: len(line) - len(line.lstrip())]
    if not groups:
        return textwrap.wrap(
            line, LONGEST, subsequent_indent=f"{pad}    ", break_long_words=False, break_on_hyphens=False
        )
    _, begin, end, commas = max(groups)
    cuts = [begin, *commas, end]
    items = [line[a + 1 : b].strip() for a, b in itertools.pairwise(cuts)]
    rows = [f"{pad}    {item}{',' if k + 1 < len(items) else ''}" for k, item in enumerate(items)]
    return [*broken(line[: begin + 1]), *(row for one in rows for row in broken(one)), f"{pad}{line[end:]}"]
