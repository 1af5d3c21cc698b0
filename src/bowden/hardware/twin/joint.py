"""A joint that several twins' benches pull, a motor and a cable each.

Each cable has its own hysteresis, from its motor's angle to where it would have the joint alone; the joint's balance is
that of `bowden.models.cable.shared_joint`.
"""

import math
from collections.abc import Sequence

import numpy as np

from bowden.core.kernel import compiled
from bowden.hardware.twin.bench import TwinBench
from bowden.models.cable.shared_joint import JointLoad, cable_pull, shared_joint


class SharedJoint:
    """The joint of several benches; each sees it in its own coordinate, in which its motor pulls upwards.

    Args:
        benches: that pull at it.
        signs: 1 of one whose coordinate is the joint's, −1 of one whose is the other way round.
        stiffness: of each cable at the joint, k [N·m/rad].
    """

    def __init__(self, benches: Sequence[TwinBench], signs: Sequence[float], stiffness: float) -> None:
        self._benches, self._signs = tuple(benches), np.array(signs)
        motor = next(bench for bench, sign in zip(benches, signs, strict=True) if sign > 0.0).bench.motor
        self._load = JointLoad(stiffness, motor.pretension, motor.spring)
        self._balance = compiled(shared_joint)
        for bench, sign in zip(benches, signs, strict=True):
            bench.shared, bench.sign = self, sign
        self.push = 0.0
        """Torque of whoever pushes the joint upwards [N·m]."""

    def joint(self, bench: TwinBench) -> float:
        """Where it is, in the coordinate of one of them [rad]."""
        ends = self._signs * [-math.inf if one.torn else one.alone for one in self._benches]
        return bench.sign * float(self._balance(ends, self._signs, self.push, self._load))

    def pull(self, bench: TwinBench) -> float:
        """Torque of the cable of one of them on the joint, 0 where it is slack [N·m]."""
        return 0.0 if bench.torn else cable_pull(bench.alone, self.joint(bench), self._load.stiffness)
