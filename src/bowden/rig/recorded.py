"""A recorded motion from a file, as a reference."""

from pathlib import Path

import numpy as np
import pyarrow as pa
from pyarrow import csv, parquet

from bowden.control.reference import Recorded
from bowden.core.errors import LogError, near
from bowden.core.units import CABLE_LOG_LIMIT, RADIANS
from bowden.rig.schema import RecordedSection


def read_motion(section: RecordedSection, folder: Path) -> Recorded:
    """The motion in a CSV (also gzipped) or Parquet file, as [reference] of a rig.toml describes it.

    Raises:
        LogError: no such file or column, text where a number should be, angles in degrees called radians.
        ParameterError: too few samples, values that are not finite, uneven time.
    """
    path = folder / section.file
    wanted = [section.time_column, section.position_column]
    try:
        table = parquet.read_table(path) if path.suffix == ".parquet" else _read_text(path, wanted)
        for name in wanted:
            if name not in table.column_names:
                raise LogError(
                    f"{path} has no column {name!r}", expected=near(name, table.column_names), do="correct it there"
                )
        time, position = (np.asarray(table[name].to_numpy(), dtype=np.float64) for name in wanted)
    except FileNotFoundError as error:
        raise LogError(
            f"{path} does not exist", expected="a CSV, csv.gz or Parquet file", do="correct reference.file"
        ) from error
    except (OSError, ValueError, pa.ArrowException) as error:
        said = " ".join(str(error).split())
        raise LogError(
            f"cannot read {path}: {said}", expected="columns of numbers under their names", do="correct the file"
        ) from error
    angle = position * RADIANS if section.unit == "deg" else position
    if section.unit == "rad" and np.any(np.abs(angle) > CABLE_LOG_LIMIT):
        raise LogError(
            f"{path}: {section.position_column} goes to {np.nanmax(np.abs(angle)):.6g} rad, which looks like degrees",
            do='write unit = "deg" in [reference]',
        )
    return Recorded(time, angle, cutoff=section.cutoff_hz, name=path.name)


def _read_text(path: Path, wanted: list[str]) -> pa.Table:
    """A CSV file with its wanted columns as numbers; lines that begin with # may stand above the names."""
    with pa.input_stream(str(path)) as stream:  # decompresses by the file's ending
        text = stream.read()
    above = 0
    while text[above : above + 1] == b"#":
        above = text.index(b"\n", above) + 1
    numbers = csv.ConvertOptions(column_types=dict.fromkeys(wanted, pa.float64()))
    return csv.read_csv(pa.BufferReader(text[above:]), csv.ReadOptions(use_threads=False), convert_options=numbers)
