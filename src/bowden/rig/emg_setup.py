"""Finding what [emg] names: the wearer's levels, and a recording's place and identity."""

import hashlib
from pathlib import Path

from bowden.core.bounded import open_file
from bowden.rig.settings import EmgSettings
from bowden.sensing import wearer_file


def found(given: EmgSettings, folder: Path, source: str | None = None) -> EmgSettings:
    """The settings with what they name looked up: the wearer's levels, and a recording's place and identity.

    Args:
        given: the settings.
        folder: where their files are found from.
        source: in place of theirs; its file is found from here.

    Raises:
        ParameterError: a wearer's file that cannot be used.
    """
    named = given.source if source is None else source
    if given.wearer is not None and given.levels is None and (named or (folder / given.wearer).exists()):
        given = given._replace(levels=wearer_file.read(folder / given.wearer))
    if named is None:
        return given
    given = given._replace(source=named)
    kind, _, rest = named.partition(":")
    if kind != "file":
        return given._replace(place="", recording="")
    path = (Path() if source is not None else folder) / rest
    return given._replace(place=f"file:{path}", recording=identity(path))


def identity(path: Path) -> str:
    """SHA-256 of a file; empty where it cannot be read, which whoever opens it says better."""
    try:
        with open_file(path) as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except (OSError, ValueError):
        return ""
