"""Tables of recordings: CSV, also gzipped, and Parquet."""

import contextlib
import os
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from bowden.core.bounded import DAMAGED, open_file, read_whole
from bowden.core.errors import LogError

if TYPE_CHECKING:
    import pyarrow as pa


MOST_CELLS = 50_000_000
"""Fields of a table that are taken into memory: twenty-five minutes of sixteen channels at 2 kHz."""
_PACKED = 4
"""A Parquet file may have this many fields more for each of its bytes; what was recorded has some bytes for a field."""


def read_table(path: Path, numbers: Iterable[str] = ()) -> "pa.Table":
    """Read a file with column names in its first row; in text, lines that begin with # may stand above.

    Args:
        path: ``.csv``, ``.csv.gz`` or ``.parquet``.
        numbers: columns in which each field of a text must be a number.

    Raises:
        LogError: it cannot be read, is no table, or is too large.
    """
    import pyarrow as pa
    from pyarrow import csv

    with readable(path):
        if path.suffix == ".parquet":
            return read_parquet(path)
        text = read_whole(path)
        above = 0
        while text[above : above + 1] == b"#" and above < len(text):
            above = text.find(b"\n", above) + 1 or len(text)
        if (cells := text.count(b",", above) + text.count(b"\n", above)) > MOST_CELLS:
            raise _too_many(path, cells)
        types = csv.ConvertOptions(column_types=dict.fromkeys(numbers, pa.float64()))
        table = pa.BufferReader(pa.py_buffer(text).slice(above))
        return csv.read_csv(table, csv.ReadOptions(use_threads=False), convert_options=types)


@contextlib.contextmanager
def readable(path: Path) -> Iterator[None]:
    """What a table cannot be read for becomes one line.

    Raises:
        LogError: that line.
    """
    import pyarrow as pa

    try:
        yield
    except DAMAGED as error:
        raise LogError(f"{path} is damaged: {error}", do="copy it again") from error
    except OSError as error:
        why = "no such file" if isinstance(error, FileNotFoundError) else error.strerror or error
        raise LogError(f"cannot read {path}: {why}", expected="a CSV or Parquet file") from error
    except pa.ArrowException as error:
        said = _printable(" ".join(str(error).split()))
        raise LogError(f"{path} is not a table: {said}", expected="CSV or Parquet with a row of names") from error
    except ValueError as error:  # a null byte in its name
        raise LogError(f"cannot read {path}: {error}", expected="a CSV or Parquet file") from error


def read_parquet(path: Path, choose: Callable[["pa.Schema"], list[str]] | None = None) -> "pa.Table":
    """Read a Parquet file, or some of its columns, if there is not much more in it than its bytes can hold.

    Args:
        path: of the file.
        choose: schema → names of the columns to read.

    Raises:
        OSError: it cannot be opened.
        pyarrow.ArrowException: it is none.
        LogError: too much is packed into it.
    """
    from pyarrow import parquet

    with open_file(path) as file:
        found = parquet.ParquetFile(file)
        about = found.metadata
        rows = sum(about.row_group(i).num_rows for i in range(about.num_row_groups))
        columns = None if choose is None else choose(found.schema_arrow)
        cells = rows * (about.num_columns if columns is None else len(columns))
        if cells > MOST_CELLS + _PACKED * file.seek(0, os.SEEK_END):
            raise _too_many(path, cells)
        return found.read(columns)


def _too_many(path: Path, cells: int) -> LogError:
    """The refusal of a table with this many fields."""
    return LogError(f"{path} has {cells} fields", expected=f"{MOST_CELLS} at most", do="shorten it, or keep fewer rows")


def _printable(text: str, most: int = 200) -> str:
    """A text for one line of a message, whatever bytes of a file are in it.

    >>> _printable("got \\x00\\x1b[31m of 2")
    'got ··[31m of 2'
    """
    shown = "".join(letter if letter.isprintable() and letter != "\ufffd" else "·" for letter in text[:most])
    return shown + ("…" if len(text) > most else "")
