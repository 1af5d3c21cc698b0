"""Our law: it learns while it runs how the cable loses motion, and makes up for it ahead of time.

Its equations are in `bowden.control.our_law`, their derivation in ``docs/background/our_law.md``.
"""

import math

from bowden.control.knowledge import Knowledge
from bowden.control.law import Law
from bowden.control.our_law.gains import LIMITS, SUIT, BowdenGains
from bowden.control.our_law.law import start, step


def settling(gains: BowdenGains) -> float:
    """Ten strokes [s]: five touches teach the width to a tenth, and a swing is recognised by a few of its half-waves.

    A stroke of the check's trial takes 2 s; no gain sets how soon the law learns.
    """
    return 20.0


DEADBAND = 0.013
"""`Law.deadband`: five times what counts as no news at rest on the default bench [rad]."""


def surely_wide(known: Knowledge) -> float:
    """The lower end of a known dead zone, (1 − 2·doubt)·width, at the motor [rad]."""
    return max(0.0, 1.0 - 2.0 * known.doubt) * known.width


def reading_noise(known: Knowledge) -> float:
    """Standard deviation of the joint's reading, its counting included [rad]."""
    return math.hypot(known.joint_noise, known.joint_step / math.sqrt(12.0))


LAW = Law(
    name="bowden",
    gains=BowdenGains(),
    start_kernel=start,
    step_kernel=step,
    source="the bowden project, docs/background/our_law.md",
    presets={"suit": SUIT},
    suit_preset="suit",
    from_rig={
        "servo_frequency": "servo_frequency",
        "servo_damping": "servo_damping",
        "servo_integral": "servo_integral",
        "delay": "delay",
        "slope": "slope",
        "width": surely_wide,
        "noise": reading_noise,
    },
    compensates_lag=True,
    settling=settling,
    deadband=DEADBAND,
    tunable=frozenset({"bandwidth", "lag"}),
    limits=LIMITS,
)
