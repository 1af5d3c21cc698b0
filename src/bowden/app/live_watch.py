"""What the operator's side takes from every row of a run, not only from those that the screen shows."""

import contextlib
import math

import numpy as np

from bowden.core.errors import DriveError
from bowden.hardware.drive_parameters import DriveParameters
from bowden.hardware.twin_control import TwinControl, control_path
from bowden.runtime.cycle import Source
from bowden.runtime.ring import RingReader

_PATIENCE = 0.5
"""For a twin's answer; it must not hold up the operator [s]."""


class Watch:
    """Looks through the rows as they come, and lets a twin's sheath begin to move when the law does.

    So the scenario is that of `bowden simulate` from the moment the law has the motor. On a rig there is no twin, and
    nobody is told.

    Args:
        rows: of the run, at its beginning.
        drive: whose twin it may be.
        start: the monotonic clock where the column ``time`` is zero [s].
    """

    def __init__(self, rows: RingReader, drive: DriveParameters, start: float) -> None:
        columns = rows.description.columns
        self._rows, self._start = rows, start
        self._twin = control_path(drive.interface, drive.channel, drive.node_id)
        self._time, self._source, self._emergency = map(columns.index, ("time", "source", "emergency"))
        self._led = False
        self.emergency = 0
        """Error code of the last emergency frame; 0 for none."""
        self._scenario(math.inf)

    def look(self) -> None:
        """Take in the rows that have come since the last look."""
        rows = self._rows.read().rows
        codes = rows[:, self._emergency]
        for code in codes[codes > 0.0][-1:]:
            self.emergency = int(code)
        led = np.flatnonzero(rows[:, self._source] >= Source.LAW_BEGINS)
        if len(led) and not self._led:
            self._led = True
            self._scenario(self._start + float(rows[led[0], self._time]))

    def _scenario(self, at: float) -> None:
        with contextlib.suppress(DriveError), TwinControl(self._twin, _PATIENCE) as twin:
            twin.start_scenario(at)
