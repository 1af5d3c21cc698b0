"""Text logs: rows of numbers under a row of names, with whatever text above, plain or gzipped."""

import io
import itertools
import json
import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from bowden.core.bounded import DAMAGED, Bounded, pieces
from bowden.core.errors import LogError
from bowden.identify.log.columns import LogColumn, find_columns, unit_of

Array = NDArray[np.float64]

MOST_ROWS = 20_000_000
"""A log of five hours at 1 kHz; more is refused before it fills the memory."""

_HEAD = 1 << 18
"""Characters within which the numbers must begin."""

_PIECE = 1 << 16  # bytes

_TRACE = "# bowden trace: "

_SPACES = r"[ \t]+"
_RECORD_AGAIN = "record or export the log again"

_QUOTED = re.compile(r'"[^"]*"')
_CONTROL = re.compile(r"[\x00-\x08\x0e-\x1f]")


@dataclass(frozen=True)
class _Layout:
    """How a text log is laid out."""

    names: list[str]
    units: list[str | None]
    skip: int
    """Lines before the first number."""
    separator: str
    """Between fields; `_SPACES` for white space."""
    decimal_comma: bool
    encoding: str


def read_text(
    path: Path, given: Mapping[str, str | None], known: Mapping[str, Sequence[str]], optional: Collection[str] = ()
) -> tuple[dict[str, LogColumn], dict[str, Array], Callable[[int], str]]:
    """The columns of a text log; see `find_columns`.

    Raises:
        LogError: binary, no numbers, no such columns, text where a number should be, rows of different length, or more
            than 20 million rows.
    """
    layout = _layout(path)
    _check_length(path)
    columns = find_columns(layout.names, given, str(path), known, optional)
    if not columns:  # all that was asked for was optional: no row need be read
        return {}, {}, lambda sample: str(path)
    for role, column in columns.items():
        unit = column.unit or layout.units[column.index]
        columns[role] = LogColumn(column.index, column.name, unit)
    try:
        table = _numbers(path, layout, [column.index for column in columns.values()])
    except DAMAGED as error:
        raise _damaged(path, error) from None
    except ValueError as error:
        raise _explained(path, layout, columns, error) from None
    values = {role: np.ascontiguousarray(table[:, i]) for i, role in enumerate(columns)}
    return columns, values, lambda sample: f"{path}, line {_line_of(path, layout, sample)}"


def _check_length(path: Path) -> None:
    """Refuse a log that is too long before anything is made of it: a small gzipped file may hold any number of rows."""
    try:
        lines = sum(piece.count(b"\n") for piece in pieces(path))
    except DAMAGED as error:
        raise _damaged(path, error) from None
    if lines > MOST_ROWS:
        raise LogError(f"{path} has more than {MOST_ROWS} rows", do="shorten it, or reduce it to about 1 kHz")


def _open(path: Path, encoding: str, errors: str = "replace") -> IO[str]:
    return io.TextIOWrapper(io.BufferedReader(Bounded(path), _PIECE), encoding=encoding, errors=errors)


def _layout(path: Path) -> _Layout:
    head, encoding = _head(path)
    lines = head.splitlines()
    if len(head) >= _HEAD:
        lines = lines[:-1]  # the last one may be cut
    for skip, line in enumerate(lines):
        following = next((later for later in lines[skip + 1 :] if later.strip()), line)
        for separator in (";", "\t", ",", _SPACES):  # a comma may be a decimal one where the others stand
            count = _row_of_numbers(line, separator)
            if count and _row_of_numbers(following, separator) in (count, 0):
                comma = separator != "," and "," in line
                open_end = separator != _SPACES and line.rstrip().endswith(separator)
                names, units = _names(path, lines[:skip], count, open_end, separator, comma)
                return _Layout(names, units, skip, separator, comma, encoding)
    raise LogError(
        f"{path}: no row of numbers found",
        expected="columns for time, motor and joint, separated by commas, semicolons, tabs or spaces",
    )


