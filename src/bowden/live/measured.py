"""From the log of `bowden measure` to the motions that cable and servo are identified from."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import SafetyError, counted
from bowden.core.files import whole_files
from bowden.cycle.one_cycle import TargetSource
from bowden.live.live_run import Live
from bowden.live.mcap_read import Recording, read
from bowden.safety.state import Mode

Array = NDArray[np.float64]

NEEDED = (
    "time",
    "lateness",
    "mode",
    "source",
    "requested_target",
    "command",
    "motor",
    "joint",
    "motor_age",
    "joint_age",
)
"""Columns of the log that are looked at."""
HEADER = "time_s,command_rad,motor_rad,joint_rad"
"""Columns of what comes out."""
_EQUAL = 1e-9
"""Targets that differ by less are the same [rad]."""
_MOST_DRAWN = 0.1
"""Share of the samples that may be drawn in between others, which the cable's and the servo's models bear."""


class Stalls(NamedTuple):
    """Stalls of the loop by this computer."""

    drawn: int
    """Cycles that were left out; their samples are drawn in between their neighbours."""
    longest: float
    """The longest time of it [s]."""

    @property
    def note(self) -> str:
        """The same for a person; empty where there was none."""
        if not self.drawn:
            return ""
        stalled = f"this computer stalled, for {1e3 * self.longest:.0f} ms at most"
        return f"{stalled}: {counted(self.drawn, 'sample')} of the files drawn in between others, so that time is even"


def write_motions(live: Live, log: Path, folder: Path) -> list[Path]:
    """Write the cable's and the servo's part of an excitation as CSV; the files.

    Args:
        live: the run that moved the motor through it.
        log: of that run.
        folder: for the files.

    Raises:
        SafetyError: the last motion of the run did not come to its end, or this computer was too busy for it.
        OutputError: the folder cannot be written.
    """
    parts = motions(read(log, NEEDED), live.table[:, 0], live.servo_from, live.rig.sample_time)
    with whole_files(folder) as stage:
        for name, table in parts.items():
            np.savetxt(stage / name, table, "%.9g", ",", header=HEADER, comments="")
    return [folder / name for name in parts]


def motions(log: Recording, motor: Array, servo_from: int, period: float) -> Mapping[str, Array]:
    """``cable.csv`` and ``servo.csv`` → rows of time [s], command, motor and joint [rad], even in time.

    The motion stands still while this computer does not let the loop run (`live.script`), and the motor on the target
    that it was sent last. What was not recorded then, and an angle that did not come in its cycle, is drawn in between
    its neighbours: neither that nor cycles that the supervisor bridged are a reason to measure again.

    Args:
        log: of the run, with the columns of `NEEDED`.
        motor: the motion that was planned, one target a cycle (n,) [rad].
        servo_from: the cycle of it at which the servo's part begins.
        period: of a cycle [s].

    Raises:
        SafetyError: the last motion of the run did not come to its end, or this computer was too busy for it.
    """
    mode, rows = log["mode"], _led(log)
    place = _places(log["requested_target"][rows], mode[rows] == Mode.RUNNING, motor)
    if place is None:
        done = len(rows)
        raise SafetyError(
            f"the motion was stopped after {done} of {len(motor)} cycles",
            do="let it run to its end; the log up to here is kept",
        )
    drawn, longest = stalls(log, period)
    if drawn > _MOST_DRAWN * len(motor):
        share = f"{100.0 * drawn / len(motor):.0f} % of the cycles were left out, for {1e3 * longest:.0f} ms at most"
        raise SafetyError(
            f"this computer is too busy to measure: {share}",
            expected=f"{100.0 * _MOST_DRAWN:g} % or less",
            do="close other programs, and run `bowden doctor`; or set a longer sample_time_ms in [bench]",
        )
    parts = {
        "cable.csv": rows[(place >= 0) & (place < servo_from)],
        "servo.csv": rows[(place >= servo_from) & (place < len(motor))],
    }
    return {name: _even(log, part, period) for name, part in parts.items()}


def _led(log: Recording) -> NDArray[np.int_]:
    """Rows of the last motion, and of the way to it."""
    mode = log["mode"]
    armed = np.flatnonzero(mode == Mode.PREFLIGHT)
    led = (log["source"] == TargetSource.MOTION) & ((mode == Mode.RUNNING) | (mode == Mode.BRIDGING))
    return np.flatnonzero(led & (np.arange(len(mode)) > (armed[-1] if len(armed) else -1)))


def stalls(log: Recording, period: float) -> Stalls:
    """Cycles that were left out in the last motion of a log, and the longest time of it.

    Args:
        log: with the columns of `NEEDED`.
        period: of a cycle [s].
    """
    time = (log["time"] - log["lateness"])[_led(log)]  # deadlines lie on a grid
    missing = np.maximum(np.rint(np.diff(time) / period) - 1.0, 0.0)
    return Stalls(int(missing.sum()), float(missing.max(initial=0.0) * period))


def _places(requested_target: Array, running: NDArray[np.bool_], motor: Array) -> NDArray[np.int_] | None:
    """Place of each cycle in the motion, below 0 before it, beyond its length on the way home; None if it did not end.

    Each cycle is one place further. The targets themselves show the last one.
    """
    last = np.abs(requested_target - motor[-1]) <= _EQUAL
    for end in np.flatnonzero(last)[::-1]:
        place = np.arange(len(requested_target)) - end + len(motor) - 1
        if place[0] > 0:
            return None
        there = running & (place >= 0) & (place < len(motor))
        if np.allclose(requested_target[there], motor[place[there]], rtol=0.0, atol=_EQUAL):
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
