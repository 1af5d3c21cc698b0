"""Timing by turns, figures with targets, and the result files of which `make docs` makes tables."""

import gc
import json
import multiprocessing
import platform
import signal
import subprocess
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from bowden.core.files import whole_file

RESULTS = Path(__file__).parent / "results"


@dataclass(frozen=True)
class Timing:
    """Seconds of one task in every round, in order; or the ratios of two tasks."""

    seconds: tuple[float, ...]
    unit: str = "s"

    @property
    def median(self) -> float:
        return float(np.median(self.seconds))

    def over(self, other: "Timing") -> "Timing":
        """How many times as long this takes, round by round."""
        return Timing(tuple(a / b for a, b in zip(self.seconds, other.seconds, strict=True)), "")

    def __str__(self) -> str:
        """The median and, of times, the extremes; of ratios, the middle half."""
        if self.unit:
            return f"{_time(self.median)} ({_time(min(self.seconds))} … {_time(max(self.seconds))})"
        low, high = np.quantile(self.seconds, (0.25, 0.75))
        return f"{_number(self.median)} ({_number(low)} … {_number(high)})"


class Row(NamedTuple):
    """One comparison with a peer."""

    what: str
    ours: object
    peer: object
    ratio: str
    target: str


class Figure(NamedTuple):
    """One figure with its target."""

    what: str
    found: str
    target: str
    held: bool = True
    """Whether the target is met; `make soak` fails where one is not."""


class Found(NamedTuple):
    """What a part of `run.py` comes to."""

    figures: Sequence[Row | Figure]
    how: str = ""
    columns: Sequence[str] = ()
    """Of a further table; none without them."""
    rows: Sequence[Sequence[Any]] = ()


def by_turns(rounds: int, **tasks: Callable[[], object]) -> dict[str, Timing]:
    """Time every task once in each round, A B C A B C …, so that a slow spell of the machine meets all of them.

    The process's time on the processor counts, which excludes other programs.
    """
    seconds: dict[str, list[float]] = {name: [] for name in tasks}
    for task in tasks.values():
        task()  # compilation, caches and first pages are not what is compared
    gc.collect()
    gc.disable()
    try:
        for _ in range(rounds):
            for name, task in tasks.items():
                start = time.process_time()
                task()
                seconds[name].append(time.process_time() - start)
    finally:
        gc.enable()
    return {name: Timing(tuple(values)) for name, values in seconds.items()}


def two_processes(task: Callable[[Any], Any], items: Sequence[Any], chunk: int) -> Iterator[Any]:
    """`task` of every item, in two processes; the first one alone, so that kernels are compiled once."""
    if not items:
        return
    yield task(items[0])
    with multiprocessing.get_context("spawn").Pool(2, signal.signal, (signal.SIGINT, signal.SIG_IGN)) as pool:
        yield from pool.imap_unordered(task, items[1:], chunk)


def percentiles(values: Iterable[float]) -> str:
    """Median, 90 %, 99 % and largest of angles [deg]."""
    found = np.percentile(list(values), (50.0, 90.0, 99.0, 100.0))
    named = ("median", "90 %", "99 %", "largest")
    return ", ".join(f"{name} {value:.2f}°" for name, value in zip(named, found, strict=True))


def machine() -> str:
    """Processor and software; no host names."""
    cpuinfo = Path("/proc/cpuinfo")
    lines = cpuinfo.read_text(encoding="utf-8").splitlines() if cpuinfo.is_file() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")] or [platform.machine()]
    parts = ", ".join(f"{name} {version(name)}" for name in ("numpy", "numba", "scipy"))
    return f"{names[0]}, {len(names)} processors, {platform.system()}, Python {platform.python_version()}, {parts}."


def table(columns: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """Markdown."""
    lines = [f"| {' | '.join(map(str, row))} |" for row in (columns, *rows)]
    return "\n".join([lines[0], "|---" * len(columns) + "|", *lines[1:]])


def cells(figures: Sequence[Row | Figure]) -> tuple[list[str], list[list[str]]]:
    """Columns and rows of figures."""
    if isinstance(figures[0], Row):
        return ["what", "bowden", "peer", "ratio", "target"], [list(map(str, row)) for row in figures]
    return ["what", "found", "target"], [list(map(str, one[:3])) for one in figures]


def write_rows(
    name: str,
    what: str,
    command: str,
    columns: Sequence[str],
    rows: Iterable[Sequence[str | float]],
    how: str = "",
    folder: Path = RESULTS,
) -> None:
    """Write the rows of an experiment, of which `make docs` makes a table.

    Args:
        name: of the file, and of the table's markers on a page.
        what: the table's caption.
        command: that made the rows.
        columns: heads of the table.
        rows: cells.
        how: conditions, after the caption.
        folder: for the file.
    """
    asked = subprocess.run(["git", "rev-parse", "--short", "HEAD"], cwd=RESULTS, capture_output=True, text=True)
    given = {"what": what, "date": "", "commit": asked.stdout.strip(), "command": command, "how": how}
    lines = [f"{key} = {json.dumps(value, ensure_ascii=False)}" for key, value in given.items() if value]
    lines.insert(1, f"date = {time.strftime('%Y-%m-%d', time.gmtime())}")
    lines.append(f"columns = {json.dumps(list(columns), ensure_ascii=False)}")
    lines += ["rows = [", *(f"  {json.dumps(list(row), ensure_ascii=False)}," for row in rows), "]", ""]
    with whole_file(folder / f"{name}.toml") as part:
        part.write_text("\n".join(lines), encoding="utf-8")


def report(name: str, what: str, command: str, found: Found, write: bool) -> None:
    """Print what a part has found and, of a whole run, write its result files."""
    tables = {name: cells(found.figures)}
    if found.columns:
        tables[f"{name}_kinds"] = list(found.columns), [list(row) for row in found.rows]
    for title, (columns, rows) in tables.items():
        print(f"\n{table(columns, rows)}\n\n*{f'{what}. {found.how}'.strip()}*", flush=True)
        if write:
            write_rows(title, what, command, columns, rows, found.how)


def _number(value: float) -> str:
    return f"{value:.2f}" if value < 10.0 else f"{value:.0f}"


def _time(seconds: float) -> str:
    return f"{seconds * 1e3:.2f} ms" if seconds < 0.1 else f"{seconds:.2f} s"
