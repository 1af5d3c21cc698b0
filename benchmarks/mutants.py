"""Mutation testing: does a test fail when one operator, comparison, condition or number of the package is changed?

    python benchmarks/mutants.py [COUNT] [--seed N] [--rooms ROOM ...] [--all] [--left] [--least SHARE]

Mutants are drawn over the rooms by size: each change of each function, and of each number that a module names, is as
likely as any other. For each, the tests that run the changed line are run, first the quick ones that run little beside
it, until one fails: in a process of its own, forked from one that has imported all of them, in which the changed code
takes the place of the function's. Defaults of fields are data, and are left alone. Which tests run which lines is
recorded once (by coverage.py, in `out/bench/mutants`), and again for test files that have changed. Results are kept
until the package changes: an interrupted run goes on where it was left. What survived, or was killed by a test that is
no longer there, is judged again by `--left`. Mutants that change nothing stand in `results/mutants_equivalent.toml`,
each with its reason. Exit code 1 if fewer of the others are killed than `--least`.
"""

import argparse
import ast
import contextlib
import copy
import functools
import gc
import importlib
import json
import linecache
import os
import random
import resource
import signal
import sys
import time
import tomllib
import traceback
import warnings
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from hashlib import sha256
from itertools import pairwise
from pathlib import Path, PurePosixPath
from types import CodeType, FunctionType, ModuleType
from typing import Any, NamedTuple

import coverage
import pytest

from kept import FOLDER, Kept

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "src" / "bowden"
REACHED = FOLDER / "mutants"
EQUIVALENT = ROOT / "benchmarks" / "results" / "mutants_equivalent.toml"
BUDGET, PATIENCE = 60.0, 200
"""Of the tests that are run for one mutant, the time that they take without it; and the processor's time that a mutant
may take [s]: how long it takes on a computer that also does other work says nothing."""
COMPILING = 4.0
"""What compiling anew adds to the first test of a file that reaches a kernel in compiled code alone [s]."""
CASES = 3
"""Of one test that wait for no others."""
ALIVE = ("survives", "no test")

COMPARED = {ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq}
COMPARED |= {ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In}  # type: ignore[dict-item]
TURNED = {ast.Gt: ast.Lt, ast.Lt: ast.Gt, ast.GtE: ast.LtE, ast.LtE: ast.GtE}
OPERATED = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult}
OPERATED |= {ast.BitOr: ast.BitAnd, ast.BitAnd: ast.BitOr, ast.Pow: ast.Mult, ast.Mod: ast.Mult}  # type: ignore[dict-item]
NAMED = {"max": "min", "min": "max"}
Change = tuple[str, Callable[[Any], None]]


class Mutant(NamedTuple):
    """One change of one function."""

    path: str
    """Of the file, within the package."""
    function: str
    """Its qualified name; empty for what a module does when it is imported."""
    index: int
    """Of the node, in the order in which `ast.walk` comes to it."""
    lines: tuple[int, int]
    """The first and last of the statement, below its function's first."""
    number: int
    """Of the change at this node."""
    what: str
    """The change in words, with its line: what it is known by."""


def become(node: Any, other: ast.expr) -> None:
    node.__class__, node.__dict__ = other.__class__, other.__dict__


def without(node: ast.BoolOp, i: int) -> None:
    del node.values[i]
    if len(node.values) == 1:
        become(node, node.values[0])


def swapped(node: ast.Call, i: int) -> None:
    node.args[i : i + 2] = reversed(node.args[i : i + 2])


