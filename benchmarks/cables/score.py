"""Identification against other methods, on the same splits of the same recordings.

Each method learns the joint from the motor on a part of a recording; errors are those on a second half that it has not
seen: of the same recording after its first half or its first two cycles alone, of another run of the same cable in the
same pose, at another frequency, under another load.

Needs scikit-learn and torch: ``pip install --editable '.[bench]'``.

    python benchmarks/cables/score.py                        # all methods, and their table
    python benchmarks/cables/score.py ours play              # some, beside what out/bench keeps of the others
    python benchmarks/cables/score.py --folder my/recordings
"""

import argparse
import importlib.util
import sys
import time as clock
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from bowden.core.units import DEGREES
from bowden.records.metrics import rmse

sys.path.append(str(Path(__file__).parents[1]))
from methods import METHODS, NEEDS
from recordings import SPLITS, Recording, Task, load, tasks

from kept import Kept
from measure import machine, table, write_rows

DATA = Path(__file__).parents[3] / "shared" / "data"
MOVED = SPLITS[2:]
"""Splits whose gain and offset are another log's: errors with both fitted anew are printed too."""
WHAT = (
    "Errors [° RMS] on second halves that a method has not seen: median (worst), and how often it is better than ours. "
    "Of another run, frequency or load: as it is; with gain and offset fitted anew"
)


def outcomes(name: str, recordings: dict[str, Recording], asked: list[Task]) -> Iterator[list[Any]]:
    """A row a task: errors as it is and with gain and offset anew [°], parameters, s to learn, µs a sample."""
    learn, known = METHODS[name][1], {}
    given = recordings if name == "ours" else {key: one.thinned() for key, one in recordings.items()}
    for task in asked:
        if (key := (task.learned, task.until)) not in known:
            begun = clock.process_time()
            known[key] = learn(given[task.learned].until(task.until)), clock.process_time() - begun
        learned, seconds = known[key]
        judged = given[task.judged]
        begun = clock.process_time()
        said = learned.predict(judged)
        step = 1e6 * (clock.process_time() - begun) / len(said)
        late = judged.time >= judged.half
        said, joint = said[late], judged.joint[late]
        anew = np.polyval(np.polyfit(said, joint, 1), said)
        errors = [round(rmse(one - joint) * DEGREES, 5) for one in (said, anew)]
        yield [*errors, learned.parameters, round(seconds, 4), round(step, 3)]


def cells(name: str, rows: dict[str, list[list[Any]]], asked: list[Task]) -> list[str]:
    """A row of the table."""
    mine = rows[name]
    found = [METHODS[name][0], f"{np.median([row[2] for row in mine]):.0f}"]
    found += [f"{np.median([row[column] for row in mine]):.2g}" for column in (3, 4)]
    for split in SPLITS:
        at = [k for k, task in enumerate(asked) if task.split == split]
        texts = []
        for column in (0, 1) if split in MOVED else (0,):
            errors, our = (np.array([rows[who][k][column] for k in at]) for who in (name, "ours"))
            better = "" if name == "ours" else f", {int(np.sum(errors < our))} of {len(at)}"
            texts.append(f"{np.median(errors):.3f} ({errors.max():.3f}{better})" if at else "–")
        found.append("; ".join(texts))
    return found


def main() -> None:
    """The named methods; a table of all that is kept; the result file once all have figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("methods", nargs="*", default=list(METHODS), metavar="METHOD", help=", ".join(METHODS))
    parser.add_argument("--folder", type=Path, default=DATA, help="of recordings")
    given = parser.parse_args()
    folders = [given.folder] if given.folder != DATA else [DATA / "cable", DATA / "cable_load"]
    recordings = {name: one for folder in folders for name, one in load(folder).items()}
    asked = list(tasks(recordings))
    missing = sorted({NEEDS[one] for one in given.methods if one in NEEDS and not importlib.util.find_spec(NEEDS[one])})
    if missing:
        raise SystemExit(f"{' and '.join(missing)} missing: pip install --editable '.[bench]', or name other methods")
    rows = {}
    for name in METHODS:
        kept = Kept(f"cables-{given.folder.name}-{name}")
        if name in given.methods:
            done = len(kept.rows())
            there = outcomes(name, recordings, asked[done:])
            rows[name] = kept.filled(there, len(asked))
            print(" | ".join(cells(name, rows, asked)) if "ours" in rows else name, flush=True)
        elif len(kept.rows()) == len(asked):
            rows[name] = kept.rows()
    if "ours" not in rows:
        return
    columns = ["method", "parameters", "s to learn", "µs a sample", *SPLITS]
    lines = [cells(name, rows, asked) for name in rows]
    print(table(columns, lines))
    if len(rows) == len(METHODS) and given.folder == DATA:
        counts = ", ".join(f"{sum(task.split == split for task in asked)} {split}" for split in SPLITS)
        how = f"{len(recordings)} recordings; tasks: {counts}. 100 samples a second, ours all. {machine()}"
        write_rows("identification_cables", WHAT, "python benchmarks/cables/score.py", columns, lines, how)


if __name__ == "__main__":
    main()
