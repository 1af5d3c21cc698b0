"""Two twins' benches on one joint: a motor and a cable each, pulling against one another.

Each cable has its own hysteresis, from its motor's angle to where it would have the joint alone; the joint's balance is
that of `bowden.models.cable.shared_joint`.
"""

from bowden.hardware.twin.bench import TwinBench
from bowden.models.cable.shared_joint import Ends, JointLoad, cable_pull, shared_joint


class SharedJoint:
    """The joint of two benches; each sees it in its own coordinate, in which its motor pulls upwards.

    Args:
        agonist: whose coordinate is the joint's.
        antagonist: whose is the other way round.
        stiffness: of each cable at the joint, k [N·m/rad].
    """

    def __init__(self, agonist: TwinBench, antagonist: TwinBench, stiffness: float) -> None:
        self._agonist, self._antagonist = agonist, antagonist
        motor = agonist.bench.motor
        self._load = JointLoad(stiffness, motor.pretension, motor.spring)
        agonist.opposed = antagonist.opposed = self
        self.push = 0.0
        """Torque of whoever pushes the joint upwards [N·m]."""

    def joint(self, bench: TwinBench) -> float:
        """Where it is, in the coordinate of one of both [rad]."""
        one, other = self._agonist, self._antagonist
        angle = shared_joint(Ends(one.alone, -other.alone, not one.torn, not other.torn), self.push, self._load)
        return angle if bench is one else -angle

    def pull(self, bench: TwinBench) -> float:
        """Torque of one of both cables on the joint, 0 where it is slack [N·m]."""
        return 0.0 if bench.torn else cable_pull(bench.alone, self.joint(bench), self._load.stiffness)
