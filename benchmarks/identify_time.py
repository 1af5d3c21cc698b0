"""How long an identification of a log takes in a process that has compiled its kernels.

The recordings of ``../shared/data`` (cable and cable_load), each three times; the smallest of the three is the least
disturbed.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/identify_time.py
"""

import os
import time
from pathlib import Path

import numpy as np

import results
from bowden import identify
from measure import machine

DATA = Path(__file__).parents[2] / "shared" / "data"
TITLE = "Time of an identification"
ROUNDS, MOST = 3, 1.0
"""Of each log, and what is asked for [s]."""


def main() -> None:
    """The command."""
    logs = sorted(path for folder in ("cable", "cable_load") for path in (DATA / folder).glob("*.csv.gz"))
    if not logs:
        raise SystemExit(f"no recordings in {DATA}")
    identify(logs[0])  # compiles
    clock, processor = np.empty((len(logs), ROUNDS)), np.empty((len(logs), ROUNDS))
    load = [os.getloadavg()[0]]
    for turn in range(ROUNDS):
        for number, log in enumerate(logs):
            begun, used = time.perf_counter(), time.process_time()
            identify(log)
            clock[number, turn] = time.perf_counter() - begun
            processor[number, turn] = time.process_time() - used
            load.append(os.getloadavg()[0])
    rows = [
        f"| {what} | {np.median(found):.2f} | {found.max():.2f} | {(found > MOST).sum()} of {found.size} |"
        for what, found in (
            ("by the clock, smallest of three", clock.min(axis=1)),
            ("by the clock, every turn", clock.ravel()),
            ("processor, smallest of three", processor.min(axis=1)),
            ("processor, every turn", processor.ravel()),
        )
    ]
    notes = [
        *machine(),
        f"{len(logs)} recordings of 20 s at 1 kHz, {ROUNDS} times each, reading the file included.",
        f"Threads of the numerical libraries: {os.environ.get('OPENBLAS_NUM_THREADS', 'as many as they take')}.",
        f"Load of the machine meanwhile: {min(load):.1f} to {max(load):.1f} processes, this one included.",
    ]
    head = f"| time [s] | median | most | above {MOST:g} s |\n|---|---|---|---|\n"
    text = head + "\n".join(rows) + "\n\n" + "\n".join(f"- {note}" for note in notes)
    print(text)
    results.write(TITLE, text)


if __name__ == "__main__":
    main()
