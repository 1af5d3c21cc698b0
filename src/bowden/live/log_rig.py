"""What a recorded run was made with, from its log alone: its rig, its law with its gains or another one in its place,
and its reference under that one.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from bowden.control import Law, user_law
from bowden.control.admittance.push import push_source
from bowden.control.knowledge import Knowledge, configured, informed
from bowden.control.law_file import LawFile, loaded, named
from bowden.control.source import TABLE, Source
from bowden.core.errors import BowdenError, LogError, ParameterError
from bowden.core.files import shortened
from bowden.core.nested import leaves, name_of
from bowden.core.own_file import OwnFile
from bowden.live.mcap_read import LogReader, Recording
from bowden.live.run_settings import source_of
from bowden.plants.pushing import push_of
from bowden.plants.suit_parts import Suit
from bowden.rig.packing import own_files
from bowden.rig.rig import Rig


def rig_of_log(path: Path) -> Rig:
    """The rig that a run was made with, with what its files held then.

    Raises:
        LogError: the log has no rig, or one that this version cannot read.
        UnknownCodeError: it has a program that its user has not named here.
    """
    settings = LogReader(path).settings
    check_code(settings, path)
    document = settings.get("rig")
    if not isinstance(document, Mapping):
        raise LogError(f"{path} does not say with which rig it ran", do="give the rig.toml of that run")
    try:
        return Rig.unpack(document).replace(origin=str(path))
    except BowdenError as error:
        raise LogError(f"{path}: its rig cannot be used: {error.what}", expected=error.expected, do=error.do) from error


class UnknownCodeError(LogError):
    """A log with a law or a plant of somebody's that was never named here."""

    def __init__(self, where: str, files: Sequence[OwnFile]) -> None:
        self.files = files
        names = " and ".join(shortened(one.name) for one in files)
        super().__init__(
            f"{where} has a program of its own, {names}, which this user has never run on this computer",
            expected="a law that you trust: it can do everything that its user can do",
            do="trust it with bowden log replay --trust-law, or name your own copy of it once",
        )


def check_code(settings: Mapping[str, Any], path: Path | str, named: Any = None) -> None:
    """Refuse a log with programs that its user has not named here before.

    Args:
        settings: of the log.
        path: of the log, or what it is called in a message.
        named: a law that the log names and does not have, if it is to be run.

    Raises:
        UnknownCodeError: it has such.
    """
    files = [*_code_in(settings), *_code_beside(named, Path(path).parent)]
    unknown = [one for one in files if not one.known]
    if unknown:
        raise UnknownCodeError(str(path), unknown)


def trust(files: Sequence[OwnFile]) -> None:
    """Have programs of a log run: its user has said so."""
    for one in files:
        one.remember()


def _code_in(settings: Mapping[str, Any]) -> Iterator[OwnFile]:
    """The laws and plants of a log's rig, and of its motors, that are users' files."""
    document = settings.get("rig")
    yield from own_files(document) if isinstance(document, Mapping) else ()


def _code_beside(law: Any, folder: Path) -> Iterator[OwnFile]:
    """The law as it is found where the log says."""
    if isinstance(law, str) and user_law.is_file(law):
        yield LawFile.seen(law, folder)


def hash_of(settings: Mapping[str, Any]) -> str | None:
    """The hash of the rig that a log's settings name; None of a log without one."""
    document = settings.get("rig")
    return document.get("hash") if isinstance(document, Mapping) else None


