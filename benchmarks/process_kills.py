"""Every process of a run killed or stopped at random moments: torque off in time, nothing left, the next run starts.

    python benchmarks/process_kills.py --operate RIG CHANNEL LOG      # a run as `bowden run --auto` has it

The operator is a process of this file, which acknowledges what the case before has left, and then does what
`bowden run --auto` does. All cases of a victim that leaves the twin alive go on with that twin: each is the restart
after the one before.
"""

import argparse
import contextlib
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from bowden.core.errors import BowdenError
from bowden.live.live_run import live_run
from bowden.live.mcap_read import LogReader
from bowden.live.operator import ending_signals, operate
from bowden.live.row import AT
from bowden.live.session import Session
from bowden.live.twin_process import RunningTwin, running_twin
from bowden.rig.rig import Rig
from bowden.safety.faults import of
from bowden.safety.state import Mode, Request
from kept import Kept
from measure import Figure, Found

KILLS = 1000
LATEST = 4.0
"""After the session has begun, at most: preflight, approach and law have begun by then [s]."""
OFF = {"loop": 0.050, "operator": 0.5, "reader": 0.25, "recorder": np.inf, "twin": np.inf}
"""Victim → torque off within, from the last heartbeat where the loop is lost, else from the signal [s]."""
MODULES = {"loop": "loop_process", "reader": "intent_process", "recorder": "live.recorder"}
MOST_LOST = 0.2
"""Of a log [s]."""
GONE = 30.0
"""All processes of a run have ended by then: the longest waits are for one that is stopped [s]."""
ENDS = (signal.SIGKILL, signal.SIGSTOP)
LIMITS = "[limits]\nreading_age = 10.0\nlateness_s = 0.04\n"
RIG = f"[scenario]\nduration_s = 60.0\n{LIMITS}"
EMG_RIG = f"{RIG}[emg]\nsource = 'file:emg.csv'\nhigh_deg = 60.0\nduration_s = 1.0\n"
COLUMNS = ("number", "victim", "signal", "moment", "off", "lost", "ended", "left", "code", "before", "faults")


def _operate(rig: Path, channel: str, log: Path) -> int:
    from bowden.live.emg_process import EmgProcess

    given = Rig.read(rig)
    live = live_run(given.on_bus(channel))
    with contextlib.ExitStack() as stack:
        ending = stack.enter_context(ending_signals())
        emg = None if live.emg is None else stack.enter_context(contextlib.closing(EmgProcess(given)))
        if emg is not None:
            emg.await_ready()
        session = stack.enter_context(Session(live, log, emg, remembers=False))
        print("begun", flush=True)
        while session.running and ((row := session.last()) is None or row["faults"]):
            session.ask(Request.ACKNOWLEDGE)
            session.wait(0.05)
            if session.still > 1.0 or (row is not None and row["time"] > 20.0):
                break
        print("free", flush=True)
        operate(session, ending, auto=True, quiet=True)
    ended = session.ended
    return 0 if ended is not None and ended.mode == Mode.STOPPED and not session.error else 1


def _recording(path: Path) -> None:
    """Bursts of an EMG in two muscles, for longer than a run."""
    rate, seconds = 1000.0, 60.0
    at = np.arange(round(seconds * rate)) / rate
    noise = 0.01 * np.random.default_rng(1).standard_normal((len(at), 2))
    loud = [np.where((at % 4.0 >= begin) & (at % 4.0 < begin + 1.0), 20.0, 1.0) for begin in (1.0, 3.0)]
    table = np.column_stack([at, noise * np.column_stack(loud)])
    np.savetxt(path, table, ["%.3f", "%.5f", "%.5f"], ",", header="time_s,biceps_mV,triceps_mV", comments="")


