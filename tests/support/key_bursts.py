"""Bursts of keys, through a terminal, into a run on the twin; the loop is in a process of its own."""

import os
import random
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from unittest import mock

from bowden.live.live_run import live_run
from bowden.live.operator import Ending, operate
from bowden.live.ring import RingReader
from bowden.live.row import AT
from bowden.live.session import Session
from bowden.live.twin_process import running_twin
from bowden.rig.rig import Rig
from bowden.safety.state import Mode

PATIENCE = 30.0
"""For each step up to the law [s]."""
TAKEN = 2.0
"""A stop that has not begun a release this long after its keys is lost; one that was taken has within 0.05 s, where the
computer is not busy with other things [s]."""
POWERED = (Mode.PREFLIGHT, Mode.RUNNING, Mode.BRIDGING)
RIG = """[scenario]
duration_s = 60.0
[limits]
reading_age = 10.0
lateness_s = 5.0
heartbeat_age_s = 6.0
operator_age_s = 1.0
"""


def bursts(folder: Path, count: int, in_law: int) -> Iterator[tuple[str, bool]]:
    """The keys of each burst, and whether its stop was taken.

    Every second burst is space and ``k`` in one write; the others are two to six keys one after the other, within some
    milliseconds.

    Args:
        folder: for rig, bus and log.
        count: of the bursts.
        in_law: one of so many is typed while the law runs, the others in the preflight.
    """
    (folder / "rig.toml").write_text(RIG)
    with running_twin(folder / "rig.toml", folder / "bus") as twin:
        live = live_run(Rig.read(folder / "rig.toml").on_bus(twin.channel))
        with Session(live, folder / "log.mcap", remembers=False) as session:
            yield from _typed(session, count, in_law)


def _typed(session: Session, count: int, in_law: int) -> Iterator[tuple[str, bool]]:
    master, slave = os.openpty()
    with open(slave) as keys, mock.patch("sys.stdin", keys):
        given: dict[str, Any] = {"auto": False, "quiet": True}
        operator = threading.Thread(target=operate, args=(session, Ending()), kwargs=given)
        operator.start()
        rows = RingReader(session.rows.path)  # a reader is one thread's
        try:
            for number in range(count):
                drawn = random.Random(number)
                _lead(master, rows, Mode.PREFLIGHT if number % in_law else Mode.RUNNING)
                time.sleep(drawn.uniform(0.0, 0.1))
                burst = [drawn.choice("ark") for _ in range(drawn.randint(1, 5))]
                burst.insert(drawn.randint(0, len(burst)), drawn.choice(" s"))
                writes = burst if number % 2 else [" k"]
                for text in writes:
                    os.write(master, text.encode())
                    time.sleep(drawn.uniform(0.0, 2e-3))
                yield "".join(writes), _stopped(rows)
        finally:
            os.write(master, b"q")
            operator.join(PATIENCE)
            os.close(master)


def _lead(master: int, rows: RingReader, wanted: Mode) -> None:
    """Press keys until the run is there."""
    deadline = time.monotonic() + PATIENCE
    while (mode := _at(rows, "mode")) != wanted:
        assert time.monotonic() < deadline, f"mode {mode}: the law does not begin"
        keys = {Mode.STOPPED: b"a", Mode.LATCHED: b"k"}
        passed = mode == Mode.PREFLIGHT and _at(rows, "preflight") == 1.0
        os.write(master, b"r" if passed else keys.get(mode, b""))
        time.sleep(0.1)


def _stopped(rows: RingReader) -> bool:
    deadline = time.monotonic() + TAKEN
    while _at(rows, "mode") in POWERED:
        if time.monotonic() > deadline:
            return False
        time.sleep(0.002)
    return True


def _at(rows: RingReader, column: str) -> float:
    row = rows.last()
    return -1.0 if row is None else float(row[AT[column]])