def changes(node: ast.AST) -> Iterator[Change]:
    """What can be changed at a node: a word for it, and a function that does it to a copy of the node."""
    if isinstance(node, ast.Compare):
        kind = type(node.ops[0])
        for others in (COMPARED, TURNED):
            if kind in others:
                yield f"{kind.__name__}→{others[kind].__name__}", lambda n, o=others: n.ops.__setitem__(0, o[kind]())  # type: ignore[misc]
    elif isinstance(node, ast.BinOp | ast.AugAssign) and type(node.op) in OPERATED:
        to = OPERATED[type(node.op)]
        yield f"{type(node.op).__name__}→{to.__name__}", lambda n: setattr(n, "op", to())
        if isinstance(node, ast.BinOp):
            yield f"{type(node.op).__name__}→left", lambda n: become(n, n.left)
            yield f"{type(node.op).__name__}→right", lambda n: become(n, n.right)
    elif isinstance(node, ast.Constant) and isinstance(node.value, bool):
        yield f"{node.value}→{not node.value}", lambda n: setattr(n, "value", not n.value)
    elif isinstance(node, ast.Constant) and isinstance(node.value, float | int):
        other = 1.5 * node.value if isinstance(node.value, float) and node.value else node.value + 1
        yield f"{node.value}→{other}", lambda n: setattr(n, "value", other)
    elif isinstance(node, ast.If | ast.IfExp):
        yield "if→if not", lambda n: setattr(n, "test", ast.UnaryOp(ast.Not(), n.test))
        yield "if→always", lambda n: setattr(n, "test", ast.Constant(True))
        yield "if→never", lambda n: setattr(n, "test", ast.Constant(False))
    elif isinstance(node, ast.BoolOp):
        other_op = ast.Or if isinstance(node.op, ast.And) else ast.And
        yield f"{type(node.op).__name__}→{other_op.__name__}", lambda n: setattr(n, "op", other_op())
        for i in range(len(node.values)):
            yield f"without {ast.unparse(node.values[i])}", lambda n, i=i: without(n, i)  # type: ignore[misc]
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        yield "without not", lambda n: become(n, n.operand)
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        yield "−→+", lambda n: setattr(n, "op", ast.UAdd())
    elif isinstance(node, ast.Attribute) and node.attr in enums().get(getattr(node.value, "id", ""), ()):
        names = enums()[node.value.id]  # type: ignore[attr-defined]
        another = names[(names.index(node.attr) + 1) % len(names)]
        yield f"{node.attr}→{another}", lambda n: setattr(n, "attr", another)
    elif isinstance(node, ast.Call):
        yield from called(node)


def called(node: ast.Call) -> Iterator[Change]:
    """What can be changed at a call: a clamp, a size, the order of its arguments."""
    name = getattr(node.func, "id", "")
    if name in NAMED:
        yield f"{name}→{NAMED[name]}", lambda n: setattr(n.func, "id", NAMED[n.func.id])
        yield f"{name}→first", lambda n: become(n, n.args[0])
    elif name == "abs":
        yield "abs→what", lambda n: become(n, n.args[0])
    else:
        plain = [isinstance(part, ast.Name | ast.Attribute | ast.BinOp | ast.Call) for part in node.args]
        for i, (one, two) in enumerate(pairwise(node.args)):
            if plain[i] and plain[i + 1] and ast.dump(one) != ast.dump(two):
                words = f"{ast.unparse(one)[:40]} ↔ {ast.unparse(two)[:40]}"
                yield words, lambda n, i=i: swapped(n, i)  # type: ignore[misc]


def silent(node: ast.AST) -> Iterator[ast.AST]:
    """What is left alone: types, defaults, what is raised and printed, decorators."""
    if isinstance(node, ast.FunctionDef | ast.Lambda):
        yield node.args
        yield from getattr(node, "decorator_list", ())
    if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
        yield node
    if isinstance(node, ast.Raise | ast.JoinedStr | ast.Assert):
        yield node
    if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "__all__":
        yield node
    yield from (part for name in ("annotation", "returns") if (part := getattr(node, name, None)))
    if isinstance(node, ast.Call) and getattr(node.func, "id", getattr(node.func, "attr", "")) in ("print", "hint"):
        yield node


