"""What a driver finds out by itself, beside what the drive says: codes of `DriveReading.emergency`, with their text."""

import math
from collections import deque
from collections.abc import Mapping

INERT, LEFT, LOST_RANGE, UNWATCHED, LOST_TURNS, JOINT_SERVO = range(0xFE01, 0xFE07)
"""Codes that no family uses for an error of its own."""

FINDINGS: Mapping[int, str] = {
    INERT: "the motor is inert: the drive reports no fault and answers, but neither turns nor draws current; check the "
    "motor's phases, its supply and its calibration",
    LEFT: "the drive has left its mode by itself and reports no fault; check its supply and its own limits",
    UNWATCHED: "the drive does not watch its host as it was set up to: it may keep its torque if this computer dies. "
    "Another device or program writes to it, or its firmware differs: end that, and begin another run",
    LOST_RANGE: "the motor has left the range that the drive's position can show",
    LOST_TURNS: "the drive has lost count of its motor's turns: its position jumped further than the motor can turn; "
    "check its supply and its encoder, bring the motor home, and start the run again",
    JOINT_SERVO: "the servo on the joint, which only measures, has torque or tells an error: end whoever else writes "
    "to it, and look at it with its maker's tool",
}
"""Code → what it means and what to do."""


def finding_text(code: int, own: Mapping[int, str] | None = None) -> str:
    """The text of a driver's finding, of any family or one of its `own`, with the code; empty of any other code."""
    text = FINDINGS.get(code) or (own or {}).get(code, "")
    return f"0x{code:04X}: {text}" if text else ""


WATCH_EVERY = 0.1
"""Between two questions to a drive about its watch over its host [s]."""
LONGEST_GAP = 15e-3
"""Between two looks at a motor that are of one course: after a loop that stood still it begins anew [s]."""


class InertWatch:
    """Sees a motor that gives no torque although the drive answers and reports no fault.

    It is inert when for `lasting` it was asked for a torque that it did not give, and stood still meanwhile: a motor
    that turns, or that is held with a current, is not. What counts as asked in vain is the family's to say.

    Args:
        still: an angle within which a motor stands still, above its encoder's noise [rad].
        lasting: for how long, below the 50 ms after which it must be off [s].
    """

    def __init__(self, still: float, lasting: float = 20e-3) -> None:
        self._still, self._lasting = still, lasting
        self.begin()

    def begin(self) -> None:
        """Nothing has been seen."""
        self._since = self._at = self._looked = math.nan

    def inert(self, position: float, now: float, *, in_vain: bool) -> bool:
        """True if it is, at `now` [s].

        Args:
            position: of the motor [rad].
            now: [s]
            in_vain: whether it is asked for a torque, and gives none.
        """
        gone = now - self._looked > LONGEST_GAP  # nobody knows what was between
        self._looked = now
        if gone or not in_vain or not abs(position - self._at) <= self._still:
            self._since, self._at = (now, position) if in_vain else (math.nan, math.nan)
        return now - self._since >= self._lasting


class LagWatch:
    """Sees an inert motor of a drive that follows a target and tells its current.

    It is asked for a torque in vain where it is far from its target and draws next to no current: next to none of its
    limit, and next to none of what the rig's servo would draw there. (Friction holds a motor that is well at a lag, and
    a soft servo far behind a target that moves; what they draw is small then, and not nothing.) It is inert where it
    stands still meanwhile (`InertWatch`), or where it falls behind a target that moves on and loses speed: one that has
    lost its torque on its way coasts, and one that is well gains speed as long as its lag grows, or brakes with a
    current.

    Args:
        current_limit: the largest that the rig asks for; 0 for none [A].
        lag_current: that the rig's servo draws per lag, at rest; infinite of one that is not known, 0 of one whose
            current says nothing, and then nothing is seen here [A/rad].
        lag_time: lag per speed at which it draws none [s].
        count: of the current as the drive tells it; of less than that nothing can be said [A].
    """

    def __init__(
        self, current_limit: float, lag_current: float = math.inf, lag_time: float = 0.0, count: float = 0.0
    ) -> None:
        self._light = LIGHT * (current_limit or 1.0)
        self._lag_current, self._lag_time, self._count = lag_current, lag_time, count
        self._track: deque[tuple[float, float]] = deque()  # time [s], motor [rad]
        self._watch = InertWatch(STILL, LASTING)
        self._past: deque[tuple[float, float, float]] = deque()  # time [s], motor, lag [rad]

    def begin(self) -> None:
        """Nothing has been seen."""
        self._watch.begin()
        self._past.clear()
        self._track.clear()

    def inert(self, motor: float, target: float, current: float, now: float, *, led: bool, fresh: bool) -> bool:
        """True if the motor is inert.

        Args:
            motor: its angle [rad].
            target: of the cycle before; NaN for none [rad].
            current: [A]
            now: [s]
            led: whether the drive says that it follows its target.
            fresh: whether the angle came in this cycle; an old one says nothing of a motor that stands still.
        """
        if led and not fresh:
            return False
        lag = target - motor
        wanted = self._lag_current * abs(lag - self._lag_time * self._speed(motor, now)) if led else 0.0
        least = GIVEN * wanted
        told = least > 0.0 and least >= self._count
        in_vain = led and told and abs(lag) >= LAG and abs(current) <= min(self._light, least)
        still = self._watch.inert(motor, now, in_vain=in_vain)
        if not in_vain or (self._past and now - self._past[-1][0] > LONGEST_GAP):
            self._past.clear()
        if not in_vain:
            return still
        self._past.append((now, motor, lag))
        while len(self._past) > 2 and now - self._past[1][0] >= LASTING:
            self._past.popleft()
        return still or self._falls_behind()

    def _speed(self, motor: float, now: float) -> float:
        """Of the motor [rad/s]; 0 of one that has not been looked at for long enough."""
        if not self._lag_time:
            return 0.0
        track = self._track
        if track and now - track[-1][0] > LONGEST_GAP:
            track.clear()
        track.append((now, motor))
        while len(track) > 2 and now - track[1][0] >= TRACK:
            track.popleft()
        began, first = track[0]
        return (motor - first) / (now - began) if now - began >= TRACK - 1e-6 else 0.0

    def _falls_behind(self) -> bool:
        """True if the lag has grown for `LASTING` while the motor, on its way to its target, has lost speed."""
        (began, first, lag), (now, last, lag_now) = self._past[0], self._past[-1]
        half, middle, _ = self._past[len(self._past) // 2]
        if not began < half < now or now - began < LASTING - 1e-6:
            return False
        side = math.copysign(1.0, lag_now)
        before, after = side * (middle - first) / (half - began), side * (last - middle) / (now - half)
        return side * (lag_now - lag) >= GROWN and before > 0.0 and after <= SLOWED * before


LAG, LIGHT, STILL, GROWN, SLOWED, LASTING = 4e-3, 0.05, 2e-3, 3e-3, 0.75, 20e-3
"""A motor this far from its target [rad], with less current than this share of the largest, is asked for a torque that
it does not give: if it stands still within this [rad], or falls behind by this [rad] while its speed falls to this
share, for this long [s]."""
GIVEN, TRACK = 0.1, 5e-3
"""Of the current that the rig's servo would draw, up to which none was given [–]; time over which the motor's speed is
taken [s]."""
