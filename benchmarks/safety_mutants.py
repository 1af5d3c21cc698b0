"""Mutation testing of the supervisor: each small change of its code must make a test fail.

    python benchmarks/safety_mutants.py [SECONDS]

Every comparison, operator, number, ufunc, branch, sign, mode, request and time in the kernels of safety/ and of what
they stand on is changed, and every operand of a sum or product left out, one at a time, in place of the running code;
then the supervisor's tests are called, interpreted, the quick ones first, until one fails. Survivors that are
explained stand in docs/safety_mutants.md. Resumable, until the package or the tests change; exit code 1 if one is left
that is not explained.
"""

import ast
import copy
import importlib.util
import inspect
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from hashlib import sha256
from itertools import islice, pairwise
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any

import numpy as np

from bowden.models import plausible, servo, thermal
from bowden.safety import supervisor
from kept import Kept

ROOT = Path(__file__).parents[1]
TESTS = [ROOT / "tests" / f"test_safety_{name}.py" for name in ("boundaries", "supervisor")]
KERNELS: list[FunctionType] = [
    *(supervisor.begin, supervisor.most_step, supervisor.look, supervisor.supervise),
    *(plausible.outside, plausible.lasting, plausible.follow, servo.servo_predict, thermal.warm),
]
COMPARED = {ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq}
OPERATED = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult}
MODES = [mode.name for mode in supervisor.Mode]
REQUESTS = [request.name for request in supervisor.Request][1:]
SWAPPED = {a: b for names in (MODES, REQUESTS) for a, b in pairwise([*names, names[0]])} | {"time": "dt", "dt": "time"}
NAMED = {"fmax": "fmin", "fmin": "fmax", "abs": "negative", "floor": "ceil"}


def become(node: Any, other: ast.expr) -> None:
    node.__class__, node.__dict__ = other.__class__, other.__dict__


def changes(node: ast.AST) -> Iterator[tuple[str, Callable[[Any], None]]]:
    """What can be changed at a node: a word for it, and a function that does it to a copy of the node."""
    if isinstance(node, ast.Compare):
        kind = type(node.ops[0])
        yield f"{kind.__name__}→{COMPARED[kind].__name__}", lambda n: n.ops.__setitem__(0, COMPARED[kind]())
        if kind in (ast.Gt, ast.Lt):
            turned = ast.Lt if kind is ast.Gt else ast.Gt
            yield f"{kind.__name__}→{turned.__name__}", lambda n: n.ops.__setitem__(0, turned())
    elif isinstance(node, ast.BinOp) and type(node.op) in OPERATED:
        to = OPERATED[type(node.op)]
        yield f"{type(node.op).__name__}→{to.__name__}", lambda n: setattr(n, "op", to())
        if isinstance(node.op, (ast.Mult, ast.Add)):
            yield f"{type(node.op).__name__}→left", lambda n: become(n, n.left)
            yield f"{type(node.op).__name__}→right", lambda n: become(n, n.right)
    elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load) and node.id in SWAPPED:
        yield f"{node.id}→{SWAPPED[node.id]}", lambda n: setattr(n, "id", SWAPPED[n.id])
    elif isinstance(node, ast.Constant) and isinstance(node.value, float):
        yield f"{node.value}→{node.value + 1.0}", lambda n: setattr(n, "value", n.value + 1.0)
    elif isinstance(node, ast.Attribute) and node.attr in NAMED:
        yield f"{node.attr}→{NAMED[node.attr]}", lambda n: setattr(n, "attr", NAMED[n.attr])
    elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "sel":
        yield "sel's branches", lambda n: setattr(n, "args", [n.args[0], n.args[2], n.args[1]])
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        yield "−→+", lambda n: setattr(n, "op", ast.UAdd())


def mutants() -> Iterator[tuple[FunctionType, str, CodeType]]:
    """Every kernel with every change: the kernel, where and what, the changed code."""
    for kernel in KERNELS:
        lines, _ = inspect.getsourcelines(kernel)
        tree = ast.parse("".join(lines))
        known = {*kernel.__code__.co_varnames, *kernel.__globals__}
        for i, node in enumerate(ast.walk(tree)):
            if isinstance(node, ast.Name) and SWAPPED.get(node.id) not in known:
                continue
            for what, change in changes(node):
                mutant = copy.deepcopy(tree)
                changed = list(ast.walk(mutant))[i]
                line = lines[changed.lineno - 1].strip()  # type: ignore[attr-defined]
                change(changed)
                space: dict[str, Any] = dict(kernel.__globals__)
                exec(compile(ast.fix_missing_locations(mutant), "mutant", "exec"), space)
                column = getattr(node, "col_offset", 0)
                yield kernel, f"{kernel.__name__}: {what} at {column} of `{line}`", space[kernel.__name__].__code__


def tests(path: Path) -> Iterator[Callable[[], object]]:
    """The tests of a file, interpreted, without those that need a fixture."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    for name, test in vars(module).items():
        if name.startswith("test_") and "monkeypatch" not in inspect.signature(test).parameters:
            if "compiled" in name or "layer" in name:
                continue
            marks = [mark for mark in getattr(test, "pytestmark", []) if mark.name == "parametrize"]
            for value in marks[0].args[1] if marks else [None]:
                yield partial(alone, module, partial(test, value) if marks else test)


def alone(module: Any, test: Callable[[], object]) -> None:
    """Call a test with nothing kept from another one."""
    if hasattr(module, "running"):
        module.running.cache_clear()
    test()


def fails(case: Callable[[], object]) -> bool:
    try:
        case()
    except Exception:  # whatever goes wrong, a test has failed
        return True
    return False


def quick_first(cases: list[Callable[[], object]]) -> list[Callable[[], object]]:
    """The tests by the time they take with nothing changed, in which they pass."""
    taken = []
    for case in cases:
        start = time.perf_counter()
        assert not fails(case), f"{case} fails without a change"
        taken.append(time.perf_counter() - start)
    return [cases[i] for i in np.argsort(taken)]


def judged(skip: int, seconds: float) -> Iterator[list[Any]]:
    """[what, survived] of each mutant."""
    end = time.monotonic() + seconds
    with np.errstate(all="ignore"):
        cases = quick_first([case for path in TESTS for case in tests(path)])
        killer = cases[0]  # what has killed one mutant often kills the next of the same line
        for kernel, what, code in islice(mutants(), skip, None):
            if time.monotonic() > end:
                return
            before, kernel.__code__ = kernel.__code__, code
            try:
                found = next((case for case in [killer, *cases] if fails(case)), None)
            finally:
                kernel.__code__ = before
            killer = found or killer
            yield [what, found is None]


def main() -> int:
    count = sum(1 for _ in mutants())
    kept = Kept(f"safety_mutants-{sha256(b''.join(path.read_bytes() for path in TESTS)).hexdigest()[:8]}")
    rows = kept.filled(judged(len(kept.rows()), float(sys.argv[1]) if len(sys.argv) > 1 else 1e9), count)
    explained = (ROOT / "docs" / "safety_mutants.md").read_text(encoding="utf-8")
    left = [what for what, survived in rows if survived]
    new = [what for what in left if what not in explained]
    for what in new:
        print("survives:", what)
    print(
        f"{len(rows)} of {count} mutants: {len(rows) - len(left)} killed, {len(left)} survive, {len(new)} unexplained"
    )
    return 1 if new or len(rows) < count else 0


if __name__ == "__main__":
    raise SystemExit(main())
