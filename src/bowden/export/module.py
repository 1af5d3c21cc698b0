"""One header and one source file of C from kernels that share a state."""

import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from enum import IntEnum
from functools import lru_cache
from pathlib import Path
from typing import Any

from bowden.core.errors import BowdenError, ParameterError
from bowden.core.nested import is_named, said_at
from bowden.core.quantity import meanings
from bowden.export.checked import Argument, Function, check_graph
from bowden.export.code import FunctionBody, Style, body
from bowden.export.graph import Graph, Operation, graph_of, settled
from bowden.export.layout import Leaf, Structs, comment, identifier, leaves, rebuilt, snake
from bowden.export.symbol import KernelTrace, Symbol, exactly
from bowden.export.truths import with_truths


@dataclass(frozen=True)
class Module:
    """What belongs in one pair of files."""

    prefix: str
    """Of every name, and the files' own."""
    title: str
    functions: Sequence[Function]
    structs: Mapping[str, str] = field(default_factory=dict)
    """Name of an argument → name of its struct, where it is not its class's."""
    units: Mapping[str, str] = field(default_factory=dict)
    """Field of the state → unit, where its class does not say."""
    meanings: Mapping[str, str] = field(default_factory=dict)
    """Field of the state → what it means, where its class does not say."""
    enums: Sequence[type[IntEnum]] = ()
    """Whose numbers a caller needs."""
    numbers: Mapping[str, tuple[float, str]] = field(default_factory=dict)
    """Name → another number that a caller needs, and what it means."""


@lru_cache(maxsize=32)
def traced(function: Function, again: int = 0) -> tuple[Graph, Any]:
    """A kernel's operations, and the structure of its results.

    Args:
        function: with examples of its arguments.
        again: another number traces it once more.

    Raises:
        ParameterError: it leaves the portable subset; the message names the line.
    """
    with exactly():
        trace = KernelTrace()
        symbols: dict[str, Symbol] = {}

        def symbol(argument: Argument) -> Callable[[Leaf], Any]:
            def replace(leaf: Leaf) -> Any:
                if argument.constant and not isinstance(leaf.value, float):
                    return leaf.value  # a whole number may count a loop
                name = f"{argument.name}:{leaf.name}"
                return symbols.setdefault(name, trace.variable(name))

            return replace

        with _explained(function):
            found = function.kernel(*(rebuilt(one.example, symbol(one)) for one in function.arguments))
            if trace.refused is not None:
                raise trace.refused
            results = [trace.known(leaf.value) for leaf in leaves(found)]
        return graph_of(trace, symbols, results), found


@contextmanager
def _explained(function: Function) -> Iterator[None]:
    try:
        yield
    except BowdenError:
        raise
    except Exception as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        raise ParameterError(
            f"{last.filename}, line {last.lineno}: {function.name} cannot be exported: {type(error).__name__}: {error}",
            do="keep to the portable subset of docs/kernels.md",
        ) from error


def header(module: Module, style: Style, preamble: str) -> str:
    """The text of the header."""
    structs = Structs(module.prefix)
    prototypes = [f"/* {one.summary} */\n{_signature(module, one, structs)};\n" for one in module.functions]
    guard = f"{module.prefix.upper()}_H"
    constants = [f"#define {name} {text}{said}" for name, text, said in _constants(module, style)]
    parts = [
        f"/* {module.title}\n *\n * {preamble}\n */",
        f"#ifndef {guard}\n#define {guard}",
        f"typedef {'float' if style.single else 'double'} {style.real};",
        "\n".join(constants),
        *(_numbers(module, enum) for enum in module.enums),
        "\n".join(
            f"#define {identifier(f'{module.prefix}_{name}').upper()} {style.number(value)}{comment(said)}"
            for name, (value, said) in module.numbers.items()
        ),
        *structs.written.values(),
        '#ifdef __cplusplus\nextern "C" {\n#endif',
        *prototypes,
        "#ifdef __cplusplus\n}\n#endif",
        "#endif",
    ]
    return "\n\n".join(part.strip() for part in parts if part.strip()) + "\n"


def source(module: Module, style: Style, preamble: str) -> str:
    """The text of the source file.

    Raises:
        ParameterError: a kernel leaves the portable subset.
    """
    bodies = [_function(module, one, style) for one in module.functions]
    kinds = set().union(*(made.kinds for made, _ in bodies))
    constants = {name: text for made, _ in bodies for name, text in made.constants.items()}
    parts = [
        f"/* {module.title}\n *\n * {preamble}\n */",
        f'#include <math.h>\n\n#include "{module.prefix}.h"',
        "\n".join(style.helpers(kinds)),
        "\n".join(constants.values()),
        *(text for _, text in bodies),
    ]
    return "\n\n".join(part.strip() for part in parts if part.strip()) + "\n"


def macro(module: Module, argument: Argument, leaf: str) -> str:
    """The name of a constant."""
    if not isinstance(argument.example, tuple):
        return f"{module.prefix}_{argument.name}".upper()
    several = len({one.name for function in module.functions for one in function.arguments if one.constant}) > 1
    alone = argument.plain or not several
    return f"{module.prefix}_{leaf}".upper() if alone else f"{module.prefix}_{argument.name}_{leaf}".upper()


def _constants(module: Module, style: Style) -> list[tuple[str, str, str]]:
    found: dict[str, tuple[str, str, str]] = {}
    for function in module.functions:
        for argument in function.arguments:
            for leaf in leaves(argument.example) if argument.constant else ():
                name = macro(module, argument, leaf.name)
                whole = isinstance(leaf.value, int)
                text = str(int(leaf.value)) if whole else style.number(leaf.value)
                said = said_at(argument.example, leaf.path, meanings) or argument.said
                found[name] = (name, f"({text})" if text.startswith("-") else text, comment(said))
    return list(found.values())


