"""The law of a rig with its gains, and what it knows of the rig."""

import math
from pathlib import Path

from bowden.control import LAWS
from bowden.control.knowledge import Knowledge, configured
from bowden.control.law import Law
from bowden.control.law_file import held, loaded, same_file
from bowden.core.errors import ParameterError
from bowden.plants.knowledge_of import knowledge_of
from bowden.rig.checked import shown
from bowden.rig.given import GivenLaw
from bowden.rig.rig import Rig
from bowden.rig.sections import DEFAULT_CABLE


def knowledge(rig: Rig) -> Knowledge:
    """What a law knows of the rig."""
    if rig.worn is not None:
        return knowledge_of(rig.worn)
    known = knowledge_of(rig.bench if rig.plant is None else rig.cabled, identified=rig.identified)
    if rig.plant is not None and math.isnan(known.slope):
        return known
    return known._replace(relative_slope=rig.slope / DEFAULT_CABLE.slope)


def fitted(rig: Rig, law: "GivenLaw | None" = None, known: Knowledge | None = None) -> Law:
    """See `Rig.fitted`."""
    if known is not None and not isinstance(known, Knowledge):
        raise ParameterError(
            f"Rig.fitted: known is {shown(known)}", expected="a Knowledge", do="leave it out for the rig's own"
        )
    given = None if law is None else held(law)
    own = given is None or given == rig.law or same_file(given, rig.law)
    found, gains = rig.loaded_law if given is None or own else loaded(given), rig.gains if own else {}
    return configured(found, known or rig.knowledge, preset=rig.preset if own else None, gains=gains)


def loaded_law(rig: Rig) -> Law:
    """The rig's law with its own gains.

    Raises:
        ParameterError: a user's file that cannot be used.
    """
    return loaded(rig.law)


def chosen_law(rig: Rig) -> Law:
    """The rig's law with the preset and the gains that the rig chooses, and no knowledge: for other plants.

    Raises:
        ParameterError: a user's file that cannot be used, or an unknown preset or gain.
    """
    law = rig.loaded_law if rig.preset is None else rig.loaded_law.preset(rig.preset)
    return law.with_gains(**rig.gains)


def check_gains(rig: Rig) -> None:
    """Refuse gains that the rig's law does not have, and say whose they are: --law does not change that.

    Raises:
        ParameterError: there are such.
    """
    own = rig.loaded_law
    try:
        own.with_gains(**rig.gains)
    except ParameterError as error:
        others = [name for name in LAWS if name != own.name and set(rig.gains) <= set(LAWS[name].numbers)]
        if set(rig.gains) <= set(own.numbers) or not others:
            raise
        named = ", ".join(others)
        raise ParameterError(
            error.what,
            expected=f"gains of {own.name}, the law of the rig; these are gains of {named}",
            do="delete [control.gains], or name one of these laws in [control]"
            if Path(rig.origin).suffix
            else "leave gains= out, or give one of these laws",
        ) from None
