"""Tables of recordings: CSV, also gzipped, NumPy's NPZ, and Parquet."""

import codecs
import contextlib
import csv
import io
import json
import os
import re
import zipfile
import zlib
from array import array
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from bowden.core.bounded import DAMAGED, open_file, read_whole
from bowden.core.errors import LogError
from bowden.core.extras import extra_module

Array = NDArray[np.float64]

KEY = "bowden"
"""Metadata of a Parquet file, and member of an NPZ file, with what a trace says of itself, as JSON."""
FIRST_LINE = b"# bowden trace: "
"""How a CSV file begins that is a trace; the same JSON follows."""
PARQUET, ZIP = b"PAR1", b"PK\x03\x04"
"""How Parquet and NPZ files begin."""
MOST_CELLS = 50_000_000
"""Fields of a table that are taken into memory: twenty-five minutes of sixteen channels at 2 kHz."""
_PACKED = 4
"""A compressed file may have so many fields more for each of its bytes."""
_IDLE = re.compile(
    rb"^(?:#(?!N/A|DIV/|VALUE!|REF!|NAME\?|NULL!|NUM!)[^\n]*|[ \r]+|[ \r]*(?=\n))(?:\n|\Z)",
    re.MULTILINE | re.IGNORECASE,
)
"""Lines of a text without fields: comments, which no error of a spreadsheet is, and what is empty but for spaces."""
_MISSING = frozenset(("", "na", "n/a", "null", "none", "#n/a"))
"""What stands for no number in a field of text."""


@dataclass(frozen=True)
class Table:
    """The columns of a file by their names; those that are asked for are read as numbers."""

    path: Path
    names: tuple[str, ...]
    read: Callable[[Sequence[int]], list[Array]] = field(repr=False)
    """See `numbers`, with errors as they come."""
    units: Mapping[str, str] = field(default_factory=dict)
    """Of the columns, where the file says them."""
    about: bytes | None = None
    """What a trace says of itself, as JSON."""

    def numbers(self, columns: Sequence[int]) -> list[Array]:
        """Columns by their places, each (n,); NaN where a field is empty.

        Raises:
            LogError: text where a number should be, rows of different length, too many fields, or a damaged file.
        """
        with readable(self.path):
            return self.read(columns)


def read_table(path: Path) -> Table:
    """A file with column names in its first row; in text, lines that begin with # and empty ones do not count.

    Fields of text stand between commas, or between semicolons or tabs, where numbers may have decimal commas.

    Args:
        path: CSV, which may be gzipped, NPZ, or Parquet; its contents decide, not its name.

    Raises:
        LogError: it cannot be read, is no table, or is too large.
        MissingExtraError: Parquet, and PyArrow is not installed.
    """
    with readable(path):
        with open_file(path) as file:
            head = file.read(len(PARQUET))
        if head == PARQUET or path.suffix == ".parquet":
            return _parquet_table(path)
        return _npz_table(path) if head == ZIP else _text_table(path)


@contextlib.contextmanager
def readable(path: Path) -> Iterator[None]:
    """What a table cannot be read for becomes one line.

    Raises:
        LogError: that line.
    """
    try:
        yield
    except DAMAGED as error:
        raise LogError(f"{path} is damaged: {error}", do="copy it again") from None
    except OSError as error:
        why = "no such file" if isinstance(error, FileNotFoundError) else error.strerror or error
        raise LogError(f"cannot read {path}: {why}", expected="a CSV or Parquet file") from None
    except (ValueError, csv.Error) as error:
        said = _printable(" ".join(str(error).split()))
        raise LogError(f"{path} is not a table: {said}", expected="CSV or Parquet with a row of names") from None


def _units_in(about: bytes | None) -> dict[str, str]:
    """Column → unit, as a trace says them."""
    try:
        return dict(json.loads(about or b"{}")["units"])
    except (ValueError, TypeError, KeyError, RecursionError):
        return {}


