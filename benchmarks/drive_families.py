"""Each family of drives against its twin, in one run: lateness, run time, replay, and the round trip over the bus.

    python benchmarks/drive_families.py [SECONDS [FAMILY …]]

For each family `bowden run --twin --auto`, with a loop that only sleeps measured before and after it, and its log
replayed; the log of a run that did not end as asked stays in `out/bench`. Then cycles at 1 kHz without power against a
twin: the round trip is from the beginning of `Drive.write` until the first frame is there to be read.
"""

import json
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

import results
from bowden.hardware.buses.link import Links
from bowden.hardware.buses.unix_bus import UnixBus
from bowden.hardware.ports import Power
from bowden.hardware.realtime import Settings
from bowden.live.lateness import bare_loop_apart, figures
from bowden.live.mcap_read import read
from bowden.live.twin_process import running_twin
from bowden.rig.families import family_of
from bowden.rig.rig import Rig
from kept import FOLDER

TITLE = "Families of drives"
BARE = 3.0
"""Length of each measurement of the bare loop [s]."""
SECONDS = 60.0
"""Length of a run whose figures are kept [s]."""
TRIPS = 2000
"""Cycles of the round trip."""
LONGEST = 20e-3
"""Longest round trip that is waited for [s]."""
RIG = """[scenario]
duration_s = {seconds}
[limits]
reading_age = 10.0
lateness_s = 5.0
heartbeat_age_s = 6.0
operator_age_s = 1.0
"""
"""A computer shared with others stalls for longer than a rig's may; each drive's own watchdog holds all the same."""


FAMILIES = {
    "cia402": "[drive]\nheartbeat_timeout_ms = 40\n",
    "ak_mit": ('[motor]\ngear = 9.0\ntorque_constant_nm_per_a = 0.091\n[drive]\nfamily = "ak_mit"\nwatchdog_ms = 40\n'),
    "moteus": '[drive]\nfamily = "moteus"\nwatchdog_ms = 39\n',
    "odrive": '[drive]\nfamily = "odrive"\nwatchdog_ms = 39\n',
}
"""Family → how its rig differs from the default one."""


def bowden(*words: str) -> dict[str, Any]:
    """What a command says."""
    command = [sys.executable, "-c", "from bowden.app.main import main; main()", *words, "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if not done.stdout:
        raise SystemExit(done.stderr)
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def one(name: str, seconds: float) -> dict[str, Any]:
    """One run; its figures."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "rig.toml"
        path.write_text(RIG.format(seconds=seconds) + FAMILIES[name])
        before, _ = bare_loop_apart(BARE, 1e-3, Settings())
        found = bowden("run", str(path), "--twin", "--auto", "--out", folder)
        after, _ = bare_loop_apart(BARE, 1e-3, Settings())
        again = bowden("log", "replay", found["log"])
        log = read(Path(found["log"]), ("lateness", "run_time"))
        if not found["ended_well"]:
            FOLDER.mkdir(parents=True, exist_ok=True)
            shutil.copy(found["log"], FOLDER / f"{name}-{Path(found['log']).name}")
        trips = round_trips(name, path, Path(folder) / "b")
    bare, late = figures(np.concatenate([before, after])), figures(log["lateness"])
    return {
        "family": name,
        "ended": "yes" if found["ended_well"] else f"no: {why(found)}",
        "cycles": found["cycles"],
        "overruns": found["overruns"],
        "p50": (late.p50_us, bare.p50_us),
        "p99": (late.p99_us, bare.p99_us),
        "run_time": np.percentile(1e6 * log["run_time"], (50.0, 99.0)),
        "other": again["verdicts_differing"] + (again["first_difference"] is not None),
        "compared": again["cycles"],
        "trips": np.percentile(1e6 * np.array(trips), (50.0, 99.0)),
    }


def why(found: dict[str, Any]) -> str:
    """What ended a run that did not end as asked."""
    stop = found["stops"][-1] if found["stops"] else {"too_busy": "", "causes": found["faults"]}
    return str(stop["too_busy"] or ", ".join(stop["causes"]) or found["error"])


def round_trips(name: str, path: Path, channel: Path) -> list[float]:
    """Times until a twin's first frame over the bus between processes [s]."""
    rig, found = Rig.read(path), list[float]()
    with running_twin(rig, channel) as twin:
        bus = UnixBus(twin.channel, create=False, fd=name == "moteus")
        drive = family_of(rig.drive).open(rig.on_bus(twin.channel).drive_parameters, Links(bus))
        drive.bring_up()
        begun = time.monotonic()
        for k in range(TRIPS):
            now = time.monotonic()
            drive.read(now)
            writes = time.monotonic()
            drive.write(0.0, Power.OFF, now)
            bus.poll(LONGEST)
            found.append(time.monotonic() - writes)
            time.sleep(max(0.0, begun + 1e-3 * (k + 1) - time.monotonic()))
        drive.close()
        bus.shutdown()
    return found


HEAD = (
    "| family | ended as asked | cycles | overruns | lateness p50 (bare) | p99 (bare) | run time p50, p99 "
    "| round trip p50, p99 | cycles that replay otherwise |"
)


def main() -> None:
    """Print a table; of whole runs it becomes a section of the page of results."""
    seconds = float(sys.argv[1]) if sys.argv[1:] else SECONDS
    lines = [HEAD, "|---|---|---|---|---|---|---|---|---|"]
    print(*lines, sep="\n")
    for name in sys.argv[2:] or FAMILIES:
        run = one(name, seconds)
        late = [f"{own:.0f} ({bare:.0f}) µs, {own / bare:.2f}" for own, bare in (run["p50"], run["p99"])]
        took, trip = (f"{a:.0f}, {b:.0f} µs" for a, b in (run["run_time"], run["trips"]))
        cells = (
            name,
            run["ended"],
            run["cycles"],
            run["overruns"],
            *late,
            took,
            trip,
            f"{run['other']} of {run['compared']}",
        )
        lines.append(f"| {' | '.join(map(str, cells))} |")
        print(lines[-1], flush=True)
    if seconds >= SECONDS and not sys.argv[2:]:
        results.write(TITLE, "\n".join(lines))


if __name__ == "__main__":
    main()
