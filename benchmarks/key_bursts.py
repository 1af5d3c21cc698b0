"""Stops among other requests: 200 bursts of keys while the law runs on the twin, 10 000 interleavings in memory.

The keys go through a terminal into `bowden.live.operator.operate`, as `bowden run` has it, and from there to the loop's
own process.
"""

import os
import random
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
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
from kept import Kept
from measure import Figure, Found

BURSTS, INTERLEAVINGS = 200, 10_000
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


def bursts(numbers: Sequence[int], led: int = 1) -> Iterator[tuple[str, bool]]:
    """The keys of each burst, and whether its stop was taken.

    Every second burst is space and ``k`` in one write; the others are two to six keys one after the other, within some
    milliseconds.

    Args:
        numbers: of the bursts.
        led: one of so many is typed while the law runs, the others in the preflight.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "rig.toml").write_text(RIG)
        with running_twin(folder / "rig.toml", folder / "bus") as twin:
            live = live_run(Rig.read(folder / "rig.toml").on_bus(twin.channel))
            with Session(live, folder / "log.mcap", remembers=False) as session:
                yield from _typed(session, numbers, led)


def _typed(session: Session, numbers: Sequence[int], led: int) -> Iterator[tuple[str, bool]]:
    master, slave = os.openpty()
    with open(slave) as keys, mock.patch("sys.stdin", keys):
        given: dict[str, Any] = {"auto": False, "quiet": True}
        operator = threading.Thread(target=operate, args=(session, Ending()), kwargs=given)
        operator.start()
        rows = RingReader(session.rows.path)  # a reader is one thread's
        try:
            for number in numbers:
                drawn = random.Random(number)
                _lead(master, rows, Mode.PREFLIGHT if number % led else Mode.RUNNING)
                time.sleep(drawn.uniform(0.0, 0.1))
                burst = [drawn.choice("ark") for _ in range(drawn.randint(1, 5))]
                burst.insert(drawn.randint(0, len(burst)), drawn.choice(" s"))
                writes = burst if number % 2 else [" k"]
                for text in writes:
                    os.write(master, text.encode())
                    time.sleep(drawn.uniform(0.0, 2e-3))
                yield "".join(writes), _waited(lambda: _at(rows, "mode") not in POWERED, TAKEN)
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


def _at(rows: RingReader, column: str) -> float:
    row = rows.last()
    return -1.0 if row is None else float(row[AT[column]])


def _waited(holds: Callable[[], bool], seconds: float) -> bool:
    deadline = time.monotonic() + seconds
    while not holds():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.002)
    return True


def _stormed(count: int) -> str:
    """What was wrong with as many interleavings, four of five of one axis and the others of two; empty for nothing."""
    from support.request_storm import Storm  # of the tests; see `run`

    for axes, share in ((1, 0.8), (2, 0.2)):
        with tempfile.TemporaryDirectory() as name:
            try:
                Storm(Path(name), count, axes, round(share * count)).loop.run()
            except AssertionError as error:
                return str(error)
    return ""


def figures(share: float) -> Found:
    """Stops lost among interleavings and bursts."""
    count, wanted = round(share * INTERLEAVINGS), max(10, round(share * BURSTS))
    wrong, kept = _stormed(count), Kept("key_bursts")
    missing = range(len(kept.rows()), wanted)
    found = kept.filled((list(one) for one in bursts(missing)) if missing else (), wanted)[:wanted]
    lost = [keys for keys, taken in found if not taken]
    for keys in lost:
        print(f"lost: {keys!r}")
    return Found(
        [
            Figure(f"stops lost in {count} interleavings of requests", wrong or "0", "0", not wrong),
            Figure(f"stops lost of {len(found)} bursts of keys", str(len(lost)), "0", not lost),
        ],
        "Up to five requests between two cycles, and between any two words that the loop reads of them.",
    )
