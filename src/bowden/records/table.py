"""Tables of recordings: text with whatever stands above its numbers, NumPy, Parquet, and what other programs write.

One reader for logs of cables and servos, recordings of EMG, labels, motions and traces. What a column is for, its
reader's user says.
"""

import contextlib
import csv
import datetime
import io
import itertools
import json
import math
import os
import re
import shlex
import zipfile
import zlib
from array import array
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.bounded import DAMAGED, Bounded, open_file, pieces
from bowden.core.errors import LogError
from bowden.core.extras import extra_module
from bowden.records.foreign import TEXT, read_foreign
from bowden.records.units import is_unit

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
_COMMENT = re.compile(r"#(?!N/A|DIV/|VALUE!|REF!|NAME\?|NULL!|NUM!).*", re.IGNORECASE)
"""In a line of text; an error of a spreadsheet is none."""
_CONTROL = re.compile(r"[\x00-\x08\x0e-\x1a\x1c-\x1f]")
"""What no text has; an escape of a terminal is one field's, and is refused with its row."""
_HEAD = 1 << 18
"""Characters within which the numbers must begin."""
_BLOCK = 1 << 22
"""Characters that are read at once: the numbers of a text fit into the memory, its lines need not."""
_SEPARATORS = (";", "\t", ",", "")
"""Between fields, the last for white space: a comma may be a decimal one where the others stand."""
_LIKE, _MOST_ALIKE = 10, 0.6
"""Lines below the first row that are looked at, and the share of them that has as many fields."""
KINDS = "CSV (also gzipped), Parquet, NumPy (.npz, .npy), MATLAB (.mat), Excel (.xlsx), TDMS or a bag of ROS 2"
_BEGINNINGS = {
    b"MATLAB 5.0": "matlab",
    b"MATLAB 7.3": "hdf5",
    b"\x89HDF": "hdf5",
    b"TDSm": "tdms",
    b"\xd0\xcf\x11\xe0": "workbook",
    b"SQLite format 3": "bag",
    b"\x89MCAP0": "bag",
}
"""How files begin that packages read → their format, see `read_foreign`."""
_BAG = "metadata.yaml"
"""What is in the folder of a bag."""
_MISSING = frozenset(("", "-", "na", "n/a", "nan", "null", "none", "#n/a"))
"""What stands for no number in a field of text."""


@dataclass(frozen=True)
class Table:
    """The columns of a file by their names; those that are asked for are read as numbers."""

    path: Path
    names: tuple[str, ...]
    read: Callable[[Sequence[int], int | None], list[Array]] = field(repr=False)
    """See `numbers`, with errors as they come."""
    units: Mapping[str, str] = field(default_factory=dict)
    """Of the columns, where the file says them."""
    about: bytes | None = None
    """What a trace says of itself, as JSON."""
    wordy: frozenset[str] = frozenset()
    """Columns of a text whose first row has no number there."""
    place: Callable[[int], str] = field(default=lambda sample: f"row {sample + 1}", repr=False)
    """Sample → where it stands in the file, for messages."""

    def numbers(self, columns: Sequence[int], clock: int | None = None) -> list[Array]:
        """Columns by their places, each (n,); NaN where a field is empty.

        Args:
            columns: places, from 0.
            clock: the one of them that may have times as text, ISO 8601 or of the day, which become seconds.

        Raises:
            LogError: text where a number should be, rows of different length, too many fields, or a damaged file.
        """
        with readable(self.path):
            return self.read(columns, clock)