def cases(numbers: list[int], victims: tuple[str, ...] = tuple(OFF)) -> Iterator[list[Any]]:
    """`COLUMNS` of each case: time to torque off and of rows lost [s], NaN where there was none; seconds until all
    had ended; what was left; exit code, None where killed; faults before the signal and at the end.
    """
    with tempfile.TemporaryDirectory() as name, contextlib.ExitStack() as stack:
        folder, twin = Path(name), None
        _recording(folder / "emg.csv")
        (folder / "rig.toml").write_text(RIG)
        (folder / "emg.toml").write_text(EMG_RIG)
        for number in numbers:
            drawn = random.Random(number)
            victim, end = drawn.choice(victims), drawn.choice(ENDS)
            if twin is None or twin.process.poll() is not None:
                stack.close()
                twin = stack.enter_context(running_twin(folder / "rig.toml", folder / f"b{number}"))
            yield [number, victim, end.name, *_case(folder, twin, number, victim, end, drawn.uniform(0.0, LATEST))]
            if victim == "twin":
                stack.close()
                twin = None


def _case(folder: Path, twin: RunningTwin, number: int, victim: str, end: signal.Signals, moment: float) -> list[Any]:
    """What a run against that twin comes to; see `COLUMNS`."""
    log = folder / f"{number}.mcap"
    rig = folder / ("emg.toml" if victim == "reader" else "rig.toml")
    words = [sys.executable, __file__, "--operate", str(rig), twin.channel, str(log)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=folder) as operator:
        return _hit(operator, folder, twin, number, victim, end, moment)


def _hit(
    operator: "subprocess.Popen[str]",
    folder: Path,
    twin: RunningTwin,
    number: int,
    victim: str,
    end: signal.Signals,
    moment: float,
) -> list[Any]:
    assert operator.stdout is not None
    assert operator.stderr is not None
    said = [operator.stdout.readline() for _ in range(2)]
    if said != ["begun\n", "free\n"]:
        return [moment, *(np.nan,) * 3, [], operator.wait(), f"did not begin: {operator.stderr.read().strip()}", ""]
    parts = _parts(operator.pid)
    hit = {**parts, "operator": operator.pid, "twin": twin.process.pid}[victim]
    time.sleep(moment)
    torque = bool(twin.control.status()["torque"])
    at = time.monotonic()
    with contextlib.suppress(ProcessLookupError):  # a fault of its own has ended the run before
        os.kill(hit, end)
    off = np.nan
    if victim == "recorder":
        time.sleep(1.0)
        operator.terminate()
    if torque and np.isfinite(OFF[victim]):
        off = _off_after(twin, at, loop=victim == "loop")
    if end == signal.SIGSTOP:
        time.sleep(max(0.0, at + 1.5 - time.monotonic()))
        if victim in ("operator", "twin"):
            os.kill(hit, signal.SIGCONT)
    begun = time.monotonic()
    pids = [operator.pid, *parts.values(), *_parts(operator.pid).values()]
    while any(map(_alive, pids)) and time.monotonic() < begun + GONE:
        operator.poll()
        pids += _parts(operator.pid).values()
        time.sleep(0.02)
    ended = time.monotonic() - begun
    left = [f"process {pid}" for pid in dict.fromkeys(pids) if _alive(pid)]
    left += [path.name for path in Path("/dev/shm").glob(f"bowden-{operator.pid}-*")]
    for pid in filter(_alive, pids):
        os.kill(pid, signal.SIGKILL)
    code = operator.wait()
    if victim != "twin" and twin.control.status()["torque"]:
        left.append("torque")
    lost, before, faults = _of_log(folder, number, at, victim)
    for file in folder.glob(f"{number}*.mcap"):
        file.unlink()
    return [moment, off, lost, ended, left, code, before, faults]


def _off_after(twin: RunningTwin, at: float, *, loop: bool) -> float:
    """From the signal, or the last heartbeat before it, to torque off [s]; infinite where it stays on."""
    deadline = time.monotonic() + 10.0
    while twin.control.status()["torque"]:
        if time.monotonic() > deadline:
            return np.inf
        time.sleep(0.005)
    last = twin.control.status()["last_heartbeat"]
    off = max((entry["time"] for entry in twin.control.journal() if entry["event"] == "torque_off"), default=at)
    return max(0.0, off - (last if loop and last is not None else at))


