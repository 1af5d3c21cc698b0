"""The live loop against the twin, in processes of their own, for as long as asked: figures beside the bare loop's.

Before and after each run a loop that only sleeps is measured with the same settings, and cyclictest where it is
installed.
"""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from bowden.hardware.realtime import Settings
from bowden.live import lateness
from bowden.live.lateness import bare_loop_apart
from bowden.live.machine import cyclictest
from bowden.live.mcap_read import read
from bowden.rig.rig import Rig
from bowden.sim.run import simulate
from kept import Kept
from measure import Figure
from same_run import rmse_deg

LAWS = ("adaptive", "bowden")
RUN = 60.0
"""Length of one run, at most [s]."""
TRIES = 2
"""Runs, over those wanted: a machine whose hypervisor stalls for 20 ms ends a run by right, and another is made."""
BARE = 5.0
"""Length of each measurement of the bare loop [s]."""
STALL = 1e-3
"""Lateness that no program of ours causes: it is counted apart where the bare loop sees it too [s]."""
RIG = """[scenario]
duration_s = {seconds}
seed = {seed}
[limits]
reading_age = 10.0
lateness_s = 0.03
[drive]
heartbeat_timeout_ms = 40.0
[live]
cpu = {cpu}
"""


def one(law: str, seconds: float, seed: int) -> dict[str, Any]:
    """One run of one law; its figures."""
    with tempfile.TemporaryDirectory() as folder:
        return _one(law, seconds, seed, Path(folder), max(os.sched_getaffinity(0)))


def _one(law: str, seconds: float, seed: int, folder: Path, cpu: int) -> dict[str, Any]:
    rig = folder / "rig.toml"
    rig.write_text(RIG.format(seconds=seconds, seed=seed, cpu=cpu))
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
    own = Rig.read(rig).with_law(law)
    led = max(1.0, found["seconds_led"])
    pure = simulate(own.bench, own.fitted(), own.trajectory, duration=led, seed=own.seed, initial_motor=own.start_motor)
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
        "rmse_same_run_deg": rmse_deg(rig, law, seconds),
        "rmse_from_rest_deg": pure.metrics().rmse_deg,
        "run_time_median_us": found["run_time_median_us"],
        "loop": _shares(late),
        "bare": _shares(bare),
        "cyclictest": other.__dict__ if other else None,
        "stalls": int((late > STALL).sum()),
        "bare_stalls": int((bare > STALL).sum()),
        "beyond_the_bare_loops_worst": int((~same).sum()),
    }


def _shares(late: Any) -> dict[str, float]:
    return dict(lateness.figures(np.asarray(late)).__dict__)


def figures(minutes: float) -> tuple[list[Figure], str]:
    """Figures of every run, and a table of them."""
    wanted, seconds = max(1, round(minutes * 60.0 / RUN)), min(RUN, minutes * 60.0)
    kept = Kept(f"live_{seconds:g}")
    found = {law: [row[0] for row in kept.rows() if row[0]["law"] == law] for law in LAWS}
    kept.filled(_missing(found, wanted, seconds), len(LAWS) * wanted)
    return [figure for law in LAWS for figure in _of_a_law(law, found[law], wanted)], (
        f"{_table([run for law in LAWS for run in found[law]])}\n\n- Loop, recorder, operator and twin as processes at "
        f"1 kHz on {os.cpu_count()} processors, with encoder noise, in runs of {seconds:g} s. The bare loop is "
        f"measured for {BARE:g} s before and after each run, cyclictest after it. A run that a fault ended, as "
        "stalls of the machine do, is made again. The same run simulated has its preflight, approach and beginning, "
        "and no stalls; the one from rest is that of `bowden simulate`."
    )


def _missing(found: dict[str, list[dict[str, Any]]], wanted: int, seconds: float) -> Iterator[list[Any]]:
    for law, runs in found.items():
        while sum(run["ended_well"] for run in runs) < wanted and len(runs) < TRIES * wanted:
            runs.append(one(law, seconds, len(runs) + 1))
            yield [runs[-1]]


def _of_a_law(law: str, runs: list[dict[str, Any]], wanted: int) -> list[Figure]:
    well = [run for run in runs if run["ended_well"]]
    cycles, logged = (sum(run[key] for run in runs) for key in ("cycles", "cycles_logged"))
    unlogged = cycles - logged
    rmse, same = (np.array([run[key] for run in well]) for key in ("rmse_deg", "rmse_same_run_deg"))
    off = 100.0 * (float(np.sqrt(np.mean(rmse**2) / np.mean(same**2))) - 1.0) if well else np.inf
    half, rare = (
        float(np.median([run["loop"][key] / run["bare"][key] for run in runs])) for key in ("p50_us", "p99_us")
    )
    took = max(run["run_time_median_us"] for run in runs)
    beyond = sum(run["beyond_the_bare_loops_worst"] for run in runs)
    led = sum(run["seconds"] for run in well)
    return [
        Figure(
            f"{law}: runs to their end, of {len(runs)}", f"{len(well)}, {led:.0f} s", f"≥ {wanted}", len(well) >= wanted
        ),
        Figure(
            f"{law}: RMSE of all, over that of the same runs in simulated time",
            f"{off:+.1f} % (runs from {rmse.min():.4f}° to {rmse.max():.4f}°, simulated {same.min():.4f}° to "
            f"{same.max():.4f}°)",
            "± 10 %",
            abs(off) <= 10.0,
        ),
        Figure(f"{law}: cycles that are not in the log", f"{unlogged} of {cycles}", "0", not unlogged),
        Figure(f"{law}: lateness over the bare loop's, p50, median of the runs", f"{half:.2f}", "≤ 1.5", half <= 1.5),
        Figure(f"{law}: the same, p99", f"{rare:.2f}", "≤ 1.5", rare <= 1.5),
        Figure(f"{law}: cycles later than 1 ms and than any of the bare loop's", str(beyond), "–"),
        Figure(f"{law}: run time of a cycle, median, worst run", f"{took:.0f} µs", "≤ 250 µs", took <= 250.0),
    ]


def _table(found: list[dict[str, Any]]) -> str:
    head = (
        "| law | s | RMSE, same run simulated, from rest [°] | cycles, in the log | overruns | run time, median [µs] "
        "| lateness of | p50 | p99 | p99.9 | max [µs] | > 1 ms |\n|---|---|---|---|---|---|---|---|---|---|---|---|"
    )
    lines = [head]
    for run in found:
        errors = [run[key] for key in ("rmse_deg", "rmse_same_run_deg", "rmse_from_rest_deg")]
        rmse = "–" if run["rmse_deg"] is None else ", ".join(f"{error:.3f}" for error in errors)
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
