"""Which operations only one side of a choice needs: they stand within that side, and are done only where it is taken.

A traced kernel does both sides of every choice. Choices that ask the same condition are put together here, with all
that nothing else needs; where they save enough they become one ``if`` of C. No operation is changed, so that every
result keeps its bits.
"""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass

from bowden.export.graph import LIBM, Graph, Operation

LEAST = 4
"""Operations that a side must save: what the jump costs, and registers that are kept free for it."""
_OF_LIBM = 20
"""Operations that a function of libm counts for."""


@dataclass(frozen=True)
class JointChoice:
    """Choices that ask the same."""

    condition: int
    """Number of the operation."""
    made: tuple[int, ...]
    """Numbers of the choices."""
    sides: tuple["Course", "Course"]
    """What is done only where it holds, and only where it does not."""


Course = tuple["int | JointChoice", ...]
"""Operations, by their numbers, in an order in which each stands behind what it needs."""


def course(graph: Graph, uses: Sequence[int], constants: Collection[int], least: int = LEAST) -> Course:
    """The order in which the operations are written, with what only one side needs within that side.

    Args:
        graph: the operations.
        uses: how often each result is used by what is needed.
        constants: numbers of those that cost nothing.
        least: operations that a side must save.
    """
    needed = (i for i in range(len(graph.operations)) if uses[i] or i in graph.results or i in constants)
    return _Planned(graph, uses, constants, least).course(needed)


class _Planned:
    def __init__(self, graph: Graph, uses: Sequence[int], constants: Collection[int], least: int) -> None:
        self._operations, self._ends, self._least, self._uses = graph.operations, set(graph.results), least, uses
        self._cost = [
            0 if i in constants or one.kind == "leaf" else _OF_LIBM if one.kind in LIBM else 1
            for i, one in enumerate(graph.operations)
        ]

    def course(self, numbers: Iterable[int]) -> Course:
        """Of some of the operations, the others being done before or within a side."""
        free = set(numbers)
        groups: list[JointChoice] = []
        together: dict[int, tuple[int, ...]] = {i: (i,) for i in free}  # what is done with each of them
        while (best := self._best(free, together)) is not None:
            condition, made, sides = best
            whole = tuple(sorted((*made, *sides[0], *sides[1])))
            together.update(dict.fromkeys(whole, whole))
            groups.append(JointChoice(condition, made, (self.course(sides[0]), self.course(sides[1]))))
        return _ordered(self._operations, free, groups, together)

    def _best(
        self, free: set[int], together: dict[int, tuple[int, ...]]
    ) -> tuple[int, tuple[int, ...], tuple[list[int], list[int]]] | None:
        """The choices that save most, if any saves enough."""
        asking: dict[int, list[int]] = {}
        for i in sorted(free):
            if self._operations[i].kind == "sel" and len(together[i]) == 1:
                asking.setdefault(self._operations[i].arguments[0], []).append(i)
        best, most = None, self._least - 1
        behind: dict[int, int] | None = None
        for condition, choices in asking.items():
            if self._saved(choices, free, together)[0] <= most:  # without the next test, which takes longer
                continue
            behind = behind or _behind(self._operations, free, together)
            made: list[int] = []
            for i in choices:  # none that needs another one of them
                if not any(behind[i] >> j & 1 for j in made):
                    made.append(i)
            saves, sides = self._saved(made, free, together)
            if saves > most:
                best, most = (condition, tuple(made), sides), saves
        return best

    def _saved(
        self, made: Sequence[int], free: set[int], together: dict[int, tuple[int, ...]]
    ) -> tuple[int, tuple[list[int], list[int]]]:
        """What the dearer side of these choices costs, and what nothing needs but either side."""
        first, second = (self._only(made, place, free, together) for place in (1, 2))
        return max(sum(self._cost[i] for i in side) for side in (first, second)), (first, second)

    def _only(self, made: Sequence[int], place: int, free: set[int], together: dict[int, tuple[int, ...]]) -> list[int]:
        """What nothing needs but one side of these choices."""
        found: list[int] = []
        met: dict[int, int] = {}
        todo = [self._operations[i].arguments[place] for i in made]
        while todo:
            j = todo.pop()
            met[j] = met.get(j, 0) + 1
            if met[j] < self._uses[j] or j not in free or j in self._ends or j in made or len(together[j]) > 1:
                continue
            if self._operations[j].kind != "leaf":
                found.append(j)
                todo += self._operations[j].arguments
        return sorted(found)


def _behind(operations: Sequence[Operation], free: set[int], together: dict[int, tuple[int, ...]]) -> dict[int, int]:
    """What each of the free operations needs, directly or not, as a sum of 2^number; a group is done as one."""
    found: dict[int, int] = {}

    def look(i: int) -> int:
        if i not in found:
            whole, bits = together[i], 0
            for j in {j for k in whole for j in operations[k].arguments} & free - set(whole):
                bits |= look(j) | 1 << j
            found.update(dict.fromkeys(whole, bits))
        return found[i]

    for i in sorted(free):
        look(i)
    return found


def _ordered(
    operations: Sequence[Operation], free: set[int], groups: Sequence[JointChoice], together: dict[int, tuple[int, ...]]
) -> Course:
    """Every operation as it came, a group as late as it can be."""
    number = {i: k for k, group in enumerate(groups) for i in group.made}
    found: list[int | JointChoice] = []
    done: set[int] = set()

    def take(i: int) -> None:
        if i in done:
            return
        whole = together[i]
        for j in sorted({j for k in whole for j in operations[k].arguments} & free - set(whole)):
            take(j)
        done.update(whole)
        group = next((number[k] for k in whole if k in number), None)
        found.append(i if group is None else groups[group])

    for i in sorted(free):
        if i == max(together[i]):
            take(i)
    return tuple(found)
