"""What many closed loops cost: runs a second on one core and on two, against runs and simulated time, and memory."""

import itertools
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from bowden.study.load import load
from bowden.study.pack import rows, warm
from bowden.study.rows import chunks
from bowden.study.study import Study
from bowden.study.workers import in_processes
from measure import Figure

STUDY = """
laws = ["adaptive"]
runs = 1000000
duration_s = {duration}
[vary]
"servo.natural_frequency_hz" = {{ log_uniform = [4, 20] }}
"bench.delay_cycles" = {{ integer = [0, 2] }}
"cable.slope" = {{ uniform = [0.7, 1.2] }}
"control.gains.feedback_gain" = {{ log_uniform = [5, 40] }}
"""
RUNS, CHUNKS, ROUNDS = 480, 24, 5
MEMORY = """
import resource, sys
from pathlib import Path
from bowden.study.load import load
from bowden.study.pack import rows
study = load(Path(sys.argv[1]))
for first in range(0, int(sys.argv[2]), 50):
    rows(study, range(first, first + 50))
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0)
"""


def figures(count: int = RUNS) -> tuple[list[Figure], list[str]]:
    """Throughput, slopes and memory."""
    with tempfile.TemporaryDirectory() as folder:
        minute, second = (_study(Path(folder), duration) for duration in (60.0, 1.0))
        warm(minute)
        rates = [[_rate(minute, count, workers) for workers in (1, 2)] for _ in range(ROUNDS)]
        one, two = (np.median([rate[i] for rate in rates]) for i in (0, 1))
        ratios = [rate[1] / rate[0] for rate in rates]
        ratio = float(np.median(ratios))
        cut = chunks(minute)
        by_runs = _slope([1, 2, 4], lambda n: [rows(minute, numbers) for numbers in cut[: int(n)]])
        lengths = [_study(Path(folder), duration) for duration in (60.0, 120.0, 240.0, 480.0)]
        many = range(max(1, count // 40))
        by_time = _slope([s.duration for s in lengths], lambda t: rows(_of(lengths, t), many))
        few, most = (_memory(second, n) for n in (max(50, count // 2), 10 * count))
    return [
        Figure("a minute of the adaptive loop at 1 kHz, one process", f"{1e3 / one:.2f} ms a run", "–"),
        Figure("100 000 of them, two processes", f"{1e5 / two / 60.0:.0f} min", "–"),
        Figure(
            "runs a second on two processes over one",
            f"{ratio:.2f} ({min(ratios):.2f} … {max(ratios):.2f})",
            "≥ 1.9 on a quiet machine",
            ratio >= 1.9,
        ),
        Figure("slope of log cost over log runs", f"{by_runs:.3f}", "1.00 ± 0.03", _near_one(by_runs)),
        Figure(
            "slope of log cost over log simulated time", f"{by_time:.3f}", "1.00 ± 0.03", abs(by_time - 1.0) <= 0.03
        ),
        Figure(
            f"peak memory of {10 * count} runs over that of {max(50, count // 2)}",
            f"{most:.0f} MB over {few:.0f} MB",
            "the same within 5 %",
            most <= 1.05 * few,
        ),
    ], [
        f"{count} plants with varied servo, delay, slope and gain, drawn, put together, run and made into rows; "
        f"runs a second are by the clock, from the first finished chunks to the last, medians of {ROUNDS} rounds in "
        "which one and two processes take turns (smallest … largest). Slopes: of processor time, the least of five; "
        f"over runs in a campaign's own chunks, {len(cut[0])} to {4 * len(cut[0])} runs.",
    ]


def _near_one(slope: float) -> bool:
    return abs(slope - 1.0) <= 0.03


def _study(folder: Path, duration: float) -> Study:
    path = folder / f"{duration:g}.toml"
    path.write_text(STUDY.format(duration=duration), encoding="utf-8")
    return load(path)


def _of(studies: list[Study], duration: float) -> Study:
    return next(study for study in studies if study.duration == duration)


def _rate(study: Study, count: int, workers: int) -> float:
    """Runs a second of processes at work: what they take to start is not in it."""
    edges = np.linspace(0, count, CHUNKS + 1).astype(int).tolist()
    work = [(i, range(a, b)) for i, (a, b) in enumerate(itertools.pairwise(edges))]
    times, done = [], []
    for chunk, _ in in_processes(study, work, workers):
        times.append(time.perf_counter())
        done.append(len(work[chunk][1]))
    return sum(done[workers:]) / (times[-1] - times[workers - 1])


def _slope(sizes: list[float] | list[int], task: Callable[[float], object]) -> float:
    """Of the logarithm of the processor time over that of the size."""
    taken = [[] for _ in sizes]  # type: list[list[float]]
    for _ in range(5):
        for size, seconds in zip(sizes, taken, strict=True):
            begin = time.process_time()
            task(size)
            seconds.append(time.process_time() - begin)
    return float(np.polyfit(np.log(sizes), np.log([min(seconds) for seconds in taken]), 1)[0])


def _memory(study: Study, count: int) -> float:
    """Largest resident memory of a process that computes so many runs [MB]."""
    command = [sys.executable, "-c", MEMORY, str(study.path), str(count)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return float(done.stdout)
