"""Mutation testing of the supervisor: each small change of its code must make a test fail.

    python benchmarks/safety_mutants.py [SECONDS] [--left]

One at a time, in place of the running code of the kernels of safety/ and of what they stand on: every comparison,
operator, number, clamp, sign, mode, request, time and field is exchanged; neighbours in a tuple or a call change
places; every operand, condition, branch, bound and detector is left out. Then the supervisor's tests are called,
interpreted, the likeliest first, until one fails. Survivors that are explained stand in results/safety_mutants.toml.
Resumable, until the package or the tests change; --left judges only what survived the last time and what is new since,
and keeps nothing. Exit code 1 if one is left that is not explained.
"""

import argparse
import ast
import copy
import importlib.util
import inspect
import json
import math
import time
from collections.abc import Callable, Iterator
from functools import partial
from hashlib import sha256
from itertools import islice, pairwise
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any

import numpy as np

from bowden.core.signals import DriveReading, Power
from bowden.models import plausible
from bowden.models.drive import servo, thermal
from bowden.safety import detectors, evidence, faults, release, state, supervisor
from kept import FOLDER, Kept

ROOT = Path(__file__).parents[1]
TESTS = [ROOT / "tests" / f"test_safety_{name}.py" for name in ("boundaries", "supervisor")]
KERNELS: list[FunctionType] = [
    kernel
    for module in (supervisor, release, detectors, evidence, faults, plausible)
    for kernel in vars(module).values()
    if hasattr(kernel, "__kernel__") and kernel.__module__ == module.__name__
] + [servo.servo_predict, thermal.warm]
STATES = {
    name: kind
    for module in (state, evidence, release, plausible, thermal)
    for name, kind in vars(module).items()
    if hasattr(kind, "_fields")
}
KERNEL_NAMES = {kernel.__name__ for kernel in KERNELS}
COMPARED = {ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq}
TURNED = {ast.Gt: ast.Lt, ast.Lt: ast.Gt, ast.GtE: ast.LtE, ast.LtE: ast.GtE}
OPERATED = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult}
OPERATED |= {ast.BitOr: ast.BitAnd, ast.BitAnd: ast.BitOr}  # type: ignore[dict-item]
MEMBERS = (state.Mode, state.Request, state.PreflightResult, faults.Reaction, Power)
NAMED = {"max": "min", "min": "max"}
LOCALS: dict[str, Any] = {
    **{
        "reading": DriveReading,
        "motor": plausible.SensorState,
        "joint": plausible.SensorState,
        "heat": thermal.ThermalState,
    },
    **{"last": state.Decision, "decided": state.Decision, "before": state.Timers, "timers": state.Timers},
    **{"servo": state.ModelledServo, "readings": evidence.ValidatedReadings, "effort": evidence.Effort},
    **{"requested": evidence.RequestedTarget, "thermal": thermal.Thermal, "state": state.SupervisorState},
    **{"release": release.Release, "observed": state.Observed, "neighbour": state.NeighbourState},
}
Change = tuple[str, Callable[[Any], None]]
Mutant = tuple[FunctionType, str, Callable[[], CodeType]]


def around(names: list[str] | tuple[str, ...]) -> dict[str, str]:
    """Each name → the next one, the last → the first."""
    return dict(pairwise([*names, names[0]]))


SWAPPED = around(["AT_ONCE", "EVENTUALLY"]) | around(["time", "dt"])
ENUMS = {kind.__name__: around([one.name for one in kind]) for kind in MEMBERS}


def become(node: Any, other: ast.expr) -> None:
    node.__class__, node.__dict__ = other.__class__, other.__dict__


def argument(i: int, value: float) -> Callable[[Any], None]:
    return lambda n: n.args.__setitem__(i, ast.Constant(value))


def left_out(node: ast.BoolOp, i: int) -> None:
    del node.values[i]
    if len(node.values) == 1:
        become(node, node.values[0])


def neighbours(name: str, parts: list[ast.expr]) -> Iterator[Change]:
    """Two neighbours in a node's list of that name change places."""
    for i, (one, other) in enumerate(pairwise(parts)):
        if ast.dump(one) != ast.dump(other):

            def swap(n: Any, i: int = i) -> None:
                pair = getattr(n, name)[i : i + 2]
                getattr(n, name)[i : i + 2] = reversed(pair)

            yield f"{i}: {ast.unparse(one)} ↔ {ast.unparse(other)}", swap