def _parquet_table(path: Path) -> Table:
    parquet = extra_module("pyarrow.parquet", "parquet", f"reading {path}")
    with _arrow_errors(), open_file(path) as file:
        found = parquet.ParquetFile(file)
        schema, shape = found.schema_arrow, found.metadata
        rows = sum(shape.row_group(i).num_rows for i in range(shape.num_row_groups))
        names = tuple(schema.names)
        size = file.seek(0, os.SEEK_END)

    def read(columns: Sequence[int]) -> list[Array]:
        wanted = [names[i] for i in columns]
        if (cells := rows * len(wanted)) > MOST_CELLS + _PACKED * size:
            raise _too_many(path, cells)
        with _arrow_errors(), open_file(path) as file:
            table = parquet.ParquetFile(file).read(wanted)
            return [_as_numbers(table[name].to_numpy(), name, path) for name in wanted]

    about = (schema.metadata or {}).get(KEY.encode())
    said = {name: (schema.field(i).metadata or {}).get(b"unit", b"") for i, name in enumerate(names)}
    units = {name: unit.decode(errors="replace") for name, unit in said.items() if unit}
    return Table(path, names, read, units or _units_in(about), about)


@contextlib.contextmanager
def _arrow_errors() -> Iterator[None]:
    """PyArrow's errors as `ValueError`."""
    import pyarrow as pa

    try:
        yield
    except (pa.ArrowException, KeyError) as error:
        raise ValueError(str(error)) from None


def _npz_table(path: Path) -> Table:
    """The arrays of a file of NumPy's (n,); other members are left alone, but for `KEY`."""
    size = path.stat().st_size
    with _zip_errors(), zipfile.ZipFile(path) as file:
        names = tuple(one.removesuffix(".npy") for one in file.namelist() if one.endswith(".npy"))
        about = _member(file, KEY, size) if KEY in file.namelist() else None

    def read(columns: Sequence[int]) -> list[Array]:
        found = []
        with _zip_errors(), zipfile.ZipFile(path) as file:
            for name in (names[i] for i in columns):
                member = io.BytesIO(_member(file, f"{name}.npy", size))
                found.append(_as_numbers(np.lib.format.read_array(member), name, path))
        if any(one.shape != (len(found[0]),) for one in found):
            raise ValueError(f"its columns have the shapes {', '.join(str(one.shape) for one in found)}")
        return found

    return Table(path, names, read, _units_in(about), about)


