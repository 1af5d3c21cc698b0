"""The whole fault matrix: every fault at 5 moments with 100 seeds and two laws, every two, and inputs of every kind."""

import itertools
import tempfile
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from bowden.control import LAWS
from bowden.plants.presets.bench import default_bench
from bowden.sim.injected import Injected
from kept import Kept
from measure import Figure, Found
from support import family_matrix
from support.adversary import attack
from support.fault_matrix import MEASURED, ROWS, begins, complaints, pair_complaints, run_row

LAW_NAMES, ONSETS, SEEDS, PAIR_SEEDS = ("adaptive", "bowden"), 5, 100, 5
CYCLES, PIECES = 10_000_000, 10


def singles(seeds: int, done: int) -> Iterator[list[Any]]:
    """[law, fault, seed, onset, cycles from its beginning and its showing to R2 or R3, to power off, if, wrong]."""
    bench = default_bench()
    todo = itertools.product(LAW_NAMES, ROWS, range(seeds), range(ONSETS))
    for law, kind, seed, onset in itertools.islice(todo, done, None):
        out = run_row(bench, LAWS[law], (kind,), seed, onset)
        since = out.shown if out.shown >= 0.0 else out.released
        wrong = "; ".join(complaints(kind, out))
        gone = out.released - round(1000.0 * begins((kind,), seed, onset)[0])
        yield [law, kind.name, seed, onset, gone, out.released - since, out.off - since, out.released >= 0.0, wrong]


def pairs(seeds: int, done: int) -> Iterator[list[Any]]:
    bench = default_bench()
    todo = itertools.product(LAW_NAMES, itertools.permutations(ROWS, 2), range(seeds))
    for law, kinds, seed in itertools.islice(todo, done, None):
        out = run_row(bench, LAWS[law], kinds, seed, 0)
        yield [law, *(kind.name for kind in kinds), seed, "; ".join(pair_complaints(kinds, seed, 0, out))]


def attacks(cycles: int, done: int) -> Iterator[list[Any]]:
    for seed in range(done, PIECES):
        yield [seed, *attack(MEASURED, cycles, seed)]


def of_devices(
    cases: Iterable[tuple[str, Any]], react: Callable[[Path, str, Any], Any]
) -> list[tuple[Any, Any, list[str]]]:
    """Each family of drives, or kind of load cell, with each of its faults: the row, what came of it, what is wrong."""
    found = []
    for name, row in cases:
        with tempfile.TemporaryDirectory() as folder:
            out = react(Path(folder), name, row)
            found.append((row, out, [*family_matrix.complaints(row, out)]))
            if found[-1][2]:
                print("wrong:", name, row.text, *found[-1][2])
    return found


def figures(share: float) -> Found:
    """What was wrong, and a table of the faults."""
    assert set(ROWS) == set(Injected) - {Injected.NOTHING}
    seeds, pair_seeds = max(1, round(share * SEEDS)), max(1, round(share * PAIR_SEEDS))
    kept = Kept(f"faults_{seeds}")
    ones = kept.filled(singles(seeds, len(kept.rows())), len(LAW_NAMES) * len(ROWS) * seeds * ONSETS)
    kept = Kept(f"pairs_{pair_seeds}")
    twos = kept.filled(pairs(pair_seeds, len(kept.rows())), len(LAW_NAMES) * len(ROWS) * (len(ROWS) - 1) * pair_seeds)
    kept, cycles = Kept(f"attacks_{share:g}"), round(share * CYCLES / PIECES)
    pieces = kept.filled(attacks(cycles, len(kept.rows())), PIECES)
    violations, powered, led = (sum(row[i] for row in pieces) for i in (1, 2, 3))
    for row in ([row for row in ones if row[-1]] + [row for row in twos if row[-1]])[:20]:
        print("wrong:", *row)
    wrong_ones, wrong_twos = (sum(bool(row[-1]) for row in rows) for rows in (ones, twos))
    blind = sum(not row[-2] for row in ones if max(ROWS[Injected[row[1]]].reactions) > 1)
    drives = of_devices(family_matrix.cases(), family_matrix.react)
    loads = of_devices(family_matrix.load_cases(), family_matrix.react_load)
    bad, odd = (sum(bool(said) for _, _, said in found) for found in (drives, loads))
    inert = max(found.after for row, found, _ in drives if row.text == "inert")
    return Found(
        [
            Figure(f"a drive's fault, {len(drives)} runs: too late, or torque left", str(bad), "0", not bad),
            Figure("of these, an inert motor, the latest [ms]", f"{inert:.0f}", "≤ 50", inert <= 50.0),
            Figure(f"a load cell's fault, {len(loads)} runs: wrong reaction, or too late", str(odd), "0", not odd),
            Figure(f"one fault, {len(ones)} runs: wrong reaction, or too late", str(wrong_ones), "0", not wrong_ones),
            Figure("of these, with a fault without a visible effect", str(blind), "–"),
            Figure(f"two faults, {len(twos)} runs: wrong end, or R3 too late", str(wrong_twos), "0", not wrong_twos),
            Figure(f"targets beyond limit or rate, {PIECES * cycles} inputs", str(violations), "0", not violations),
            Figure("of these inputs, with power; with the law in charge", f"{powered}; {led}", "–"),
        ],
        "Times in ms, from the fault's beginning, and from its first visible effect.",
        COLUMNS,
        [_kind(kind.name, [row for row in ones if row[1] == kind.name]) for kind in ROWS],
    )


COLUMNS = (
    *("injected", "runs", "wrong", "stopped", "R2 or R3 after it begins [ms]: median", "worst", "after it shows"),
    *("worst", "power off, worst"),
)


def _kind(name: str, rows: list[list[Any]]) -> list[Any]:
    """A row of the table."""
    stopped = np.array([row[4:7] for row in rows if row[7]])
    times: list[Any] = ["–"] * 5
    if len(stopped):
        (begun, shown, _), worst = np.median(stopped, axis=0), stopped.max(axis=0)
        times = [round(float(one)) for one in (begun, worst[0], shown, worst[1], worst[2])]
    return [name, len(rows), sum(bool(row[-1]) for row in rows), len(stopped), *times]
