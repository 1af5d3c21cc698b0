"""A small file about a drive that outlives the run: one for each drive and kind, whole or as it was."""

import hashlib
import json
import os
from pathlib import Path
from typing import Any

from bowden.core.files import state_folder
from bowden.rig.families import DEFAULT, family_of


def path_of(drive: Any, kind: str) -> Path:
    """Where it is; it need not be there.

    Two families may have the same number on one bus, and each of these drives has files of its own.

    Raises:
        RuntimeError: a user without a home.
    """
    family = family_of(drive)
    whose = [*family.address(drive).values(), *([] if family.name == DEFAULT else [family.name])]
    name = hashlib.sha256(":".join(whose).encode()).hexdigest()[:16]
    return state_folder() / f"{kind}-{name}.json"


def keep(path: Path, document: dict[str, Any], *, surely: bool) -> None:
    """Write it in place of what was there.

    Args:
        path: of `path_of`.
        document: what is to be kept.
        surely: wait until the disk has it, so that a loss of power loses it no more.

    Raises:
        OSError: it cannot be kept; what was there is as it was.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_suffix(f".{os.getpid()}")
    try:
        with open(part, "w", encoding="utf-8") as file:
            json.dump(document, file)
            file.flush()
            if surely:
                os.fsync(file.fileno())
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)
