"""Parquet files of nothing but numbers: what a trace is kept in, written and read without another package.

    PAR1 │ pages of column 0, of column 1, … │ the same of each further group of rows │ footer │ its length │ PAR1

A page is a small head and its numbers as they are (PLAIN, not compressed, no gaps), so that pandas, polars, DuckDB and
MATLAB read them, and here a page is one call of NumPy. A file that somebody else wrote is compressed, as a rule, and
has gaps and text; `Foreign` says so, and PyArrow reads it (`bowden.core.table`).

Source: the Apache Parquet format 2.9, *README* and *parquet.thrift*.
"""

import io
import struct
from collections.abc import Iterator, Mapping, Sequence
from typing import IO, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core import thrift
from bowden.core.thrift import I64

Array = NDArray[np.float64]

MAGIC = b"PAR1"
_DOUBLE, _REQUIRED, _PLAIN, _RLE, _UNCOMPRESSED, _DATA_PAGE = 5, 0, 0, 3, 0, 0
_PAGE = 1 << 17
"""Numbers of a page."""
_HEAD = 128
"""No head of a page is longer [bytes]."""
_FOOTER = 64 << 20
"""No footer is longer [bytes]."""
_WRITER = b"bowden"


class Foreign(ValueError):
    """A Parquet file with more in it than plain numbers."""


class Contents(NamedTuple):
    """What the footer says."""

    names: tuple[str, ...]
    rows: int
    about: dict[str, bytes]
    """Metadata of the file."""
    groups: list[list[dict[int, Any]]]
    """Group of rows → the metadata of its columns."""


def write(file: IO[bytes], parts: Iterator[Sequence[Array]], names: Sequence[str], about: Mapping[str, bytes]) -> None:
    """Write columns of numbers, piece by piece.

    Args:
        file: at its beginning.
        parts: pieces of the table, each a column (n,) for each name.
        names: of the columns.
        about: metadata of the file, UTF-8.

    Raises:
        OSError: it cannot be written.
    """
    at = file.write(MAGIC)
    groups, rows = [], 0
    for columns in parts:
        found, begin, count = [], at, len(columns[0])
        for name, values in zip(names, columns, strict=True):
            first = at
            for page in range(0, max(count, 1), _PAGE):
                at += _write_page(file, np.ascontiguousarray(values[page : page + _PAGE], dtype="<f8"))
            size = I64(at - first)
            chunk = {1: _DOUBLE, 2: [_PLAIN, _RLE], 3: [name.encode()], 4: _UNCOMPRESSED, 5: I64(count)}
            found.append({2: I64(first), 3: chunk | {6: size, 7: size, 9: I64(first)}})
        groups.append({1: found, 2: I64(at - begin), 3: I64(count)})
        rows += count
    root = {4: b"schema", 5: len(names)}
    leaves = [{1: _DOUBLE, 3: _REQUIRED, 4: name.encode()} for name in names]
    keys = [{1: key.encode(), 2: value} for key, value in about.items()]
    footer = thrift.written({1: 2, 2: [root, *leaves], 3: I64(rows), 4: groups, 5: keys, 6: _WRITER})
    file.write(footer + struct.pack("<I", len(footer)) + MAGIC)


def _write_page(file: IO[bytes], values: Array) -> int:
    shape = {1: len(values), 2: _PLAIN, 3: _RLE, 4: _RLE}
    head = thrift.written({1: _DATA_PAGE, 2: values.nbytes, 3: values.nbytes, 5: shape})
    file.write(head)
    file.write(values.data)
    return len(head) + values.nbytes


def contents(file: io.BufferedIOBase) -> Contents:
    """What is in a file of plain numbers.

    Raises:
        Foreign: there is more in it than those.
        ValueError: it is damaged, or no Parquet file.
    """
    size = file.seek(0, io.SEEK_END)
    if size < 12:
        raise ValueError("it is too short")
    file.seek(0)
    begins = file.read(4)
    file.seek(size - 8)
    (length,), ends = struct.unpack("<I", file.read(4)), file.read(4)
    if begins != MAGIC or ends != MAGIC or length > min(size - 12, _FOOTER):
        raise ValueError("it does not end as a Parquet file does: it was cut off, or is none")
    file.seek(size - 8 - length)
    said, _ = thrift.read(file.read(length))
    try:
        return _plain(said, size)
    except (KeyError, TypeError, AttributeError, IndexError) as error:
        raise ValueError("its footer does not say what is in it") from error


def _plain(said: dict[int, Any], size: int) -> Contents:
    leaves = said[2][1:]
    if not str(said.get(6, b""), "utf-8", "replace").startswith(_WRITER.decode()):
        raise Foreign("another program wrote it")
    if any((leaf.get(1), leaf.get(3)) != (_DOUBLE, _REQUIRED) for leaf in leaves):
        raise Foreign("it has columns of another kind")
    names, rows = tuple(leaf[4].decode() for leaf in leaves), said[3]
    groups = [[column[3] for column in group[1]] for group in said[4]]
    for group, columns in zip(said[4], groups, strict=True):
        if len(columns) != len(names) or any(column[5] != group[3] for column in columns):
            raise ValueError("its columns are not of one length")
        if any((column[1], column[4]) != (_DOUBLE, _UNCOMPRESSED) for column in columns):
            raise Foreign("its columns are compressed")
        if group[3] < 0 or any(not 0 <= column[9] <= size for column in columns):
            raise ValueError("a place that it names is not in it")
    if rows != sum(group[3] for group in said[4]):
        raise ValueError("it does not have as many rows as it says")
    if 8 * rows * len(names) > size:
        raise ValueError("it says that it has more rows than fit into it")
    return Contents(names, rows, {one[1].decode(): one.get(2, b"") for one in said.get(5, [])}, groups)


def column(file: io.BufferedIOBase, found: Contents, index: int) -> Array:
    """A column (rows,).

    Raises:
        ValueError: it is damaged.
    """
    values, filled = np.empty(found.rows, dtype="<f8"), 0
    for group in found.groups:
        at, end = group[index][9], filled + group[index][5]
        while filled < end:
            file.seek(at)
            head, length = thrift.read(file.read(_HEAD))
            shape = head.get(5)
            if not isinstance(shape, dict) or head.get(1) != _DATA_PAGE or shape.get(2) != _PLAIN:
                raise ValueError("a page of it is not one of plain numbers")
            count = shape.get(1)
            if type(count) is not int or not 0 < count <= end - filled or head.get(3) != 8 * count:
                raise ValueError("a page of it is not as long as it says")
            file.seek(at + length)
            data = file.read(8 * count)
            if len(data) < 8 * count:
                raise ValueError("it ends too early")
            values[filled : filled + count] = np.frombuffer(data, "<f8")
            filled, at = filled + count, at + length + 8 * count
    return values
