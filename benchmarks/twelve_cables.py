"""The twelve recorded cables from their logs to a running law, by the commands that a user types.

Each cable has a folder of its own. Its log goes into `bowden identify`; after that every command is the one that the
last line of the one before names, up to the exported law, which is compiled and replayed. Nothing is added but
``--duration`` of the run on the twin. The figures go into results/twelve_cables.toml. What came of
a cable is kept: when it is begun again with the same source, that cable is left out.

    python benchmarks/twelve_cables.py [FOLDER OF LOGS]
"""

import argparse
import shlex
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from kept import Kept
from measure import write_rows

ROOT = Path(__file__).parents[1]
LOGS = ROOT.parent / "shared" / "data" / "cable"
RUN_FOR = 20.0
"""Of the run on the twin [s]."""
MOST_RMSE = 0.3
"""Wanted of every cable in simulation [deg]."""
_LONGEST = 900.0
"""Of one command [s]."""
_TRIES = 4
"""Of a run on a twin that a busy computer ends."""
_ANYWHERE = "from bowden.app.main import main; main()"


class Step(NamedTuple):
    """One command, and what came of it."""

    words: list[str]
    """As they were typed."""
    code: int
    out: str
    """On standard output."""
    error: str
    """On standard error."""

    @property
    def next(self) -> list[str]:
        """The command that its last line names; nothing where it names none."""
        last = self.out.strip().splitlines()[-1] if self.out.strip() else ""
        return shlex.split(last.removeprefix("Next: "), comments=True) if last.startswith("Next: ") else []


class Cable(NamedTuple):
    """What came of one log."""

    name: str
    model: str
    held_out_deg: float
    trust: str
    law: str
    simulated_deg: float
    tuned_deg: float
    """In simulation with the gains that were found."""
    twin_deg: float
    replayed: str
    """What the exported law's replay says."""


class BrokenOff(RuntimeError):
    """A cable whose path ends before a running law: with the command and what it said."""


def command(words: list[str], folder: Path) -> Step:
    """Run one command line in a folder; ``bowden`` is this environment's."""
    real = [sys.executable, "-c", _ANYWHERE, *words[1:]] if words[0] == "bowden" else words
    done = subprocess.run(real, cwd=folder, capture_output=True, text=True, timeout=_LONGEST, check=False)
    return Step(words, done.returncode, done.stdout, done.stderr)


def path_of(log: Path, folder: Path, run_for: float = RUN_FOR) -> Iterator[Step]:
    """Every command from a log to the replay of its exported law, as each is named by the one before.

    Args:
        log: its file.
        folder: an empty one.
        run_for: how long the law runs on the twin [s].

    Raises:
        BrokenOff: a command fails, or names none.
    """
    shutil.copy(log, folder / log.name)
    words, tries = ["bowden", "identify", log.name], 1
    while True:
        step = command([*words, "--duration", f"{run_for:g}"] if words[1] == "run" else words, folder)
        yield step
        if words[0] == "make" and step.code == 0:
            return
        if words[1] == "run" and step.code == 1 and "too busy" in step.out and tries < _TRIES:
            _allow_for_a_busy_computer(folder / words[2])
            tries += 1
            continue
        if step.code != 0 or not step.next:
            raise BrokenOff(
                f"{log.name}: {shlex.join(step.words)} ends with {step.code}: {step.out[-1000:]} {step.error[-1000:]}"
            )
        words = ["bowden", "tune", words[2]] if words[1] == "check" else step.next


_SHARED = "reading_age = 10.0\nlateness_s = 5.0\nheartbeat_age_s = 6.0\noperator_age_s = 1.0\n"
"""Limits under which a run on a twin outlives the stalls of a computer that others use too."""


def _allow_for_a_busy_computer(rig: Path) -> None:
    """Widen the limits of times, once: on a rig of one's own they stay as they are."""
    text = rig.read_text(encoding="utf-8")
    if _SHARED not in text:
        head, _, rest = text.partition("[limits]")
        comment, _, keys = rest.partition("\n")
        rig.write_text(f"{head}[limits]{comment}\n{_SHARED}{keys}", encoding="utf-8")


