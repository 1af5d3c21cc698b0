"""The rig of a recorded run, from its log alone."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from bowden.control import user_law
from bowden.control.law_file import LawFile
from bowden.core.errors import BowdenError, LogError
from bowden.core.files import shortened
from bowden.core.own_file import OwnFile
from bowden.live.mcap_read import LogReader
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
