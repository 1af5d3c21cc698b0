"""All that MuJoCo is asked about one suit on one arm, and the verdict."""

import math
from collections.abc import Callable
from typing import NamedTuple

from bowden.control.reference import PeriodicMinimumJerk
from bowden.control.uncompensated import UNCOMPENSATED
from bowden.core.units import DEGREES
from bowden.models.arm import Arm
from bowden.models.geometry import SuitGeometry
from bowden.sim.arm_check import (
    EXCURSION_LIMIT,
    INTEGRATORS,
    MOMENT_ARM_LIMIT,
    MOTION_LIMIT,
    Cables,
    Convergence,
    Motion,
    cases,
    compare_cables,
    compare_motion,
    convergence,
)
from bowden.sim.suit import simulate_suit
from bowden.sim.suit_plant import Suit
from bowden.sim.suit_replay import replay

PERIOD = 25.0
"""Of the suit's run, a flexion to 90° and back as in Fig. 6 [s]."""


class Agreement(NamedTuple):
    """What was compared."""

    cables: Cables
    motions: list[Motion]
    """Those of `arm_check.cases`, then the suit's run."""
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


def check_arm(geometry: SuitGeometry, arm: Arm, progress: Callable[[str, float], None] | None = None) -> Agreement:
    """Compare excursions, moment arms, three motions, their convergence, and one run of the uncompensated suit.

    Args:
        geometry: the suit's.
        arm: the wearer's, with the upper arm hanging.
        progress: is told what runs now, and the share that is done.

    Raises:
        BowdenError: MuJoCo is not installed.
        LogError: the elbow of the suit's run meets its stops.
        ParameterError: geometry or arm cannot be built.
    """

    def tell(what: str, share: float) -> None:
        if progress is not None:
            progress(what, share)

    tell("cables", 0.0)
    cables = compare_cables(geometry)
    motions, convergences = [], []
    for done, case in enumerate(cases(geometry, arm)):
        tell(case.name, 0.05 + 0.2 * done)
        motion = compare_motion(geometry, arm, case)
        motions.append(motion)
        convergences += [(case.name, convergence(geometry, arm, case, motion, name)) for name in INTEGRATORS]
    tell("a run of the suit", 0.65)
    reference = PeriodicMinimumJerk(0.0, 0.5 * math.pi, PERIOD)
    suit = Suit(geometry=geometry, arm=arm)
    motions.append(replay(simulate_suit(suit, UNCOMPENSATED, reference, duration=PERIOD)))
    return Agreement(cables, motions, convergences)
