"""How warm a run left its motor, kept for the next one: a restart cools nothing.

A motor cools by the time that this computer has counted since: its clock may be set, or wrong after a start. What was
kept and cannot be read is a motor as hot as it may be; only where nothing was ever kept is it taken for cold.
"""

import json
import math
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bowden.core.clock import boot_seconds
from bowden.live import drive_file
from bowden.live.row import thermal_of
from bowden.models.drive.thermal import ThermalState, cold, rested
from bowden.safety.limits import Limits


def _path(drive: Any) -> Path:
    """One file for a drive, wherever it is."""
    return drive_file.path_of(drive, "thermal")


def read(drive: Any, limits: Limits) -> ThermalState:
    """The motor as it is now, after the time since the last run; cold where there was none.

    What was kept but cannot be used is reported, and the motor is then as hot as `limits` allow. Nothing
    is colder than its surroundings.
    """
    thermal = limits.thermal
    try:
        kept = json.loads(_path(drive).read_text(encoding="utf-8"))
        state = ThermalState(*(float(kept[name]) for name in ThermalState._fields))
        if not all(map(math.isfinite, state)):
            raise ValueError(f"the motor is at {state.winding} °C")
        boot, now = boot_seconds()
        since = float(kept["boot_s"]) if kept["boot"] == boot else 0.0
        return ThermalState(*map(max, rested(thermal, state, now - since), cold(thermal)))
    except (FileNotFoundError, RuntimeError):  # the first run, or a user without a home, who knows that already
        return cold(thermal)
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        what = f"the motor's temperature after the last run cannot be read from {_path(drive)}"
        said = f"bowden: note: {what} ({type(error).__name__}: {error}); it is assumed to be as hot as allowed"
        print(said, file=sys.stderr)
        peak, most = limits.current_peak, thermal.continuous_current
        return ThermalState(limits.winding_limit, limits.housing_limit, (peak * peak - most * most) * limits.i2t_time)


def write(drive: Any, row: Mapping[str, float], *, surely: bool = False) -> str:
    """Keep what a row of the run says; why it cannot be kept, or nothing.

    Args:
        drive: its parameters.
        row: of the run.
        surely: wait until the disk has it, so that a loss of power loses it no more.
    """
    boot, now = boot_seconds()
    document = thermal_of(row)._asdict() | {"boot": boot, "boot_s": now}
    try:
        drive_file.keep(_path(drive), document, surely=surely)
    except (OSError, RuntimeError) as error:  # RuntimeError: a user without a home
        return str(error)
    return ""
