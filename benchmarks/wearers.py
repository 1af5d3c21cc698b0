"""Random wearers of the suit, in sheath paths that nobody tuned for, and how far the elbow is from where it should be.

Each is drawn from its number alone: a body of 45–120 kg with a body mass index of 17–35 kg/m², the upper arm raised by
up to 30°; sheaths that are moved all the time between 0.7 and 1.6 times their bend, with a loss of 0–25 % of the slope
when the bend doubles; play of 0.5–1.5 times, friction at the spool of 0.7–1.3 times, stiffness of cable and fabric of
0.7–1.4 times those of the paper's suit, a pretension of 15–35 N; a third of the wearers do nothing, the others are
weak, tremble, resist, or press with a constant torque; and a flex sensor whose zero and scale are off by up to 0.4°
between them, beside its own loop, drift and noise (`bowden.models.suit.flex_sensor.PAPER_FLEX`).
"""

import math
from typing import Any, NamedTuple

import numpy as np

from bowden.control.law import Law
from bowden.control.reference import PeriodicMinimumJerk
from bowden.core.units import DEGREES, RADIANS
from bowden.models.cable.sheath_path import BendPath, random_bend
from bowden.models.suit.arm import Wearer, arm_of
from bowden.models.suit.flex_sensor import PAPER_FLEX
from bowden.plants.presets.suit import suit
from bowden.plants.suit_parts import Suit
from bowden.records.trace import Trace
from bowden.sim.run import simulate
from bowden.sim.suit_runs import DRIVE_INTEGRAL, FRICTION_FEEDFORWARD, knowing_drive, suit_adaptive_integral, suit_ours
from kept import Kept
from measure import Figure, Found, percentiles, two_processes

PERIOD, FLEXIONS, LEARNING = 25.0, 4, 2
"""Of the reference, 0–90°, as in Fig. 17 [s]; how many are run; and how many of them a law has to learn in."""


class RandomWearer(NamedTuple):
    """A drawn suit on its wearer, and how the sheaths move."""

    suit: Suit
    bend: BendPath
    mass: float
    """[kg]"""
    kind: str
    """What their muscles do."""


class Worn(NamedTuple):
    """What came of one run."""

    number: int
    mass: float
    """[kg]"""
    kind: str
    stable: bool
    learning_deg: float
    """Largest |joint − reference| of the first two flexions, after the first second [deg]; NaN of one that ran away."""
    largest_deg: float
    """The same of the two that follow, all of their time [deg]."""
    rmse_deg: float
    """Of the two that follow [deg]."""


def random_wearer(number: int, suit: Suit) -> RandomWearer:
    """The wearer of that number, in a suit that varies about the given one."""
    random = np.random.default_rng([number, 5])
    mass = float(random.uniform(45.0, 120.0))
    lowest, highest = max(1.45, math.sqrt(mass / 35.0)), min(2.05, math.sqrt(mass / 17.0))
    height = float(random.uniform(lowest, highest))
    arm = arm_of(mass, height, elevation=float(random.uniform(0.0, 30.0)) * RADIANS)
    share = random.uniform(0.0, 1.0)
    stiff, cable, friction, play = (float(random.uniform(low, high)) for low, high in _ABOUT)
    kind, wearer = _muscles(random)
    made = suit.flexor._replace(stiffness=cable * suit.flexor.stiffness, half_width=play * suit.flexor.half_width)
    worn = suit._replace(
        motor=suit.motor._replace(friction=friction * suit.motor.friction),
        flexor=made,
        extensor=made,
        fabric=suit.fabric._replace(stiffness=stiff * suit.fabric.stiffness, damping=stiff * suit.fabric.damping),
        pretension=float(random.uniform(15.0, 35.0)),
        sheath=suit.sheath._replace(loss=float(random.uniform(0.0, 0.25))),
        arm=arm,
        wearer=wearer,
        joint_sensor=PAPER_FLEX._replace(
            offset=float(random.uniform(-0.4, 0.4)) * share * RADIANS,
            gain=float(random.uniform(-0.4, 0.4)) * (1.0 - share) / 90.0,
        ),
    )
    rest = suit.sheath.bend
    bend = random_bend(0.7 * rest, 1.6 * rest, float(random.uniform(2.0, 6.0)), PERIOD * FLEXIONS, number)
    return RandomWearer(worn, bend, mass, kind)