def is_number(node: ast.stmt) -> bool:
    """Whether a module's statement names a number."""
    return isinstance(node, ast.Assign | ast.AnnAssign) and isinstance(
        node.value, ast.Constant | ast.BinOp | ast.UnaryOp
    )


class Place(NamedTuple):
    """Where a node stands."""

    function: str | None
    """The qualified name of the function that it is in; empty at a module's level, None in a class's body."""
    lines: tuple[int, int]
    """The first and last of its statement, without the statements within that."""


def places(tree: ast.Module) -> dict[ast.AST, Place]:
    """Node → its place."""
    found: dict[ast.AST, Place] = {}

    def go(node: ast.AST, outer: str, at: Place) -> None:
        for child in ast.iter_child_nodes(node):
            inner, of, lines = outer, at.function, at.lines
            if isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef):
                of = f"{outer}{child.name}"
                inner = f"{of}.<locals>."
            elif isinstance(child, ast.ClassDef):
                inner, of = f"{outer}{child.name}.", of or None
            if isinstance(child, ast.stmt):
                body = getattr(child, "body", ())
                lines = child.lineno, max(child.lineno, body[0].lineno - 1) if body else child.end_lineno or 0
            found[child] = Place(of, lines)
            go(child, inner, found[child])

    go(tree, "", Place("", (0, 0)))
    return found


@functools.cache
def parsed() -> dict[str, ast.Module]:
    """Every file of the package."""
    return {
        str(path.relative_to(PACKAGE)): ast.parse(path.read_text(encoding="utf-8")) for path in PACKAGE.rglob("*.py")
    }


@functools.cache
def enums() -> dict[str, list[str]]:
    """Enumeration of the package → its members."""
    return {
        node.name: [part.targets[0].id for part in node.body if isinstance(part, ast.Assign)]  # type: ignore[attr-defined]
        for tree in parsed().values()
        for node in ast.walk(tree)
        if isinstance(node, ast.ClassDef) and any("Enum" in ast.unparse(base) for base in node.bases)
    }


def mutants(rooms: list[str]) -> Iterator[Mutant]:
    """Every change of every file of the rooms."""
    for path, tree in sorted(parsed().items()):
        if rooms and not any(map(PurePosixPath(path).is_relative_to, rooms)):
            continue
        found, below = places(tree), lines_of(tree)
        lines = (PACKAGE / path).read_text(encoding="utf-8").splitlines()
        hidden = {id(inner) for node in ast.walk(tree) for part in silent(node) for inner in ast.walk(part)}
        numbers = {id(inner) for statement in tree.body if is_number(statement) for inner in ast.walk(statement)}
        for index, node in enumerate(ast.walk(tree)):
            if id(node) in hidden or not hasattr(node, "lineno") or not (found[node].function or id(node) in numbers):
                continue
            of, (first, last) = found[node].function or "", (below.get(line, ("", 0))[1] for line in found[node].lines)
            for number, (what, _) in enumerate(changes(node)):
                place = f"{what} at {node.col_offset} of `{lines[node.lineno - 1].strip()}`"
                yield Mutant(path, of, index, (first, last), number, f"{path}: {of or 'module'}: {place}")


def codes(code: CodeType) -> Iterator[CodeType]:
    yield code
    for part in code.co_consts:
        if isinstance(part, CodeType):
            yield from codes(part)


def changed_source(mutant: Mutant) -> str:
    """The text of its file with the change, on the same lines."""
    data = (PACKAGE / mutant.path).read_bytes()
    node = list(ast.walk(ast.parse(data)))[mutant.index]
    changed: Any = copy.deepcopy(node)
    list(changes(changed))[mutant.number][1](changed)
    place, new = (node.test, changed.test) if isinstance(node, ast.If) else (node, changed)
    lines = [b"", *data.splitlines(keepends=True)]
    begin, end = (
        (sum(map(len, lines[:line])) + column)
        for line, column in ((place.lineno, place.col_offset), (place.end_lineno, place.end_col_offset))
    )
    text = ast.unparse(ast.fix_missing_locations(new))
    if isinstance(new, ast.expr):
        text = f"({text}{chr(10) * (place.end_lineno - place.lineno)})"
    return (data[:begin] + text.encode() + data[end:]).decode()