def called(node: ast.Call) -> Iterator[Change]:
    """What can be changed at a call: a clamp, a size, a bound, a detector."""
    name = node.func.id if isinstance(node.func, ast.Name) else getattr(node.func, "attr", "")
    if name in NAMED:
        yield f"{name}→{NAMED[name]}", lambda n: setattr(n.func, "id", NAMED[n.func.id])
        yield f"{name}→left", lambda n: become(n, n.args[0])
        yield f"{name}→right", lambda n: become(n, n.args[1])
    elif name == "abs":
        yield "abs→what", lambda n: become(n, n.args[0])
    elif name == "outside":
        yield "without low", argument(1, -math.inf)
        yield "without high", argument(2, math.inf)
    elif name == "bit":
        yield "never", argument(1, 0.0)
    elif name in STATES:
        yield from neighbours("args", node.args)
    if name in KERNEL_NAMES:
        yield from neighbours("args", node.args)


def changes(node: ast.AST, kinds: dict[str, Any]) -> Iterator[Change]:
    """What can be changed at a node: a word for it, and a function that does it to a copy of the node.

    `kinds`: names → the tuple that each of them is.
    """
    if isinstance(node, ast.Compare):
        kind = type(node.ops[0])
        for others in (COMPARED, TURNED):
            if kind in others:
                yield f"{kind.__name__}→{others[kind].__name__}", lambda n, o=others: n.ops.__setitem__(0, o[kind]())  # type: ignore[misc]
    elif isinstance(node, ast.BinOp) and type(node.op) in OPERATED:
        to = OPERATED[type(node.op)]
        yield f"{type(node.op).__name__}→{to.__name__}", lambda n: setattr(n, "op", to())
        yield f"{type(node.op).__name__}→left", lambda n: become(n, n.left)
        yield f"{type(node.op).__name__}→right", lambda n: become(n, n.right)
    elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load) and node.id in SWAPPED:
        yield f"{node.id}→{SWAPPED[node.id]}", lambda n: setattr(n, "id", SWAPPED[n.id])
    elif isinstance(node, ast.Constant) and isinstance(node.value, bool):
        yield f"{node.value}→{not node.value}", lambda n: setattr(n, "value", not n.value)
    elif isinstance(node, ast.Constant) and isinstance(node.value, float | int):
        yield f"{node.value}→{node.value + 1}", lambda n: setattr(n, "value", n.value + 1)
    elif isinstance(node, ast.If | ast.IfExp):
        yield "if→if not", lambda n: setattr(n, "test", ast.UnaryOp(ast.Not(), n.test))
        yield "if→always", lambda n: setattr(n, "test", ast.Constant(True))
        yield "if→never", lambda n: setattr(n, "test", ast.Constant(False))
    elif isinstance(node, ast.BoolOp):
        other = ast.Or if isinstance(node.op, ast.And) else ast.And
        yield f"{type(node.op).__name__}→{other.__name__}", lambda n: setattr(n, "op", other())
        for i in range(len(node.values)):
            yield f"without {ast.unparse(node.values[i])}", lambda n, i=i: left_out(n, i)  # type: ignore[misc]
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        yield "without not", lambda n: become(n, n.operand)
    elif isinstance(node, ast.Attribute) and getattr(node.value, "id", "") in ENUMS:
        named = ENUMS[node.value.id]  # type: ignore[attr-defined]
        yield f"{node.attr}→{named[node.attr]}", lambda n: setattr(n, "attr", named[n.attr])
    elif isinstance(node, ast.Attribute):
        fields = getattr(kinds.get(getattr(node.value, "id", getattr(node.value, "attr", ""))), "_fields", ())
        if node.attr in fields:
            other = around(fields)[node.attr]
            yield f"{node.attr}→{other}", lambda n: setattr(n, "attr", other)
    elif isinstance(node, ast.Call):
        yield from called(node)
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        yield "−→+", lambda n: setattr(n, "op", ast.UAdd())
    elif isinstance(node, ast.Tuple) and isinstance(node.ctx, ast.Load):
        yield from neighbours("elts", node.elts)