def _of_log(folder: Path, number: int, at: float, victim: str) -> tuple[float, str, str]:
    """Seconds of the run that are in no file, faults before the signal, and all of them."""
    numbers, rows, start = [], [], 0.0
    for file in sorted(folder.glob(f"{number}*.mcap")):
        try:
            log = LogReader(file)
            for piece in log:
                numbers.append(piece.numbers)
                rows.append(piece.rows)
        except BowdenError:  # killed before anything was in it
            continue
        start = 1e-9 * float(log.about["start_monotonic_ns"])
    if not numbers:
        return np.inf, "", ""
    found, kept = np.unique(np.concatenate(numbers), return_index=True)
    table = np.concatenate(rows)[kept]
    when = table[:, AT["time"]] + start
    lost = 1e-3 * float(found[-1] + 1 - len(found))
    latched = table[:, AT["mode"]] >= Mode.RELEASING
    early = np.flatnonzero(latched & (when < at - 0.001))
    if victim == "loop" and not len(early) and when[-1] < at:
        lost += at - float(when[-1])
    names = [fault.name for fault in of(float(table[early[0], AT["faults"]]))] if len(early) else []
    all_bits = int(np.bitwise_or.reduce(table[latched, AT["faults"]].astype(np.int64))) if latched.any() else 0
    return lost, " ".join(names or ["ended"] * bool(len(early))), " ".join(fault.name for fault in of(float(all_bits)))


def _parts(operator: int) -> dict[str, int]:
    """Processes of a run by what they are."""
    found: dict[str, int] = {}
    with contextlib.suppress(OSError):  # it has ended meanwhile
        for thread in Path(f"/proc/{operator}/task").iterdir():
            for child in (thread / "children").read_text().split():
                said = Path(f"/proc/{child}/cmdline").read_text()
                found |= {name: int(child) for name, module in MODULES.items() if module in said}
    return found


def _alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def figures(share: float) -> Found:
    """Torque off in time, what was left, and what was lost of the logs."""
    kept, wanted = Kept("process_kills"), max(10, round(share * KILLS))
    there = {row[0] for row in kept.rows()}
    rows = kept.filled(cases([number for number in range(wanted) if number not in there]), wanted)
    rows = [dict(zip(COLUMNS, row, strict=True)) for row in rows][:wanted]
    found = [_torque_figure(victim, limit, rows) for victim, limit in OFF.items() if np.isfinite(limit)]
    left = [row for row in rows if row["left"]]
    tripped = [row for row in rows if row["before"]]
    lost = max(row["lost"] for row in rows if np.isfinite(row["ended"]))
    for row in (*left, *tripped):
        print(row)
    found += [
        Figure(f"runs that left something, of {len(rows)}", str(len(left)), "0", not left),
        Figure("runs that did not begin, or were ended before the signal", str(len(tripped)), "0", not tripped),
        Figure("lost of a log", f"{lost:.3f} s at most", f"≤ {MOST_LOST} s", lost <= MOST_LOST),
    ]
    return Found(found, f"SIGKILL or SIGSTOP of one of five processes, up to {LATEST:g} s after the session has begun.")


def _torque_figure(victim: str, limit: float, rows: list[dict[str, Any]]) -> Figure:
    off = [row["off"] for row in rows if row["victim"] == victim and not row["before"] and np.isfinite(row["moment"])]
    off = [one for one in off if not np.isnan(one)]
    most = max(off, default=0.0)
    said = f"{1e3 * float(np.median(off or [0.0])):.0f} ms in the median, {1e3 * most:.0f} ms at most, {len(off)} times"
    return Figure(f"torque off without its {victim}", said, f"≤ {1e3 * limit:.0f} ms", most <= limit)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--operate", nargs=3, required=True, metavar=("RIG", "CHANNEL", "LOG"))
    rig_path, bus, log_path = parser.parse_args().operate
    raise SystemExit(_operate(Path(rig_path), bus, Path(log_path)))
