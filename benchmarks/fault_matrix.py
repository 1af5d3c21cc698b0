"""The whole fault matrix: every fault at 5 moments with 100 seeds and two laws, every two, and inputs of every kind.

    python benchmarks/fault_matrix.py [SEEDS]

What is done is kept in out/bench: interrupted, it goes on where it was left. Exit code 1 if anything is wrong.
"""

import itertools
import sys
from collections import Counter
from collections.abc import Iterator
from typing import Any

from bowden.control import LAWS
from bowden.paper.bench import default_bench
from bowden.sim.adversary import attack
from bowden.sim.fault_matrix import MEASURED, ROWS, complaints, pair_complaints, run_row
from bowden.sim.injected import Injected
from kept import Kept

LAW_NAMES, ONSETS, SEEDS, PAIR_SEEDS = ("adaptive", "bowden"), 5, 100, 5
CYCLES, PIECES = 10_000_000, 10


def singles(seeds: int, done: int) -> Iterator[list[Any]]:
    """[law, fault, seed, onset, cycles from its showing to R2 or R3, to power off, what is wrong]."""
    bench = default_bench()
    todo = itertools.product(LAW_NAMES, ROWS, range(seeds), range(ONSETS))
    for law, kind, seed, onset in itertools.islice(todo, done, None):
        out = run_row(bench, LAWS[law], (kind,), seed, onset)
        since = out.shown if out.shown >= 0.0 else out.released
        wrong = "; ".join(complaints(kind, out))
        yield [law, kind.name, seed, onset, out.released - since, out.off - since, out.released >= 0.0, wrong]


def pairs(seeds: int, done: int) -> Iterator[list[Any]]:
    bench = default_bench()
    todo = itertools.product(LAW_NAMES, itertools.permutations(ROWS, 2), range(seeds))
    for law, kinds, seed in itertools.islice(todo, done, None):
        out = run_row(bench, LAWS[law], kinds, seed, 0)
        yield [law, *(kind.name for kind in kinds), seed, "; ".join(pair_complaints(kinds, seed, 0, out))]


def attacks(done: int) -> Iterator[list[Any]]:
    for seed in range(done, PIECES):
        yield [seed, *attack(MEASURED, CYCLES // PIECES, seed)]


def main() -> int:
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else SEEDS
    kept = Kept(f"faults_{seeds}")
    rows = kept.filled(singles(seeds, len(kept.rows())), len(LAW_NAMES) * len(ROWS) * seeds * ONSETS)
    print(f"{'injected':18} runs  wrong  stopped  R2/R3 after [ms]: median, worst   power off, worst [ms]")
    for kind in ROWS:
        mine = [row for row in rows if row[1] == kind.name]
        after = sorted(row[4] for row in mine if row[6]) or [float("nan")]
        off = max((row[5] for row in mine if row[6]), default=float("nan"))
        print(
            f"{kind.name:18} {len(mine):4} {sum(bool(row[7]) for row in mine):6} {sum(row[6] for row in mine):8}"
            f"  {after[len(after) // 2]:12.0f} {after[-1]:8.0f} {off:24.0f}"
        )
    kept = Kept(f"pairs_{PAIR_SEEDS}")
    twos = kept.filled(pairs(PAIR_SEEDS, len(kept.rows())), len(LAW_NAMES) * len(ROWS) * (len(ROWS) - 1) * PAIR_SEEDS)
    print(f"every two: {len(twos)} runs, {sum(bool(row[-1]) for row in twos)} wrong")
    kept = Kept("attacks")
    pieces = kept.filled(attacks(len(kept.rows())), PIECES)
    violations, powered, led = (sum(row[i] for row in pieces) for i in (1, 2, 3))
    print(f"{CYCLES} inputs of every kind: {violations} violations; power in {powered} of the cycles, led in {led}")
    wrong = [row for row in rows if row[7]] + [row for row in twos if row[-1]]
    for row in wrong[:20]:
        print("wrong:", *row)
    print(Counter(row[1] for row in wrong) if wrong else "nothing is wrong")
    return 1 if wrong or violations else 0


if __name__ == "__main__":
    assert set(ROWS) == set(Injected) - {Injected.NOTHING}
    raise SystemExit(main())
