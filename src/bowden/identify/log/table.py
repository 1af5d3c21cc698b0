"""Tables of recordings: CSV, also gzipped, and Parquet."""

from pathlib import Path
from typing import TYPE_CHECKING

from bowden.core.errors import LogError

if TYPE_CHECKING:
    import pyarrow as pa


def read_table(path: Path) -> "pa.Table":
    """Read a file with column names in its first row.

    Raises:
        LogError: it cannot be read, or is no table.
    """
    import pyarrow as pa
    from pyarrow import csv, parquet

    try:
        return parquet.read_table(path) if path.suffix == ".parquet" else csv.read_csv(path)
    except OSError as error:
        raise LogError(f"cannot read {path}: {error.strerror or error}", expected="a CSV or Parquet file") from error
    except pa.ArrowInvalid as error:
        said = _printable(" ".join(str(error).split()))
        raise LogError(f"{path} is not a table: {said}", expected="CSV or Parquet with a row of names") from error


def _printable(text: str, most: int = 200) -> str:
    """A text for one line of a message, whatever bytes of a file are in it.

    >>> _printable("got \\x00\\x1b[31m of 2")
    'got ··[31m of 2'
    """
    shown = "".join(letter if letter.isprintable() and letter != "\ufffd" else "·" for letter in text[:most])
    return shown + ("…" if len(text) > most else "")
