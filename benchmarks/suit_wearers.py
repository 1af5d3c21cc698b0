"""The compensated suit on 500 random wearers that nobody tuned it for: is it ever unstable, how far off is the elbow?

Ours and the adaptive law, both with gains for the suit, on a drive whose position loop has an integral and that pushes
against friction.
"""

import multiprocessing
import signal
from collections.abc import Iterator
from typing import Any

import numpy as np

from bowden.control.law import Law
from bowden.plants.presets.suit import suit
from bowden.plants.suit_parts import Suit
from bowden.sim.suit_runs import DRIVE_INTEGRAL, FRICTION_FEEDFORWARD, suit_adaptive_integral, suit_ours
from kept import Kept
from measure import Figure
from wearers import Worn, wear

COUNT, PROCESSES, CHUNK, BAND = 500, 2, 5, 5.0
_SHARES = (50.0, 90.0, 99.0, 100.0)


def worn_suit() -> Suit:
    """The paper's suit with an integral in its drive, which pushes against friction alike for every wearer."""
    made = suit()
    return made._replace(motor=made.motor._replace(integral=DRIVE_INTEGRAL, friction_feedforward=FRICTION_FEEDFORWARD))


def figures(count: int = COUNT) -> tuple[list[Figure], list[str]]:
    """How many runs are unstable, how many stay within 5°, and the percentiles and the worst of the errors."""
    found: list[Figure] = []
    notes = ["Wearers and sheaths: `wearers.py`; four flexions 0–90° of 25 s, the first two to learn in."]
    for law in (suit_ours(), suit_adaptive_integral()):
        kept = Kept(f"suit_wearers_{law.name}")
        there = {row[0] for row in kept.rows()}
        missing = [number for number in range(count) if number not in there]
        rows = [Worn(*row) for row in kept.filled(_runs(law, missing), count) if row[0] < count]
        stable = [row for row in rows if row.stable]
        within = sum(row.largest_deg <= BAND for row in stable)
        worst = max(stable, key=lambda row: row.largest_deg)
        found += [
            Figure(f"{law.name}: unstable", f"{len(rows) - len(stable)} of {len(rows)}", "0"),
            Figure(f"{law.name}: within ±5° in the third and fourth flexion", f"{within} of {len(rows)}", "all"),
            Figure(f"{law.name}: largest error there", _percentiles([row.largest_deg for row in stable]), "5°"),
            Figure(f"{law.name}: largest error while learning", _percentiles([r.learning_deg for r in stable]), "–"),
        ]
        notes.append(f"{law.name}: the worst is number {worst.number}, {worst.mass:.0f} kg, {worst.kind}.")
    return found, notes


def _runs(law: Law, numbers: list[int]) -> Iterator[list[Any]]:
    """Each wearer's outcome is its number's alone, so that neither the order nor the processes matter."""
    if not numbers:
        return
    yield _run((law.name, numbers[0]))  # compiled once, before there are two processes that would
    with multiprocessing.get_context("spawn").Pool(PROCESSES, _ignore_interrupts) as pool:
        yield from pool.imap_unordered(_run, [(law.name, number) for number in numbers[1:]], CHUNK)


def _run(task: tuple[str, int]) -> list[Any]:
    name, number = task
    law = next(law for law in (suit_ours(), suit_adaptive_integral()) if law.name == name)
    return list(wear(number, worn_suit(), law))


def _ignore_interrupts() -> None:
    """Ctrl-C is for the process that keeps the results."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _percentiles(values: list[float]) -> str:
    found = np.percentile(values, _SHARES)
    named = ("median", "90 %", "99 %", "largest")
    return ", ".join(f"{name} {value:.2f}°" for name, value in zip(named, found, strict=True))
