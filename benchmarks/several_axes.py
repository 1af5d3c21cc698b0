"""One, two and four axes in one loop against their twins, beside a loop that only sleeps: lateness and run time.

Two drives share a bus, as many as one of 1 Mbit/s carries at 1 kHz.

    python benchmarks/several_axes.py [SECONDS] [CASE …]

Each run is `bowden run --twin --auto` with SECONDS of motion (20), with the bare loop measured before and after it. The
cases are those of `CASES`; all of them unless some are named. Each is printed with how long it took, and where: the
bare loop's 10 s, starting (twins, bring-up and check, one axis after the other) and running. What makes it long is the
fixed part, which grows with the axes: each drive's bus is listened to for a second, and each CiA 402 drive's watch is
tried; each twin is a process that loads the package.

It needs a computer of its own with more processors than twins, or the twins are late: each takes a quarter of one and
more at 1 kHz. A case that a stall ended says so, and its figures then say nothing.
"""

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

import results
from bowden.hardware.realtime import Settings
from bowden.live.lateness import bare_loop_apart, figures
from bowden.live.mcap_read import read
from drive_families import why

TITLE = "Several axes"
CASES = {"1": (1, "cia402"), "2": (2, "cia402"), "4": (4, "cia402"), "1ak": (1, "ak_mit"), "4ak": (4, "ak_mit")}
"""Name → axes, and family of their drives."""
SECONDS = 20.0
"""Length of a run whose figures are kept [s]."""
BARE = 5.0
"""Length of each measurement of the bare loop [s]."""
RIG = """[scenario]
duration_s = {seconds}
[control]
law = "bowden"
[limits]
reading_age = 10.0
lateness_s = 0.03
"""
FAMILIES = {
    "cia402": "[drive]\nheartbeat_timeout_ms = 40.0\n",
    "ak_mit": '[motor]\ngear = 9.0\ntorque_constant_nm_per_a = 0.091\n[drive]\nfamily = "ak_mit"\n',
}
AXIS = """[[axis]]
name = "axis{number}"
[axis.drive]
node_id = {number}
channel = "bus{bus}"
"""
ON_A_BUS = 2
"""Drives that a bus of 1 Mbit/s carries at 1 kHz."""
JOINT = "joint_node_id = {joint}\n"


def rig_of(count: int, family: str, seconds: float) -> str:
    """The rig of a case."""
    text = RIG.format(seconds=seconds) + FAMILIES[family]
    for number in range(1, count + 1) if count > 1 else ():
        text += AXIS.format(number=number, bus=(number + ON_A_BUS - 1) // ON_A_BUS) + (
            JOINT.format(joint=32 + number) if family == "ak_mit" else ""
        )
    return text


def one(count: int, family: str, seconds: float) -> dict[str, Any]:
    """One run; its figures."""
    with tempfile.TemporaryDirectory() as folder:
        rig = Path(folder) / "rig.toml"
        rig.write_text(rig_of(count, family, seconds))
        began = time.monotonic()
        before, _ = bare_loop_apart(BARE, 1e-3, Settings())
        measured = time.monotonic()
        words = ["run", str(rig), "--twin", "--auto", "--json", "--out", folder]
        command = [sys.executable, "-c", "from bowden.app.main import main; main()", *words]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if not done.stdout:
            raise SystemExit(done.stderr)
        ran = time.monotonic()
        found = json.loads(done.stdout)
        after, _ = bare_loop_apart(BARE, 1e-3, Settings())
        log = read(Path(found["log"]), ("time", "lateness", "run_time"))
        over = time.monotonic()
        if not found["ended_well"]:
            print(f"ended: {why(found)}", file=sys.stderr)
    bare, late, took = figures(np.concatenate([before, after])), figures(log["lateness"]), 1e6 * log["run_time"]
    return {
        "axes": f"{count} {family}",
        "seconds": (over - began, over - ran + measured - began, ran - measured - float(np.ptp(log["time"]))),
        "ended_well": found["ended_well"],
        "cycles": found["cycles"],
        "overruns": found["overruns"],
        "p50": (late.p50_us, bare.p50_us),
        "p99": (late.p99_us, bare.p99_us),
        "run_time": [float(np.percentile(took, share)) for share in (50.0, 99.0)],
    }


def main() -> None:
    """Print a table."""
    seconds = float(sys.argv[1]) if sys.argv[1:] else SECONDS
    lines = [
        "| axes | ended as asked | cycles | overruns | lateness p50 (bare) | p99 (bare) | run time p50 | p99 | took |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    print(*lines, sep="\n")
    for name in sys.argv[2:] or CASES:
        run = one(*CASES[name], seconds)
        late = [f"{own:.0f} ({bare:.0f}) µs, {own / bare:.2f}" for own, bare in (run["p50"], run["p99"])]
        took = [f"{value:.0f} µs" for value in run["run_time"]]
        whole, bare, starting = run["seconds"]
        parts = f"{whole:.0f} s: bare loop {bare:.0f}, starting and ending {starting:.0f}"
        cells = (run["axes"], "yes" if run["ended_well"] else "no", run["cycles"], run["overruns"], *late, *took, parts)
        lines.append(f"| {' | '.join(map(str, cells))} |")
        print(lines[-1], flush=True)
    if seconds >= SECONDS and not sys.argv[2:]:
        results.write(TITLE, "\n".join(lines))


if __name__ == "__main__":
    main()
