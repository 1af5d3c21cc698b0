"""Faults of a run that have not been acknowledged, kept for the next run: a restart acknowledges nothing.

One file for a drive. It is there from the latch to the acknowledgement, whichever process ends meanwhile. What is there
and cannot be read is a latch all the same. A twin on a bus between processes hurts nobody, and is not remembered.
"""

import contextlib
import json
import sys
from pathlib import Path
from typing import Any

from bowden.live import drive_file
from bowden.rig.families import family_of
from bowden.safety.faults import Fault, bits_of, of


def latch_path(drive: Any) -> Path | None:
    """The file of a drive; None of a twin."""
    return None if family_of(drive).simulated(drive) else drive_file.path_of(drive, "latched")


def read(drive: Any) -> int | None:
    """The faults that have not been acknowledged, a bit each; None where there is no latch."""
    try:
        path = latch_path(drive)
        if path is None:
            return None
        kept = json.loads(path.read_text(encoding="utf-8"))["faults"]
        return bits_of(fault for fault in Fault if fault.name in kept)
    except (FileNotFoundError, RuntimeError):  # RuntimeError: a user without a home
        return None
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        said = f"the fault of the last run cannot be read from {path} ({type(error).__name__}: {error})"
        print(f"bowden: note: {said}; it has to be acknowledged anyway", file=sys.stderr)
        return 0


def write(drive: Any, faults: int) -> None:
    """Keep a latch, and wait until the disk has it; what cannot be kept is reported on standard error.

    The latch of this run holds in any case.
    """
    try:
        path = latch_path(drive)
        if path is not None:
            drive_file.keep(path, {"faults": [fault.name for fault in of(faults)]}, surely=True)
    except (OSError, RuntimeError) as error:  # RuntimeError: a user without a home
        said = f"the fault of this run cannot be stored ({error})"
        print(f"bowden: note: {said}; the next run will not ask for an acknowledgement", file=sys.stderr)


def acknowledge(drive: Any) -> None:
    """An operator has acknowledged it."""
    with contextlib.suppress(OSError, RuntimeError):
        path = latch_path(drive)
        if path is not None:
            path.unlink(missing_ok=True)
