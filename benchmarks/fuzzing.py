"""A million inputs that nobody would write, for everything that reads what others wrote.

Each target of ``tests/support/fuzz.py`` gets its share of them, in pieces, each in a process of its own: an input that
ends its process is found by the piece that has no end. What breaks is named by its number; ``fuzz.changed(target,
number)`` makes it again, and it belongs into ``tests/data/fuzz/TARGET``.

    python benchmarks/fuzzing.py TARGET FIRST COUNT
"""

import itertools
import json
import logging
import resource
import subprocess
import sys
import time
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).parents[1] / "tests"))  # where the targets are

from kept import Kept
from measure import Figure, Found
from support import fuzz

COUNT, PIECE = 1_000_000, 5000
_MB = 1 << 20


def pieces(share: float) -> list[tuple[str, int, int]]:
    """Target, number of the first input, and how many; all targets by turns."""
    found = []
    for name, target in fuzz.TARGETS.items():
        count = max(1, round(share * COUNT * target.share))
        found += [(name, first, min(PIECE, count - first)) for first in range(0, count, PIECE)]
    return sorted(found, key=lambda piece: piece[1])


def tried(share: float, done: int) -> Iterator[list[Any]]:
    """[target, first, count, taken, what broke it, longest of an input [s], memory [bytes], seconds]."""
    for name, first, count in itertools.islice(pieces(share), done, None):
        words = [sys.executable, __file__, name, str(first), str(count)]
        ended = subprocess.run(words, capture_output=True, text=True)
        try:
            yield json.loads(ended.stdout.splitlines()[-1])
        except (IndexError, ValueError):
            yield [name, first, count, 0, [f"{name} {first}…: exit code {ended.returncode}"], 0.0, 0, 0.0]


def piece(name: str, first: int, count: int) -> list[Any]:
    warnings.simplefilter("ignore")
    logging.disable()
    target, taken, broken, longest, began = fuzz.TARGETS[name], 0, [], 0.0, time.perf_counter()
    with fuzz.watched():
        for number in range(first, first + count):
            data, start = fuzz.changed(name, number), time.perf_counter()
            try:
                taken += fuzz.tried(target, data)
            except Exception as error:
                broken.append(f"{name} {number}: {type(error).__name__}: {' '.join(str(error).split())[:200]}")
            longest = max(longest, time.perf_counter() - start)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss << 10
    return [name, first, count, taken, broken, longest, memory, time.perf_counter() - began]


def figures(share: float) -> Found:
    """What broke, and the targets."""
    kept = Kept(f"fuzzing_{share:g}")
    rows = kept.filled(tried(share, len(kept.rows())), len(pieces(share)))
    broken = [one for row in rows for one in row[4]]
    for one in broken[:20]:
        print("broken:", one)
    columns = ("target", "inputs", "taken, not refused", "broken", "longest [s]", "memory [MB]", "ms an input")
    targets = []
    for name in fuzz.TARGETS:
        _, _, counts, taken, wrong, longest, memory, took = zip(*(row for row in rows if row[0] == name), strict=True)
        inputs, cost = sum(counts), 1e3 * sum(took) / sum(counts)
        broke = sum(map(len, wrong))
        targets.append((name, inputs, sum(taken), broke, round(max(longest), 2), max(memory) // _MB, round(cost, 2)))
    most, memory, bound = max(row[5] for row in rows), max(row[6] for row in rows), fuzz.MOST_MEMORY
    return Found(
        [
            Figure(f"inputs that broke, of {sum(row[2] for row in rows)}", str(len(broken)), "0", not broken),
            Figure("longest of an input [s]", f"{most:.2f}", f"{fuzz.LONGEST}", most <= fuzz.LONGEST),
            Figure("memory [MB]", f"{memory // _MB}", f"{bound // _MB}", memory <= bound),
        ],
        columns=columns,
        rows=targets,
    )


if __name__ == "__main__":
    print(json.dumps(piece(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))))