def put_in_place(mutant: Mutant) -> None:
    """Let this process run the changed code, in every function that has the old one; or know the changed number.

    Who reads the source of a function, as the export does, reads the changed one.
    """
    file, text = str(PACKAGE / mutant.path), changed_source(mutant)
    linecache.cache[file] = (len(text), None, text.splitlines(keepends=True), file)
    code = compile(text, file, "exec")
    name = "bowden." + mutant.path.removesuffix(".py").removesuffix("/__init__").replace("/", ".")
    module = importlib.import_module(name)  # or a test that imports it late would import what has not changed
    if mutant.function:
        outer = mutant.function.partition(".<locals>")[0]
        within = [one for one in codes(code) if one.co_qualname.partition(".<locals>")[0] == outer]
        times = Counter(one.co_qualname for one in within)
        new = {one.co_qualname: one for one in within if times[one.co_qualname] == 1}  # lambdas have no name
        for function in [one for one in gc.get_objects() if type(one) is FunctionType]:
            old = function.__code__
            if old.co_filename == file and old.co_qualname in new:
                function.__code__ = new[old.co_qualname]
        return
    before, after = vars(module), {"__name__": name, "__file__": file}
    first = dict(before)
    exec(code, after)
    for key, value in after.items():
        if isinstance(value, int | float) and key in before and before[key] != value:
            modules = [vars(module) for module in list(sys.modules.values()) if isinstance(module, ModuleType)]
            for names in [*modules, *(dispatcher.py_func.__globals__ for dispatcher, *_ in COMPILED)]:
                if key in names and names[key] is first[key]:
                    names[key] = value


SHARED = "shared"
CONTEXTS = [""]
"""The test that runs, and above it, for as long as one that outlives it is made, `SHARED` for the fixture."""
CALLED: dict[str, set[str]] = defaultdict(set)
"""Context → kernels within the compiled code that it has called, by their names."""
COMPILED: list[tuple[Any, Any, Any]] = []
"""What is compiled in this process: Numba's dispatcher, the kernel, and its parts."""


class Called:
    """Compiled code that says when it is called."""

    def __init__(self, inner: Any, names: frozenset[str]) -> None:
        self._inner, self._names = inner, names

    def __call__(self, *given: Any, **named: Any) -> Any:
        CALLED[CONTEXTS[-1]].update(self._names)
        return self._inner(*given, **named)

    def __getattr__(self, name: str) -> Any:
        return getattr(object.__getattribute__(self, "_inner"), name)


def watch_compiled() -> None:
    """Let all compiled code say when it is called, what tests compile when they are imported too."""
    from bowden.core import kernel

    compile_ = kernel._compile

    @functools.cache
    def watched(function: Any, name: str, parts: Any, *, within: bool) -> Any:
        inner = compile_(function, name, parts, within=within)
        COMPILED.append((inner, function, parts))
        return inner if within else Called(inner, frozenset(kernels_in(function, parts)))

    kernel._compile = watched  # type: ignore[assignment]


def compile_changed() -> None:
    """Let what was compiled of changed code be compiled anew, and all else be found where it is kept."""
    from bowden.core import kernel_cache, kernel_content

    kernel_content._function.cache_clear()
    kernel_cache._write = lambda path, content: None  # of a mutant nothing is kept
    for dispatcher, function, parts in COMPILED:
        if getattr(dispatcher, "overloads", None):  # compiled before the change, where a test file was imported
            dispatcher._reset_overloads()
        if kept := getattr(dispatcher, "_cache", None):
            kept._content = f"{kept._content} {kernel_content.content_of(function, parts)}"


