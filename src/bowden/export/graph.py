"""What was traced, as a list of operations on numbered values, each with the line of the kernel that it comes from."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

from bowden.core import kernel
from bowden.export.symbol import KernelTrace, Place, Symbol


@dataclass(frozen=True)
class Operation:
    """One operation, or a leaf: a variable, a constant of the law, or a literal number."""

    kind: str
    """``add``, ``sel``, ``tanh``, … or ``leaf``."""
    arguments: tuple[int, ...]
    """Numbers of the operations whose results it takes."""
    leaf: str = ""
    """Name of the symbol, for a leaf."""
    place: Place | None = None


@dataclass(frozen=True)
class Graph:
    """Operations in an order in which each stands behind what it needs, and which of them are the results."""

    operations: list[Operation]
    results: list[int]


EVALUATE: Mapping[str, Any] = {
    "add": lambda x, y: x + y,
    "sub": lambda x, y: x - y,
    "mul": lambda x, y: x * y,
    "div": np.divide,
    "neg": lambda x: -x,
    "lt": lambda x, y: float(x < y),
    "le": lambda x, y: float(x <= y),
    "eq": lambda x, y: float(x == y),
    "ne": lambda x, y: float(x != y),
    "fabs": abs,
    "sqrt": np.sqrt,
    "floor": np.floor,
    "sign": np.sign,
    "fmin": np.fmin,
    "fmax": np.fmax,
    "copysign": math.copysign,
    "tanh": kernel.tanh,
    "exp": kernel.exp,
    "sin": kernel.sin,
    "cos": kernel.cos,
    "log": kernel.log,
    "pow": kernel.power,
    "sel": lambda condition, a, b: a if condition else b,
    "and": lambda p, q: float(p != 0.0 and q != 0.0),
    "or": lambda p, q: float(p != 0.0 or q != 0.0),
    "not": lambda p: float(p == 0.0),
}
"""What each kind of operation does to doubles, in Python."""

LIBM = ("tanh", "exp", "sin", "cos", "log", "pow")
"""Kinds whose last bit is the C library's own."""


def graph_of(trace: KernelTrace, leaves: Mapping[str, Symbol], results: Sequence[Symbol]) -> Graph:
    """The operations that the results need, without those that are done twice.

    CasADi has no choice between two values: its ``if_else(c, a, b)`` is (c ? a : 0) + (!c ? b : 0), which takes the
    sign from a zero. Nothing else makes those parts, so they are put together to a true choice again.
    """
    casadi = trace.casadi
    names = dict(leaves) | {f"literal {key}": symbol for key, symbol in trace.literals.items()}
    function = casadi.Function("f", [symbol.sx for symbol in names.values()], [result.sx for result in results])
    expressions, kinds = function.instructions_sx(), _kinds(casadi)
    raw: list[Operation] = []
    register: dict[int, int] = {}
    found = [0] * len(results)
    for k in range(function.n_instructions()):
        code, taken, given = function.instruction_id(k), function.instruction_input(k), function.instruction_output(k)
        if code == casadi.OP_OUTPUT:
            found[given[0]] = register[taken[0]]
            continue
        if code == casadi.OP_INPUT:
            raw.append(Operation("leaf", (), list(names)[taken[0]]))
        else:
            kind = kinds[code]
            arguments = tuple(register[i] for i in taken[: 1 if kind in _OF_ONE else 2])
            raw.append(Operation(kind, arguments, "", trace.places.get(expressions[k].element_hash())))
        register[given[0]] = len(raw) - 1
    return _simplified(raw, found)


@cache
def _kinds(casadi: Any) -> dict[int, str]:
    wanted = [kind for kind in EVALUATE if kind != "sel"] + ["if_else_zero"]
    return {getattr(casadi, f"OP_{kind.upper()}"): kind for kind in wanted}


_OF_ONE = {"neg", "fabs", "sqrt", "floor", "sign", "tanh", "exp", "sin", "cos", "log", "not"}


def _simplified(raw: list[Operation], results: list[int]) -> Graph:
    """True choices, nothing twice, nothing unused, in the order in which Python met them."""
    same: dict[tuple[Any, ...], int] = {}
    stands_for: list[int] = []
    met: list[int] = []
    for i, one in enumerate(raw):
        arguments = tuple(stands_for[j] for j in one.arguments)
        if one.kind == "add" and all(raw[j].kind == "if_else_zero" for j in arguments):
            (condition, a), (_, b) = (raw[j].arguments for j in arguments)
            one, arguments = Operation("sel", (), "", one.place), (condition, a, b)
        raw[i] = replace(one, arguments=arguments)
        stands_for.append(same.setdefault((one.kind, one.leaf, arguments), i))
        met.append(one.place.order if one.place else -1)
        met[stands_for[i]] = min(met[stands_for[i]], met[i])
    order = sorted(range(len(raw)), key=lambda i: (met[i], i))
    return _needed(raw, order, [stands_for[i] for i in results])


def _needed(operations: Sequence[Operation], order: Sequence[int], ends: Sequence[int]) -> Graph:
    """The operations that the results need, numbered in an order."""
    needed, todo = set(ends), list(ends)
    while todo:
        new = set(operations[todo.pop()].arguments) - needed
        needed |= new
        todo += new
    kept = [i for i in order if i in needed]
    number = {old: new for new, old in enumerate(kept)}
    renumbered = [replace(operations[i], arguments=tuple(number[j] for j in operations[i].arguments)) for i in kept]
    return Graph(renumbered, [number[i] for i in ends])


def settled(graph: Graph, leaves: Mapping[str, float]) -> Graph:
    """The operations without choices that constants settle, and without what the side that is not taken needs."""
    values = evaluate(graph, leaves)
    taken: list[int] = []
    operations = []
    for i, one in enumerate(graph.operations):
        arguments = tuple(taken[j] for j in one.arguments)
        operations.append(replace(one, arguments=arguments))
        condition = values[one.arguments[0]] if one.kind == "sel" else None
        taken.append(i if condition is None else arguments[1] if condition else arguments[2])
    return _needed(operations, range(len(operations)), [taken[i] for i in graph.results])


def evaluate(graph: Graph, leaves: Mapping[str, float]) -> list[float | None]:
    """The value of every operation in doubles; None for what depends on a leaf that is not given."""
    values: list[float | None] = []
    with np.errstate(all="ignore"):
        for one in graph.operations:
            if one.kind == "leaf":
                literal = one.leaf.removeprefix("literal ")
                known = float.fromhex(literal) if literal != one.leaf else leaves.get(one.leaf)
                values.append(None if known is None else np.float64(known))
                continue
            arguments = [values[i] for i in one.arguments]
            if one.kind == "sel" and arguments[0] is not None:
                values.append(arguments[1] if arguments[0] else arguments[2])
                continue
            missing = any(value is None for value in arguments)
            values.append(None if missing else np.float64(EVALUATE[one.kind](*arguments)))
    return values