def _numbers(module: Module, enum: type[IntEnum]) -> str:
    """The members of an enum as constants: C++ warns of its own enums where they meet a `double`."""
    kind = snake(enum.__name__)
    names = {member: f"{module.prefix}_{kind}_{member.name}".upper() for member in enum}
    rows = [f"#define {name} {one.value}{comment(getattr(one, 'meaning', ''))}" for one, name in names.items()]
    return "\n".join([f"/* {kind.replace('_', ' ').capitalize()}, by number. */", *rows])


def _signature(module: Module, one: Function, structs: Structs) -> str:
    found = traced(one)[1]
    results = (found,) if len(one.results) == 1 else found
    returned = "void"
    inputs, outputs = [], []
    for argument in one.arguments:
        if argument.constant or argument.name == "state":
            continue
        kind = structs.name(argument.example, module.structs.get(argument.name, ""))
        pointer = f"const {kind} *" if is_named(argument.example) else f"{kind} "
        inputs.append(f"{pointer}{argument.name}")
    for name, value in zip(one.results, results, strict=True):
        of_state = (module.units, module.meanings) if name == "state" else ()
        kind = structs.name(value, module.structs.get(name, ""), *of_state)
        if name == "return":
            returned = kind
        elif name == "state":
            inputs.insert(0, f"{kind} *state")
        else:
            outputs.append(f"{kind} *{name}")
    return f"{returned} {module.prefix}_{one.name}({', '.join(inputs + outputs)})"


def written(one: Function) -> tuple[Graph, dict[str, float]]:
    """The operations of a function as they are written, and the values of the leaves that are constants."""
    constants = {
        f"{argument.name}:{leaf.name}": float(leaf.value)
        for argument in one.arguments
        for leaf in leaves(argument.example)
        if argument.constant
    }
    return with_truths(settled(traced(one)[0], constants), constants), constants


def _function(module: Module, one: Function, style: Style) -> tuple[FunctionBody, str]:
    whole, found = traced(one)
    check_graph(one, whole, again=traced(one, again=1)[0])
    results = (found,) if len(one.results) == 1 else found
    texts = {
        f"{argument.name}:{leaf.name}": (
            macro(module, argument, leaf.name) if argument.constant else leaf.access(argument.name)
        )
        for argument in one.arguments
        for leaf in leaves(argument.example)
    }
    graph, constants = written(one)
    ends = [(name, leaf) for name, value in zip(one.results, results, strict=True) for leaf in leaves(value)]
    named: dict[int, str] = {}
    for (name, leaf), i in zip(ends, graph.results, strict=True):
        if graph.operations[i].kind != "leaf":
            named.setdefault(i, f"new_{leaf.name}" if leaf.path else identifier(f"{name}_value"))
    made = body(graph, style, texts.__getitem__, constants, named, _where)
    used = {graph.operations[i].leaf.partition(":")[0] for i in range(len(graph.operations))}
    unused = [f"    (void){a.name};" for a in one.arguments if not a.constant and a.name not in used | {"state"}]
    before, after = _assigned(ends, made, graph, style)
    returned = [f"    return {made.texts[k]};" for k, (name, _) in enumerate(ends) if name == "return"]
    lines = [*unused, *made.lines, *before, *after, *returned]
    signature = _signature(module, one, Structs(module.prefix))
    return made, f"{signature}\n{{\n" + "\n".join(lines) + "\n}\n"


def _where(one: Operation) -> str:
    return one.place.function if one.place else ""


def _assigned(
    ends: Sequence[tuple[str, Leaf]], made: FunctionBody, graph: Graph, style: Style
) -> tuple[list[str], list[str]]:
    """What is read of the state before it is written, and the writing; values that move on by one place are a loop."""
    before, after, loops = [], [], []
    moves = [_moves_on(ends, graph, k) for k in range(len(ends))]
    for k, (name, leaf) in enumerate(ends):
        text, operation = made.texts[k], graph.operations[graph.results[k]]
        target = leaf.access(name) if leaf.path else f"*{name}"
        if name == "return" or text == target:
            continue
        if moves[k] and sum(moves) > 3:
            if k + 1 == len(ends) or not moves[k + 1]:
                array = target.rpartition("[")[0]
                loops.append(f"    for (int i = {leaf.path[-1]}; i > 0; --i) {{")
                loops.append(f"        {array}[i] = {array}[i - 1];\n    }}")
            continue
        if operation.kind == "leaf" and operation.leaf.startswith("state:"):
            before.append(f"    const {style.real} old_{leaf.name} = {text};")
            text = f"old_{leaf.name}"
        after.append(f"    {target} = {text};")
    return before, loops + after


def _moves_on(ends: Sequence[tuple[str, Leaf]], graph: Graph, k: int) -> bool:
    """Whether a result is the value that stood one place before it."""
    path = ends[k][1].path
    if not path or not isinstance(path[-1], int) or path[-1] == 0:
        return False
    return graph.operations[graph.results[k]].leaf == f"state:{Leaf((*path[:-1], path[-1] - 1), 0.0).name}"


def files(module: Module, style: Style, preamble: str) -> dict[str, str]:
    """Name → text of both files."""
    return {
        f"{module.prefix}.h": header(module, style, preamble),
        f"{module.prefix}.c": source(module, style, preamble),
    }


def template(name: str) -> str:
    """A file of C that stands beside this one; what is to be filled in stands between @."""
    return (Path(__file__).parent / "templates" / name).read_text(encoding="utf-8")