def mutants() -> Iterator[Mutant]:
    """Every kernel with every change: the kernel, where and what, a function that gives the changed code."""
    for kernel in KERNELS:
        lines, _ = inspect.getsourcelines(kernel)
        tree = ast.parse("".join(lines))
        for part in ast.walk(tree):  # what a type says runs nowhere
            for name in {"annotation", "returns"} & set(part._fields):
                setattr(part, name, None)
        known = {*kernel.__code__.co_varnames, *kernel.__globals__}
        kinds = LOCALS | inspect.get_annotations(kernel)
        for i, node in enumerate(ast.walk(tree)):
            if isinstance(node, ast.Name) and SWAPPED.get(node.id) not in known:
                continue
            for what, change in changes(node, kinds):
                line = lines[node.lineno - 1].strip()  # type: ignore[attr-defined]
                height = node.end_lineno - node.lineno  # type: ignore[attr-defined]
                end = f"{node.end_col_offset}{f' {height} lines on' * bool(height)}"  # type: ignore[attr-defined]
                place = f"{what} at {node.col_offset}–{end} of `{line}`"  # type: ignore[attr-defined]
                yield kernel, f"{kernel.__name__}: {place}", partial(changed, kernel, tree, i, change)


def changed(kernel: FunctionType, tree: ast.Module, i: int, change: Callable[[Any], None]) -> CodeType:
    """A kernel's code with a change at the node that a walk comes to as its number `i`."""
    mutant = copy.deepcopy(tree)
    change(list(ast.walk(mutant))[i])
    space: dict[str, Any] = dict(kernel.__globals__)
    exec(compile(ast.fix_missing_locations(mutant), "mutant", "exec"), space)
    code: CodeType = space[kernel.__name__].__code__
    return code


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


def timed(cases: list[Callable[[], object]]) -> Iterator[float]:
    """The time that each test takes with nothing changed, in which it passes [s]."""
    for case in cases:
        start = time.perf_counter()
        assert not fails(case), f"{case} fails without a change"
        yield time.perf_counter() - start


def judged(wanted: Iterator[Mutant], seconds: float) -> Iterator[list[Any]]:
    """[what, survived] of each mutant."""
    end = time.monotonic() + seconds
    with np.errstate(all="ignore"):
        cases = [case for path in TESTS for case in tests(path)]
        taken, kills = np.array(list(timed(cases))), np.ones(len(cases))
        killer = 0  # what has killed one mutant often kills the next of the same line; then what kills most in its time
        for kernel, what, change in wanted:
            if time.monotonic() > end:
                return
            before, kernel.__code__ = kernel.__code__, change()
            try:
                found = next((i for i in [killer, *np.argsort(taken / kills)] if fails(cases[i])), None)
            finally:
                kernel.__code__ = before
            if found is not None:
                killer = found
                kills[found] += 1
            yield [what, found is None]


def judged_last() -> dict[str, bool]:
    """What was judged the last time, by older code or tests, and whether it survived."""
    files = sorted(FOLDER.glob("safety_mutants-*.jsonl"), key=lambda file: file.stat().st_mtime)
    return dict(map(json.loads, files[-1].read_text(encoding="utf-8").splitlines())) if files else {}


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("seconds", nargs="?", type=float, default=math.inf, help="how long, at most")
    parser.add_argument("--left", action="store_true", help="only what survived the last time, or is new since")
    given = parser.parse_args()
    if given.left:
        before = judged_last()
        rows = list(judged((mutant for mutant in mutants() if before.get(mutant[1], True)), given.seconds))
        count = len(rows)
    else:
        count = sum(1 for _ in mutants())
        kept = Kept(f"safety_mutants-{sha256(b''.join(path.read_bytes() for path in TESTS)).hexdigest()[:8]}")
        rows = kept.filled(judged(islice(mutants(), len(kept.rows()), None), given.seconds), count)
    explained = (ROOT / "benchmarks" / "results" / "safety_mutants.toml").read_text(encoding="utf-8")
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
