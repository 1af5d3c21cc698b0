"""What a user waits for: every law and every command that computes, each in a process of its own, from its start.

With an empty cache of compiled code, and with a full one, to the first line of the answer and to the end. The command
is at a terminal, where it shows its progress. A simulated minute from Python, in a fresh process too, is beside it.

    python benchmarks/fresh_process.py                # all of it
    python benchmarks/fresh_process.py identify check # only these commands
    python benchmarks/fresh_process.py --warm         # leaves the empty cache out, and fills that of the user
"""

import argparse
import os
import selectors
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

from bowden.control import LAWS
from measure import Row, Timing, table

COMMAND = (sys.executable, "-c", "from bowden.app.main import main; main()")
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


_STUDY = """
laws = ["adaptive", "bowden"]
runs = 64
duration_s = 5.0
[vary]
"cable.slope" = { uniform = [0.8, 1.0] }
"""


class Taken(NamedTuple):
    """Seconds from the start of a command."""

    first: float
    """Until the first line of its answer, by the clock."""
    whole: float
    """Until its end, by the clock."""
    processor: float
    """Until its end, on the processor."""


COMMANDS: tuple[tuple[tuple[str, ...], str, str], ...] = (
    *((("simulate", "rig.toml", "--force", "--law", law), "≤ 15 s", "first line ≤ 1.2 s") for law in LAWS),
    (("check", "rig.toml"), "≤ 15 s", "first line ≤ 1.2 s"),
    (("identify", "log.csv"), "", "end ≤ 1.5 s"),
    (("tune", "rig.toml", "--dry-run"), "", ""),
    (("league", "--plants", "play", "--scenarios", "periodic", "--data", "none"), "", ""),
    (("campaign", "study.toml", "--out", "study-{round}"), "", ""),
    (("run", "rig.toml", "--twin", "--auto", "--duration", "1"), "", ""),
    (("export", "rig.toml", "--to", "code-{round}"), "", ""),
    (("--help",), "", "first line ≤ 0.5 s"),
)
"""Arguments, and the targets with an empty cache (on the processor) and with a full one."""


def rows(warm_rounds: int = 5, only: tuple[str, ...] = (), *, cold: bool = True) -> tuple[list[Row], list[str]]:
    """Two rows for each command, and notes.

    Args:
        warm_rounds: how often each is called with a full cache.
        only: names of commands; all of them where none is given.
        cold: whether an empty cache is looked at too; else the user's own is filled and used.
    """
    found = []
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        subprocess.run([*COMMAND, "init", "rig.toml"], cwd=folder, check=True, capture_output=True)
        subprocess.run([sys.executable, "-c", _LOG], cwd=folder, check=True)
        (folder / "study.toml").write_text(_STUDY, encoding="utf-8")
        for i, (arguments, cold_target, warm_target) in enumerate(COMMANDS):
            if only and arguments[0] not in only:
                continue
            cache = folder / f"cache-{i}" if cold else None
            empty, *warm = [answered(arguments, folder, cache, number) for number in range(1 + warm_rounds)]
            said = f"`bowden {' '.join(arguments)}`"
            if cold:
                on_it = f"{empty.processor:.2f} s on the processor"
                found.append(Row(f"{said}, empty cache", f"{empty.first:.2f} s", on_it, "", "", cold_target))
            first, whole = (Timing(tuple(one[which] for one in warm)) for which in (0, 1))
            found.append(Row(f"{said}, cache filled", first, whole, "", "", warm_target))
        if cold and not only:
            minute = Timing((_minute(str(folder / "other")),))
            again = Timing(tuple(_minute(str(folder / "other")) for _ in range(3)))
            found += [
                Row("a minute simulated from Python, empty cache", "", minute, "", "", "≤ 10 s"),
                Row("the same, cache filled", "", again, "", "", "≤ 1.5 s"),
            ]
    return found, [
        "Commands in a fresh process: seconds by the clock to the first line of the answer, and (in the place of a "
        "peer) to the end, its page included; with an empty cache, the seconds on the processor.",
    ]


def answered(arguments: tuple[str, ...], folder: Path, cache: Path | None, number: int) -> Taken:
    """Run a command at a terminal, with the number of its round where it names one.

    Raises:
        RuntimeError: it failed, or said nothing.
    """
    answer, progress = os.openpty(), os.openpty()
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    environment |= {"COLUMNS": "100", "TERM": "xterm"} | ({"BOWDEN_CACHE_DIR": str(cache)} if cache else {})
    before, began = os.times(), time.perf_counter()
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
                    first = first or (time.perf_counter() - began if b"\n" in text.lstrip() else 0.0)
    for outer in (answer[0], progress[0]):
        os.close(outer)
    if process.wait() or not first:
        raise RuntimeError(f"bowden {' '.join(arguments)}: {(text + said).decode(errors='replace')[-500:]}")
    whole, after = time.perf_counter() - began, os.times()
    processor = after.children_user + after.children_system - before.children_user - before.children_system
    return Taken(first, whole, processor)


def _minute(cache: str) -> float:
    before = os.times()
    subprocess.run([sys.executable, "-c", _MINUTE], check=True, env=os.environ | {"BOWDEN_CACHE_DIR": cache})
    after = os.times()
    return after.children_user + after.children_system - before.children_user - before.children_system


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("only", nargs="*", help="names of commands")
    parser.add_argument("--warm", action="store_true", help="with the user's cache alone")
    parser.add_argument("--rounds", type=int, default=5, help="with a full cache")
    arguments = parser.parse_args()
    found, notes = rows(arguments.rounds, tuple(arguments.only), cold=not arguments.warm)
    load = ", ".join(f"{value:.1f}" for value in os.getloadavg())
    print("\n".join([table(found), "", *notes, f"Load of the machine: {load}."]))


if __name__ == "__main__":
    main()
