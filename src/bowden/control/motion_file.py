"""Reading a recorded motion from the file that a rig names."""

from pathlib import Path

import numpy as np

from bowden.control.recorded_motion import RecordedFile, RecordedMotion
from bowden.core.errors import LogError, near
from bowden.core.units import CABLE_LOG_LIMIT, RADIANS
from bowden.records.table import read_table


def read_motion(said: RecordedFile, folder: Path) -> RecordedMotion:
    """The motion in a CSV (also gzipped), NPZ or Parquet file, as [reference] of a rig.toml describes it.

    Raises:
        LogError: no such file or column, text where a number should be, angles in degrees called radians.
        ParameterError: too few samples, values that are not finite, uneven time.
    """
    path, names = folder / said.file, (said.time_column, said.position_column)
    table = read_table(path)
    for name in names:
        if name not in table.names:
            raise LogError(f"{path} has no column {name!r}", expected=near(name, table.names), do="correct it there")
    time, position = table.numbers([table.names.index(name) for name in names])
    angle = position * RADIANS if said.unit == "deg" else position
    if said.unit == "rad" and np.any(np.abs(angle) > CABLE_LOG_LIMIT):
        raise LogError(
            f"{path}: {said.position_column} goes to {np.nanmax(np.abs(angle)):.6g} rad, which looks like degrees",
            do='write unit = "deg" in [reference]',
        )
    found = RecordedMotion(said, time, angle)
    _ = found.motion  # which refuses what cannot be
    return found
