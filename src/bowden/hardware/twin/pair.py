"""Two twins' benches on one joint: a motor and a cable each, pulling against one another.

Each cable has its own hysteresis, from its motor's angle m to where it would have the joint if nothing but the load's
spring held against it, x(m). Both are springs of one stiffness k at the joint, which pull and do not push, and the
joint is without mass:

    k·[x₁ − q]₊ − k·[q − x₂]₊ + push = p + s·q          pretension p and spring s of the load

Where both are taut q lies between x₁ and x₂, weighed by their stiffnesses; where one is slack it follows the other
alone. Source: the balance of the torques on the joint, and nothing else. Its slope by q is −2k − s where both are taut
and −k − s where one is: with linear springs co-contraction does not change how stiff the joint is between both cables,
but how far it may be pushed, or its cables may disagree, before one of them is slack and half of the stiffness gone.

Left out: the joint's inertia, and that a cable's own friction grows with its tension.
"""

from bowden.hardware.twin.bench import TwinBench


class SharedJoint:
    """The joint of two benches; each sees it in its own coordinate, in which its motor pulls upwards.

    Args:
        agonist: whose coordinate is the joint's.
        antagonist: whose is the other way round.
        stiffness: of each cable at the joint, k [N·m/rad].
    """

    def __init__(self, agonist: TwinBench, antagonist: TwinBench, stiffness: float) -> None:
        self._agonist, self._antagonist, self._stiffness = agonist, antagonist, stiffness
        agonist.opposed = antagonist.opposed = self
        self.push = 0.0
        """Torque of whoever pushes the joint upwards [N·m]."""

    def joint(self, bench: TwinBench) -> float:
        """Where it is, in the coordinate of one of both [rad]."""
        angle = self._angle()
        return angle if bench is self._agonist else -angle

    def pull(self, bench: TwinBench) -> float:
        """Torque of one of both cables on the joint, 0 where it is slack [N·m]."""
        return 0.0 if bench.torn else self._stiffness * max(0.0, bench.alone - self.joint(bench))

    def _angle(self) -> float:
        k, motor = self._stiffness, self._agonist.bench.motor
        load, spring = motor.pretension - self.push, motor.spring
        up, down = self._agonist.alone, -self._antagonist.alone
        above, below = not self._agonist.torn, not self._antagonist.torn
        if above and below:
            both = (k * (up + down) - load) / (2.0 * k + spring)
            if down <= both <= up:
                return both
        if above:
            alone = (k * up - load) / (k + spring)
            if alone <= up and not (below and alone > down):
                return alone
        if below:
            alone = (k * down - load) / (k + spring)
            if alone >= down:
                return alone
        rest = -load / spring if spring > 0.0 else 0.0
        high = down if below else rest
        low = up if above else rest
        return min(max(rest, min(low, high)), max(low, high))