def read_table(path: Path) -> Table:
    """The columns of a file by their names.

    In text the names stand in the last line above the numbers that has as many fields, whatever stands above it; the
    columns of a table without names are called by their numbers, from 1. Lines that begin with # or % and empty ones do
    not count. Fields stand between commas, white space, or semicolons or tabs, where numbers may have decimal commas.

    Args:
        path: CSV (also gzipped), NPZ, NPY, Parquet, MATLAB, HDF5, a workbook, TDMS or the folder of a bag of ROS 2; its
            contents decide, not its name.

    Raises:
        LogError: it cannot be read, is no table, or is too large.
        MissingExtraError: the package that reads it is not installed.
    """
    with readable(path):
        if is_bag(path):
            return _columns_table(path, read_foreign(path, "bag"))
        with open_file(path) as file:
            head = file.read(512)
        if head.startswith(PARQUET) or path.suffix == ".parquet":
            return _parquet_table(path)
        if head.startswith(b"\x93NUMPY"):
            return _columns_table(path, {"data": _loaded(path)})
        if head.startswith(ZIP):
            with _zip_errors(), zipfile.ZipFile(path) as archive:
                workbook = not {"[Content_Types].xml", "content.xml"}.isdisjoint(archive.namelist())
            return _workbook_table(path) if workbook else _npz_table(path)
        kind = next((one for begin, one in _BEGINNINGS.items() if head.startswith(begin)), None)
        if kind == "workbook":
            return _workbook_table(path)
        if kind == "bag" and b"bowden" in head:
            raise LogError(
                f"{path} is the log of a live run",
                expected="time, motor and joint in columns",
                do=f"write them: bowden log export {shlex.quote(str(path))}; in Python read it with "
                "bowden.read_trace(path), which bowden.identify takes",
            )
        if kind == "bag":  # what its messages are, the folder says
            if not is_bag(path.parent):
                raise LogError(f"{path} is a part of a bag of ROS 2", expected="its folder", do=f"put {_BAG} beside it")
            return _columns_table(path, read_foreign(path.parent, "bag"))
        if kind or path.suffix.lower() == ".mat":
            return _columns_table(path, read_foreign(path, kind or "matlab"))
        return _text_table(path)


def is_bag(path: Path) -> bool:
    """True if a folder is a recording of ROS 2."""
    return (path / _BAG).is_file()


def _workbook_table(path: Path) -> Table:
    """The rows of a workbook's longest sheet, read as text is: what stands above the numbers, dates, empty cells."""
    text = read_foreign(path, "workbook")[TEXT].tobytes().decode()
    if not text:
        raise LogError(f"{path} has no rows", expected="a sheet with times and angles", do="save it again")
    return _text_table(path, text)


def _loaded(path: Path) -> NDArray[Any]:
    with _zip_errors(), open_file(path) as file:
        return np.lib.format.read_array(file)


def _columns_table(path: Path, content: Mapping[str, NDArray[Any]]) -> Table:
    """Vectors by their names, and the columns of matrices by theirs and a number."""
    found: dict[str, NDArray[Any]] = {}
    for name, value in content.items():
        if value.dtype.names:
            found |= {one: value[one] for one in value.dtype.names}
        elif value.ndim == 1:
            found[name] = value
        elif value.ndim == 2 and min(value.shape) == 1:
            found[name] = value.ravel()
        elif value.ndim == 2:
            found |= {f"{name} {k}": column for k, column in enumerate(value.T, 1)}
    if not found:
        raise LogError(f"{path}: no vector of numbers in it", expected="vectors of one length", do="save them so")
    names = tuple(found)

    def read(columns: Sequence[int], clock: int | None) -> list[Array]:
        wanted = {names[i]: found[names[i]] for i in columns}
        for name, one in wanted.items():
            if np.iscomplexobj(one):
                raise LogError(f"{path}: {name!r} is complex", expected="real numbers", do="save its real part")
        return _of_one_length(path, {name: _as_numbers(one, name, path) for name, one in wanted.items()})

    return Table(path, names, read, place=lambda sample: f"{path}, sample {sample + 1}")


