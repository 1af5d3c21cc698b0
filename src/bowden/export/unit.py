"""One header and one source file of C from kernels."""

import itertools
import re
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from pathlib import Path
from typing import Any

import jinja2

from bowden.core.errors import ParameterError
from bowden.core.kernel_content import Parts, reaching
from bowden.core.nested import leaves, name_of
from bowden.core.quantity import meanings
from bowden.export.function import ATOM, UNARY, Expression, Function
from bowden.export.kinds import (
    Kind,
    Row,
    Several,
    Struct,
    Style,
    comment,
    comments,
    identifier,
    is_enum,
    is_number,
    kind_of,
    snake_case,
)
from bowden.export.source import origin

LONGEST = 112
"""Of a line of C, where it can be broken."""


def rendered(file: str, /, **words: Any) -> str:
    """A file of `templates` with what is to be filled in."""
    text = (Path(__file__).parent / "templates" / file).read_text(encoding="utf-8")
    page = jinja2.Template(text, variable_start_string="[[", variable_end_string="]]", trim_blocks=True)
    return f"{page.render(**words).rstrip()}\n"


_HELPERS = rendered("helpers.c")
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
        plain = {float: self.style.real, int: "int64_t", bool: "bool"}
        if is_number(kind) and kind in plain:
            return plain[kind]
        if kind not in self._kinds:
            self._define(kind)
        return self._kinds[kind]

    def _define(self, kind: Kind) -> None:
        """The text of a struct, a row or an enum, under a name that no other type has."""
        if isinstance(kind, Row):
            of = (
                ""
                if kind.of is float
                else f"{self.type(kind.of).removeprefix(f'{self.style.prefix}_').removesuffix('_t')}_"
            )
            name, rows = f"{of}row{kind.length}", [f"    {self.type(kind.of)} at[{kind.length}];"]
        elif isinstance(kind, Struct | Several):
            name = identifier(kind.made.__name__) if isinstance(kind, Struct) else f"{kind.function}_result"
            meant = meanings(kind.made) if isinstance(kind, Struct) else {}
            rows = [self._field(field, one, meant.get(field, "")) for field, one in kind.fields]
        else:
            name, rows = identifier(kind.__name__), []
        name = name if isinstance(kind, Several) else f"{self.style.prefix}_{name}"
        while name in self.types:
            name = f"{name}_"
        self._kinds[kind] = name
        if is_enum(kind):
            texts = [f"    {self.member(one).text} = {one.value}," for one in kind]
            texts[-1] = texts[-1].rstrip(",")
            rows = [f"{text}{comment(getattr(one, 'meaning', ''))}" for text, one in zip(texts, kind, strict=True)]
        self.types[name] = "\n".join([f"typedef {'enum' if is_enum(kind) else 'struct'} {{", *rows, f"}} {name};"])

    def _field(self, field: str, kind: Kind, text: str) -> str:
        unit = self.units.get(field, "")
        if unit and "[" not in text:
            text = f"{text} [{'–' if unit == '1' else unit}]".strip()
        return f"    {self.type(kind)} {identifier(field)};{comment(text)}"

    def member(self, member: IntEnum) -> Expression:
        """A member of an enum."""
        return Expression(f"{snake_case(self.type(type(member)))}_{member.name}".upper(), type(member))

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

    def call(self, function: Any, kinds: tuple[Kind, ...]) -> tuple[str, Kind]:
        """The name of a kernel for arguments of these kinds, and the kind of its result; it is written if it is new."""
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
    written = [_public(unit, module, one) for one in module.functions]
    written = [*([_begins(unit, module)] if module.begins else []), *written]
    seen = _seen(unit, module)
    types = [[text for name, text in unit.types.items() if (name in seen) is public] for public in (True, False)]
    numbers = "\n".join(
        f"#define {identifier(f'{module.prefix}_{name}').upper()} {style.number(value)}{comment(said)}"
        for name, (value, said) in module.numbers.items()
    )
    constants, functions = "\n\n".join(unit.constants.values()), [*unit.helpers.values(), *unit.functions.values()]
    words = {
        "head": f"/* {module.title}\n *\n * {preamble}\n */",
        "prefix": module.prefix,
        "guard": f"{module.prefix.upper()}_H",
        "real": style.real,
        "prototypes": [prototype for prototype, _ in written],
    }
    bodies = [f"{prototype}\n{body}" for prototype, body in written]
    texts = {
        f"{module.prefix}.h": rendered("module.h", **words, parts=[numbers, *types[0]]),
        f"{module.prefix}.c": rendered("module.c", **words, parts=[*types[1], constants, *functions, *bodies]),
    }
    return {name: "\n".join(row for line in text.split("\n") for row in broken(line)) for name, text in texts.items()}


def _seen(unit: Unit, module: Module) -> set[str]:
    """The types that the header needs."""
    todo = [kind_of(one.example) for public in module.functions for one in public.arguments if not one.constant]
    todo += [kind for public in module.functions for kind in results_of(unit, public)[1]]
    todo += [*module.enums]
    found: set[str] = set()
    for kind in todo:  # which grows meanwhile
        if isinstance(kind, Row):
            todo.append(kind.of)
        elif isinstance(kind, Struct):
            todo += [inner for _, inner in kind.fields]
        found.add(unit.type(kind))
    return found