class Recorder:
    """What each test reaches of the package, and how long it takes.

    Coverage's contexts tell which lines run as Python; a kernel may also be reached within compiled code. What a
    fixture does that outlives a test counts for all tests of the file.
    """

    def __init__(self) -> None:
        self.found: dict[str, dict[str, Any]] = {}
        os.environ["NUMBA_JIT_COVERAGE"] = "0"  # what is compiled has not run
        self._coverage = coverage.Coverage(data_file=None, config_file=False, source=[str(PACKAGE)])
        self._coverage.start()

    @contextlib.contextmanager
    def _context(self, name: str) -> Iterator[None]:
        CONTEXTS.append(name)
        self._coverage.switch_context(name)
        try:
            yield
        finally:
            CONTEXTS.pop()
            self._coverage.switch_context(CONTEXTS[-1])

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef: Any) -> Iterator[None]:
        with self._context(CONTEXTS[-1] if fixturedef.scope == "function" else SHARED):
            return (yield)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: Any) -> Iterator[None]:
        with self._context(item.nodeid):
            return (yield)

    def pytest_runtest_logreport(self, report: Any) -> None:
        if report.when == "call":
            self.found[report.nodeid] = {"time": report.duration, "passed": report.passed}

    def finished(self) -> dict[str, dict[str, Any]]:
        """Test → its time, the lines of functions that it runs, and the kernels that it calls compiled."""
        self._coverage.stop()
        with warnings.catch_warnings(action="ignore"):  # that nothing of the package has run
            data = self._coverage.get_data()
        lines: dict[str, Counter[str]] = defaultdict(Counter)
        for file in data.measured_files():
            path = str(Path(file).relative_to(PACKAGE))
            below = lines_of(parsed().get(path, ast.Module([], [])))  # of a page's template nothing
            for line, contexts in data.contexts_by_lineno(file).items():
                for context in contexts if line in below else ():
                    lines[context][f"{path}:{below[line][0]}"] |= 1 << below[line][1]
        for test, row in self.found.items():
            names = {*lines[test], *lines[SHARED]}
            row["plain"] = {name: f"{lines[test][name] | lines[SHARED][name]:x}" for name in sorted(names)}
            row["compiled"] = sorted(CALLED[test] | CALLED[SHARED])
        return self.found


def lines_of(tree: ast.Module) -> dict[int, tuple[str, int]]:
    """Line → the qualified name of the innermost function that it is in, and how far below its first line it stands.

    A change of another function moves neither.
    """
    of, found = places(tree), dict[int, tuple[str, int]]()
    functions = [node for node in of if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)]
    for node in sorted(functions, key=lambda one: one.lineno):
        for line in range(node.body[0].lineno, (node.end_lineno or node.lineno) + 1):
            found[line] = of[node].function or "", line - node.lineno
    return found


def name_of(code: CodeType) -> str:
    """A function of the package, by its file and name; nothing for others."""
    inside = code.co_filename.startswith(str(PACKAGE))
    return f"{code.co_filename[len(str(PACKAGE)) + 1 :]}:{code.co_qualname}" if inside else ""


def kernels_in(function: Any, parts: Any) -> Iterator[str]:
    """A kernel and all that it calls, as `Recorder` names them."""
    from bowden.core.kernel_content import global_names, global_value, is_kernel

    todo, seen = [function], {function}
    while todo:
        one = todo.pop()
        if name_of(one.__code__):
            yield name_of(one.__code__)
        for name in global_names(one.__code__):
            value = global_value(one, name, dict(parts))
            if is_kernel(value) and value not in seen:
                seen.add(value)
                todo.append(value)


