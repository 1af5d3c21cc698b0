"""The check of a rig's law, over the bends and the stroke of its run."""

from dataclasses import replace
from typing import TYPE_CHECKING

from bowden.control import Law, user_law
from bowden.core.shown import listed
from bowden.rig.rig import Rig
from bowden.sim import ranges

if TYPE_CHECKING:
    from bowden.design.check_result import Check


def check_rig(rig: Rig, law: Law) -> "Check | str":
    """What was found, or why nothing could be: a law of the user's own that gives no number at rest."""
    from bowden.design.check import check
    from bowden.design.linearise import NoNumberError

    with user_law.explained(law):
        try:
            return check(ranges.judged(rig), law, bends=ranges.bends(rig), stroke=ranges.stroke(rig), seed=rig.seed)
        except NoNumberError as error:
            return error.what


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


def pair_laws(rig: Rig) -> tuple[Law, Law]:
    """The laws of both motors on one joint with the gains that the rig gives them, the agonist's first."""
    one, other = (rig.axis(name).fitted() for name in rig.pair.names)
    return one, other


def checked_pair(rig: Rig) -> "Check":
    """The check of both motors on their joint, with its advice."""
    from bowden.design.pair_check import check_pair, with_advice
    from bowden.sim.pair_of_rig import pair_plant_of, pair_ranges

    pair, laws, (bends, stroke) = pair_plant_of(rig), pair_laws(rig), pair_ranges(rig)
    with user_law.explained(laws[0]):
        found = check_pair(pair, laws, bends=bends, stroke=stroke, seed=rig.axis(rig.pair.agonist).seed)
    return with_advice(found, pair)