def results_of(unit: Unit, one: Public) -> tuple[str, list[Kind], Kind]:
    """The kernel's name, and the kinds of its results, apart and as a whole."""
    kinds = tuple(kind_of(argument.example) for argument in one.arguments)
    for argument, kind in zip(one.arguments, kinds, strict=True):
        if kind is None:
            raise ParameterError(
                f"{argument.name} of {one.name} is {argument.example!r}",
                expected="numbers, and NamedTuples of numbers",
                do="take texts and arrays out of it",
            )
    name, result = unit.call(one.kernel, kinds)
    apart = [result] if len(one.results) == 1 else [kind for _, kind in result.fields]
    return name, apart, result


def _public(unit: Unit, module: Module, one: Public) -> tuple[str, str]:
    """Prototype and body of a function that others call: the state first, then what is read, then what is written."""
    name, kinds, result = results_of(unit, one)
    results = dict(zip(one.results, kinds, strict=True))
    written = {called: f"{unit.type(kind)} *{called}" for called, kind in results.items() if called != "return"}
    signature = [written.pop("state")] if "state" in written else []
    texts: list[str] = []
    for argument in one.arguments:
        kind, called = kind_of(argument.example), identifier(argument.name)
        if argument.constant:
            called = unit.constant("", argument.name, argument.example, argument.said).text
            texts.append(called if is_number(kind) else f"&{called}")
            continue
        texts.append(called)
        if argument.name != "state":
            signature.append(f"const {unit.type(kind)} {'' if is_number(kind) else '*'}{called}")
    returned = unit.type(results["return"]) if "return" in results else "void"
    head = f"{returned} {module.prefix}_{one.name}({', '.join([*signature, *written.values()]) or 'void'})"
    call = f"{name}({', '.join(texts)})"
    if not isinstance(result, Several):
        lines = [f"return {call};" if one.results == ("return",) else f"*{one.results[0]} = {call};"]
        return _function(one.summary, head, lines)
    lines, last = [f"const {unit.type(result)} result = {call};", ""], []
    for called, (part, kind) in zip(one.results, result.fields, strict=True):
        if called == "state":  # number by number, so that the compiler keeps them in registers
            lines += [f"state->{way} = result.{part}.{way};" for way in _leafs(kind)]
        elif called == "return":
            last = [f"return result.{part};"]
        else:
            lines.append(f"*{called} = result.{part};")
    return _function(one.summary, head, lines + last)


def _function(summary: str, head: str, lines: Sequence[str]) -> tuple[str, str]:
    """Prototype and body of a public function."""
    body = "\n".join(f"    {line}" if line else "" for line in lines)
    return f"/* {summary} */\n{head}", f"{{\n{body}\n}}"


def _leafs(kind: Kind) -> list[str]:
    """How C reaches each number of a struct."""
    if not isinstance(kind, Struct):
        return [""]
    return [f"{identifier(name)}.{way}".rstrip(".") for name, inner in kind.fields for way in _leafs(inner)]


def _begins(unit: Unit, module: Module) -> tuple[str, str]:
    """Prototype and body of a function that sets a state that was worked out here."""
    assert module.begins
    name, state, marker, summary = module.begins
    kind = kind_of(state)
    unit.constants["BEGIN"] = unit._constant("BEGIN", state, kind, "a state before the first sample")
    sets = [f"state->{name_of(path)} = first;" for path, value in leaves(state) if value == marker]
    head = f"void {module.prefix}_{name}({unit.type(kind)} *state, const {unit.style.real} first)"
    return _function(summary, head, ["*state = BEGIN;", *(sets or ["(void)first;"])])


def broken(line: str) -> list[str]:
    """A line of C as several, where it is too long: an item a line of the longest bracket that it ends with."""
    if len(line) <= LONGEST or line.lstrip().startswith(("/*", "*", "#")):
        return [line]
    pad = line[: len(line) - len(line.lstrip())]
    opened: list[list[int]] = []
    groups = []
    for k, c in enumerate(line):
        if c in "({[":
            opened.append([k])
        elif c == "," and opened:
            opened[-1].append(k)
        elif c in ")}]" and opened and len(cuts := [*opened.pop(), k]) > 2 and len(line) - k < 4:
            groups.append(cuts)
    if not groups:
        deeper = f"{pad}    "
        return textwrap.wrap(line, LONGEST, subsequent_indent=deeper, break_long_words=False, break_on_hyphens=False)
    cuts = max(groups, key=lambda cuts: cuts[-1] - cuts[0])
    items = [f"{pad}    {line[a + 1 : b].strip()}," for a, b in itertools.pairwise(cuts)]
    items[-1] = items[-1].removesuffix(",")
    return [*broken(line[: cuts[0] + 1]), *(row for one in items for row in broken(one)), f"{pad}{line[cuts[-1] :]}"]
