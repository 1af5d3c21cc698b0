"""What a run does, cycle by cycle: hold, preflight, approach, then the law on its reference or a planned motion, home.

The reference is a table that was made beforehand, or is made cycle by cycle of what EMG says.

The law begins where the joint is: what the preflight has left in the cable's play sets the joint some degrees off, and
this goes out of the reference by minimum jerk in the run's first second.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.signals import DriveReading, Reference
from bowden.cycle.one_cycle import HOLD, LAW, LAW_BEGINS, MOTION, NOWHERE, Plan
from bowden.hardware.emg.course import EmgCourse
from bowden.live import preflight
from bowden.live.row import NOTHING_READ
from bowden.models.minimum_jerk import PEAK_SPEED, minimum_jerk
from bowden.safety.state import Mode, PreflightResult


class Home(NamedTuple):
    """Where a run ends."""

    place: float
    """The joint's rest, or, of a table for the motor, the motor's angle there [rad]."""
    speed: float
    """Of the way there, at its quickest [rad/s]."""


class Script:
    """The plan of a run.

    Args:
        table: what follows the approach: (n, 3) references of the joint for the law [rad, rad/s, rad/s²], or (n, 1)
            targets of the motor [rad]. Not looked at in a run by EMG.
        start: motor angle to go to first [rad].
        speed: of that approach, at its quickest [rad/s].
        checks: the preflight between arming and running.
        period: of a cycle [s].
        course: of a run by EMG.
        slope: about what the joint moves by per motor angle [rad/rad].
        home: where the reference leads once the table, or the run by EMG, has come to its end; None to stay there.
    """

    def __init__(
        self,
        table: NDArray[np.float64],
        start: float,
        speed: float,
        checks: preflight.Preflight,
        period: float,
        course: EmgCourse | None = None,
        slope: float = 1.0,
        home: Home | None = None,
    ) -> None:
        self._slope, self._home = slope, home
        self._homing: tuple[float, float, float] | None = None
        """Where the way home begins [rad], when, and how long it takes [s]."""
        self._table, self._width = np.ascontiguousarray(table, dtype=np.float64).reshape(-1).data, table.shape[1]
        self._course, self._last = course, (len(table) if course is None else course.cycles) - 1
        self._start, self._speed, self._checks, self._period = start, speed, checks, period
        self._checked = preflight.begin(checks, NOTHING_READ)
        self._mode = Mode.STOPPED
        self._from, self._approach, self._cycles, self._begun = 0.0, 0.0, 0, False
        self._aside = 0.0
        self.outcome = PreflightResult.PENDING
        """Of the preflight."""
        self.play = math.nan
        """Dead zone that the preflight has measured; NaN before it has [rad]."""
        self.least = 0.0
        """The approach takes at least this long: where several motors begin together, as long as the longest [s]."""
        self.done = False
        """True if the run has come to its end since it began, and the joint home."""

    def plan(self, mode: Mode, target: float, reading: DriveReading, cycles: int) -> Plan:
        """Plan of this cycle.

        Args:
            mode: the supervisor's, after the last cycle.
            target: what the drive was sent then [rad].
            reading: what the drive says.
            cycles: periods since the last cycle, more than 1 after an overrun. A motion of the motor's own goes on
                where it was after one, and ends this much later: its target does not jump.
        """
        if mode == Mode.BRIDGING:
            mode = self._mode  # R1 holds the target meanwhile; preflight or law go on, and find their place again
        if self._width == 1 and mode == Mode.RUNNING:
            cycles = 1
        if mode != self._mode:
            self._enter(mode, target, reading, cycles)
        if mode == Mode.PREFLIGHT:
            self._checked, requested_target, said = preflight.step(
                self._checks, self._checked, reading, cycles * self._period
            )
            if said.result > self.outcome:
                self.play = preflight.dead_zone(self._checked, reading, self._slope)
            self.outcome = said.result
            return Plan(MOTION, requested_target, NOWHERE)
        if mode != Mode.RUNNING:
            return Plan(HOLD, target, NOWHERE)
        self._cycles += cycles
        at = self._cycles * self._period
        if at < self._approach:
            return Plan(MOTION, float(minimum_jerk(self._from, self._start, self._approach, at).position), NOWHERE)
        row = round((at - self._approach) / self._period)
        over = row >= self._last or (self._course is not None and self._course.over)
        values = self._to_home(row, at) if over and self._home is not None else self._values(row)
        self.done = over and (self._homing is None or at >= self._homing[1] + self._homing[2])
        if self._width == 1:
            return Plan(MOTION, values[0], NOWHERE)
        if not self._begun:
            aside = reading.joint - values[0]
            self._aside = aside if abs(aside) <= _FURTHEST else 0.0  # NaN is not
        source, self._begun = (LAW if self._begun else LAW_BEGINS), True
        since = at - self._approach
        if since < _BLEND:  # later it is nothing, and took longer than the rest of the plan
            values = [
                value + more for value, more in zip(values, minimum_jerk(self._aside, 0.0, _BLEND, since), strict=True)
            ]
        position, velocity, acceleration = values
        return Plan(source, target, Reference(float(position), float(velocity), float(acceleration)))

    def _values(self, row: int) -> Sequence[float]:
        """Of a row of the table, or what EMG makes of one cycle more.

        After cycles that were skipped a motion by EMG goes on where it was, and ends this much later: nobody has said
        when it is to end, and a reference that jumps makes a law jump.
        """
        if self._course is not None:
            if not self._begun:
                self._course.begin()
            return self._course.step(self._period)
        place = self._width * min(row, self._last)
        return self._table[place : place + self._width]  # no array is indexed in the loop

    def _to_home(self, row: int, at: float) -> Sequence[float]:
        """The way from where the reference has come to, `at` [s] after the run began.

        It begins at rest, also where the reference moved: a way that slowed down first would leave the reference's
        range. What the law is shown is a motion all the same (`control.conditioning`).
        """
        assert self._home is not None
        if self._homing is None:
            begin = float(self._values(row)[0])
            way = abs(begin - self._home.place)
            takes = max(_BLEND, PEAK_SPEED * way / self._home.speed) if way > _THERE else self._period
            self._homing = begin, at, takes
        begin, since, takes = self._homing
        return minimum_jerk(begin, self._home.place, takes, at - since)

    def _enter(self, mode: Mode, target: float, reading: DriveReading, cycles: int) -> None:
        if mode == Mode.PREFLIGHT:
            self.outcome = PreflightResult.PENDING
            self._checked = preflight.begin(self._checks, reading)
        if mode == Mode.RUNNING:
            self._from, self._cycles, self._begun, self.done, self._homing = target, -cycles, False, False, None
            self._approach = max(self.least, self.approach(target))
        self._mode = mode

    def approach(self, target: float) -> float:
        """Duration of the motion from a target of the motor [rad] to the beginning, in whole cycles [s]."""
        return math.ceil(PEAK_SPEED * abs(self._start - target) / self._speed / self._period) * self._period

    @property
    def reason(self) -> preflight.Reason:
        """Reason for which the preflight failed; `NONE` where it has not."""
        return self._checked.reason


_BLEND = 1.0
"""Time in which the reference goes from where the joint is to its own motion [s]."""

_THERE = 1e-3
"""A reference so near to its home is there [rad]."""
_FURTHEST = 0.3
"""A joint further from the reference than this is not explained by play: the law is shown it as it is [rad]."""
