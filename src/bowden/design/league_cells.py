"""The league's cells: plants that nobody tuned for, and what their joints are asked to do."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bowden.control.knowledge import Knowledge
from bowden.control.reference import PeriodicMinimumJerk, PointToPoint, Recorded, Trajectory
from bowden.core.units import DEGREES, RADIANS
from bowden.models.cable.capstan import Tendon
from bowden.models.cable.lumped_cable import LumpedTendon
from bowden.models.drive.encoder import Encoder
from bowden.plants.bench import Bench
from bowden.plants.cable_plant import Cable, CablePlant
from bowden.plants.cables import as_cable_plant, play
from bowden.plants.friction_cables import lumped, sliding
from bowden.plants.suit_parts import Suit
from bowden.plants.user_plant import UserPlant
from bowden.sim.scenario import BendPath, constant_bend

STROKE = 70.0 * RADIANS
"""Of the bench's joint (Section 3.1) and of every plant that has no range of its own [rad]."""


@dataclass(frozen=True)
class LeaguePlant:
    """A plant of the league."""

    name: str
    """As ``--plants`` has it."""
    what: str
    """One line for the page."""
    plant: CablePlant | UserPlant | Suit
    """Servo, cable, encoders, delay."""
    bend: BendPath
    """The sheath's bend while it runs."""
    stroke: float = STROKE
    """Largest joint angle that is asked of it; the smallest is 0 [rad]."""
    known: Knowledge | None = None
    """What the laws know; `knowledge_of` the plant, and so nothing of its cable, where it is not given."""


@dataclass(frozen=True)
class LeagueScenario:
    """What a joint is asked to do."""

    name: str
    """As ``--scenarios`` has it."""
    what: str
    """One line for the page."""
    duration: float
    """[s]"""
    motion: Trajectory
    """For the stroke of the bench."""

    def reference(self, stroke: float) -> Trajectory:
        """The motion, made smaller in proportion for a plant of another stroke [rad]."""
        return self.motion if stroke == STROKE else Scaled(self.motion, stroke / STROKE)


@dataclass(frozen=True)
class Scaled:
    """A trajectory times a number."""

    motion: Trajectory
    factor: float

    def sample(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """See `Trajectory.sample`."""
        return self.factor * self.motion.sample(time)

    def describe(self) -> dict[str, Any]:
        """See `Trajectory.describe`."""
        return {"kind": "scaled", "factor": self.factor, "motion": self.motion.describe()}


def scenarios(elbow: Recorded | None = None) -> list[LeagueScenario]:
    """Every scenario.

    Args:
        elbow: a recorded motion of a person's elbow; without it there is one scenario less.
    """
    times, angles = zip(*((2.0 * i, share * STROKE) for i, share in enumerate(_WAY_POINTS)), strict=True)
    found = [
        LeagueScenario(
            "periodic", "0–70° and back in 10 s, minimum jerk", 60.0, PeriodicMinimumJerk(0.0, STROKE, 10.0)
        ),
        LeagueScenario("slow", "0–70° and back in 25 s", 50.0, PeriodicMinimumJerk(0.0, STROKE, 25.0)),
        LeagueScenario("fast", "0–70° and back in 2 s", 20.0, PeriodicMinimumJerk(0.0, STROKE, 2.0)),
        LeagueScenario(
            "point_to_point", "moves of 2 s with holds of 2 s or more between", 36.0, PointToPoint(times, angles)
        ),
    ]
    if elbow is not None:
        top = float(np.max(elbow.sample(np.linspace(0.0, elbow.duration, 2000))[:, 0]))
        what = f"a person's elbow as recorded, up to {top * DEGREES:.0f}°"
        found.append(LeagueScenario("elbow", what, elbow.duration, elbow))
    return found


_WAY_POINTS = (0.0, 0.5, 0.5, 1.0, 1.0, 0.8, 0.8, 0.9, 0.9, 0.3, 0.3, 0.4, 0.4, 0.4, 0.0, 0.0, 0.7, 0.7)
"""Shares of the stroke, every two seconds: moves of 10 to 70 %, some on, some back."""


def plants(bench: Bench, moved: BendPath) -> list[LeaguePlant]:
    """The plants that need no data: all have the bench's servo, motor and encoders where nothing else is said.

    Args:
        bench: the default bench.
        moved: how its sheath is moved in Fig. 15.
    """
    base = as_cable_plant(bench)
    constant = constant_bend(bench.sheath.bend)
    own_loss = base._replace(sheath=bench.sheath._replace(gap=1.0, loss=0.0))  # these cables compute their own
    coarse, noisy = Encoder(0.09 * RADIANS, 0.0), base.joint_encoder._replace(noise=0.05 * RADIANS)
    slack = Tendon(pretension=0.0, slack=0.001)

    def round_a(cable: Cable) -> CablePlant:
        return own_loss._replace(cable=cable)

    return [
        LeaguePlant("bench", "the paper's bench", base, constant),
        LeaguePlant("moved_sheath", "the bench, its sheath bent to twice its angle from 10 to 20 s", base, moved),
        LeaguePlant("play", "pure play of 6°", round_a(play()), constant),
        LeaguePlant("coulomb", "lumped masses with Coulomb friction", round_a(lumped()), constant),
        LeaguePlant(
            "dahl",
            "lumped masses with Dahl friction",
            round_a(lumped(LumpedTendon(dahl=True, presliding=1e-4))),
            constant,
        ),
        LeaguePlant("capstan", "an elastic tendon, sliding in parts, capstan friction", round_a(sliding()), constant),
        LeaguePlant("slack", "the same without pretension and with 1 mm of slack", round_a(sliding(slack)), constant),
        LeaguePlant(
            "coarse_encoder",
            "the bench with encoders of 0.09°",
            base._replace(joint_encoder=coarse, motor_encoder=coarse),
            constant,
        ),
        LeaguePlant(
            "noise",
            "the bench with 0.05° of noise on both encoders",
            base._replace(joint_encoder=noisy, motor_encoder=noisy),
            constant,
        ),
        LeaguePlant(
            "delay_3ms",
            "the bench with 3 ms between a sample and its command",
            base._replace(delay=max(1, round(3e-3 / base.sample_time))),
            constant,
        ),
    ]
