"""Friction made up for ahead of any error: the torque offset that the drive takes beside its target, made in the loop.

The push is that of `models.drive.geared_motor`, on the target that the supervisor has let through, in the spool's
angle. It acts while law, preflight or a planned motion have the motor and nothing is wrong; in a release, while a
target is held for a reading that is missing, and without power it is none. The drive bounds it once more before the
wire.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bowden.core.kernel import compiled, kernel
from bowden.core.signals import Power
from bowden.models.drive.geared_motor import FrictionPush, turn_push
from bowden.models.suit.suit_angle import SpoolMap, spool_of
from bowden.safety.faults import Reaction
from bowden.safety.state import Mode, Verdict

Array = NDArray[np.float64]

COLUMNS = {"push.torque": "N·m", "push.settled_target": "rad", "push.direction": "1"}
"""Column → unit of what a run with an offset records beside the rest; torque and angle are the spool's."""

_LEADS = (Mode.PREFLIGHT, Mode.RUNNING)


@kernel
def _in_place(spool: Array, memory: Array, target: float, acts: bool, dt: float) -> None:
    """On arrays, since tuples cost more to hand over than all of it."""
    s = spool
    turned = spool_of(target, SpoolMap(s[2], s[3], s[4], s[5], s[6], s[7], s[8], s[9], s[10]))
    push = FrictionPush(memory[1], memory[2])
    for _ in range(int(s[1])):
        push = turn_push(push, turned, dt / s[1])
    memory[1] = push.settled_target if acts else turned
    memory[2] = push.direction if acts else 0.0
    memory[0] = s[0] * memory[2]


class TorqueOffset:
    """The offset of a run.

    Args:
        torque: of the whole push, at the spool [N·m].
        substeps: in which a cycle goes, as those of the simulated drive: the target moves in the first of them, so that
            the push turns with `TURNING` times their number.
        spool: from the motor's angle to the spool's.
    """

    def __init__(self, torque: float, substeps: int, spool: SpoolMap) -> None:
        self._settings = np.array([torque, substeps, *spool])
        self._memory = np.zeros(3)
        self._row = self._memory.data
        self._step = compiled(_in_place)
        self.step(0.0, Verdict(0.0, Power.OFF, Mode.STOPPED, Reaction.NONE, 0), 0.001)  # compiles

    def step(self, target: float, verdict: Verdict, dt: float) -> float:
        """The offset of this cycle, `dt` [s] after the one before [N·m]."""
        acts = verdict.power == Power.ON and verdict.reaction == Reaction.NONE and verdict.mode in _LEADS
        self._step(self._settings, self._memory, target, acts, dt)
        return self._row[0]

    def take(self, row: Sequence[float]) -> None:
        """Go on from what was recorded: `COLUMNS`."""
        self._memory[:] = row

    def row(self) -> tuple[float, ...]:
        """This cycle's record: `COLUMNS`."""
        return tuple(self._row)
