"""Mutation testing of the kernels outside safety/: do the tests notice a small change of a model, a law or a filter?

    python benchmarks/kernel_mutants.py [COUNT] [--seed N] [--seconds S]

Draws so many changes as `safety_mutants` makes them, writes each into a copy of the package, and calls the test files
that name the kernel or its module, the likeliest first, until one fails.
"""

import argparse
import ast
import importlib
import inspect
import os
import pkgutil
import random
import re
import shutil
import subprocess
import sys
import tempfile
import textwrap
import time
from collections.abc import Iterator
from pathlib import Path
from types import FunctionType

import bowden
from safety_mutants import ROOT, changes

ROOMS = ("models", "control", "plants", "cycle", "sensing")
MOST_FILES, PATIENCE = 3, 120.0
"""Test files that are called for one mutant, and for how long [s]."""
UNJUDGED = "tests that take too long"


def kernels() -> Iterator[FunctionType]:
    """Every kernel of the rooms."""
    for room in ROOMS:
        package = importlib.import_module(f"bowden.{room}")
        for found in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            module = importlib.import_module(found.name)
            for value in vars(module).values():
                if getattr(value, "__kernel__", False) and value.__module__ == module.__name__:
                    yield value


def mutants(kernel: FunctionType) -> Iterator[tuple[str, str]]:
    """What each change of a kernel is, and the kernel's source with it; annotations and docstrings stay."""
    lines, _ = inspect.getsourcelines(kernel)
    text = textwrap.dedent("".join(lines))
    whole = ast.parse(text)
    hints = [getattr(node, name, None) for node in ast.walk(whole) for name in ("annotation", "returns")]
    typed = {node for hint in hints if hint for node in ast.walk(hint)}
    for i, node in enumerate(ast.walk(whole)):
        if getattr(node, "lineno", 0) <= 1 or isinstance(node, ast.Name) or node in typed:
            continue
        for what, change in changes(node, inspect.get_annotations(kernel)):
            tree = ast.parse(text)
            change(list(ast.walk(tree))[i])
            where = f"{Path(kernel.__code__.co_filename).name}: {kernel.__name__}"
            line = text.splitlines()[node.lineno - 1].strip()  # type: ignore[attr-defined]
            yield f"{where}: {what} at {node.col_offset} of `{line}`", ast.unparse(tree)  # type: ignore[attr-defined]


def drawn(count: int, seed: int) -> list[tuple[FunctionType, str, str]]:
    """So many mutants, each as likely as any other."""
    every = [(kernel, what, text) for kernel in kernels() for what, text in mutants(kernel)]
    return random.Random(seed).sample(every, count)


def tests_of(kernel: FunctionType) -> list[str]:
    """The test files that name the kernel or its module: those of its room first, then those that name them most."""
    _, room, *_, module = kernel.__module__.split(".")
    words = re.compile(rf"\b({kernel.__name__}|{module})\b")
    counts = {path: len(words.findall(path.read_text(encoding="utf-8"))) for path in ROOT.glob("tests/test_*.py")}
    found = [path for path, number in counts.items() if number]
    return [str(path) for path in sorted(found, key=lambda path: (room not in path.name, -counts[path]))[:MOST_FILES]]


def killed(kernel: FunctionType, text: str, copy: Path) -> str:
    """The test that notices a mutant, or nothing."""
    file = copy / Path(kernel.__code__.co_filename).relative_to(Path(bowden.__file__).parents[1])
    before = file.read_text(encoding="utf-8")
    lines, first = inspect.getsourcelines(kernel)
    rows = before.splitlines(keepends=True)
    file.write_text("".join([*rows[: first - 1], f"{text}\n", *rows[first - 1 + len(lines) :]]), encoding="utf-8")
    command = [sys.executable, "-m", "pytest", "-xq", "-p", "no:xdist", "-p", "no:cacheprovider"]
    environment = os.environ | {"PYTHONPATH": str(copy), "PYTHONDONTWRITEBYTECODE": "1"}
    try:
        done = subprocess.run(
            [*command, "-m", "not live and not long", *tests_of(kernel)],
            cwd=ROOT,
            env=environment,
            capture_output=True,
            text=True,
            timeout=PATIENCE,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return UNJUDGED
    finally:
        file.write_text(before, encoding="utf-8")
    failed = re.search(r"^(?:FAILED|ERROR) (\S+)", done.stdout, re.MULTILINE)
    return failed[1] if failed else "" if done.returncode == 0 else "an error"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("count", nargs="?", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=float("inf"), help="how long, at most")
    given = parser.parse_args()
    end, said = time.monotonic() + given.seconds, []
    with tempfile.TemporaryDirectory(prefix="bowden-mutants-") as folder:
        copy = Path(folder) / "src"
        shutil.copytree(Path(bowden.__file__).parents[1], copy, ignore=shutil.ignore_patterns("__pycache__"))
        for kernel, what, text in drawn(given.count, given.seed):
            if time.monotonic() > end:
                break
            by = killed(kernel, text, copy)
            said.append({"": "survives", UNJUDGED: "is not judged"}.get(by, "is killed"))
            print(f"{said[-1]}: {what} {by and f'← {by}'}", flush=True)
    print(f"{len(said)} of {given.count} mutants: {', '.join(f'{said.count(one)} {one}' for one in sorted(set(said)))}")
    return "survives" in said


if __name__ == "__main__":
    sys.exit(main())