def _row_of_numbers(line: str, separator: str) -> int:
    """How many fields a line has if it is a row of a log: at least two numbers, and no more text than numbers."""
    fields = _fields(line, separator)
    numbers = sum(_number(field, separator != ",") for field in fields)
    return len(fields) if numbers >= max(2, (len(fields) + 1) // 2) else 0


def _head(path: Path) -> tuple[str, str]:
    """The log's beginning as text, and its encoding."""
    for encoding in ("utf-8-sig", "utf-16", "latin-1"):  # UTF-16 asks for its byte order mark
        try:
            with _open(path, encoding, "strict") as file:
                head = file.read(_HEAD)
        except UnicodeError:
            continue
        except DAMAGED as error:
            raise _damaged(path, error) from None
        if not head.strip():
            raise LogError(f"{path} is empty", expected="columns for time, motor and joint", do=_RECORD_AGAIN)
        if not _CONTROL.search(head):
            return head, encoding
    raise LogError(
        f"{path} is binary",
        expected="a text log (CSV, also gzipped) or a MATLAB file up to version 7",
        do="export it as CSV",
    )


def _names(
    path: Path, above: list[str], count: int, open_end: bool, separator: str, comma: bool
) -> tuple[list[str], list[str | None]]:
    """Names and units of the columns: the names stand in the last line above the numbers that has as many fields."""
    declared = _declared_units(above[0]) if above else {}
    units: list[str | None] = [None] * count
    for number, line in reversed(list(enumerate(above, start=1))):
        cells = _fields(line.lstrip("# "), separator)
        if open_end and len(cells) == count - 1:  # rows end in a separator, names do not
            cells.append("")
        elif len(cells) == count + 1 and not cells[-1]:
            cells.pop()
        if len(cells) != count or not any(cells):
            continue
        if all(unit_of(cell) or cell in ("", "-", "1") for cell in cells):
            units = [unit_of(cell) for cell in cells]
        elif any(_number(cell, comma) for cell in cells):
            raise LogError(
                f"{path}, line {number}: {line.strip()[:60]!r} is neither column names nor numbers",
                expected="one number for each column",
                do="remove or correct that row",
            )
        else:
            return cells, [declared.get(cell, unit) for cell, unit in zip(cells, units, strict=True)]
    raise LogError(
        f"{path}: no column names above the {count} columns of numbers",
        do="put a line such as time_s,motor_deg,joint_deg above them (where numbers have decimal commas, columns need "
        "semicolons or tabs between them)",
    )


def _declared_units(first: str) -> dict[str, str | None]:
    """Column → unit, where the first line is the one that `bowden.records.trace.Trace.write` writes."""
    if not first.startswith(_TRACE):
        return {}
    try:
        return {name: unit_of(unit) for name, unit in json.loads(first.removeprefix(_TRACE))["units"].items()}
    except (ValueError, KeyError, AttributeError):
        return {}


def _fields(line: str, separator: str) -> list[str]:
    parts = re.split(_SPACES, line.strip()) if separator == _SPACES else line.strip("\r\n").split(separator)
    return [part.strip().strip('"').strip() for part in parts]


def _number(text: str, comma: bool) -> bool:
    try:
        float(text.replace(",", ".") if comma else text)
    except ValueError:
        return False
    return True


def _numbers(path: Path, layout: _Layout, indices: list[int]) -> Array:
    rows = (text for _, text in _data_lines(path, layout))
    table = np.loadtxt(
        (text.replace(",", ".") for text in rows) if layout.decimal_comma else rows,
        delimiter=None if layout.separator == _SPACES else layout.separator,
        usecols=indices,
        quotechar='"',
        comments=None,
        ndmin=2,
    )
    return np.asarray(table, dtype=np.float64)


def _damaged(path: Path, error: Exception) -> LogError:
    return LogError(f"{path} is damaged: {error}", do="copy it again")


def _explained(path: Path, layout: _Layout, columns: Mapping[str, LogColumn], error: ValueError) -> LogError:
    """The first row that is not three numbers, in words."""
    needed = max(column.index for column in columns.values()) + 1
    for number, line in _data_lines(path, layout):
        fields = _fields(line, layout.separator)
        if len(fields) < needed:
            return LogError(
                f"{path}, line {number}: {len(fields)} of {len(layout.names)} columns",
                expected="rows of one length",
                do="remove the row (a log that was cut off ends with such a one)",
            )
        for column in columns.values():
            text = fields[column.index]
            if not _number(text, layout.decimal_comma):
                what = repr(text[:40]) if text else "nothing"
                return LogError(
                    f"{path}, line {number}: {what} in column {column.name!r}",
                    expected="a number",
                    do="remove or correct that row",
                )
    return LogError(f"{path} cannot be read: {error}", do="export it as CSV, a number in every field")


def _line_of(path: Path, layout: _Layout, row: int) -> int:
    """The file's line, from 1, in which a row of numbers stands."""
    for count, (number, _) in enumerate(_data_lines(path, layout)):
        if count == row:
            return number
    return layout.skip + row + 1


def _data_lines(path: Path, layout: _Layout) -> Iterator[tuple[int, str]]:
    """Number and text of each line that holds a row: blank lines and what follows a ``#`` are left out.

    Raises:
        LogError: a row with more fields than there are columns; NumPy would take the first ones and say nothing.
    """
    separator, spaces = layout.separator, layout.separator == _SPACES
    most = len(layout.names)
    with _open(path, layout.encoding) as file:
        for number, line in enumerate(itertools.islice(file, layout.skip, None), start=layout.skip + 1):
            text = line.rstrip("\r\n")
            if "#" in text:
                text = line.split("#")[0]
            if not text or text.isspace():
                continue
            if spaces:
                count = len(text.split())
            else:
                count = (_QUOTED.sub("", text) if '"' in text else text).count(separator) + 1
            if count > most and count > most + (not spaces and text.rstrip().endswith(separator)):
                raise LogError(
                    f"{path}, line {number}: {count} fields where there are {most} columns",
                    expected="rows of one length",
                    do="remove or correct that row (decimal commas ask for semicolons between the columns)",
                )
            yield number, text
