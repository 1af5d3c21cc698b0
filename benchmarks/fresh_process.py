"""What a user waits for: ``bowden simulate rig.toml`` from its start to the first line of its answer.

With an empty cache of compiled code, and with a full one. The command is at a terminal, where it shows its progress,
and the time is the clock's. A simulated minute from Python, in a fresh process too, is beside it.
"""

import os
import selectors
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from measure import Row, Timing

COMMAND = (sys.executable, "-c", "from bowden.app.main import main; main()")
_MINUTE = """
from bowden.control import LAWS
from bowden.control.reference import PeriodicMinimumJerk
from bowden.sim.run import simulate
from bowden.plants.bench import Bench
simulate(Bench(), LAWS["adaptive"], PeriodicMinimumJerk(0.0, 1.2, 10.0), duration=60.0)
"""


def rows(warm_rounds: int = 9) -> tuple[list[Row], list[str]]:
    """One row for each kind of start, and notes."""
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        subprocess.run([*COMMAND, "init", "rig.toml"], cwd=folder, check=True, capture_output=True)
        cold = _answered(folder)
        warm = Timing(tuple(_answered(folder) for _ in range(warm_rounds)))
        first = Timing((_minute(str(folder / "other")),))
        again = Timing(tuple(_minute(str(folder / "other")) for _ in range(3)))
    return [
        Row("`bowden simulate` to the first line of its answer, empty cache", f"{cold:.2f} s", "", "", "", "≤ 10 s"),
        Row("the same, cache filled", warm, "", "", "", "≤ 1.5 s"),
        Row("a minute simulated from Python in a fresh process, empty cache", first, "", "", "", "≤ 10 s"),
        Row("the same, cache filled", again, "", "", "", "≤ 1.5 s"),
    ], [
        "`bowden simulate`: by the clock, at a terminal; others may be at work (load of the machine at the end: "
        f"{os.getloadavg()[0]:.1f} on {os.cpu_count()} processors), so the smallest time is the least disturbed. The "
        "simulated minute: seconds on the processor.",
    ]


def _answered(folder: Path) -> float:
    """Seconds from the start of the command to the first line of its answer."""
    answer, progress = os.openpty(), os.openpty()
    environment = os.environ | {"BOWDEN_CACHE_DIR": str(folder / "cache"), "COLUMNS": "100", "TERM": "xterm"}
    begin = time.perf_counter()
    process = subprocess.Popen(
        [*COMMAND, "simulate", "rig.toml"],
        cwd=folder,
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=answer[1],
        stderr=progress[1],
    )
    for inner in (answer[1], progress[1]):
        os.close(inner)
    text, said, taken = b"", b"", 0.0
    with selectors.DefaultSelector() as ready:
        for outer in (answer[0], progress[0]):
            ready.register(outer, selectors.EVENT_READ)
        while ready.get_map():
            for key, _ in ready.select():
                try:
                    read = os.read(key.fd, 65536)
                except OSError:  # how Linux says that the other end is closed
                    read = b""
                if not read:
                    ready.unregister(key.fd)
                elif key.fd == progress[0]:
                    said += read
                else:
                    text += read
                    taken = taken or (time.perf_counter() - begin if b"\n" in text.lstrip() else 0.0)
    for outer in (answer[0], progress[0]):
        os.close(outer)
    if process.wait() or not taken:
        raise RuntimeError(f"bowden simulate: {said.decode(errors='replace')[-500:]}")
    return taken


def _minute(cache: str) -> float:
    before = os.times()
    subprocess.run([sys.executable, "-c", _MINUTE], check=True, env=os.environ | {"BOWDEN_CACHE_DIR": cache})
    after = os.times()
    return after.children_user + after.children_system - before.children_user - before.children_system
