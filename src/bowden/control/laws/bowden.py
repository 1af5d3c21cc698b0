"""Our law: it learns while it runs how the cable loses motion, and makes up for it ahead of time.

Its equations are in `bowden.control.our_law`, their derivation in ``docs/our_law.md``.
"""

from bowden.control.law import Law
from bowden.control.our_law.gains import LIMITS, SUIT, BowdenGains
from bowden.control.our_law.law import start, step


def settling(gains: BowdenGains) -> float:
    """Ten strokes [s]: nine full crossings teach all that the dead zone's filter weighs them by, and nothing is leaked.

    A stroke of the check's trial takes 2 s; no gain sets how soon the law learns.
    """
    return 20.0


FORMER = {
    "height": "width, the dead zone in motor angle",
    "steepness": "nothing in its place: the law learns it",
    "soft_feedback": "feedback, with most as its largest",
    "least_speed": "slow",
    "wander": "nothing in its place: the law measures it",
    "noise": "nothing in its place: the law measures it",
}
"""Gains of the law's first version (`Law.former`)."""

LAW = Law(
    name="bowden",
    gains=BowdenGains(),
    start_kernel=start,
    step_kernel=step,
    source="this project, docs/our_law.md",
    presets={"suit": SUIT},
    suit_preset="suit",
    from_rig={name: name for name in ("servo_frequency", "servo_damping", "delay", "slope", "width", "doubt")},
    compensates_lag=True,
    settling=settling,
    limits=LIMITS,
    former=FORMER,
)
