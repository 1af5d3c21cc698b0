"""What is 0 or 1 by its making, as C's ``!``, ``&&`` and ``||``: in kernels it is arithmetic of comparisons."""

from collections.abc import Mapping
from dataclasses import replace

from bowden.export.graph import Graph, Operation, evaluate

_COMPARES = ("eq", "ne", "lt", "le")
_JOINS = ("and", "or", "not")


def with_truths(graph: Graph, leaves: Mapping[str, float]) -> Graph:
    """The same operations, in which products, sums and differences of truths, and what asks them, are truths.

    With p, q either 0 or 1: p·q is ``p && q``, 1 − p is ``!p``, 0 < p + q is ``p || q``, 0 < p and p ? 1 : 0 are p, and
    c < (p ? a : b) of constants is p or ``!p``. All values stay the same, to the bit.

    Args:
        graph: the operations.
        leaves: values of the leaves that are constants.
    """
    made = _Made(graph, leaves)
    for i, one in enumerate(graph.operations):
        made.take(i, replace(one, arguments=tuple(made.stands_for[j] for j in one.arguments)))
    return Graph(made.operations, [made.stands_for[i] for i in graph.results])


class _Made:
    """The operations so far; `stands_for` has the new number of each old one."""

    def __init__(self, graph: Graph, leaves: Mapping[str, float]) -> None:
        self.operations: list[Operation] = []
        self.stands_for: list[int] = []
        self._values = evaluate(graph, leaves)
        self._known: list[float | None] = []
        self._same: dict[tuple[str, tuple[int, ...]], int] = {}

    def take(self, i: int, one: Operation) -> None:
        """The next of the old operations."""
        value = self._values[i]
        self.stands_for.append(self._rewritten(one) if one.kind != "leaf" and value is None else self._new(one, value))

    def _new(self, one: Operation, value: float | None = None) -> int:
        key = (one.kind, one.arguments)
        if one.kind in _JOINS and key in self._same:
            return self._same[key]
        self.operations.append(one)
        self._known.append(value)
        self._same[key] = len(self.operations) - 1
        return self._same[key]

    def _rewritten(self, one: Operation) -> int:
        join = {"mul": "and", "sub": "not", "lt": "or", "sel": "sel"}.get(one.kind)
        arguments = one.arguments
        if join == "and" and all(map(self._truth, arguments)):
            return self._new(replace(one, kind="and"))
        if join == "not" and self._is(arguments[0], 1.0) and self._truth(arguments[1]):
            return self._denied(arguments[1], one)
        if join == "or":
            return self._asked(one)
        if join == "sel":
            asked = self._either(arguments[0], one)
            if asked is not None and self._is(arguments[1], 1.0) and self._is(arguments[2], 0.0):
                return asked
            one = replace(one, arguments=(arguments[0] if asked is None else asked, *arguments[1:]))
        return self._new(one)

    def _asked(self, one: Operation) -> int:
        """c < x, where x may be a truth, a sum of such, or a choice between constants."""
        bound, inner = self._known[one.arguments[0]], self.operations[one.arguments[1]]
        if bound is None:
            return self._new(one)
        truth = self._either(one.arguments[1], one)
        if truth is not None and 0.0 <= bound < 1.0:
            return truth
        if inner.kind == "sel":
            condition = self._either(inner.arguments[0], one)
            a, b = (self._known[j] for j in inner.arguments[1:])
            if condition is not None and a is not None and b is not None and (bound < a) != (bound < b):
                return condition if bound < a else self._denied(condition, one)
        return self._new(one)

    def _either(self, i: int, one: Operation) -> int | None:
        """A truth that holds where the operation's result is not 0, for truths and sums of them; else None."""
        if self._truth(i):
            return i
        inner = self.operations[i]
        if inner.kind != "add":
            return None
        parts = [self._either(j, one) for j in inner.arguments]
        if None in parts:
            return None
        return self._new(Operation("or", tuple(part for part in parts if part is not None), "", one.place))

    def _denied(self, i: int, one: Operation) -> int:
        inner = self.operations[i]
        return inner.arguments[0] if inner.kind == "not" else self._new(Operation("not", (i,), "", one.place))

    def _truth(self, i: int) -> bool:
        one = self.operations[i]
        if one.kind == "sel":
            return all(self._truth(j) or self._is(j, 0.0) or self._is(j, 1.0) for j in one.arguments[1:])
        return one.kind in _COMPARES + _JOINS and self._known[i] is None

    def _is(self, i: int, value: float) -> bool:
        known = self._known[i]
        return known is not None and float(known).hex() == value.hex()
