"""What a user waits for: every law and the commonest commands, each in a process of its own, from its start.

With an empty cache of compiled code, and with a full one, to the first line of the answer and to the end. The command
is at a terminal, where it shows its progress. A simulated minute from Python, in a fresh process too, is beside it.
"""

import os
import selectors
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

from measure import Row, Timing

COMMAND = (sys.executable, "-c", "from bowden.app.main import main; main()")
LAWS = (
    "uncompensated",
    "observer",
    "adaptive",
    "offset_inverse",
    "hysteresis_model",
    "cascaded_pid",
    "backlash_inverse",
    "active_disturbance_rejection",
    "bowden",
)
_MINUTE = """
from bowden.control import LAWS
from bowden.control.reference import PeriodicMinimumJerk
from bowden.sim.run import simulate
from bowden.plants.bench import Bench
simulate(Bench(), LAWS["adaptive"], PeriodicMinimumJerk(0.0, 1.2, 10.0), duration=60.0)
"""
_LOG = """
import numpy as np
from bowden.control import LAWS
from bowden.control.reference import PeriodicMinimumJerk
from bowden.sim.run import simulate
from bowden.plants.bench import Bench
run = simulate(Bench(), LAWS["uncompensated"], PeriodicMinimumJerk(0.0, 1.2, 5.0), duration=20.0)
columns = np.column_stack([run[name] for name in ("time", "motor_measured", "joint_measured")])
np.savetxt("log.csv", columns, delimiter=",", header="time,motor,joint", comments="")
"""


class Taken(NamedTuple):
    """Seconds on the processor from the start of a command."""

    first: float
    """Until the first line of its answer."""
    whole: float
    """Until its end."""


def rows(warm_rounds: int = 5) -> tuple[list[Row], list[str]]:
    """Two rows for each command, and notes."""
    found = []
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        subprocess.run([*COMMAND, "init", "rig.toml"], cwd=folder, check=True, capture_output=True)
        subprocess.run([sys.executable, "-c", _LOG], cwd=folder, check=True)
        for i, (arguments, cold_target, warm_target) in enumerate(COMMANDS):
            cache = folder / f"cache-{i}"
            cold, *warm = [answered(arguments, folder, cache, number) for number in range(1 + warm_rounds)]
            said = f"`bowden {' '.join(arguments)}`"
            found += [
                Row(f"{said}, empty cache", f"{cold.first:.2f} s", f"{cold.whole:.2f} s", "", "", cold_target),
                Row(f"{said}, cache filled", _timing(warm, 0), _timing(warm, 1), "", "", warm_target),
            ]
        first = Timing((_minute(str(folder / "other")),))
        again = Timing(tuple(_minute(str(folder / "other")) for _ in range(3)))
    found += [
        Row("a minute simulated from Python, empty cache", "", first, "", "", "≤ 10 s"),
        Row("the same, cache filled", "", again, "", "", "≤ 1.5 s"),
    ]
    return found, [
        "Commands in a fresh process: seconds on the processor to the first line of the answer, and (in the place of a "
        "peer) to the end, its page included.",
    ]


COMMANDS: tuple[tuple[tuple[str, ...], str, str], ...] = (
    *((("simulate", "rig.toml", "--law", law), "first line ≤ 15 s", "first line ≤ 1.2 s") for law in LAWS),
    (("check", "rig.toml"), "first line ≤ 15 s", "first line ≤ 1.2 s"),
    (("identify", "log.csv"), "", "end ≤ 1.5 s"),
    (("export", "rig.toml", "--to", "code-{round}"), "", ""),
    (("--help",), "", "first line ≤ 0.5 s"),
)
"""Arguments, and the targets with an empty and with a full cache."""


def _timing(taken: list[Taken], which: int) -> Timing:
    return Timing(tuple(one[which] for one in taken))


def answered(arguments: tuple[str, ...], folder: Path, cache: Path, number: int) -> Taken:
    """Run a command at a terminal, with the number of its round where it names one.

    Raises:
        RuntimeError: it failed, or said nothing.
    """
    answer, progress = os.openpty(), os.openpty()
    environment = os.environ | {"BOWDEN_CACHE_DIR": str(cache), "COLUMNS": "100", "TERM": "xterm"}
    before = os.times()
    process = subprocess.Popen(
        [*COMMAND, *(argument.format(round=number) for argument in arguments)],
        cwd=folder,
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=answer[1],
        stderr=progress[1],
    )
    for inner in (answer[1], progress[1]):
        os.close(inner)
    text, said, first = b"", b"", 0.0
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
                    first = first or (_on_processor(process.pid) if b"\n" in text.lstrip() else 0.0)
    for outer in (answer[0], progress[0]):
        os.close(outer)
    if process.wait() or not first:
        raise RuntimeError(f"bowden {' '.join(arguments)}: {(text + said).decode(errors='replace')[-500:]}")
    after = os.times()
    whole = after.children_user + after.children_system - before.children_user - before.children_system
    return Taken(first, whole)


def _on_processor(pid: int) -> float:
    """What a process has taken so far, as Linux counts it [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _minute(cache: str) -> float:
    before = os.times()
    subprocess.run([sys.executable, "-c", _MINUTE], check=True, env=os.environ | {"BOWDEN_CACHE_DIR": cache})
    after = os.times()
    return after.children_user + after.children_system - before.children_user - before.children_system
