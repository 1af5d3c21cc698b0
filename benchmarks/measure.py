"""Timing by turns, the machine's description, and the table of results."""

import gc
import platform
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np


@dataclass(frozen=True)
class Timing:
    """Seconds of one task in every round, in order."""

    seconds: tuple[float, ...]

    @property
    def median(self) -> float:
        return float(np.median(self.seconds))

    def over(self, other: "Timing") -> "Ratio":
        """How many times as long this takes, round by round."""
        return Ratio(tuple(a / b for a, b in zip(self.seconds, other.seconds, strict=True)))

    def __str__(self) -> str:
        return f"{_time(self.median)} ({_time(min(self.seconds))} … {_time(max(self.seconds))})"


@dataclass(frozen=True)
class Ratio:
    """Ratios of two tasks' times, one a round."""

    values: tuple[float, ...]

    @property
    def median(self) -> float:
        return float(np.median(self.values))

    def __str__(self) -> str:
        low, high = np.quantile(self.values, (0.25, 0.75))
        return f"{_number(self.median)} ({_number(low)} … {_number(high)})"


@dataclass(frozen=True)
class Row:
    """One comparison."""

    what: str
    ours: object
    """What ours took: a timing or a text, printed as it stands."""
    peer: object
    ratio: object
    unit: str
    """What the ratio is, such as ``× C``."""
    target: str


@dataclass(frozen=True)
class Figure:
    """One figure that has no peer."""

    what: str
    found: str
    target: str
    held: bool = True
    """Whether the target is met; `make soak` fails where one is not."""


def by_turns(rounds: int, **tasks: Callable[[], object]) -> dict[str, Timing]:
    """Time every task once in each round, A B C A B C …, so that a slow spell of the machine meets all of them.

    It is the process's time on the processor that counts: what else runs on the machine is not in it.
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


def machine() -> list[str]:
    """What this runs on, a line each; no host names."""
    cpu = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    lines = cpuinfo.read_text(encoding="utf-8").splitlines() if cpuinfo.is_file() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    parts = ", ".join(f"{name} {version(name)}" for name in ("numpy", "numba", "scipy", "control", "pygad"))
    return [
        f"Processor: {names[0] if names else cpu} ({platform.machine()}), {len(names) or '?'} in sight",
        f"Software: {platform.system()}, Python {platform.python_version()}, {parts}",
    ]


def table(rows: list[Row] | list[Figure]) -> str:
    """The rows as a Markdown table."""
    if isinstance(rows[0], Figure):
        lines = [f"| {f.what} | {f.found} | {f.target} |" for f in rows if isinstance(f, Figure)]
        return "\n".join(["| what | found | target |", "|---|---|---|", *lines])
    head = ["| what | bowden | peer | ratio | target |", "|---|---|---|---|---|"]
    return "\n".join(
        [
            *head,
            *(
                f"| {r.what} | {r.ours} | {r.peer} | {r.ratio} {r.unit} | {r.target} |"
                for r in rows
                if isinstance(r, Row)
            ),
        ]
    )


def _number(value: float) -> str:
    return f"{value:.2f}" if value < 10.0 else f"{value:.0f}"


def _time(seconds: float) -> str:
    return f"{seconds * 1e3:.2f} ms" if seconds < 0.1 else f"{seconds:.2f} s"
