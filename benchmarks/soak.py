"""The live loop against the twin, in processes of their own, for as long as asked: figures beside the bare loop's.

``make soak MINUTES=10`` or ``python benchmarks/soak.py --minutes 10 [--out FOLDER]``. Laws adaptive and bowden, one after
the other, in runs of a minute; before and after each run a loop that only sleeps is measured with the same settings,
and cyclictest where it is installed. Every finished run is a JSON file in the folder: an interrupted soak goes on where
it was. At the end the table of benchmarks/RESULTS.md is written.
"""

import argparse
import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np

from bowden.app import compose
from bowden.runtime.lateness import bare_loop_apart, figures
from bowden.runtime.machine import cyclictest
from bowden.runtime.mcap_read import read
from bowden.runtime.realtime import Settings
from bowden.sim.closed_loop import simulate

LAWS = ("adaptive", "bowden")
RUN = 60.0
"""Length of one run [s]."""
BARE = 10.0
"""Length of each measurement of the bare loop [s]."""
STALL = 1e-3
"""Lateness that no program of ours causes: it is counted apart where the bare loop sees it too [s]."""
RIG = """[scenario]
duration_s = {seconds}
[limits]
reading_age = 10.0
[live]
cpu = {cpu}
"""
BEGIN, END = "<!-- soak -->", "<!-- end of soak -->"


def one(law: str, seconds: float, folder: Path, cpu: int) -> dict[str, Any]:
    """One run of one law; its figures."""
    rig = folder / "rig.toml"
    rig.write_text(RIG.format(seconds=seconds, cpu=cpu))
    settings = Settings(cpu=cpu)
    before, _ = bare_loop_apart(BARE, 1e-3, settings)
    words = ["run", str(rig), "--twin", "--auto", "--json", "--law", law, "--out", str(folder)]
    command = [sys.executable, "-c", "from bowden.app.main import main; main()", *words]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if not done.stdout:
        raise SystemExit(done.stderr)
    found = json.loads(done.stdout)
    after, _ = bare_loop_apart(BARE, 1e-3, settings)
    bare, other = np.concatenate([before, after]), cyclictest(BARE, 1e-3, settings.priority, cpu)
    log = read(Path(found["log"]))
    late = log["lateness"]
    setup, description = compose.setup(rig)
    chosen = compose.law_for(law, description, setup.bench, folder)
    pure = simulate(
        setup.bench, chosen, setup.reference, duration=seconds, seed=setup.seed, initial_motor=setup.initial_motor
    )
    same = late <= max(STALL, float(bare.max()))
    return {
        "law": law,
        "ended_well": found["ended_well"],
        "faults": found["faults"],
        "seconds": found["seconds_led"],
        "cycles": found["cycles"],
        "cycles_logged": found["cycles_logged"],
        "overruns": found["overruns"],
        "rmse_deg": found["rmse_deg"],
        "rmse_simulated_deg": pure.metrics().rmse_deg,
        "run_time_median_us": found["run_time_median_us"],
        "loop": _figures(late),
        "bare": _figures(bare),
        "cyclictest": other.__dict__ if other else None,
        "stalls": int((late > STALL).sum()),
        "bare_stalls": int((bare > STALL).sum()),
        "beyond_the_bare_loops_worst": int((~same).sum()),
    }


def _figures(late: Any) -> dict[str, float]:
    return dict(figures(np.asarray(late)).__dict__)


def table(found: list[dict[str, Any]]) -> str:
    """The section of RESULTS.md."""
    head = (
        "| law | s | RMSE, simulated [°] | cycles, in the log | overruns | run time, median [µs] | lateness of"
        " | p50 | p99 | p99.9 | max [µs] | > 1 ms |\n|---|---|---|---|---|---|---|---|---|---|---|---|"
    )
    lines = [head]
    for run in found:
        rmse = "–" if run["rmse_deg"] is None else f"{run['rmse_deg']:.3f}, {run['rmse_simulated_deg']:.3f}"
        ended = "" if run["ended_well"] else f" (ended by: {', '.join(run['faults'])})"
        first = (
            f"| {run['law']}{ended} | {run['seconds']:g} | {rmse} | {run['cycles']}, {run['cycles_logged']} "
            f"| {run['overruns']} | {run['run_time_median_us']:.0f} "
        )
        for name, key, stalls in (
            ("loop", "loop", run["stalls"]),
            ("bare loop", "bare", run["bare_stalls"]),
            ("cyclictest", "cyclictest", None),
        ):
            late = run[key]
            if late is None:
                continue
            shares = " | ".join(f"{late[share]:.0f}" for share in ("p50_us", "p99_us", "p999_us", "max_us"))
            lines.append(f"{first}| {name} | {shares} | {'–' if stalls is None else stalls} |")
            first = "| | | | | | "
        ratios = [run["loop"][share] / run["bare"][share] for share in ("p50_us", "p99_us")]
        lines.append(f"| | | | | | | ratio to the bare loop | {ratios[0]:.2f} | {ratios[1]:.2f} | | | |")
    return "\n".join(lines)


def write(found: list[dict[str, Any]], page: Path) -> None:
    """Put the table in its place, or at the end of the page."""
    text = page.read_text(encoding="utf-8")
    section = (
        f"{BEGIN}\n## The live loop\n\n`make soak`: loop, recorder, operator and twin as processes at 1 kHz on "
        f"{os.cpu_count()} processors; the bare loop is measured before and after each run.\n\n{table(found)}\n{END}"
    )
    if BEGIN in text:
        text = re.sub(f"{BEGIN}.*{END}", lambda _: section, text, flags=re.DOTALL)
    else:
        text = text.rstrip() + "\n\n" + section + "\n"
    page.write_text(text, encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--out", type=Path, default=Path("out/soak"))
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    runs = max(1, round(given.minutes * 60.0 / RUN))
    seconds = min(RUN, given.minutes * 60.0)
    cpu = max(os.sched_getaffinity(0))
    found = []
    for law in LAWS:
        for number in range(runs):
            kept = given.out / f"{law}-{seconds:g}s-{number}.json"
            if not kept.exists():
                result = one(law, seconds, given.out, cpu)
                kept.write_text(json.dumps(result))
                print(f"{kept.name}: {json.dumps(result)}", flush=True)
            found.append(json.loads(kept.read_text()))
    write(found, Path(__file__).with_name("RESULTS.md"))


if __name__ == "__main__":
    main()
