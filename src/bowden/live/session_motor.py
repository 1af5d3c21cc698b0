"""One motor of a live run from the operator's side: its rows, its faults, and what is remembered of its drive."""

import contextlib
import math
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor

import numpy as np
from numpy.typing import NDArray

from bowden.core.clock import SECOND
from bowden.core.errors import DriveError
from bowden.cycle.one_cycle import TargetSource
from bowden.hardware.twin.control import TwinControl
from bowden.live import drive_memory
from bowden.live.gain_ramp import in_force
from bowden.live.live_run import Live
from bowden.live.row import AT
from bowden.live.stops import onsets
from bowden.live.together import OF_ALL, view
from bowden.models.drive.thermal import cold
from bowden.rig.families import family_of
from bowden.safety.faults import Fault
from bowden.safety.state import Mode

Array = NDArray[np.float64]

_PATIENCE = 0.5
"""For a twin's answer; it must not hold up the operator [s]."""


class SessionMotor:
    """One motor; of a rig with one motor that is the whole run.

    Args:
        live: the run of this motor.
        columns: of the whole run.
        names: of all motors.
        start: the monotonic clock where the column ``time`` is zero [ns].
        remembers: whether the motor's warmth and its latch are taken from the run before and kept for the next one.
    """

    def __init__(
        self, live: Live, columns: Sequence[str], names: Sequence[str], start: int, *, remembers: bool
    ) -> None:
        self.live, self.name, self._remembers = live, live.name, remembers
        seen = view(columns, names, live.name)
        self._places, self.columns = np.array(seen.places), seen.columns
        """As a run with this motor alone has them."""
        at = dict(zip(seen.columns, seen.places, strict=True))
        self._at = {name: at[name] for name in AT}
        drive = live.rig.drive_parameters
        self._start, self._led = start / SECOND, False
        self._start_scenario(math.inf)
        self.thermal = drive_memory.read_heat(drive, live.limits) if remembers else cold(live.limits.thermal)
        """Temperatures of the motor at the end of the previous run."""
        self.latched = drive_memory.read_latch(drive) if remembers else None
        """Faults that have not been acknowledged, a sum of 2**fault; None where there is no latch."""
        self.came: dict[Fault, float] = {}
        """Onset of each present fault [s], in the order of time."""
        self.emergency = 0
        """Error code of the drive's last emergency; 0 where there was none."""

    def see(self, rows: Array, latching: Executor) -> None:
        """Take in the run's newest rows (n, width), one at least; what is remembered is kept by `latching`."""
        at = self._at
        led = np.flatnonzero(rows[:, at["source"]] >= TargetSource.LAW_BEGINS)
        if len(led) and not self._led:
            self._led = True
            self._start_scenario(self._start + float(rows[led[0], at["time"]]))
        bits = rows[:, at["faults"]]
        clear = np.flatnonzero(bits == 0.0)
        begin = int(clear[-1]) + 1 if len(clear) else 0
        before = {} if len(clear) else self.came
        self.came = {**before, **onsets(bits[begin:], rows[begin:, at["time"]]), **before}
        codes = rows[:, at["emergency"]]
        self.emergency = int(next((code for code in codes[::-1] if code > 0.0), self.emergency))
        self._remember_latch(rows[-1], latching)

    def _start_scenario(self, at: float) -> None:
        """Tell the drive's twin when the law begins [s]: until then its sheath stays as it is at the scenario's start.

        On a rig there is no twin, and nothing is sent.
        """
        drive = self.live.rig.drive_parameters
        with contextlib.suppress(DriveError), TwinControl(family_of(drive).control(drive), _PATIENCE) as twin:
            twin.start_scenario(at)

    def _remember_latch(self, row: Array, latching: Executor) -> None:
        """Keep what latched the run, until somebody acknowledges it, by a thread of its own: a disk may be slow."""
        latched = int(row[self._at["faults"]]) if row[self._at["mode"]] == Mode.LATCHED else None
        if (latched is None) == (self.latched is None) or not self._remembers:
            return
        if latched is not None:
            latching.submit(drive_memory.keep_latch, self.live.rig.drive_parameters, latched)
        else:
            latching.submit(drive_memory.acknowledge, self.live.rig.drive_parameters)
        self.latched = latched

    def mode(self, row: Array) -> float:
        """The number of its mode in a row of the run."""
        return float(row[self._at["mode"]])

    def values(self, row: Array) -> dict[str, float]:
        """This motor's part of a row of the run, by its columns without its name."""
        return dict(zip(self.columns, row[self._places].tolist(), strict=True))

    def of(self, row: Mapping[str, float]) -> dict[str, float]:
        """The same of a row that has names, as `Session.last` gives it or as the ring has it."""
        named = list(row.values())
        own = {name: named[place] for name, place in zip(self.columns, self._places.tolist(), strict=True)}
        return own | {name: row[column] for name in OF_ALL if (column := f"{self.name}.{name}") in row}

    def gains(self, row: Mapping[str, float] | None) -> dict[str, float]:
        """Gain → its value in force, by this motor's newest row."""
        numbers = {name: float(value) for name, value in self.live.law.numbers.items()}
        return numbers if row is None else {**numbers, **in_force(row)}

    def remember(self, row: Mapping[str, float], *, surely: bool) -> str:
        """Keep how warm the motor is, by a row of this motor; why it cannot be kept, or nothing."""
        return drive_memory.keep_heat(self.live.rig.drive_parameters, row, surely=surely)