def _of_one_length(path: Path, wanted: Mapping[str, Array]) -> list[Array]:
    if any(one.shape != next(iter(wanted.values())).shape or one.ndim != 1 for one in wanted.values()):
        lengths = ", ".join(f"{name} has {' × '.join(map(str, one.shape))}" for name, one in wanted.items())
        raise LogError(f"{path}: the columns differ in length ({lengths})", expected="one", do="save those of one run")
    return list(wanted.values())


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
    except IsADirectoryError:
        raise LogError(f"{path} is a folder", expected="a log file", do=f"give the path of one: {KINDS}") from None
    except FileNotFoundError:
        raise LogError(f"cannot read {path}: no such file", do="check the path") from None
    except OSError as error:
        raise LogError(f"cannot read {path}: {error.strerror or error}", do="check its permissions") from None
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

    def read(columns: Sequence[int], clock: int | None) -> list[Array]:
        wanted = [names[i] for i in columns]
        if (cells := rows * len(wanted)) > MOST_CELLS + _PACKED * size:
            raise _too_many(path, cells)
        with _arrow_errors(), open_file(path) as file:
            table = parquet.ParquetFile(file).read(wanted)
            return [_as_numbers(table[name].to_numpy(), name, path) for name in wanted]

    about = (schema.metadata or {}).get(KEY.encode())
    said = {name: (schema.field(i).metadata or {}).get(b"unit", b"") for i, name in enumerate(names)}
    units = {name: unit.decode(errors="replace") for name, unit in said.items() if unit}
    return Table(path, names, read, units or _units_in(about), about, place=lambda sample: f"{path}, row {sample + 1}")


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

    def read(columns: Sequence[int], clock: int | None) -> list[Array]:
        found = {}
        with _zip_errors(), zipfile.ZipFile(path) as file:
            for name in (names[i] for i in columns):
                member = io.BytesIO(_member(file, f"{name}.npy", size))
                found[name] = _as_numbers(np.lib.format.read_array(member), name, path)
        return _of_one_length(path, found)

    return Table(path, names, read, _units_in(about), about, place=lambda sample: f"{path}, row {sample + 1}")


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
    if column.dtype.kind == "M":
        return np.asarray(column.astype("datetime64[ns]").astype(np.int64) * 1e-9)
    if column.dtype.kind not in "fiub":
        for row, value in enumerate(column.tolist()):
            if value is not None and (isinstance(value, str) or not isinstance(value, int | float)):
                raise LogError(
                    f"{path}, row {row + 1}: {_printable(name)} is {_printable(repr(value), 60)}", expected="a number"
                )
    return np.array(column, dtype=np.float64)


def _text_table(path: Path, text: str | None = None) -> Table:
    """The table in a file of text, or in the text of a workbook."""
    head, encoding = (text[:_HEAD], "") if text else _head(path)
    layout = _layout(path, head, encoding)._replace(text=text)
    first = head.partition("\n")[0]
    about = first.removeprefix(FIRST_LINE.decode()).encode() if first.startswith(FIRST_LINE.decode()) else None
    said = _units_in(about)
    units = {name: unit for name, unit in layout.units.items() if unit} | said

    def read(columns: Sequence[int], clock: int | None) -> list[Array]:
        rows = text.count("\n") if text else sum(piece.count(b"\n") for piece in pieces(path))
        if (cells := rows * max(1, len(columns))) > MOST_CELLS:
            raise _too_many(path, cells)
        parts = [_numbers(path, layout, lines, number, columns, clock) for number, lines in _blocks(path, layout)]
        return [np.concatenate([part[i] for part in parts]) if parts else np.empty(0) for i in range(len(columns))]

    def place(sample: int) -> str:
        rows = (line for number, lines in _blocks(path, layout) for line, _ in _rows(path, layout, lines, number))
        return f"{path}, line {next(itertools.islice(rows, sample, None), layout.skip + sample + 1)}"

    return Table(path, layout.names, read, units, about, layout.wordy, place)


