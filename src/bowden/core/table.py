"""Tables of recordings: CSV, also gzipped, and Parquet."""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from bowden.core.errors import LogError

if TYPE_CHECKING:
    import pyarrow as pa


def read_table(path: Path, numbers: Iterable[str] = ()) -> "pa.Table":
    """Read a file with column names in its first row; in text, lines that begin with # may stand above.

    Args:
        path: ``.csv``, ``.csv.gz`` or ``.parquet``.
        numbers: columns in which each field of a text must be a number.

    Raises:
        LogError: it cannot be read, or is no table.
    """
    import pyarrow as pa
    from pyarrow import csv, parquet

    try:
        if path.suffix == ".parquet":
            return parquet.read_table(path)
        with pa.input_stream(str(path)) as stream:  # decompresses by the file's ending
            text = stream.read()
        above = 0
        while text[above : above + 1] == b"#" and above < len(text):
            above = text.find(b"\n", above) + 1 or len(text)
        types = csv.ConvertOptions(column_types=dict.fromkeys(numbers, pa.float64()))
        return csv.read_csv(pa.BufferReader(text[above:]), csv.ReadOptions(use_threads=False), convert_options=types)
    except OSError as error:
        why = "no such file" if isinstance(error, FileNotFoundError) else error.strerror or error
        raise LogError(f"cannot read {path}: {why}", expected="a CSV or Parquet file") from error
    except pa.ArrowException as error:
        said = _printable(" ".join(str(error).split()))
        raise LogError(f"{path} is not a table: {said}", expected="CSV or Parquet with a row of names") from error


def _printable(text: str, most: int = 200) -> str:
    """A text for one line of a message, whatever bytes of a file are in it.

    >>> _printable("got \\x00\\x1b[31m of 2")
    'got ··[31m of 2'
    """
    shown = "".join(letter if letter.isprintable() and letter != "\ufffd" else "·" for letter in text[:most])
    return shown + ("…" if len(text) > most else "")
