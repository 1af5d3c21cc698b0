"""A twin's sheath moves from the moment when the law has the motor, as in the simulation."""

import contextlib
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import DriveError
from bowden.cycle.one_cycle import TargetSource
from bowden.hardware.twin.control import TwinControl
from bowden.live.row import AT
from bowden.rig.families import family_of

_PATIENCE = 0.5
"""For a twin's answer; it must not hold up the operator [s]."""


class TwinScenario:
    """Tells the twin of a drive when the law began; on a rig there is no twin, and nothing is sent.

    Until then the sheath stays as it is at the scenario's start.

    Args:
        drive: parameters of the drive whose twin it may be.
        start: the monotonic clock where the column ``time`` is zero [s].
        at: column of this drive's motor → its place in a row.
    """

    def __init__(self, drive: Any, start: float, at: Mapping[str, int] = AT) -> None:
        self._at = at
        self._path = family_of(drive).control(drive)
        self._start, self._begun = start, False
        self._tell(math.inf)

    def see(self, rows: NDArray[np.float64]) -> None:
        """Take in the rows of a run that have come since the last call (n, width)."""
        led = np.flatnonzero(rows[:, self._at["source"]] >= TargetSource.LAW_BEGINS)
        if len(led) and not self._begun:
            self._begun = True
            self._tell(self._start + float(rows[led[0], self._at["time"]]))

    def _tell(self, at: float) -> None:
        with contextlib.suppress(DriveError), TwinControl(self._path, _PATIENCE) as twin:
            twin.start_scenario(at)