def followed(log: Path, folder: Path, run_for: float = RUN_FOR) -> Cable:
    """The figures of one log's path.

    Raises:
        BrokenOff: see `path_of`.
    """
    steps = list(path_of(log, folder, run_for))
    model = tomllib.loads((folder / "out/identify/model.toml").read_text(encoding="utf-8"))
    trust = next(line for line in steps[0].out.splitlines() if line.startswith("Trust it? "))
    rig = folder / "rig.toml"
    law = tomllib.loads(rig.read_text(encoding="utf-8"))["control"]["law"]
    made = f"out/simulate/{law}.npz"
    simulated = rmse_of(folder / made)
    again = command(["bowden", "simulate", "rig.toml", "--out", "out/tuned"], folder)
    if again.code != 0:
        raise BrokenOff(f"{log.name}: the tuned rig cannot be simulated: {again.error}")
    return Cable(
        name=log.name.partition(".")[0],
        model=model["best"],
        held_out_deg=model["models"][model["best"]]["test_rms_deg"],
        trust=trust.removeprefix("Trust it? ").partition(":")[0].lower(),
        law=law,
        simulated_deg=simulated,
        tuned_deg=rmse_of(folder / "out" / "tuned" / f"{law}.npz"),
        twin_deg=twin_rmse(sorted((folder / "out" / "run").glob("*.mcap"), key=lambda one: one.stat().st_mtime)[-1]),
        replayed=_replayed(steps[-1]),
    )


def _replayed(step: Step) -> str:
    """The last line of a replay of the exported law: ``passed: N cycles, K commands differ, by …``."""
    cycles, differing = (step.out + step.error).strip().splitlines()[-1].partition(": ")[2].split(", ")[:2]
    return f"{differing.split()[0]} of {cycles} differ"


def rmse_of(trace: Path) -> float:
    """Of a simulation, from rest [deg]; infinite where it ran away."""
    from bowden import read_trace

    found = read_trace(trace).metrics().rmse_deg
    return np.inf if found is None else found


def twin_rmse(log: Path) -> float:
    """Of a live run, while the law had the motor [deg]."""
    from bowden.cycle.one_cycle import TargetSource
    from bowden.live.mcap_read import read

    found = read(log, ("source", "joint", "reference"))
    error = (found["joint"] - found["reference"])[found["source"] >= TargetSource.LAW_BEGINS]
    return float(np.degrees(np.sqrt(np.mean(error[np.isfinite(error)] ** 2))))


COLUMNS = (
    *("log", "model", "held-out error, RMS [°]", "trust", "law", "simulated, RMS [°]", "tuned, RMS [°]"),
    *("on the twin, RMS [°]", "cycles that differ in C"),
)


def row(one: Cable) -> list[Any]:
    """Of the table."""
    return [
        *(one.name, f"`{one.model}`", round(one.held_out_deg, 3), one.trust, f"`{one.law}`"),
        *(round(value, 3) for value in (one.simulated_deg, one.tuned_deg, one.twin_deg)),
        one.replayed.removesuffix(" cycles differ"),
    ]


def main() -> None:
    """All logs of a folder; exit code 1 where one does not come through, or errs by more than is wanted."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("logs", nargs="?", type=Path, default=LOGS)
    kept, failed = Kept("twelve_cables"), []
    there = {one[0] for one in kept.rows()}
    for log in sorted(parser.parse_args().logs.glob("*.csv.gz")):
        if log.name.partition(".")[0] in there:
            continue
        with tempfile.TemporaryDirectory() as folder:
            try:
                kept.filled([row(followed(log, Path(folder)))], 1)
            except BrokenOff as error:
                failed.append(str(error))
                print(error, file=sys.stderr, flush=True)
    rows = sorted(kept.rows())
    if failed or not rows:
        sys.exit("; ".join(failed) or "no logs")
    what = "Twelve recorded cables from the log to the exported law, by the command that each command names next"
    write_rows("twelve_cables", what, "python benchmarks/twelve_cables.py", COLUMNS, rows)
    if max(one[5] for one in rows) > MOST_RMSE:
        sys.exit(f"more than {MOST_RMSE}° in simulation")


if __name__ == "__main__":
    main()
