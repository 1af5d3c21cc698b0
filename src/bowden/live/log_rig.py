"""The rig of a recorded run, from its log alone."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bowden.core.errors import BowdenError, LogError
from bowden.live.mcap_reader import LogReader
from bowden.rig.rig import Rig

_OLDER = "the log is of an older bowden, which kept the rig's sections and not what they name"


def rig_of_log(path: Path) -> Rig:
    """The rig that a run was made with, with what its files held then.

    A log of an older version holds the sections of a rig.toml alone: files that they name are read where they are
    still found from here, and the law's gains are those that ran.

    Raises:
        LogError: the log has no rig, or one that this version cannot read.
    """
    settings = LogReader(path).settings
    document = settings.get("rig")
    if not isinstance(document, Mapping):
        raise LogError(f"{path} does not say with which rig it ran", do="give the rig.toml of that run")
    try:
        if "format" in document:
            return Rig.unpack(document).replace(origin=str(path))
        tree = without_none(document)
        law = settings.get("law_file") or settings.get("law")
        control = {"law": law, "gains": settings.get("gains", {})} if isinstance(law, str) else {}
        rig = Rig.of_tree(tree | {"control": control}, path)
        return rig.replace(remarks=(*rig.remarks, f"{path}: {_OLDER}"))
    except BowdenError as error:
        raise LogError(f"{path}: its rig cannot be used: {error.what}", expected=error.expected, do=error.do) from error


def hash_of(settings: Mapping[str, Any]) -> str | None:
    """The hash of the rig that a log's settings name; None of a log without one."""
    document = settings.get("rig")
    return document.get("hash") if isinstance(document, Mapping) else None


def without_none(tree: Any) -> Any:
    """Nested dictionaries without the keys that older logs kept as left out."""
    if not isinstance(tree, Mapping):
        return tree
    return {key: without_none(value) for key, value in tree.items() if value is not None}
