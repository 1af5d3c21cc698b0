"""What is traced, and whether the trace does what the kernel does."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from bowden.core.errors import ParameterError
from bowden.export.graph import Graph, evaluate
from bowden.export.layout import Leaf, leaves, rebuilt

_DRAWS = 12
"""Sets of numbers on which trace and kernel are compared."""


@dataclass(frozen=True)
class Argument:
    """What a kernel is handed."""

    name: str
    example: Any
    """A value of the same structure; of a constant, its value."""
    constant: bool = False
    """Whether it is written into the code."""
    plain: bool = False
    """Whether its constants go by their fields' names alone, beside others that go by their argument's as well."""
    said: str = ""
    """What a constant that is one number means, for the header."""


@dataclass(frozen=True)
class Function:
    """A kernel that becomes a function of C."""

    name: str
    kernel: Callable[..., Any]
    arguments: tuple[Argument, ...]
    """In the kernel's order; the one called ``state`` is what the function reads and writes."""
    results: tuple[str, ...]
    """In the kernel's order: ``state``, ``return`` for what the function returns, other names for pointers to it."""
    summary: str
    about: Callable[..., Any] | None = None
    """The kernel that messages name, where another one is wrapped around it."""


def check_graph(function: Function, graph: Graph, again: Graph) -> None:
    """Compare a trace with another one, and with the kernel on numbers.

    A kernel that asks what type its numbers have does something else with symbols, and nothing else would show it.

    Args:
        function: the kernel with examples of its arguments.
        graph: its operations.
        again: traced once more.

    Raises:
        ParameterError: they are not the same.
    """
    code = getattr(function.about or function.kernel, "__code__", None)
    where = f"{code.co_filename}, line {code.co_firstlineno}: " if code else ""
    if again != graph:
        raise ParameterError(
            f"{where}{function.name} is not the same when it is traced twice",
            do="take clocks, random numbers and globals that change out of the kernel",
        )
    rng = np.random.default_rng(1)
    for draw in range(_DRAWS):
        numbers: dict[str, float] = {}
        arguments = [_drawn(one, numbers, rng, 10.0 ** (draw % 4 - 2)) for one in function.arguments]
        try:
            with np.errstate(all="ignore"):
                found = function.kernel(*arguments)
        except ArithmeticError:  # plain Python where C gives an infinity or a NaN
            continue
        values = evaluate(graph, numbers)
        traced = np.array([values[i] for i in graph.results], dtype=np.float64)
        if not np.array_equal(traced, np.array([leaf.value for leaf in leaves(found)], np.float64), equal_nan=True):
            raise ParameterError(
                f"{where}{function.name} behaves differently with symbols than with numbers",
                do="let nothing in it depend on the type of a value",
            )


def _drawn(argument: Argument, numbers: dict[str, float], rng: np.random.Generator, scale: float) -> Any:
    """An argument with other numbers, which are written down by the names of their leaves."""

    def number(leaf: Leaf) -> Any:
        value = leaf.value if argument.constant else float(rng.normal(0.0, scale))
        numbers[f"{argument.name}:{leaf.name}"] = float(value)
        return value

    return rebuilt(argument.example, number)
