"""The law of a recorded run, with the gains it had, or another one in its place; and its reference under that one."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from bowden.control import Law, user_law
from bowden.control.admittance.push import push_source
from bowden.control.reference import PointToPoint
from bowden.control.source import TABLE, Source
from bowden.core.errors import BowdenError, LogError, ParameterError, near
from bowden.core.nested import leaves, name_of
from bowden.live.mcap_read import Recording
from bowden.live.run_settings import source_of
from bowden.plants.suit_parts import Suit
from bowden.rig import compose
from bowden.rig.config import explained
from bowden.rig.laws import KNOWN
from bowden.rig.schema import Rig
from bowden.sim.suit_sources import push_of


def law_of(found: Recording, wanted: str | None) -> tuple[Law, bool]:
    """The law to replay, and whether it is the one of the record.

    The record's own gets the record's gains, whether it is named or not; any other has its default gains.

    Raises:
        ParameterError: no such law, or a file that cannot be used.
        LogError: the record does not say which law ran, or its gains do not fit.
    """
    recorded = found.settings.get("law")
    source = found.settings.get("law_file") or recorded
    name = wanted or source
    if not isinstance(name, str):
        raise LogError("the log does not say which law ran", do="name one with --law")
    law = _load(name)
    if law.name != recorded:
        return law, False
    gains = found.settings.get("gains", {})
    try:
        return law.with_gains(**gains), True
    except (ParameterError, TypeError) as error:
        raise LogError(f"the log's gains do not fit the law {law.name!r}: {error}", do="name another law") from error


def _load(name: str) -> Law:
    if user_law.is_file(name):
        return user_law.load(name, Path())
    if name in KNOWN:
        return KNOWN[name]
    raise ParameterError(f"there is no law {name!r}", expected=near(name, KNOWN), do="or name a file: my_law.py:NAME")


def source_for(found: Recording, law: Law) -> Source:
    """What makes the reference of a recorded run for a law: of a wearer's push, with the lead that this law needs.

    How far the motor is sent ahead, and whether the reference has the give of the cables, is another thing for each
    law (`control.push`). For another law than the record's it is made again of the rig that the log has; what the
    wearer's push becomes, within which range, stays as recorded.

    Raises:
        LogError: the log does not say which law ran, has no rig, or one of which this version makes another source
            than the one that ran.
    """
    recorded, ran = source_of(found.settings), found.settings.get("law")
    if recorded is TABLE or law.name == ran:
        return recorded
    if not isinstance(ran, str):
        raise LogError("the log does not say which law ran, and its lead is that law's", do=_WITHOUT)
    if "rig" not in found.settings:
        raise LogError("the log has no rig, of which the wearer's push is made for another law", do=_WITHOUT)
    suit, share = _suit_of(found.settings["rig"])
    had = recorded.settings

    def push(name: str) -> Any:
        return push_of(
            suit,
            replace(law, name=name),
            had.admittance,
            estimated=had.estimated > 0.5,
            carried=had.carried,
            friction_share=share,
            room=had.under.room,
        )

    for (path, again), (_, given) in zip(leaves(push(ran)), leaves(had), strict=True):
        if not np.isclose(again, given, rtol=1e-9, atol=0.0):
            raise LogError(
                f"the log's rig makes another source of the wearer's push: its {name_of(path)} is {again:.12g}, "
                f"and ran with {given:.12g}",
                do=_WITHOUT,
            )
    return push_source(had._replace(under=push(law.name).under))


_WITHOUT = "replay it without --law, which needs no rig"


def _suit_of(told: Any) -> tuple[Suit, float]:
    """Suit and friction share of a log's rig.

    What the push does not need is left out, lest files be looked for that were the run's: reference and cable's model.
    """
    where, hold = Path("the log's rig"), PointToPoint((0.0, 1.0), (0.0, 0.0))
    try:
        rig = Rig.model_validate(told)
        own = rig.model_copy(update={"cable": rig.cable.model_copy(update={"model": None})})
        suit = compose.setup_of(own, where, reference=hold).suit
    except ValidationError as error:
        wrong = explained(error, where)
        raise LogError(wrong.what, expected=wrong.expected, do=_WITHOUT) from error
    except BowdenError as error:
        raise LogError(error.what, expected=error.expected, do=_WITHOUT) from error
    if suit is None:
        raise LogError("the log's rig wears no suit", do=_WITHOUT)
    return suit, rig.admittance.friction_share
