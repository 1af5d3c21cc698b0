"""What is remembered of a drive from one run to the next: how warm its motor is, and a latch that nobody acknowledged.

A restart cools nothing: a motor cools by the time that this computer has counted since; its clock may be set, or wrong
after a start. What was kept and cannot be read is a motor as hot as it may be; only where nothing was ever kept is it
taken for cold.

A restart acknowledges nothing: faults are there from the latch to the acknowledgement, whichever process ends
meanwhile. What is there and cannot be read is a latch all the same. A twin on a bus between processes hurts nobody, and
has no latch.

There is one small file for each drive and kind, whole or as it was.
"""

import contextlib
import hashlib
import json
import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bowden.core.clock import boot_seconds
from bowden.core.errors import note
from bowden.core.files import state_folder
from bowden.live.row import thermal_of
from bowden.models.drive.thermal import ThermalState, cold, rested
from bowden.rig.families import DEFAULT, family_of
from bowden.safety.faults import Fault, bits_of, of
from bowden.safety.limits import Limits


def file_of(drive: Any, kind: str) -> Path:
    """The file of a drive, ``thermal`` or ``latched``; it need not be there.

    Two families may have the same number on one bus, and each of these drives has files of its own.

    Raises:
        RuntimeError: a user without a home.
    """
    family = family_of(drive)
    whose = [*family.address(drive).values(), *([] if family.name == DEFAULT else [family.name])]
    name = hashlib.sha256(":".join(whose).encode()).hexdigest()[:16]
    return state_folder() / f"{kind}-{name}.json"


def read_heat(drive: Any, limits: Limits) -> ThermalState:
    """The motor as it is now, after the time since the last run; cold where there was none.

    What was kept but cannot be used is reported, and the motor is then as hot as `limits` allow. Nothing
    is colder than its surroundings.
    """
    thermal = limits.thermal
    try:
        kept = json.loads(file_of(drive, "thermal").read_text(encoding="utf-8"))
        state = ThermalState(*(float(kept[name]) for name in ThermalState._fields))
        if not all(map(math.isfinite, state)):
            raise ValueError(f"the motor is at {state.winding} °C")
        boot, now = boot_seconds()
        since = float(kept["boot_s"]) if kept["boot"] == boot else 0.0
        return ThermalState(*map(max, rested(thermal, state, now - since), cold(thermal)))
    except (FileNotFoundError, RuntimeError):  # the first run, or a user without a home, who knows that already
        return cold(thermal)
    except _UNREADABLE as error:
        what = f"the motor's temperature after the last run cannot be read from {file_of(drive, 'thermal')}"
        note(f"{what} ({type(error).__name__}: {error}); it is assumed to be as hot as allowed")
        peak, most = limits.current_peak, thermal.continuous_current
        return ThermalState(limits.winding_limit, limits.housing_limit, (peak * peak - most * most) * limits.i2t_time)


def keep_heat(drive: Any, row: Mapping[str, float], *, surely: bool = False) -> str:
    """Keep what a row of the run says; why it cannot be kept, or nothing.

    Args:
        drive: its parameters.
        row: of the run.
        surely: wait until the disk has it, so that a loss of power loses it no more.
    """
    boot, now = boot_seconds()
    try:
        _keep(file_of(drive, "thermal"), thermal_of(row)._asdict() | {"boot": boot, "boot_s": now}, surely=surely)
    except (OSError, RuntimeError) as error:  # RuntimeError: a user without a home
        return str(error)
    return ""


def read_latch(drive: Any) -> int | None:
    """The faults that have not been acknowledged, a bit each; None where there is no latch."""
    if family_of(drive).simulated(drive):
        return None
    try:
        kept = json.loads(file_of(drive, "latched").read_text(encoding="utf-8"))["faults"]
        return bits_of(fault for fault in Fault if fault.name in kept)
    except (FileNotFoundError, RuntimeError):  # RuntimeError: a user without a home
        return None
    except _UNREADABLE as error:
        what = f"the fault of the last run cannot be read from {file_of(drive, 'latched')}"
        note(f"{what} ({type(error).__name__}: {error}); it has to be acknowledged anyway")
        return 0


def keep_latch(drive: Any, faults: int) -> None:
    """Keep a latch, and wait until the disk has it; what cannot be kept is reported on standard error.

    The latch of this run holds in any case.
    """
    try:
        if not family_of(drive).simulated(drive):
            _keep(file_of(drive, "latched"), {"faults": [fault.name for fault in of(faults)]}, surely=True)
    except (OSError, RuntimeError) as error:  # RuntimeError: a user without a home
        note(f"the fault of this run cannot be stored ({error}); the next run will not ask for an acknowledgement")


def acknowledge(drive: Any) -> None:
    """An operator has acknowledged the latch."""
    with contextlib.suppress(OSError, RuntimeError):
        file_of(drive, "latched").unlink(missing_ok=True)


_UNREADABLE = (OSError, ValueError, KeyError, TypeError, RecursionError)


def _keep(path: Path, document: dict[str, Any], *, surely: bool) -> None:
    """Write it in place of what was there; what was there stays where it cannot be kept."""
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
