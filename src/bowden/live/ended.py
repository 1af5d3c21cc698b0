"""How the loop ended, from its process to all who say it."""

from collections.abc import Mapping, Sequence
from functools import reduce
from operator import or_
from typing import Any, NamedTuple

from bowden.hardware.ports import TorqueLeft
from bowden.live.preflight import REASONS, Reason
from bowden.safety.state import Mode


class EndedMotor(NamedTuple):
    """State of one motor at the end of a run."""

    mode: Mode
    """The supervisor's last."""
    faults: int
    """The supervisor's last bit set."""
    torque: TorqueLeft
    reason: Reason
    """Reason for which its preflight failed."""


class Ended(NamedTuple):
    """State of the loop at its end."""

    cycles: int
    overruns: int
    """Deadlines that were skipped."""
    stalled: float
    """Time for which this computer stalled the loop, where that ended the run; else 0 [s]."""
    unattended: float
    """Age of the operator's last sign of life, where nobody asked for the end and this alone brought it before the
    reference had come to its own; 0 elsewhere [s]."""
    ran: bool
    """True if a motor ever was in `Mode.RUNNING`."""
    motors: tuple[EndedMotor, ...]

    @classmethod
    def of(cls, said: Mapping[str, Any]) -> "Ended":
        """What its process says of it, a JSON object of the fields."""
        motors = (EndedMotor(Mode(m), bits, TorqueLeft(t), Reason(r)) for m, bits, t, r in said["motors"])
        return cls(**{**said, "motors": tuple(motors)})

    @property
    def mode(self) -> Mode:
        """Of several motors the worst."""
        return max(one.mode for one in self.motors)

    @property
    def faults(self) -> int:
        """Of several motors all that are in one of them."""
        return reduce(or_, (one.faults for one in self.motors), 0)

    @property
    def torque(self) -> TorqueLeft:
        """Of several motors the worst; unknown where the loop has said nothing."""
        return max((one.torque for one in self.motors), default=TorqueLeft.UNKNOWN)

    def why_not(self, names: Sequence[str]) -> str:
        """Why the preflight failed, of several motors with their names; empty where it did not."""
        failed = zip(names, self.motors, strict=False)
        return "; ".join(f"{name}: {REASONS[one.reason]}".removeprefix(": ") for name, one in failed if one.reason)


SAID_NOTHING = Ended(0, 0, 0.0, 0.0, True, ())
"""Of a loop that ended without a word."""
