"""The bytes of a MATLAB file up to version 7: its numbers, and those in structs.

SciPy's reader of them does not take every file for what it is: some that are damaged end the process. So what a log
needs is read here, and each length is held against the bytes that are there; text, cells and sparse matrices are passed
over.

Source: MathWorks, "MAT-File Format" (MAT-File level 5; level 4 in the appendix).
"""

import struct
import zlib
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.bounded import MOST_DATA

_HEAD = 128  # bytes before the first variable
_PIECE = 1 << 20  # bytes
_INT8, _INT32, _UINT32, _MATRIX, _COMPRESSED = 1, 5, 6, 14, 15
"""Kinds of an element."""
_STORED = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
"""Kind of an element → its numbers. A matrix of doubles may be stored as shorter ones."""
_STRUCT, _NUMERIC = 2, range(6, 16)
"""Classes of a matrix."""
_COMPLEX, _LOGICAL = 0x800, 0x200
"""Flags of a matrix."""
_DEEPEST = 8
"""A log stands in no struct of more others."""
_LEVEL4 = ("f8", "f4", "i4", "i2", "u2", "u1")

Content = dict[str, Any]
"""Name → array, squeezed as MATLAB's (n, 1) and (1, n) are vectors, or the content of a struct."""


class _Element(NamedTuple):
    kind: int
    data: memoryview


def content_of(data: bytes) -> Content:
    """The numbers in a file, by their names.

    Raises:
        ValueError: it is damaged, none of MATLAB's, or unpacks to more than `MOST_DATA`.
        zlib.error: it is damaged.
    """
    if data.startswith(b"MATLAB 5.0"):
        return _level5(data)
    if len(data) >= 20 and 0 in data[:4]:
        return _level4(data)
    raise ValueError("it does not begin as one does")


def _level5(data: bytes) -> Content:
    order = {b"IM": "<", b"MI": ">"}.get(data[126:128])
    if order is None:
        raise ValueError("its head is damaged")
    found: Content = {}
    left = MOST_DATA
    for element in _elements(memoryview(data)[_HEAD:], order):
        inner = element.data
        if element.kind == _COMPRESSED:
            inner = memoryview(_unpacked(inner, left))
            left -= len(inner)
            element = next(_elements(inner, order), _Element(0, inner))
        if element.kind == _MATRIX and (named := _matrix(element.data, order, 0)):
            found[named[0]] = named[1]
    return found


def _unpacked(data: memoryview, most: int) -> bytes:
    unpacker, parts = zlib.decompressobj(), list[bytes]()
    packed = bytes(data)
    while packed and not unpacker.eof:
        parts.append(unpacker.decompress(packed, _PIECE))
        packed = unpacker.unconsumed_tail
        most -= len(parts[-1])
        if most < 0:
            raise ValueError(f"it has more than {MOST_DATA >> 20} MB unpacked")
    return b"".join(parts)


def _elements(data: memoryview, order: str) -> Iterator[_Element]:
    """One after the other: a short one has its kind, length and up to four bytes within eight."""
    at = 0
    while at + 8 <= len(data):
        kind, size = struct.unpack_from(f"{order}II", data, at)
        if kind >> 16:
            size, kind = kind >> 16, kind & 0xFFFF
            if size > 4:
                raise ValueError(f"a short element has {size} bytes")
            yield _Element(kind, data[at + 4 : at + 4 + size])
            at += 8
            continue
        if size > len(data) - at - 8:
            raise ValueError(f"an element has {size} bytes, and {len(data) - at - 8} follow")
        yield _Element(kind, data[at + 8 : at + 8 + size])
        at += 8 + size + (0 if kind == _COMPRESSED else -size % 8)


