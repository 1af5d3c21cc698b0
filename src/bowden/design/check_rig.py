"""The check of a rig's law, over the bends and the stroke of its run."""

from typing import TYPE_CHECKING

from bowden.control import Law, user_law
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


def pair_laws(rig: Rig) -> tuple[Law, Law]:
    """The laws of both motors on one joint with the gains that the rig gives them, the agonist's first."""
    one, other = (rig.axis(name).fitted() for name in rig.pair.names)
    return one, other
