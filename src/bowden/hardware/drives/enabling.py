"""Whether a drive that has switched itself off may be switched on again: not before its master has wanted it off."""

from bowden.core.signals import DriveState
from bowden.hardware.ports import Power


def fell(before: DriveState, now: DriveState, *, asked: bool, already: bool, power: Power) -> bool:
    """Whether the drive has left operation by itself and must not be switched on again as if nothing was.

    A drive whose master was silent for a moment may be without torque when the master is back; switching it on again
    would be a restart that nobody ordered. It is forgotten when the master itself has wanted the power off.

    Args:
        before: the state of the cycle before.
        now: the state of this cycle.
        asked: whether operation was what the cycle before asked for.
        already: the value of the cycle before.
        power: what is wanted now.
    """
    if power is Power.OFF:
        return False
    left = before is DriveState.OPERATION_ENABLED and now is not DriveState.OPERATION_ENABLED
    return already or (left and asked)


class Silence:
    """Our own: a drive that gives torque again with the next command must be switched off after it, and stays off.

    Args:
        watch: time without a word of ours after which the drive has taken its torque off [s].
    """

    def __init__(self, watch: float) -> None:
        self._watch, self._last = watch, -1.0

    def begin(self) -> None:
        """Nothing has been said yet."""
        self._last = -1.0

    def broken(self, now: float) -> bool:
        """Whether we were silent until `now` [s] for so long that the drive has, or may have, let go; we speak now."""
        last, self._last = self._last, now
        return last >= 0.0 and now - last >= _MARGIN * self._watch


_MARGIN = 0.9
"""Of the drive's own time: whether it has let go is not known this near to it, and then it counts as let go."""
