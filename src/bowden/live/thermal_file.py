"""How warm a run left its motor, kept for the next one: a restart cools nothing."""

import hashlib
import json
import math
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bowden.core.clock import unix_seconds
from bowden.hardware.drives.family import family_of
from bowden.live.row import thermal_of
from bowden.models.drive.thermal import Thermal, ThermalState, cold, rested


def _path(drive: Any) -> Path:
    """One file for a drive, wherever it is."""
    root = Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state")
    name = hashlib.sha256(":".join(family_of(drive).address(drive).values()).encode()).hexdigest()[:16]
    return root / "bowden" / f"thermal-{name}.json"


def read(drive: Any, thermal: Thermal) -> ThermalState:
    """The motor as it is now, after the time since the last run; cold where nothing is known of it.

    What was kept but cannot be used is told on standard error. Nothing is colder than its surroundings.
    """
    try:
        kept = json.loads(_path(drive).read_text(encoding="utf-8"))
        state = ThermalState(*(float(kept[name]) for name in ThermalState._fields))
        state = rested(thermal, state, unix_seconds() - float(kept["unix_s"]))
        if not all(map(math.isfinite, state)):
            raise ValueError(f"the motor is at {state.winding} °C")
        return ThermalState(*map(max, state, cold(thermal)))
    except (FileNotFoundError, RuntimeError):  # the first run, or a user without a home, who has been told
        pass
    except (OSError, ValueError, KeyError, TypeError) as error:
        what = f"how warm the last run left the motor cannot be read from {_path(drive)}"
        print(f"bowden: note: {what} ({type(error).__name__}: {error}); it is taken for cold", file=sys.stderr)
    return cold(thermal)


def write(drive: Any, row: Mapping[str, float]) -> str:
    """Keep what a row of the run says; why it cannot be kept, or nothing. The next run then begins cold."""
    text = json.dumps(thermal_of(row)._asdict() | {"unix_s": unix_seconds()})
    try:
        path = _path(drive)
        path.parent.mkdir(parents=True, exist_ok=True)
        part = path.with_suffix(f".{os.getpid()}")
        part.write_text(text, encoding="utf-8")
        part.replace(path)
    except (OSError, RuntimeError) as error:  # RuntimeError: a user without a home
        return str(error)
    return ""