def _member(file: zipfile.ZipFile, name: str, size: int) -> bytes:
    """A member of an NPZ file of that size."""
    if (cells := file.getinfo(name).file_size // 8) > MOST_CELLS + _PACKED * size:
        raise ValueError(f"{name} has {cells} numbers")
    return file.read(name)


@contextlib.contextmanager
def _zip_errors() -> Iterator[None]:
    """What NumPy and zipfile raise of a damaged file as `ValueError`."""
    try:
        yield
    except (
        zipfile.BadZipFile,
        zlib.error,
        EOFError,
        NotImplementedError,
        RuntimeError,
        MemoryError,
        KeyError,
    ) as error:
        raise ValueError(f"it is damaged: {error}") from None


def _as_numbers(column: Any, name: str, path: Path) -> Array:
    """A column of whatever kind as numbers.

    Raises:
        LogError: one of them is none.
    """
    if column.dtype.kind not in "fiub":
        for row, value in enumerate(column.tolist()):
            try:
                _number(value)
            except (TypeError, ValueError):
                raise _no_number(path, row, name, value) from None
    return np.array(column, dtype=np.float64)


def _text_table(path: Path) -> Table:
    whole = read_whole(path).removeprefix(codecs.BOM_UTF8)
    about = whole[: whole.find(b"\n")].removeprefix(FIRST_LINE) if whole.startswith(FIRST_LINE) else None
    text = _IDLE.sub(b"", whole)
    if (cells := max(text.count(one) for one in (b",", b";", b"\t")) + text.count(b"\n")) > MOST_CELLS:
        raise _too_many(path, cells)

    def opened() -> IO[str]:
        return io.TextIOWrapper(io.BytesIO(text), "utf-8", errors="replace")

    with opened() as file:
        first = next((line for line in file if line.strip()), "").removeprefix("\ufeff")
    if not first:
        raise ValueError("it is empty")
    if "\ufffd" in first:
        raise LogError(f"{path}: a column's name is not text", expected="UTF-8", do="export it as that")
    separator = next((one for one in (";", "\t") if one in first and "," not in first), ",")
    if separator == "," and ";" in first and all(map(_is_number, first.split(";"))):
        separator = ";"  # a row of numbers with decimal commas
    names = tuple(next(csv.reader([first.rstrip("\r\n")], delimiter=separator)))
    if (filled := [name for name in names if name.strip()]) and all(map(_is_number, filled)):
        raise LogError(
            f"{path}: the first row has numbers: {_printable(first.strip(), 60)}",
            expected="a row of names",
            do="add a row of names above it, such as time_s,emg_mV (onset_s,offset_s of labels)",
        )

    def read(columns: Sequence[int]) -> list[Array]:
        with opened() as file:
            while not file.readline().strip():
                pass
            if not (begin := _first_row(file)):
                return [np.empty(0) for _ in columns]
            try:
                lines = _with(begin, file)
                if separator != ",":
                    lines = (line.replace(",", ".") for line in lines)
                found = np.loadtxt(lines, delimiter=separator, quotechar='"', comments=None, ndmin=2)
            except ValueError:  # text in it, or nothing, or rows of different length
                found = None
        if found is not None and found.shape[1] == len(names):
            return [np.ascontiguousarray(found[:, i]) for i in columns]
        return _field_by_field(path, opened, names, columns, separator)

    return Table(path, names, read, _units_in(about), about)


def _number(text: Any) -> float:
    """What `float` makes of a field, but for digits of other scripts and with underscores, which are no file's numbers.

    Raises:
        ValueError: no number.
    """
    if isinstance(text, str) and ("_" in text or not text.strip().isascii()):
        raise ValueError(f"{text!r} is no number")
    return float(text)


def _is_number(text: str) -> bool:
    """Whether a field is a number, with a decimal comma, too.

    >>> [_is_number(text) for text in ("1e-3", " 0,5", "emg_mV", "")]
    [True, True, False, False]
    """
    try:
        _number(text.replace(",", "."))
    except ValueError:
        return False
    return True


def _first_row(file: IO[str]) -> str:
    return next((line for line in file if line.strip()), "")


def _with(first: str, rest: IO[str]) -> Iterator[str]:
    yield first
    yield from rest


def _field_by_field(
    path: Path, opened: Callable[[], IO[str]], names: tuple[str, ...], columns: Sequence[int], separator: str
) -> list[Array]:
    """What has fields that are no numbers: the same, slower, with a reason where it cannot be."""
    found = [array("d") for _ in columns]
    with opened() as file:
        while not file.readline().strip():
            pass
        for row, fields in enumerate(cells for cells in csv.reader(file, delimiter=separator) if cells):
            if len(fields) != len(names):
                raise LogError(
                    f"{path}, row {row + 1}: {len(fields)} fields where there are {len(names)} columns",
                    expected="as many in each row",
                    do="remove or mend that row"
                    + ("; numbers with decimal commas need ; or tabs between them" if separator == "," else ""),
                )
            for values, place in zip(found, columns, strict=True):
                cell = fields[place]
                try:
                    values.append(_number(cell if separator == "," else cell.replace(",", ".")))
                except ValueError:
                    if cell.strip().lower() not in _MISSING:
                        raise _no_number(path, row, names[place], cell) from None
                    values.append(np.nan)
    return [np.array(values, dtype=np.float64) for values in found]


def _no_number(path: Path, row: int, name: str, value: object) -> LogError:
    return LogError(f"{path}, row {row + 1}: {name} is {_printable(repr(value), 60)}", expected="a number")


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
