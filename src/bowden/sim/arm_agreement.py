"""All that MuJoCo is asked about one suit on one arm, and the verdict."""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

from bowden.control.law import Law
from bowden.control.reference import PeriodicMinimumJerk
from bowden.core.units import DEGREES
from bowden.plants.suit_parts import Suit
from bowden.sim.arm_check import (
    EXCURSION_LIMIT,
    INTEGRATORS,
    MOMENT_ARM_LIMIT,
    MOTION_LIMIT,
    ArmMotion,
    Cables,
    Convergence,
    cases,
    compare_cables,
    compare_motion,
    convergence,
)
from bowden.sim.run import simulate
from bowden.sim.suit_replay import replay

PERIOD = 25.0
"""Of the suit's runs, a flexion to 90° and back as in Fig. 17 [s]."""


class Agreement(NamedTuple):
    """What was compared."""

    cables: Cables
    motions: list[ArmMotion]
    """Those of `sim.arm_check.cases`, then the suit's runs."""
    convergences: list[tuple[str, Convergence]]
    """Of which motion, and how its error goes with MuJoCo's step."""

    @property
    def reasons(self) -> list[str]:
        """What is beyond its limit; empty where all agrees."""
        found, cables = [], self.cables
        for name, error, arm in (
            ("flexor", cables.flexor, cables.flexor_arm),
            ("extensor", cables.extensor, cables.extensor_arm),
        ):
            if not error <= EXCURSION_LIMIT:
                found.append(f"the {name}'s excursion differs by {1e3 * error:.2g} mm")
            if not arm <= MOMENT_ARM_LIMIT:
                found.append(f"the {name}'s moment arm differs by {1e3 * arm:.2g} mm")
        for motion in self.motions:
            if not motion.error <= MOTION_LIMIT:
                found.append(f"{motion.name}: the elbow differs by {motion.error * DEGREES:.2g}°")
        return found


def check_arm(suit: Suit, laws: Sequence[Law], progress: Callable[[str, float], None] | None = None) -> Agreement:
    """Compare excursions, moment arms, three motions, their convergence, and runs of the suit.

    Args:
        suit: with its geometry and the arm that wears it, the upper arm hanging.
        laws: of the suit's runs, one flexion each.
        progress: called with what runs now, and the share that is done.

    Raises:
        BowdenError: MuJoCo is not installed.
        LogError: a run of the suit ran away, or was at the elbow's stops for most of its time.
        ParameterError: geometry or arm cannot be built.
    """

    def tell(what: str, share: float) -> None:
        if progress is not None:
            progress(what, share)

    geometry, arm = suit.geometry, suit.arm
    tell("cables", 0.0)
    cables = compare_cables(geometry)
    motions, convergences = [], []
    for done, case in enumerate(cases(geometry, arm)):
        tell(case.name, 0.05 + 0.15 * done)
        motion = compare_motion(geometry, arm, case)
        motions.append(motion)
        convergences += [(case.name, convergence(geometry, arm, case, motion, name)) for name in INTEGRATORS]
    reference = PeriodicMinimumJerk(0.0, 0.5 * math.pi, PERIOD)
    for done, law in enumerate(laws):
        tell(f"suit, {law.name} (compiled at first)", 0.5 + 0.4 * done / len(laws))
        run = replay(simulate(suit, law, reference, duration=PERIOD))
        motions.append(run._replace(name=f"suit, {law.name}"))
    return Agreement(cables, motions, convergences)