class _Layout(NamedTuple):
    """How a text is laid out."""

    names: tuple[str, ...]
    units: Mapping[str, str]
    """As a line of their own says them, below the names."""
    skip: int
    """Lines before the first row."""
    separator: str
    """Between fields; empty for white space."""
    encoding: str
    wordy: frozenset[str] = frozenset()
    """Columns whose first row has no number there."""
    text: str | None = None
    """Of a workbook; else it is the file's."""


def _open(path: Path, encoding: str, errors: str = "replace") -> IO[str]:
    return io.TextIOWrapper(io.BufferedReader(Bounded(path), 1 << 16), encoding=encoding, errors=errors)


def _head(path: Path) -> tuple[str, str]:
    """A text's beginning, and its encoding."""
    for encoding in ("utf-8-sig", "utf-16", "latin-1"):  # UTF-16 asks for its byte order mark
        try:
            with _open(path, encoding, "strict") as file:
                head = file.read(_HEAD)
        except UnicodeError:
            continue
        if not head.strip():
            raise LogError(f"{path} is empty", expected="a row of names, and rows of numbers", do="record it again")
        if not _CONTROL.search(head):
            return head, encoding
    raise LogError(f"{path} is binary", expected=KINDS, do="export it as CSV")


def _layout(path: Path, head: str, encoding: str) -> _Layout:
    """Where the numbers begin, and what stands above them.

    The first row is a line of numbers that most of those after it are like, or that stands below as many names. Lines
    of numbers right above it are rows too, which are refused as they are read.
    """
    if head.startswith(FIRST_LINE.decode()):  # a trace: its names may be whatever its user called them
        rows = csv.reader(io.StringIO(head.partition("\n")[2], newline=""))
        names = tuple(next(rows, ()))
        return _Layout(names, {}, 1 + rows.line_num, ",", encoding)
    lines = head.splitlines()
    if len(head) >= _HEAD:
        lines = lines[:-1]  # the last one may be cut
    for least in (2, 1):  # a line with one number is a row where no other has two
        for skip in range(len(lines)):
            found = [
                (numbers, count, separator)
                for separator in _SEPARATORS
                for count, numbers in [_first_row(path, lines, skip, separator, least)]
                if count
            ]
            if found:
                _, count, separator = max(found, key=lambda one: one[0])
                first = skip
                for above in range(skip - 1, -1, -1):
                    if _numbers_alone(lines[above]):
                        first = above
                    elif lines[above].strip():
                        break
                if first < skip:
                    _, count, separator = max(_numbers_alone(lines[first]), key=lambda one: one[0])
                names, units = _names(path, lines[:first], count, separator)
                cells = dict(zip(names, _fields(lines[first], separator), strict=False))
                units |= {name: "s" for name, one in cells.items() if ":" in one and _value(one, separator, clock=True)}
                wordy = frozenset(name for name, one in cells.items() if _value(one, separator, clock=True) is None)
                return _Layout(names, units, first, separator, encoding, wordy)
    named = [(number, one) for number, one in enumerate(lines, 1) if one.strip() and not one.startswith("#")]
    skip, first_line = named[0] if named else (len(lines), "")
    separator = next((one for one in (";", "\t") if one in first_line and "," not in first_line), ",")
    return _Layout(tuple(_fields(first_line, separator)), {}, skip, separator, encoding)


def _first_row(path: Path, lines: Sequence[str], skip: int, separator: str, least: int) -> tuple[int, int]:
    """How many fields, and how many numbers, a line has if the rows of a table may begin with it; else 0, 0."""
    count, numbers = _row_of_numbers(lines[skip], separator, least)
    if not count or (least == 1 and (count > 1 or any(mark in lines[skip] for mark in ";\t,"))):
        return 0, 0
    after = [one for one in lines[skip + 1 : skip + 1 + 2 * _LIKE] if one.strip()]
    below = [one for one in after if one[0] not in "#%"][:_LIKE]
    if (below and _no_number(below[0], separator)) or (
        after and _no_number(after[0], separator) and len(_fields(after[0].lstrip("#% "), separator)) == count > 1
    ):
        return 0, 0  # names stand below it
    alike = sum(_row_of_numbers(one, separator, 1)[0] == count for one in below) >= _MOST_ALIKE * len(below)
    above = [one for one in lines[:skip] if one.strip()][-2:]
    if not alike:
        alike = bool(_numbers_alone(lines[skip])) and _names(path, above, count, separator)[0][0] != "1"
    return (count, numbers) if alike else (0, 0)