_ABOUT = ((0.7, 1.4), (0.7, 1.4), (0.7, 1.3), (0.5, 1.5))
"""Ranges about the given suit: fabric, cable, friction, play."""


def _muscles(random: np.random.Generator) -> tuple[str, Wearer]:
    """What the wearer does, and how strongly."""
    size = float(random.uniform(0.2, 1.0))
    wearers = {
        "none": Wearer(),
        "weak": Wearer(share=0.5 * size),
        "tremor": Wearer(tremor=0.5 * size, tremor_frequency=float(random.uniform(4.0, 6.0))),
        "resisting": Wearer(stiffness=size, damping=0.5 * size, centre=45.0 * RADIANS),
        "constant": Wearer(constant=float(random.choice([-1.0, 1.0])) * size),
    }
    kind = str(random.choice(list(wearers), p=(1 / 3, 1 / 6, 1 / 6, 1 / 6, 1 / 6)))
    return kind, wearers[kind]


def wear(number: int, suit: Suit, law: Law) -> Worn:
    """Run a law on the wearer of that number."""
    drawn, law = random_wearer(number, suit), knowing_drive(law, suit.motor.integral)
    motion = PeriodicMinimumJerk(0.0, 90.0 * RADIANS, PERIOD)
    errors = _errors(simulate(drawn.suit, law, motion, duration=PERIOD * FLEXIONS, bend=drawn.bend, seed=number))
    return Worn(number, drawn.mass, drawn.kind, errors is not None, *(errors or (math.nan,) * 3))


def _errors(run: Trace) -> tuple[float, float, float] | None:
    """Largest error while learning, after it, and the RMSE then [deg]; None of a run that ran away."""
    if not run.ended:
        return None
    first = (run.time >= 1.0) & (run.time < PERIOD * LEARNING)
    error = run.error * DEGREES
    after = error[run.time >= PERIOD * LEARNING]
    return float(np.max(np.abs(error[first]))), float(np.max(np.abs(after))), float(np.sqrt(np.mean(after**2)))


COUNT, BAND = 500, 5.0
"""Wearers of a whole run, and the error that is wanted at most [deg]."""


def figures(share: float) -> Found:
    """Ours and the adaptive law, with gains for the suit, on a drive with an integral and friction compensation."""
    found: list[Figure] = []
    for law in (suit_ours(), suit_adaptive_integral()):
        kept = Kept(f"suit_wearers_{law.name}")
        there, wanted = {row[0] for row in kept.rows()}, range(round(share * COUNT))
        missing = [(law.name, number) for number in wanted if number not in there]
        rows = [Worn(*row) for row in kept.filled(two_processes(_run, missing, 5), len(wanted)) if row[0] in wanted]
        stable = [row for row in rows if row.stable]
        within = sum(row.largest_deg <= BAND for row in stable)
        found += [
            Figure(f"{law.name}: unstable", f"{len(rows) - len(stable)} of {len(rows)}", "0"),
            Figure(f"{law.name}: within ±5° in the third and fourth flexion", f"{within} of {len(rows)}", "all"),
            Figure(f"{law.name}: largest error there", percentiles(row.largest_deg for row in stable), "5°"),
            Figure(f"{law.name}: largest error while learning", percentiles(r.learning_deg for r in stable), "–"),
        ]
    return Found(found, "Four flexions 0–90° of 25 s, the first two to learn in.")


def _run(task: tuple[str, int]) -> list[Any]:
    law = next(law for law in (suit_ours(), suit_adaptive_integral()) if law.name == task[0])
    made = suit()
    motor = made.motor._replace(integral=DRIVE_INTEGRAL, friction_feedforward=FRICTION_FEEDFORWARD)
    return list(wear(task[1], made._replace(motor=motor), law))
