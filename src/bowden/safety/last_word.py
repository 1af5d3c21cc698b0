"""The last word on a verdict, apart from the function that made it: interpreted, and on numbers that no law can reach.

Law and supervisor are compiled into one function. What that writes where it must not, by a law that leaves its arrays
or a compiler's mistake, may be the verdict itself. So each verdict is looked at once more before it reaches the drive,
by plain Python on Python's own numbers: what no supervisor that is whole ever says ends the run without torque.
"""

from bowden.core.errors import SafetyError
from bowden.core.signals import Power
from bowden.safety.limits import Limits
from bowden.safety.state import Mode, Verdict

_POWERS = dict.fromkeys((Mode.STOPPED, Mode.LATCHED), (Power.OFF,)) | dict.fromkeys(
    (Mode.PREFLIGHT, Mode.RUNNING, Mode.BRIDGING, Mode.RELEASING), (Power.OFF, Power.ON)
)
"""Mode → powers that there may be."""
_LATE = 5.0
"""A late loop may move the target by as many cycles at most (`evidence.most_step`)."""
_ROUNDING = 1e-9
"""[rad]"""


class LastWord:
    """Check of the verdicts of one run.

    Args:
        limits: of the rig.
        period: length of a cycle [s].
        target: where the target is before the first cycle [rad].
    """

    def __init__(self, limits: Limits, period: float, target: float) -> None:
        self._low, self._high = limits.motor_low, limits.motor_high
        self._step = limits.target_speed * _LATE * period + _ROUNDING
        self._target = target

    def judge(self, verdict: Verdict) -> None:
        """Let a verdict pass.

        Raises:
            SafetyError: its target is no number, beyond the motor's range or too far from the last one, or it gives a
                power that there is not, or in a mode that has none.
        """
        target, before = verdict.target, self._target
        whole = self._low <= target <= self._high and abs(target - before) <= self._step
        if not (whole and verdict.power in _POWERS.get(verdict.mode, ())):
            raise SafetyError(
                f"the supervisor's verdict is broken: target {target!r} rad after {before!r} rad, power "
                f"{verdict.power!r} in mode {verdict.mode!r}",
                expected=f"{self._low!r} to {self._high!r} rad, steps of {self._step:.3g} rad, power 0 or 3",
                do="do not run this law on this computer again before it is known why",
            )
        self._target = target
