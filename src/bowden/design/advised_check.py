"""The check of a rig with its advice, and with the law that holds better where its own does not."""

from dataclasses import replace
from typing import TYPE_CHECKING

from bowden.control import user_law
from bowden.design.check_rig import pair_laws
from bowden.drawing.shown import listed
from bowden.rig.rig import Rig
from bowden.sim import ranges

if TYPE_CHECKING:
    from bowden.design.check_result import Check


def checked(rig: Rig) -> "Check":
    """The check of a rig's own law, with its advice."""
    from bowden.design.advice import advise
    from bowden.design.check import check
    from bowden.design.other_law import other_law

    law, plant = rig.fitted(), ranges.judged(rig)
    bends, stroke = ranges.bends(rig), ranges.stroke(rig)
    with user_law.explained(law):
        found = check(plant, law, bends=bends, stroke=stroke, seed=rig.seed)
        advice = advise(plant, law, found, bends=bends, stroke=stroke)
    better = other_law(rig, [law.name]) if not found.holds else None
    if better is None:
        return replace(found, advice=advice)
    return replace(found, advice=listed((advice, str(better)), "; "), instead=better.law)


def checked_pair(rig: Rig) -> "Check":
    """The check of both motors on their joint, with its advice."""
    from bowden.design.pair_check import check_pair, with_advice
    from bowden.sim.pair_of_rig import pair_plant_of, pair_ranges

    pair, laws, (bends, stroke) = pair_plant_of(rig), pair_laws(rig), pair_ranges(rig)
    with user_law.explained(laws[0]):
        found = check_pair(pair, laws, bends=bends, stroke=stroke, seed=rig.axis(rig.pair.agonist).seed)
    return with_advice(found, pair)
