"""One header and one source file of C from kernels."""

import itertools
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jinja2

from bowden.export.function import called
from bowden.export.kinds import Kind, Row, Struct, comment, identifier, is_number
from bowden.export.module import Constant, Module, Public
from bowden.export.unit import LONGEST, Unit


def files(module: Module, preamble: str, *, single: bool = False) -> dict[str, str]:
    """Name → text of both files, in double or in float.

    Raises:
        ParameterError: a kernel leaves the subset; the message names the line.
    """
    unit = Unit(module, single=single)
    header = {unit.type(enum) for enum in module.enums}
    functions = []
    for one in module.functions:
        kinds = [kind for name, kind in one.kinds.items() if not isinstance(one.given.get(name), Constant)]
        header |= {unit.type(inner) for kind in (*kinds, *results_of(unit, one)[1]) for inner in _within(kind)}
        functions.append(_public(unit, one))
    types = [[text for name, text in unit.types.items() if (name in header) is public] for public in (True, False)]
    numbers = "\n".join(
        f"#define {identifier(f'{module.prefix}_{name}').upper()} {unit.number(value)}{comment(said)}"
        for name, (value, said) in module.numbers.items()
    )
    bodies = ["\n\n".join(unit.constants.values()), *unit.helpers.values(), *unit.functions.values()]
    words = {
        "head": f"/* {module.title}\n *\n * {preamble}\n */",
        "prefix": module.prefix,
        "guard": f"{module.prefix.upper()}_H",
        "real": unit.real,
        "prototypes": [prototype for prototype, _ in functions],
    }
    texts = {
        f"{module.prefix}.h": rendered("module.h", **words, parts=[numbers, *types[0]]),
        f"{module.prefix}.c": rendered("module.c", **words, parts=[*types[1], *bodies, *map("\n".join, functions)]),
    }
    return {name: "\n".join(row for line in text.split("\n") for row in broken(line)) for name, text in texts.items()}


def rendered(file: str, /, **words: Any) -> str:
    """A file of `templates` with what is to be filled in."""
    text = (Path(__file__).parent / "templates" / file).read_text(encoding="utf-8")
    page = jinja2.Template(text, variable_start_string="[[", variable_end_string="]]", trim_blocks=True)
    return f"{page.render(**words).rstrip()}\n"


def _within(kind: Kind) -> Iterator[Kind]:
    """A kind, and all those that it is made of."""
    yield kind
    for inner in [kind.of] if isinstance(kind, Row) else [one for _, one in getattr(kind, "fields", ())]:
        yield from _within(inner)


def results_of(unit: Unit, one: Public) -> tuple[str, list[Kind], Kind]:
    """The kernel's name, and the kinds of its results, apart and as a whole."""
    name, result = called(unit, one.kernel, tuple(one.kinds.values()))
    return name, [result] if len(one.results) == 1 else [kind for _, kind in result.fields], result


def _public(unit: Unit, one: Public) -> tuple[str, str]:
    """Prototype and body of a function that others call: the state first, then what is read, then what is written."""
    name, kinds, result = results_of(unit, one)
    results = {to: unit.type(kind) for to, kind in zip(one.results, kinds, strict=True)}
    returned = results.pop("return", "void")
    read, given = [], []
    for argument, kind in one.kinds.items():
        text, mark, value = identifier(argument), "" if is_number(kind) else "*", one.given.get(argument)
        if isinstance(value, Constant):
            text = unit.constant("", argument, value.value, value.said)
            given.append(f"{mark and '&'}{text}")
            continue
        given.append(text)
        if argument != "state":
            read.append(f"const {unit.type(kind)} {mark}{text}")
    written = [f"{type_} *{to}" for to, type_ in results.items()]
    first = int("state" in results)
    signature = ", ".join([*written[:first], *read, *written[first:]]) or "void"
    call = f"{name}({', '.join(given)})"
    if len(one.results) == 1:
        lines = [f"return {call};" if one.results == ("return",) else f"*{one.results[0]} = {call};"]
    else:
        lines, last = [f"const {unit.type(result)} result = {call};", ""], []
        for to, (part, kind) in zip(one.results, result.fields, strict=True):
            if to == "state":  # number by number, so that the compiler keeps them in registers
                lines += [f"state->{way} = result.{part}.{way};" for way in _ways(kind)]
            elif to == "return":
                last = [f"return result.{part};"]
            else:
                lines.append(f"*{to} = result.{part};")
        lines += last
    body = "\n".join(f"    {line}" if line else "" for line in lines)
    return f"/* {one.summary} */\n{returned} {unit.prefix}_{one.name}({signature})", f"{{\n{body}\n}}"


def _ways(kind: Kind) -> list[str]:
    """How C reaches each number of a struct."""
    if not isinstance(kind, Struct):
        return [""]
    return [f"{identifier(name)}.{way}".rstrip(".") for name, inner in kind.fields for way in _ways(inner)]


def broken(line: str) -> list[str]:
    """A line of C as several, where it is too long: an item a line of the longest bracket that it ends with."""
    if len(line) <= LONGEST or line.lstrip().startswith(("/*", "*", "#")):
        return [line]
    pad = line[: len(line) - len(line.lstrip())]
    opened: list[list[int]] = []
    cuts: list[int] = []
    for k, c in enumerate(line):
        if c in "({[":
            opened.append([k])
        elif c == "," and opened:
            opened[-1].append(k)
        elif c in ")}]" and opened and len(found := [*opened.pop(), k]) > 2 and len(line) - k < 4:
            cuts = max(cuts, found, key=lambda one: one[-1] - one[0] if one else 0)
    if not cuts:
        deeper = f"{pad}    "
        return textwrap.wrap(line, LONGEST, subsequent_indent=deeper, break_long_words=False, break_on_hyphens=False)
    items = [f"{pad}    {line[a + 1 : b].strip()}," for a, b in itertools.pairwise(cuts)]
    items[-1] = items[-1].removesuffix(",")
    return [*broken(line[: cuts[0] + 1]), *(row for one in items for row in broken(one)), f"{pad}{line[cuts[-1] :]}"]
