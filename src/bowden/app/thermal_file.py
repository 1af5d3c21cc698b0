"""How warm a run left its motor, kept for the next one: a restart cools nothing."""

import contextlib
import hashlib
import json
import math
import os
from collections.abc import Mapping
from pathlib import Path

from bowden.hardware.drive_parameters import DriveParameters
from bowden.models.thermal import Thermal, ThermalState, cold, rested
from bowden.runtime.clock import unix_seconds
from bowden.runtime.row import thermal_of


def _path(drive: DriveParameters) -> Path:
    """One file for a drive: its bus and its number."""
    root = Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state")
    name = hashlib.sha256(f"{drive.interface}:{drive.channel}:{drive.node_id}".encode()).hexdigest()[:16]
    return root / "bowden" / f"thermal-{name}.json"


def read(drive: DriveParameters, thermal: Thermal) -> ThermalState:
    """The motor as it is now, after the time since the last run; cold where nothing is known of it."""
    try:
        kept = json.loads(_path(drive).read_text(encoding="utf-8"))
        state = ThermalState(*(float(kept[name]) for name in ThermalState._fields))
        if all(map(math.isfinite, state)):
            return rested(thermal, state, unix_seconds() - float(kept["unix_s"]))
    except (OSError, ValueError, KeyError, TypeError, RuntimeError):
        pass
    return cold(thermal)


def write(drive: DriveParameters, row: Mapping[str, float]) -> None:
    """Keep what a row of the run says; where it cannot be kept the next run begins cold, as a first one does."""
    path, text = _path(drive), json.dumps(thermal_of(row)._asdict() | {"unix_s": unix_seconds()})
    with contextlib.suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        part = path.with_suffix(f".{os.getpid()}")
        part.write_text(text, encoding="utf-8")
        part.replace(path)
