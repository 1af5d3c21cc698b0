"""What a user waits for: every law and every command that computes, each in a process of its own, from its start.

With an empty cache of compiled code, and with a full one, to the first line of the answer and to the end, what it takes
of the processor, in all of its processes, and whether it compiles anything with a full one. The command is at a
terminal, where it shows its progress. What is measured is kept in ``out/bench``, so that it can be interrupted.

    python benchmarks/fresh_process.py                         # all of it, and its section of RESULTS.md
    python benchmarks/fresh_process.py identify check          # only these commands
    python benchmarks/fresh_process.py simulate --law adaptive # only with this law
    python benchmarks/fresh_process.py --warm                  # leaves the empty cache out, and fills that of the user
"""

import argparse
import json
import os
import selectors
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import results
from bowden.control import LAWS
from kept import Kept
from measure import machine

TITLE = "What a user waits for"
COMMAND = (sys.executable, "-c", "from bowden.app.main import main; main()")
_LOG = """
import numpy as np
from bowden.control import LAWS
from bowden.control.reference import PeriodicMinimumJerk
from bowden.sim.run import simulate
from bowden.plants.bench import Bench
run = simulate(Bench(), LAWS["uncompensated"], PeriodicMinimumJerk(0.0, 1.2, 5.0), duration=20.0)
def save(file, names, header):
    np.savetxt(file, np.column_stack([run[name] for name in names]), delimiter=",", header=header, comments="")
save("log.csv", ("time", "motor_measured", "joint_measured"), "time_s,motor_rad,joint_rad")
save("servo.csv", ("time", "command", "motor_measured"), "time_s,command_rad,motor_rad")
time = np.arange(40_000) / 2000.0
active = (time % 4.0 > 2.0) & (time % 4.0 < 3.0)
emg = np.random.default_rng(1).normal(0.0, np.where(active, 1.0, 0.03))
np.savetxt("emg.csv", np.column_stack([time, emg]), delimiter=",", header="time_s,biceps_mV", comments="")
labels = np.array([[k + 2.0, k + 3.0] for k in range(0, 20, 4)])
np.savetxt("labels.csv", labels, delimiter=",", header="onset_s,offset_s", comments="")
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
    compiled: int
    """Passes of the compiler, and files that it left in the cache: 0 where nothing was compiled."""


COLD, FIRST, HELP = 15.0, 1.2, 0.5
"""Asked for: on the processor with an empty cache, to the first line with a full one, and to that of the help [s]."""

COMMANDS: tuple[tuple[str, ...], ...] = (
    ("--help",),
    ("init", "rig-{round}.toml"),
    *(("simulate", "rig.toml", "--force", "--law", law) for law in LAWS),
    *(("check", "rig.toml", "--law", law) for law in LAWS),
    ("identify", "log.csv"),
    ("identify-servo", "servo.csv"),
    ("tune", "rig.toml", "--dry-run"),
    ("campaign", "study.toml", "--out", "study-{round}"),
    *(("run", "rig.toml", "--twin", "--auto", "--duration", "2", "--law", law) for law in ("adaptive", "bowden")),
    ("run", "suit.toml", "--twin", "--auto", "--duration", "2"),
    ("simulate", "suit.toml", "--force"),
    ("check", "suit.toml"),
    ("emg", "score", "emg.csv", "--labels", "labels.csv"),
    ("export", "rig.toml", "--to", "code-{round}"),
)
"""Arguments; those of a command that writes have the number of the round in them."""


def taken(command: tuple[str, ...], folder: Path, warm_rounds: int, *, cold: bool) -> list[Taken]:
    """With an empty cache, which fills it, and then with a full one.

    Args:
        command: its arguments.
        folder: with all that it names.
        warm_rounds: how often it is called with a full cache.
        cold: whether its cache is one of its own and empty; else the user's is filled and used.
    """
    with tempfile.TemporaryDirectory() as cache:
        given = Path(cache) if cold else None
        return [answered(command, folder, given, number) for number in range(1 + warm_rounds)]


def prepared(folder: Path) -> None:
    """Put everything that the commands name into a folder."""
    for arguments in (("init", "rig.toml"), ("init", "suit.toml", "--suit")):
        subprocess.run([*COMMAND, *arguments], cwd=folder, check=True, capture_output=True)
    subprocess.run([sys.executable, "-c", _LOG], cwd=folder, check=True)
    (folder / "study.toml").write_text(_STUDY, encoding="utf-8")


def table(found: Sequence[tuple[tuple[str, ...], Sequence[Taken]]]) -> str:
    """A line a command: the times with an empty cache, then the medians with a full one."""
    lines = [
        "| command | empty cache: first line | end | processor | cache filled: first line | end | processor | "
        "compiled anew |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for command, (empty, *warm) in found:
        medians = [statistics.median(values) for values in zip(*warm, strict=True)]
        cells = [f"{value:.2f} s" for value in (*empty[:3], *medians[:3])]
        said = "yes" if max(one.compiled for one in warm) else "no"
        lines.append(f"| `bowden {' '.join(command)}` | {' | '.join(cells)} | {said} |")
    return "\n".join(lines)


def answered(arguments: tuple[str, ...], folder: Path, cache: Path | None, number: int) -> Taken:
    """Run a command at a terminal, with the number of its round where it names one.

    Raises:
        RuntimeError: it failed, or said nothing.
    """
    answer, progress = os.openpty(), os.openpty()
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    environment |= {"COLUMNS": "100", "TERM": "xterm"}
    trace = folder / "passes.json"
    if cache:  # Numba's options are part of what its cache goes by
        environment |= {"BOWDEN_CACHE_DIR": str(cache), "NUMBA_CHROME_TRACE": str(trace)}
    before, began, moment = os.times(), time.perf_counter(), time.time()
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
    refused = process.wait() and b"bowden: " in said  # a check that does not hold, and a run that is late, answer
    if refused or not first:
        raise RuntimeError(f"bowden {' '.join(arguments)}: {(text + said).decode(errors='replace')[-500:]}")
    whole, after = time.perf_counter() - began, os.times()
    processor = after.children_user + after.children_system - before.children_user - before.children_system
    return Taken(first, whole, processor, _compiled(cache, trace, moment))


def _compiled(cache: Path | None, trace: Path, before: float) -> int:
    """Files of compiled code that are newer than a command's start, and passes of the compiler in its process."""
    newer = [] if cache is None else [file for file in cache.rglob("*.*") if file.stat().st_mtime > before]
    passes = len(json.loads(trace.read_text(encoding="utf-8"))) if trace.is_file() else 0
    trace.unlink(missing_ok=True)
    return len(newer) + passes