def law_of(found: Recording, wanted: str | None) -> tuple[Law, bool]:
    """The law to replay, and whether it is the one of the record.

    The record's own gets the record's gains, whether it is named or not; any other those that
    the log's rig gives it.

    Raises:
        ParameterError: no such law, or a file that cannot be used.
        UnknownCodeError: the log has a law or a plant of its own that its user has not named here.
        LogError: the record does not say which law ran, its gains do not fit, or its rig cannot be read.
    """
    recorded = found.settings.get("law")
    of_user = None if wanted is None else named(wanted)
    check_code(found.settings, "the log")
    given = of_user if of_user is not None else _recorded_law(found)
    if given is None:
        raise LogError("the log does not say which law ran", do="name one with --law")
    if of_user is None:
        check_code(found.settings, "the log", given)
    law = loaded(named(given) if isinstance(given, str) else given)
    if law.name != recorded:
        return configured(law, _known_of(found.settings)), False
    if wanted is not None and isinstance(own := _recorded_law(found), LawFile):
        law = loaded(own)
    gains = found.settings.get("gains", {})
    try:
        law = law.with_gains(**gains)
    except (ParameterError, TypeError) as error:
        raise LogError(
            f"the log's gains are not those of the law {law.name!r}: {error}", do="name another law"
        ) from error
    return informed(law, _known_of(found.settings)), True  # its conditioner knows the rig; the gains are the record's


def _recorded_law(found: Recording) -> str | LawFile | None:
    """The law that ran: a user's with its source, where the log has that."""
    ran, rig = found.settings.get("law"), found.settings.get("rig")
    where = found.settings.get("law_file")
    for law in own_files({**rig, "motors": ()}) if isinstance(rig, Mapping) else ():
        if isinstance(law, LawFile) and law.load().name == ran:  # a measurement runs another one than the rig's
            return law
    return where or (ran if isinstance(ran, str) else None)


def _known_of(settings: Mapping[str, Any]) -> Knowledge:
    """What the rig of a log knows."""
    return _rig_of(settings["rig"]).knowledge if "rig" in settings else Knowledge()


def source_for(found: Recording, law: Law) -> Source:
    """What makes the reference of a recorded run for a law: of a wearer's push, with the lead that this law needs.

    How far the motor is sent ahead, and whether the reference has the give of the cables, is another thing for each
    law (`control.admittance.push`). For another law than the record's it is made again of the rig that the log has;
    what the wearer's push becomes, within which range, stays as recorded.

    Raises:
        LogError: the log has no rig, or one of which this version makes another source than the one that ran.
    """
    recorded = source_of(found.settings)
    if recorded is TABLE or law.name == found.settings.get("law"):
        return recorded
    if "rig" not in found.settings:
        raise LogError("the log has no rig, of which the wearer's push is made for another law", do=_WITHOUT)
    suit, share = _suit_of(found.settings["rig"])
    had = recorded.settings

    def push(law: Law) -> Any:
        return push_of(
            suit,
            law,
            had.admittance,
            estimated=had.estimated > 0.5,
            carried=had.carried,
            friction_share=share,
            room=had.under.room,
        )

    ran = replace(  # what its law declared shows in the record
        law,
        compensates_lag=had.under.lead == 0.0,
        feeds_back=frozenset({"joint"} if had.under.compliance != 0.0 else ()),
    )
    for (path, again), (_, given) in zip(leaves(push(ran)), leaves(had), strict=True):
        if not np.isclose(again, given, rtol=1e-9, atol=0.0):
            raise LogError(
                f"the log's rig computes the wearer's push in another way: its {name_of(path)} is {again:.12g}, "
                f"and ran with {given:.12g}",
                do=_WITHOUT,
            )
    return push_source(had._replace(under=push(law).under))


_WITHOUT = "replay it without --law, which needs no rig"


def _suit_of(document: Any) -> tuple[Suit, float]:
    """Suit and friction share of a log's rig."""
    rig = _rig_of(document)
    if rig.worn is None:
        raise LogError("the log's rig wears no suit", do=_WITHOUT)
    return rig.worn, rig.admittance.friction_share


def _rig_of(document: Any) -> Rig:
    """A log's rig."""
    try:
        return Rig.unpack({**document, "origin": "the log's rig"})
    except BowdenError as error:
        what = error.what.removeprefix("the log's rig: ")
        raise LogError(f"the log's rig: {what}", expected=error.expected, do=_WITHOUT) from error
