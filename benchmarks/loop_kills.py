"""The loop's process killed or stopped at random moments while the motor has torque: how soon the twin takes it off."""

import contextlib
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from bowden.live.twin_process import RunningTwin, running_twin
from kept import Kept
from measure import Figure

KILLS, MOST = 200, 0.050
LATEST = 3.0
"""After the torque came on, at most: preflight, approach and law have begun by then [s]."""
RIG = "[scenario]\nduration_s = 60.0\n[limits]\nreading_age = 10.0\n"
COMMAND = [sys.executable, "-c", "from bowden.app.main import main; main()", "run"]
ENDS = (signal.SIGKILL, signal.SIGSTOP)
TRIES = 5


def kills(first: int, end: int) -> Iterator[list[Any]]:
    """[number, signal, seconds after the torque came on, from the last heartbeat to torque off, longest wait, mode]."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        rig = folder / "rig.toml"
        rig.write_text(RIG)
        os.environ["XDG_STATE_HOME"] = str(folder / "state")
        for number in range(first, end):
            moment = random.Random(number).uniform(0.05, LATEST)
            with running_twin(rig, folder / f"b{number}") as twin:
                taken = next(found for _ in range(TRIES) if (found := _kill(rig, twin, ENDS[number % 2], moment)))
            yield [number, ENDS[number % 2].name, moment, *taken]


def _kill(rig: Path, twin: RunningTwin, end: signal.Signals, moment: float) -> tuple[float, float] | None:
    """None where the run had ended by itself before."""
    words = [*COMMAND, str(rig), "--channel", twin.channel, "--out", str(rig.parent), "--auto", "--json"]
    run = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    loop = 0
    try:
        if not _torque(twin, True, run):
            return None
        loop = _loop_of(run.pid)
        time.sleep(moment)
        if not twin.control.status()["torque"]:
            return None
        os.kill(loop, end)
        if not _torque(twin, False):
            return np.inf, np.inf
        status, journal = twin.control.status(), twin.control.journal()
        off = [entry["time"] for entry in journal if entry["event"] == "torque_off"][-1]
        return off - status["last_heartbeat"], status["longest_wait"]
    finally:
        for pid in filter(None, (loop, run.pid)):
            with contextlib.suppress(ProcessLookupError):  # it has ended by itself
                os.kill(pid, signal.SIGKILL)
        run.wait()


def _torque(twin: RunningTwin, on: bool, run: "subprocess.Popen[bytes] | None" = None) -> bool:
    deadline = time.monotonic() + 60.0
    while twin.control.status()["torque"] != on:
        if time.monotonic() > deadline or (run and run.poll() is not None):
            return False
        time.sleep(0.005)
    return True


def _loop_of(operator: int) -> int:
    """Number of the loop's process."""
    for thread in Path(f"/proc/{operator}/task").iterdir():
        for child in (thread / "children").read_text().split():
            if "loop_process" in Path(f"/proc/{child}/cmdline").read_text():
                return int(child)
    raise RuntimeError("the run has no loop")


def figures(share: float) -> tuple[list[Figure], str]:
    """Figures of all kills, and how they were made."""
    kept, wanted = Kept("loop_kills"), max(2, round(share * KILLS))
    rows = kept.filled(kills(len(kept.rows()), wanted), wanted)[:wanted]
    off = np.array([row[3] for row in rows])
    low, high = np.percentile(off, (50, 99))
    found = f"{1e3 * low:.1f} ms in the median, {1e3 * high:.1f} ms in 99 of 100, {1e3 * off.max():.1f} ms at most"
    return [
        Figure(
            f"from the last heartbeat to torque off, {len(rows)} times",
            found,
            "≤ 50 ms in all",
            bool(off.max() <= MOST),
        )
    ], (
        f"- `bowden run --auto` and `bowden twin`; the loop's process gets SIGKILL or SIGSTOP up to {LATEST:g} s after "
        "the torque came on, in preflight, approach or law. Both times are the twin's clock's."
    )
