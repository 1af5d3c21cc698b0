"""One, two and four axes in one loop against their twins, beside a loop that only sleeps: lateness and run time.

    python benchmarks/several_axes.py [SECONDS]

Each run is `bowden run --twin --auto`, in the order 1, 2, 4 axes, with the bare loop measured before and after it.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from bowden.hardware.realtime import Settings
from bowden.live.lateness import bare_loop_apart, figures
from bowden.live.mcap_read import read

COUNTS = (1, 2, 4)
BARE = 5.0
"""Length of each measurement of the bare loop [s]."""
RIG = """[scenario]
duration_s = {seconds}
[control]
law = "bowden"
[limits]
reading_age = 10.0
lateness_s = 0.03
[drive]
heartbeat_timeout_ms = 40.0
"""
AXIS = """[[axis]]
name = "axis{number}"
[axis.drive]
node_id = {number}
"""


def one(count: int, seconds: float) -> dict[str, Any]:
    """One run; its figures."""
    with tempfile.TemporaryDirectory() as folder:
        rig = Path(folder) / "rig.toml"
        axes = "".join(AXIS.format(number=number) for number in range(1, count + 1)) if count > 1 else ""
        rig.write_text(RIG.format(seconds=seconds) + axes)
        before, _ = bare_loop_apart(BARE, 1e-3, Settings())
        words = ["run", str(rig), "--twin", "--auto", "--json", "--out", folder]
        command = [sys.executable, "-c", "from bowden.app.main import main; main()", *words]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if not done.stdout:
            raise SystemExit(done.stderr)
        found = json.loads(done.stdout)
        after, _ = bare_loop_apart(BARE, 1e-3, Settings())
        log = read(Path(found["log"]), ("lateness", "run_time"))
    bare, late, took = figures(np.concatenate([before, after])), figures(log["lateness"]), 1e6 * log["run_time"]
    return {
        "axes": count,
        "ended_well": found["ended_well"],
        "cycles": found["cycles"],
        "overruns": found["overruns"],
        "p50": (late.p50_us, bare.p50_us),
        "p99": (late.p99_us, bare.p99_us),
        "run_time": [float(np.percentile(took, share)) for share in (50.0, 99.0)],
    }


def main() -> None:
    """Print a table."""
    seconds = float(sys.argv[1]) if sys.argv[1:] else 20.0
    print("| axes | ended as asked | cycles | overruns | lateness p50 (bare) | p99 (bare) | run time p50 | p99 |")
    print("|---|---|---|---|---|---|---|---|")
    for count in COUNTS:
        run = one(count, seconds)
        late = [f"{own:.0f} ({bare:.0f}) µs, {own / bare:.2f}" for own, bare in (run["p50"], run["p99"])]
        took = [f"{value:.0f} µs" for value in run["run_time"]]
        cells = (run["axes"], "yes" if run["ended_well"] else "no", run["cycles"], run["overruns"], *late, *took)
        print(f"| {' | '.join(map(str, cells))} |", flush=True)


if __name__ == "__main__":
    main()
