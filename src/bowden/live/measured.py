"""From the log of `bowden measure` to the motions that cable and servo are identified from."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import SafetyError
from bowden.core.files import whole_files
from bowden.cycle.one_cycle import WishSource
from bowden.live.live_run import Live
from bowden.live.mcap_read import Recording, read
from bowden.safety.supervisor import Mode

Array = NDArray[np.float64]

NEEDED = ("time", "lateness", "mode", "source", "wish", "command", "motor", "joint", "motor_age", "joint_age")
"""Columns of the log that are looked at."""
HEADER = "time_s,command_rad,motor_rad,joint_rad"
"""Columns of what comes out."""
_MOST_SKIPPED = 1000
"""Deadlines that the last cycle of the motion may have skipped."""


def write_motions(live: Live, log: Path, folder: Path) -> list[Path]:
    """Write the cable's and the servo's part of an excitation as CSV; the files.

    Args:
        live: the run that moved the motor through it.
        log: of that run.
        folder: for the files.

    Raises:
        SafetyError: the last motion of the run did not come to its end.
        OutputError: the folder cannot be written.
    """
    parts = motions(read(log, NEEDED), live.table[:, 0], live.servo_from, live.rig.sample_time)
    with whole_files(folder) as stage:
        for name, table in parts.items():
            np.savetxt(stage / name, table, "%.9g", ",", header=HEADER, comments="")
    return [folder / name for name in parts]


def motions(log: Recording, motor: Array, servo_from: int, period: float) -> Mapping[str, Array]:
    """``cable.csv`` and ``servo.csv`` → rows of time [s], command, motor and joint [rad], even in time.

    A cycle that was skipped, and an angle that did not come in its cycle, is drawn in between its neighbours: cycles
    that the supervisor bridged are no reason to measure again.

    Args:
        log: of the run, with the columns of `NEEDED`.
        motor: the motion that was planned, one target a cycle (n,) [rad].
        servo_from: the cycle of it at which the servo's part begins.
        period: of a cycle [s].

    Raises:
        SafetyError: the last motion of the run did not come to its end.
    """
    mode = log["mode"]
    armed = np.flatnonzero(mode == Mode.PREFLIGHT)
    led = (log["source"] == WishSource.MOTION) & ((mode == Mode.RUNNING) | (mode == Mode.BRIDGING))
    rows = np.flatnonzero(led & (np.arange(len(mode)) > (armed[-1] if len(armed) else -1)))
    tick = np.rint((log["time"] - log["lateness"])[rows] / period).astype(int)  # deadlines lie on a grid
    place = _places(tick, log["wish"][rows], mode[rows] == Mode.RUNNING, motor)
    if place is None:
        done = int(tick[-1] - tick[0]) + 1 if len(rows) else 0
        raise SafetyError(
            f"the motion was stopped after {done} of {len(motor)} cycles",
            do="let it run to its end; the log up to here is kept",
        )
    parts = {"cable.csv": rows[(place >= 0) & (place < servo_from)], "servo.csv": rows[place >= servo_from]}
    return {name: _even(log, part, period) for name, part in parts.items()}


def _places(tick: NDArray[np.int_], wish: Array, running: NDArray[np.bool_], motor: Array) -> NDArray[np.int_] | None:
    """Where in the motion each cycle is, less than 0 on the way to it; None where the motion did not end.

    The wishes themselves show it: the last cycle is at the end of the motion, or as far behind it as it has skipped.
    """
    for beyond in range(_MOST_SKIPPED if len(tick) else 0):
        place = tick - tick[-1] + len(motor) - 1 + beyond
        if place[0] > 0:
            return None
        there = running & (place >= 0)
        if np.allclose(wish[there], motor[np.minimum(place[there], len(motor) - 1)], rtol=0.0, atol=1e-9):
            return place
    return None


def _even(log: Recording, rows: NDArray[np.int_], period: float) -> Array:
    time = log["time"][rows]
    even = np.arange(time[0], time[-1], period)
    columns = [even - even[0], np.interp(even, time, log["command"][rows])]
    for angle in ("motor", "joint"):
        came = (log[f"{angle}_age"][rows] == 0.0) & np.isfinite(log[angle][rows])
        columns.append(np.interp(even, time[came], log[angle][rows][came]))
    return np.column_stack(columns)
