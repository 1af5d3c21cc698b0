"""Every attack of the tests' hostile Trigno server and LSL outlet, again and again: ``make soak PARTS=hostile``."""

from collections.abc import Iterator
from typing import Any

import test_hardware_hostile_emg as hostile
from bowden.hardware.emg.lsl_library import library
from kept import Kept
from measure import Figure

ROUNDS, BESIDE = 20, 8
"""How often each attack is tried, and how many side by side."""


def rounds(count: int, done: int) -> Iterator[list[Any]]:
    """[attacks that were tried, what was wrong with them in two tries]."""
    lsl = library()
    tables: list[tuple[dict[str, hostile.Row], Any]] = [
        (hostile.OUTLETS, lambda name, row: hostile.against_outlet(lsl, name, row)),
        (hostile.SERVERS, lambda name, row: hostile.against_server(row)),
    ]
    for _ in range(done, count):
        wrong: list[str] = []
        for rows, one in tables:
            for k in range(0, len(rows), BESIDE):
                once = hostile.at_once(rows, list(rows)[k : k + BESIDE], one)
                again = hostile.at_once(rows, once, one) if once else {}
                wrong += [f"{name}: {'; '.join(said)}" for name, said in again.items()]
        yield [sum(len(rows) for rows, _ in tables), " / ".join(wrong)]


def figures(share: float) -> tuple[list[Figure], str]:
    """How many attacks ended otherwise than their tables say."""
    count = max(1, round(share * ROUNDS))
    kept = Kept(f"hostile_{count}")
    done = kept.filled(rounds(count, len(kept.rows())), count)
    for row in done:
        if row[-1]:
            print("wrong:", row[-1])
    attacks, wrong = sum(row[0] for row in done), sum(row[1].count(" / ") + 1 for row in done if row[1])
    what = f"attacks of a Trigno server and of an LSL outlet, {attacks} tries: ended otherwise than their table says"
    return [Figure(what, f"{wrong}", "0", wrong == 0)], "- the tables are those of tests/test_hardware_hostile_emg.py."