def _no_number(line: str, separator: str) -> bool:
    return all(_value(one, separator, clock=True) is None for one in _fields(line, separator))


def _numbers_alone(line: str) -> list[tuple[int, int, str]]:
    """Numbers, fields and separator, for each separator between which a line has nothing but numbers."""
    found = []
    for separator in _SEPARATORS:
        count, numbers = _row_of_numbers(line, separator, 1)
        if count and numbers == sum(one.lower() not in _MISSING for one in _fields(line, separator)):
            found.append((numbers, count, separator))
    return found


def _row_of_numbers(line: str, separator: str, least: int) -> tuple[int, int]:
    """How many fields a line has if it is a row, at least so many numbers and no more text, else 0; and the numbers."""
    fields = _fields(line, separator)
    filled = [field for field in fields if field.lower() not in _MISSING]
    numbers = sum(_value(field, separator, clock=True) is not None for field in filled)
    return len(fields) if numbers >= max(least, (len(filled) + 1) // 2) else 0, numbers


def _names(path: Path, above: Sequence[str], count: int, separator: str) -> tuple[tuple[str, ...], dict[str, str]]:
    """Names and units of the columns: the names stand in the last line above the numbers that has as many fields.

    Where there is none, the columns are called by their numbers, from 1.
    """
    units: list[str] = []
    for line in reversed(above):
        cells = _fields(line.lstrip("#% "), separator)
        while len(cells) > count and not cells[-1]:
            cells.pop()
        if len(cells) == count - 1:  # rows end in a separator, names do not
            cells.append("")
        if (
            separator == ","
            and 2 * len(cells) == count
            and not any(_value(one, separator) is not None for one in cells)
        ):
            raise LogError(
                f"{path}: {count} columns of numbers below {len(cells)} names",
                expected="as many",
                do="numbers with decimal commas need semicolons or tabs between the columns: export it so",
            )
        if len(cells) != count or not any(cells):
            continue
        if not units and all(is_unit(cell) for cell in cells):
            units = cells
        elif any(_value(cell, separator) is not None for cell in cells):
            break
        else:
            return tuple(cells), dict(zip(cells, units, strict=False))
    return tuple(str(number) for number in range(1, count + 1)), {}


def _fields(line: str, separator: str) -> list[str]:
    if '"' in line and separator:  # quotes that are left are the fields' own
        return [one.strip() for one in next(_csv([line.strip("\r\n")], separator), [])]
    parts = line.strip("\r\n").split(separator) if separator else line.split()
    return [part.strip().strip('"').strip() for part in parts]


def _csv(lines: Iterable[str], separator: str) -> Any:
    return csv.reader(lines, delimiter=separator, skipinitialspace=True)


def _blocks(path: Path, layout: _Layout) -> Iterator[tuple[int, list[str]]]:
    """The lines from the first row on, some megabytes at a time, and the number of the first of them."""
    with io.StringIO(layout.text) if layout.text else _open(path, layout.encoding) as file:
        for _ in range(layout.skip):
            file.readline()
        number = layout.skip + 1
        while lines := file.readlines(_BLOCK):
            yield number, lines
            number += len(lines)


def _numbers(
    path: Path, layout: _Layout, lines: list[str], number: int, columns: Sequence[int], clock: int | None
) -> list[Array]:
    """Columns of some lines, the first of which has that number; at the speed of C where they are numbers alone."""
    text, separator, count = "".join(lines), layout.separator, len(layout.names)
    fields = _counts(text, separator) if separator else {len(line.split()) for line in lines}
    even = fields in ({count}, {count + 1}) if separator else fields == {count}
    if even and columns and not any(mark in text for mark in '#"%'):
        if separator not in ("", ",") and "," in text:
            lines = [line.replace(",", ".") for line in lines]
        with contextlib.suppress(ValueError):
            found = np.loadtxt(lines, delimiter=separator or None, usecols=columns, comments=None, ndmin=2)
            if len(found) == len(lines):
                return [np.ascontiguousarray(column) for column in found.T]
    kept = [array("d") for _ in columns]
    for line, cells in _rows(path, layout, lines, number):
        for values, place in zip(kept, columns, strict=True):
            cell = cells[place] if place < len(cells) else ""
            value = _value(cell, separator, clock=place == clock)
            if value is None and cell.strip().lower() not in _MISSING:
                raise LogError(
                    f"{path}, line {line}: {_printable(layout.names[place])} is {_printable(repr(cell), 60)}",
                    expected="a number",
                    do="correct or remove that row",
                )
            values.append(math.nan if value is None else value)
    return [np.array(values, dtype=np.float64) for values in kept]


def _counts(text: str, separator: str) -> set[int]:
    """How many fields the lines of a text have, whatever is in quotes."""
    letters = np.frombuffer(text.encode(), np.uint8)
    begins = np.append(0, np.flatnonzero(letters[:-1] == ord("\n")) + 1)
    return set((np.add.reduceat(letters == ord(separator), begins, dtype=np.int64) + 1).tolist())


def _rows(path: Path, layout: _Layout, lines: Sequence[str], number: int) -> Iterator[tuple[int, list[str]]]:
    """Number and fields of each line that is a row: blank lines and comments are left out.

    Raises:
        LogError: a row with more or fewer fields than there are columns.
    """
    count, separator = len(layout.names), layout.separator
    for line, text in enumerate(lines, number):
        cut = _COMMENT.sub("", text) if "#" in text else text
        if not cut.strip() or cut[0] == "%":
            continue
        cells = _fields(cut, separator)
        while len(cells) > count and not cells[-1] and len(cells) <= count + 1:
            cells.pop()
        if len(cells) != count:
            raise LogError(
                f"{path}, line {line}: {len(cells)} fields where there are {count} columns",
                expected="as many in each row",
                do="remove or correct that row (a log that was cut off ends with such a one)"
                + ("; numbers with decimal commas need ; or tabs between them" * (separator == ",")),
            )
        yield line, cells


def _value(text: str, separator: str, *, clock: bool = False) -> float | None:
    """What a field says [–], of a clock's time also as ISO 8601 or as a time of day [s]; None where it is no number.

    Digits of other scripts and with underscores, which Python takes, are no file's numbers.

    >>> [_value(text, ";") for text in ("1e-3", " 0,5", "emg_mV", "")]
    [0.001, 0.5, None, None]
    >>> [_value(text, ",", clock=True) for text in ("14:32:05.5", "1970-01-02T00:00:01Z")]
    [52325.5, 86401.0]
    """
    text = text.strip()
    if "_" in text or not text.isascii():
        return None
    try:
        return float(text.replace(",", ".") if separator != "," else text)
    except ValueError:
        if not clock or ":" not in text:
            return None
    try:
        if "-" in text:
            moment = datetime.datetime.fromisoformat(text)
            return (moment if moment.tzinfo else moment.replace(tzinfo=datetime.UTC)).timestamp()
        at = datetime.time.fromisoformat(text.rpartition(" ")[2])
        return 3600.0 * at.hour + 60.0 * at.minute + at.second + 1e-6 * at.microsecond
    except ValueError:
        return None


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
