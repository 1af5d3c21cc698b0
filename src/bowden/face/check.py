"""`check`: does a law hold on a rig, before anything moves?"""

from dataclasses import replace

from bowden.control import user_law
from bowden.design.advice import advise
from bowden.design.check import Check
from bowden.design.check import check as judge
from bowden.design.other_law import other_law
from bowden.drawing.shown import listed
from bowden.face import given
from bowden.face.given import GivenLaw, GivenRig
from bowden.face.pair import checked_pair
from bowden.rig import ranges
from bowden.rig.axes import refuse_sources
from bowden.rig.objections import refusals
from bowden.rig.rig import Rig


def check(rig: GivenRig, law: GivenLaw | None = None, *, preset: str | None = None) -> Check:
    """Check whether a law holds on a rig: margins over all bends of the sheath, limit cycle, chatter, trial runs.

    Args:
        rig: a `Rig`, or the path of a rig.toml; with two motors on one joint (docs/pair.md), both are judged as one.
        law: a key of `LAWS`, ``FILE.py:NAME`` or a `Law`; the rig's by default.
        preset: a named set of gains of that law.

    Returns:
        The check: ``holds``, whether the loop stays bounded; ``verdict`` (``holds``, ``little_margin``, ``limit_cycle``
        or ``does_not_hold``), its ``reason``, the margins, and ``advice`` on what to change; of two motors on one joint
        ``pair`` too.

    Raises:
        ParameterError: a rig, law or setting that cannot be used.

    >>> found = check(Rig(), "adaptive")
    >>> found.holds, found.verdict, round(found.gain_margin_db)
    (True, 'holds', 19)
    """
    with given.in_words_of_python():
        whole = given.under(given.rig_of(rig, "check", pair=True), law, preset, "check")
        refuse_sources(whole)
        found = checked_pair(whole) if whole.pair.there else checked(whole)
    given.tell((*whole.notes, *refusals(whole)))
    return found


def checked(rig: Rig) -> Check:
    """The check of a rig's own law, with its advice."""
    law, plant = rig.fitted(), ranges.judged(rig)
    bends, stroke = ranges.bends(rig), ranges.stroke(rig)
    with user_law.explained(law):
        found = judge(plant, law, bends=bends, stroke=stroke, seed=rig.seed)
        advice = advise(plant, law, found, bends=bends, stroke=stroke)
    better = other_law(rig, [law.name]) if not found.holds else None
    if better is None:
        return replace(found, advice=advice)
    return replace(found, advice=listed((advice, str(better)), "; "), instead=better.law)