def in_child(work: Callable[[], Any], seconds: int) -> Any:
    """What `work` gives in a process of its own; None where it uses more of the processor's time, or dies.

    Raises:
        RuntimeError: what it raised.
    """
    reader, writer = os.pipe()
    child = os.fork()
    if not child:
        os.setsid()
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
        os.close(reader)
        silence = os.open(os.devnull, os.O_RDWR)
        for stream in (0, 1, 2):
            os.dup2(silence, stream)
        with contextlib.suppress(BaseException), os.fdopen(writer, "w") as answer:
            try:
                json.dump(["gives", work()], answer)
            except Exception:
                json.dump(["raises", traceback.format_exc()], answer)
        os._exit(0)
    os.close(writer)
    with os.fdopen(reader, "rb") as told:
        data = told.read()  # until the child ends
    with contextlib.suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)  # and what it has started
    os.waitpid(child, 0)
    kind, value = json.loads(data) if data else ("gives", None)
    if kind == "raises":
        raise RuntimeError(value)
    return value


def run(items: list[Any], until: Callable[[], bool] = lambda: False) -> None:
    """Run tests one after another, until something is so."""
    for item, following in pairwise([*items, None]):
        assert item is not None
        item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
        if until():
            return


def found_soon(item: Any) -> None:
    """Have a property's test end with the first example that fails: how simple one could be says nothing here."""
    from hypothesis import Phase, settings  # pytest is to import it

    function, name = item.obj, "_hypothesis_internal_use_settings"
    if hasattr(function, "hypothesis"):
        usual = getattr(function, name, None) or settings.default
        setattr(function, name, settings(usual, phases=(Phase.explicit, Phase.generate), report_multiple_bugs=False))


class Mutating:
    """A plugin of pytest that judges mutants by the tests that were collected, in place of running these once."""

    def __init__(self, given: argparse.Namespace) -> None:
        self.given, self.code = given, 1
        self._failed = ""

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        items = {item.nodeid: item for item in session.items}
        for item in session.items:
            found_soon(item)
        tests = reached(items)
        every = list(mutants(self.given.rooms))
        count = len(every) if self.given.all else min(self.given.count, len(every))
        drawn = every if self.given.all else random.Random(self.given.seed).sample(every, count)
        of = sha256(repr(self.given.rooms).encode()).hexdigest()[:8]
        kept = Kept(f"mutants-{of}-{'all' if self.given.all else self.given.seed}")
        again = {what for what, by in kept.rows() if by in ALIVE or ("::" in by and by not in tests)}
        done = {what: by for what, by in kept.rows() if not (self.given.left and what in again)}
        kept.replace([[one.what, done[one.what]] for one in drawn if one.what in done])
        end = time.monotonic() + self.given.seconds
        missing = (one for one in drawn if one.what not in done and time.monotonic() < end)
        rows = kept.filled(([one.what, self.judge(one, tests, items)] for one in missing), count)
        self.code = summary(rows, count, self.given.least)
        return True

    def pytest_runtest_logreport(self, report: Any) -> None:
        if report.failed and not self._failed:
            self._failed = report.nodeid

    def judge(self, mutant: Mutant, tests: dict[str, Any], items: dict[str, Any]) -> str:
        """The test that notices a mutant; one of `ALIVE` if none does."""
        names = tests_for(mutant, tests)

        def work() -> str:
            put_in_place(mutant)
            try:
                compile_changed()
            except Exception as error:  # of what tells contents apart
                return f"compiling raises {error!r}"
            run([items[name] for name in names], until=lambda: bool(self._failed))
            return self._failed or "survives"

        by = (in_child(work, PATIENCE) or "does not end, or dies") if names else "no test"
        print(f"{by} ← {mutant.what}", flush=True)
        return by


