"""What only one side of a choice needs is done within it, in an order in which nothing is used before it is made."""

import itertools
import random
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from bowden.control import LAWS
from bowden.core.kernel import exp, kernel, sel
from bowden.export.checked import Argument, Function
from bowden.export.code import Style
from bowden.export.graph import Graph, Operation
from bowden.export.law import law_module
from bowden.export.module import Module, files, written
from bowden.export.readme import FLAGS
from bowden.export.sides import Course, JointChoice, course

pytest.importorskip("casadi", reason="casadi, of the extra export, is not installed")
COMPILER = shutil.which("cc")


class Pair(NamedTuple):
    """Two results."""

    first: float
    second: float


@kernel
def chosen(x: float, y: float) -> Pair:
    """Both results ask the same; u and w are one side's, v both sides'."""
    up = x > y
    u = (x + 2.0) * (x + 3.0) * (x + 5.0)
    v = (y + 7.0) * (y + 11.0)
    w = exp(y) * (y - x) * v
    deep = sel(y > 0.0, w / x / (y + 1.0) / (y + 2.0) / (y + 3.0), 0.0)
    return Pair(sel(up, u + v, w), sel(up, 13.0 * u, deep))


def text_of() -> str:
    function = Function("step", chosen, (Argument("x", 0.0), Argument("y", 0.0)), ("found",), "")
    return files(Module("two", "", (function,)), Style("two"), "")["two.c"]


def uses_of(graph: Graph) -> list[int]:
    uses = [0] * len(graph.operations)
    for one in graph.operations:
        for j in one.arguments:
            uses[j] += 1
    return uses


def walked(items: Course) -> Iterator[int]:
    """Operations in the order of writing; a choice's own come behind its sides."""
    for item in items:
        if isinstance(item, JointChoice):
            yield from walked(item.sides[0])
            yield from walked(item.sides[1])
            yield from item.made
        else:
            yield item


def seen_from(items: Course, graph: Graph, before: set[int]) -> set[int]:
    """What is done after these; fails where something is used that was not done, or only on another side."""
    done = set(before)
    for item in items:
        if isinstance(item, JointChoice):
            assert item.condition in done
            for place, side in enumerate(item.sides, start=1):
                there = seen_from(side, graph, done)
                assert {graph.operations[i].arguments[place] for i in item.made} <= there
            done.update(item.made)
        else:
            assert set(graph.operations[item].arguments) <= done
            done.add(item)
    return done


def test_choices_that_ask_the_same_are_one_if_with_what_only_they_need() -> None:
    text = text_of()
    before, _, rest = text.partition("    if (")
    inside, _, other = rest.partition("} else {")
    assert text.count("y < x") == 1
    assert "(y + 7.0) * (y + 11.0)" in before
    assert "exp(y)" not in before + inside
    assert "exp(y)" in other
    assert "x + 5.0" in inside
    assert "x + 5.0" not in before + other
    assert "if (0.0 < y) {" in other


def test_a_side_that_saves_little_is_an_expression() -> None:
    function = Function("step", chosen, (Argument("x", 0.0), Argument("y", 0.0)), ("found",), "")
    graph, _ = written(function)
    assert not any(isinstance(item, JointChoice) for item in course(graph, uses_of(graph), set(), least=1000))


@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
def test_it_gives_the_bits_of_python(tmp_path: Path) -> None:
    function = Function("step", chosen, (Argument("x", 0.0), Argument("y", 0.0)), ("found",), "")
    for name, text in files(Module("two", "", (function,)), Style("two"), "").items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    (tmp_path / "main.c").write_text(
        '#include <stdio.h>\n#include "two.h"\n'
        "int main(void) { double row[2]; two_pair found; while (fread(row, 8, 2, stdin) == 2) {\n"
        "two_step(row[0], row[1], &found); fwrite(&found, sizeof found, 1, stdout); } return 0; }\n"
    )
    command = [str(COMPILER), *FLAGS.split(), "two.c", "main.c", "-o", "two", "-lm"]
    subprocess.run(command, cwd=tmp_path, check=True)
    rows = np.array(list(itertools.product([0.0, -0.0, 1.5, -2.5, 1e300, np.inf, np.nan], repeat=2)))
    done = subprocess.run([tmp_path / "two"], input=rows.tobytes(), capture_output=True, check=True)
    found = np.frombuffer(done.stdout).reshape(-1, 2)
    with np.errstate(all="ignore"):
        wanted = np.array([chosen(x, y) for x, y in rows])
    np.testing.assert_array_equal(found, wanted)
    numbers = ~np.isnan(wanted)
    np.testing.assert_array_equal(np.signbit(found[numbers]), np.signbit(wanted[numbers]))


@pytest.mark.parametrize("name", sorted(LAWS))
def test_every_law_is_written_in_an_order_that_can_be(name: str) -> None:
    graph, _ = written(law_module(LAWS[name], 1e-3).functions[1])
    found = course(graph, uses_of(graph), set())
    assert seen_from(found, graph, set()) >= set(graph.results)
    assert len(list(walked(found))) == len(set(walked(found)))


@pytest.mark.parametrize("seed", range(40))
def test_so_is_whatever_is_drawn(seed: int) -> None:
    """Choices that need one another, in any order."""
    dice = random.Random(seed)
    operations = [Operation("leaf", (), f"x{k}") for k in range(4)]
    conditions = []
    for k in range(4):
        conditions.append(len(operations))
        operations.append(Operation("lt", (k, (k + 1) % 4)))
    for _ in range(120):
        pick = [dice.randrange(max(0, len(operations) - 12), len(operations)) for _ in range(2)]
        if dice.random() < 0.3:
            operations.append(Operation("sel", (dice.choice(conditions), *pick)))
        else:
            operations.append(Operation("add", tuple(pick)))
    ends = [dice.randrange(len(operations) - 20, len(operations)) for _ in range(3)]
    needed, todo = set(ends), list(ends)
    while todo:
        new = set(operations[todo.pop()].arguments) - needed
        needed |= new
        todo += new
    number = {old: new for new, old in enumerate(sorted(needed))}
    kept = [
        Operation(operations[i].kind, tuple(number[j] for j in operations[i].arguments), operations[i].leaf)
        for i in sorted(needed)
    ]
    graph = Graph(kept, [number[i] for i in ends])
    found = course(graph, uses_of(graph), set(), least=1)
    assert seen_from(found, graph, set()) >= set(graph.results)
    assert sorted(walked(found)) == list(range(len(kept)))