def _matrix(data: memoryview, order: str, depth: int) -> tuple[str, Any] | None:
    """Name and content of a matrix; None of one without numbers."""
    parts = _elements(data, order)
    flags, shape, name = (next(parts, _Element(0, data[:0])) for _ in range(3))
    if (flags.kind, shape.kind, name.kind) != (_UINT32, _INT32, _INT8) or len(flags.data) != 8 or len(shape.data) % 4:
        return None
    (word,) = struct.unpack_from(f"{order}I", flags.data)
    sizes = np.frombuffer(shape.data, f"{order}i4").tolist()
    called = bytes(name.data).decode("ascii", "replace")
    if word & 0xFF == _STRUCT and depth < _DEEPEST and sizes and all(size == 1 for size in sizes):
        return called, _struct(parts, order, depth)
    if word & 0xFF not in _NUMERIC or word & _LOGICAL:
        return None
    whole = _numbers(next(parts, None), order)
    if word & _COMPLEX:
        whole = whole + 1j * _numbers(next(parts, None), order)
    return called, _shaped(whole, sizes)


def _struct(parts: Iterator[_Element], order: str, depth: int) -> Content:
    """The fields of a struct; their matrices have no names of their own."""
    length, names = (next(parts, None) for _ in range(2))
    if length is None or names is None or len(length.data) != 4:
        raise ValueError("a struct has no fields")
    (size,) = struct.unpack(f"{order}i", length.data)
    if size <= 0:
        raise ValueError(f"the names of a struct have {size} letters")
    found: Content = {}
    for at, part in zip(range(0, len(names.data), size), parts, strict=False):
        inner = _matrix(part.data, order, depth + 1) if part.kind == _MATRIX else None
        if inner is not None:
            found[bytes(names.data[at : at + size]).split(b"\0")[0].decode("ascii", "replace")] = inner[1]
    return found


def _numbers(element: _Element | None, order: str) -> NDArray[Any]:
    if element is None or element.kind not in _STORED:
        raise ValueError("a matrix has no numbers")
    kind = np.dtype(order + _STORED[element.kind])
    if len(element.data) % kind.itemsize:
        raise ValueError(f"{len(element.data)} bytes are no whole numbers")
    return np.frombuffer(element.data, kind).astype(np.float64)


def _shaped(values: NDArray[Any], sizes: list[int]) -> NDArray[Any]:
    """As MATLAB has it, column by column, without dimensions of length 1."""
    longer = [size for size in sizes if size != 1]
    if min(longer, default=0) < 0 or len(longer) > 2:
        longer = [len(values)]
    try:
        return values.reshape(longer, order="F")
    except ValueError:
        raise ValueError(f"a matrix of {' × '.join(map(str, sizes))} has {len(values)} numbers") from None


def _level4(data: bytes) -> Content:
    found: Content = {}
    at = 0
    while at + 20 <= len(data):
        order = "<" if 0 <= struct.unpack_from("<i", data, at)[0] < 5000 else ">"
        kind, rows, columns, imaginary, length = struct.unpack_from(f"{order}5i", data, at)
        stored, sort = kind // 10 % 10, kind % 10
        if not 0 <= kind < 5000 or stored >= len(_LEVEL4) or min(rows, columns, length) < 0:
            raise ValueError("its head is damaged")
        dtype = np.dtype(order + _LEVEL4[stored])
        begin = at + 20 + length
        at = begin + rows * columns * dtype.itemsize * (2 if imaginary else 1)
        if at > len(data):
            raise ValueError(f"a matrix of {rows} × {columns} ends behind the file")
        if sort == 0:
            values = np.frombuffer(data, dtype, rows * columns * (2 if imaginary else 1), begin).astype(np.float64)
            if imaginary:
                values = values[: rows * columns] + 1j * values[rows * columns :]
            name = data[begin - length : begin].split(b"\0")[0].decode("ascii", "replace")
            found[name] = _shaped(values, [rows, columns])
    return found


def vectors(content: Mapping[str, Any]) -> Iterator[tuple[str, NDArray[Any]]]:
    """Name → vector, for every vector of numbers at the top or in a struct."""
    for name, value in content.items():
        if isinstance(value, dict):
            yield from vectors(value)
        elif value.ndim == 1 and value.size > 1:
            yield name, value