def reached(items: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """Test → what it reaches; of test files that have changed, found anew."""
    REACHED.mkdir(parents=True, exist_ok=True)
    parsed()  # once for all children
    rows: dict[str, Any] = {}
    for file in sorted({name.partition("::")[0] for name in items}):
        kept = REACHED / f"{file.replace('/', '-')}-{sha256((ROOT / file).read_bytes()).hexdigest()[:16]}.json"
        if not kept.is_file():
            own, start = [item for name, item in items.items() if name.partition("::")[0] == file], time.monotonic()

            def work(own: list[Any] = own) -> Any:
                recorder = Recorder()
                own[0].config.pluginmanager.register(recorder)
                run(own)
                return recorder.finished()

            found = in_child(work, 1200) or {}
            print(f"{file}: {len(found)} tests in {time.monotonic() - start:.0f} s", flush=True)
            kept.write_text(json.dumps(found), encoding="utf-8")
        rows |= json.loads(kept.read_text(encoding="utf-8"))
    return {name: row for name, row in rows.items() if name in items and row.get("passed")}


def runs(mutant: Mutant, row: dict[str, Any]) -> int | None:
    """0 if a test runs what is changed as Python, 1 if it does in compiled code; a module's number is in all of it."""
    key, (first, last) = f"{mutant.path}:{mutant.function}", mutant.lines
    if not mutant.function:
        return next(
            (i for i, kind in enumerate(("plain", "compiled")) if any(x.startswith(key) for x in row[kind])), None
        )
    if int(row["plain"].get(key, "0"), 16) >> first & (1 << last - first + 1) - 1:
        return 0
    return 1 if key in row["compiled"] else None


def tests_for(mutant: Mutant, tests: dict[str, dict[str, Any]]) -> list[str]:
    """The tests that run what is changed.

    Those first that run it as Python, which waits for no compiler, and of these the quick ones that run little beside
    it; of one that has many cases the further ones wait for others as if they took longer.
    """
    chosen, cases = [], Counter[str]()
    for name, row in sorted(tests.items(), key=lambda item: item[1]["time"]):
        if (compiled := runs(mutant, row)) is not None:
            cases[name.partition("[")[0]] += 1
            rank, reach = cases[name.partition("[")[0]] // CASES, len(row["plain"]) + len(row["compiled"])
            chosen.append((compiled, reach * (0.1 + row["time"]) * (1.0 + rank), row["time"], name))
    total, names, files = 0.0, [], set[str]()
    for compiled, _, cost, name in sorted(chosen):
        total += cost + COMPILING * (compiled and name.partition("::")[0] not in files)
        files.add(name.partition("::")[0])
        if not names or total < BUDGET:
            names.append(name)
    return names


def summary(rows: list[list[str]], wanted: int, least: float) -> int:
    known = dict(tomllib.loads(EQUIVALENT.read_text(encoding="utf-8"))["rows"])
    left = [what for what, by in rows if by in ALIVE and what not in known]
    judged = Counter(what.split("/")[0] for what, _ in rows if what not in known)
    for what in left:
        print("survives:", what)
    for room, number in sorted(judged.items()):
        print(f"{room}: {number - sum(what.startswith(f'{room}/') for what in left)} of {number} killed")
    whole = sum(judged.values())
    print(f"{len(rows)} of {wanted}: {whole - len(left)} of {whole} killed, {len(rows) - whole} change nothing")
    return 1 if whole - len(left) < least * whole or len(rows) < wanted else 0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("count", nargs="?", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--rooms", nargs="*", default=[], help="folders or files of the package; all, if none is named")
    parser.add_argument("--tests", nargs="*", default=["tests", "src"], help="all, and doctests, if none is named")
    parser.add_argument("--all", action="store_true", help="every mutant of the rooms")
    parser.add_argument("--left", action="store_true", help="judge again what survived")
    parser.add_argument("--least", type=float, default=1.0, help="share that is to be killed")
    parser.add_argument("--seconds", type=float, default=float("inf"), help="after which no further one is begun")
    given = parser.parse_args()
    FOLDER.mkdir(parents=True, exist_ok=True)
    os.chdir(ROOT)
    watch_compiled()
    plugin = Mutating(given)
    options = ["-q", "-s", "-p", "no:xdist", "-p", "no:cacheprovider", "-m", "not live and not long and not browser"]
    pytest.main([*options, *given.tests], plugins=[plugin])
    return plugin.code


if __name__ == "__main__":
    raise SystemExit(main())
