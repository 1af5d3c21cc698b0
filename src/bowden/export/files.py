"""One header and one source file of C from kernels."""

import itertools
import textwrap
from pathlib import Path
from typing import Any

import jinja2

from bowden.export.function import called
from bowden.export.kinds import Kind, comment, identifier, is_number, numbers, within
from bowden.export.unit import LONGEST, Constant, Module, Public, Unit


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
        header |= {unit.type(part) for kind in (*kinds, *results_of(unit, one)[1]) for _, part in within(kind)}
        functions.append(_public(unit, one))
    types = [[text for name, text in unit.types.items() if (name in header) is public] for public in (True, False)]
    defined = "\n".join(
        f"#define {identifier(f'{module.prefix}_{name}').upper()} {unit.number(value)}{comment(said)}"
        for name, (value, said) in module.numbers.items()
    )
    words = {
        "head": f"/* {module.title}\n *\n * {preamble}\n */",
        "prefix": module.prefix,
        "real": unit.real,
        "helpers": unit.helpers,
        "kernels": unit.functions.values(),
        "functions": functions,
    }
    parts = {"h": [defined, *types[0]], "c": [*types[1], "\n\n".join(unit.constants.values())]}
    texts = {end: rendered(f"module.{end}", **words, parts=some).split("\n") for end, some in parts.items()}
    return {
        f"{module.prefix}.{end}": "\n".join(row for line in text for row in broken(line)) for end, text in texts.items()
    }


def rendered(file: str, /, **words: Any) -> str:
    """A file of `templates` with what is to be filled in."""
    text = (Path(__file__).parent / "templates" / file).read_text(encoding="utf-8")
    page = jinja2.Template(text, variable_start_string="[[", variable_end_string="]]", trim_blocks=True)
    return f"{page.render(**words).rstrip()}\n"


def results_of(unit: Unit, one: Public) -> tuple[str, list[Kind], Kind]:
    """The kernel's name, and the kinds of its results, apart and as a whole."""
    name, result = called(unit, one.kernel, tuple(one.kinds.values()))
    return name, [result] if len(one.results) == 1 else [kind for _, kind in result.fields], result


def _public(unit: Unit, one: Public) -> dict[str, str]:
    """Head and body of a function that others call: the state first, then what is read, then what is written."""
    name, kinds, result = results_of(unit, one)
    read, given, several = list[str](), list[str](), len(kinds) > 1
    for argument, kind in one.kinds.items():
        text, mark, value = identifier(argument), "" if is_number(kind) else "*", one.given.get(argument)
        if isinstance(value, Constant):
            text = f"{mark and '&'}{unit.constant('', argument, value.value, value.said)}"
        elif argument != "state":
            read.append(f"const {unit.type(kind)} {mark}{text}")
        given.append(text)
    call, returned = f"{name}({', '.join(given)})", "void"
    lines = [f"const {unit.type(result)} result = {call};", ""] if several else []
    first, written, last = list[str](), list[str](), list[str]()
    for to, kind, part in zip(one.results, kinds, getattr(result, "fields", "?"), strict=False):
        source = f"result.{part[0]}" if several else call
        if to == "return":
            returned, last = unit.type(kind), [f"return {source};"]
            continue
        (first if to == "state" else written).append(f"{unit.type(kind)} *{to}")
        if to == "state" and several:  # number by number, so that the compiler keeps them in registers
            ways = dict.fromkeys(way.partition(".at[")[0] for way, _ in numbers(kind))
            lines += [f"state->{way[1:]} = {source}{way};" for way in ways]
        else:
            lines.append(f"*{to} = {source};")
    signature = ", ".join([*first, *read, *written]) or "void"
    body = "\n".join(f"    {line}" if line else "" for line in (*lines, *last))
    return {"summary": one.summary, "head": f"{returned} {unit.prefix}_{one.name}({signature})", "body": body}


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