def measured(only: Sequence[str], law: str, rounds: int, *, cold: bool) -> list[tuple[tuple[str, ...], list[Taken]]]:
    """Every command that is asked for with what it took; what was measured before with empty caches is kept."""
    wanted = [one for one in COMMANDS if (not only or one[0] in only) and (not law or law in one)]
    kept = Kept(f"fresh_process-{rounds}") if cold else None
    with tempfile.TemporaryDirectory() as made:
        prepared(Path(made))

        def run(missing: Iterable[tuple[str, ...]]) -> Iterator[list[Any]]:
            for command in missing:
                yield [list(command), taken(command, Path(made), rounds, cold=cold)]

        if kept is None:
            rows = list(run(wanted))
        else:
            there = {tuple(row[0]) for row in kept.rows()}
            missing = [one for one in wanted if one not in there]
            rows = kept.filled(run(missing), len(there) + len(missing))
    of = {tuple(command): [Taken(*values) for values in found] for command, found in rows}
    return [(one, of[one]) for one in wanted]


def section(found: Sequence[tuple[tuple[str, ...], Sequence[Taken]]], rounds: int) -> str:
    """The table and its notes."""
    load = ", ".join(f"{value:.1f}" for value in os.getloadavg())
    notes = [
        *machine(),
        "Each command in a fresh process: by the clock to the first line of its answer and to its end, its page "
        f"included, and what all its processes take of the processor; with a full cache medians of {rounds} rounds. "
        f"Others ran meanwhile (load at the end: {load} on two processors): the processor's time says more.",
        "Compiled anew: whether a pass of the compiler ran, or compiled code was written, with a full cache.",
        f"Asked for: with an empty cache at most {COLD:g} s on the processor, with a full one the first line within "
        f"{FIRST:g} s, of the help {HELP:g} s.",
    ]
    return table(found) + "\n\n" + "\n".join(f"- {note}" for note in notes)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("only", nargs="*", help="names of commands")
    parser.add_argument("--law", default="", help="of commands that are called with every law, this one only")
    parser.add_argument("--warm", action="store_true", help="with the user's cache alone")
    parser.add_argument("--rounds", type=int, default=3, help="with a full cache")
    given = parser.parse_args()
    text = section(measured(given.only, given.law, given.rounds, cold=not given.warm), given.rounds)
    print(f"\n{text}")
    if not given.only and not given.law and not given.warm:
        results.write(TITLE, text)


if __name__ == "__main__":
    main()
