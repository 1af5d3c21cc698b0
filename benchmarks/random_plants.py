"""Our law on 10 000 random plants that nobody tuned it for: is it ever unstable, and how large are its errors?"""

import multiprocessing
import signal
from collections.abc import Iterator
from typing import Any

import numpy as np

from bowden.control import LAWS
from drawn_plants import run_random_plant, run_random_plants
from kept import Kept
from measure import Figure

COUNT, PROCESSES, CHUNK = 10_000, 2, 20
_SHARES = (50.0, 90.0, 99.0, 100.0)


def figures(count: int = COUNT) -> tuple[list[Figure], list[str]]:
    """How many runs are unstable, and percentiles of the others' errors."""
    kept = Kept("random_plants")
    there = {row[0] for row in kept.rows()}
    rows = kept.filled(_runs([number for number in range(count) if number not in there]), count)
    ours = [row for row in rows if row[0] < count]
    stable = [row for row in ours if row[1]]
    unstable = sorted(row[0] for row in ours if not row[1])
    return [
        Figure("unstable", f"{len(unstable)} of {len(ours)}", "0"),
        Figure("RMSE from rest, 40 s", _percentiles([row[2] for row in stable]), "–"),
        Figure("peak error", _percentiles([row[3] for row in stable]), "–"),
    ], [
        "Plants: servo 2–20 Hz, of which the law knows the frequency to ± 20 %, delay 0–3 ms, slope 0.6–1.2, dead zone "
        "0–15°, both drifting, encoders of 0.02–0.2°, load lag up to 30 ms (`drawn_plants.py`)."
        + (f" Unstable: {', '.join(map(str, unstable[:20]))}." if unstable else "")
    ]


def _runs(numbers: list[int]) -> Iterator[list[Any]]:
    """Each plant's outcome is its number's alone, so that neither the order nor the processes matter."""
    if not numbers:
        return
    run_random_plant(LAWS["bowden"], numbers[0], 1.0)  # compiled once, before there are two processes that would
    with multiprocessing.get_context("spawn").Pool(PROCESSES, _ignore_interrupts) as pool:
        parts = [numbers[i : i + CHUNK] for i in range(0, len(numbers), CHUNK)]
        for found in pool.imap_unordered(_run, parts):
            yield from found


def _run(numbers: list[int]) -> list[list[Any]]:
    return [list(outcome) for outcome in run_random_plants(LAWS["bowden"], numbers)]


def _ignore_interrupts() -> None:
    """Ctrl-C is for the process that keeps the results."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _percentiles(values: list[float]) -> str:
    found = np.percentile(values, _SHARES)
    named = ("median", "90 %", "99 %", "largest")
    return ", ".join(f"{name} {value:.2f}°" for name, value in zip(named, found, strict=True))
