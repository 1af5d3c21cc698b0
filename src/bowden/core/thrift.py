"""Thrift's compact protocol, as far as the footer of a Parquet file needs it.

A structure is a dict of its fields by their numbers. To be written, a value is an `int` of 32 bits, an `I64`, bytes, a
list of one kind, or a dict.

Source: the Apache Thrift project, *Thrift compact protocol encoding* (thrift-compact-protocol.md).
"""

from collections.abc import Mapping
from typing import Any

_TRUE, _FALSE, _BYTE, _I16, _I32, _I64, _DOUBLE, _BINARY, _LIST, _SET, _MAP, _STRUCT = range(1, 13)
_DEEPEST = 16
"""Structures and lists in one another; a Parquet footer has six."""


class I64(int):
    """A number that is written with 64 bits."""


def written(fields: Mapping[int, Any]) -> bytes:
    """A structure as bytes.

    >>> written({1: 2, 3: I64(-1)}).hex()
    '1504260100'
    """
    found, last = bytearray(), 0
    for number in sorted(fields):
        value = fields[number]
        kind, step = _kind(value), number - last
        found += bytes([step << 4 | kind]) if step < 16 else bytes([kind]) + _varint(_zigzag(number))
        found += _value(kind, value)
        last = number
    return bytes(found) + b"\0"


def _kind(value: Any) -> int:
    if isinstance(value, int):
        return _I64 if isinstance(value, I64) else _I32
    return _BINARY if isinstance(value, bytes) else _LIST if isinstance(value, list) else _STRUCT


def _value(kind: int, value: Any) -> bytes:
    if kind in (_I32, _I64):
        return _varint(_zigzag(value))
    if kind == _BINARY:
        return _varint(len(value)) + bytes(value)
    if kind == _STRUCT:
        return written(value)
    inner = _kind(value[0]) if value else _BINARY
    head = bytes([len(value) << 4 | inner]) if len(value) < 15 else bytes([0xF0 | inner]) + _varint(len(value))
    return head + b"".join(_value(inner, one) for one in value)


def _zigzag(number: int) -> int:
    return number << 1 if number >= 0 else (-number << 1) - 1


def _varint(number: int) -> bytes:
    found = bytearray()
    while number > 0x7F:
        found.append(number & 0x7F | 0x80)
        number >>= 7
    return bytes(found) + bytes([number])


def read(data: bytes, at: int = 0) -> tuple[dict[int, Any], int]:
    """A structure, and where it ends.

    Raises:
        ValueError: it is none.

    >>> read(written({1: 2, 3: [b"a", b"b"], 20: {1: I64(-70000)}}))
    ({1: 2, 3: [b'a', b'b'], 20: {1: -70000}}, 16)
    """
    reader = _Reader(data, at)
    return reader.structure(0), reader.at


class _Reader:
    """Where reading is."""

    def __init__(self, data: bytes, at: int) -> None:
        self._data, self.at = data, at

    def structure(self, depth: int) -> dict[int, Any]:
        """Fields up to the end of the structure."""
        found: dict[int, Any] = {}
        number = 0
        while head := self._take(1)[0]:
            number = number + (head >> 4) if head >> 4 else self._signed()
            kind = head & 15
            found[number] = kind == _TRUE if kind in (_TRUE, _FALSE) else self._one(kind, depth + 1)
        return found

    def _one(self, kind: int, depth: int) -> Any:
        if depth > _DEEPEST:
            raise ValueError("it is nested without reason")
        if kind in (_I16, _I32, _I64):
            return self._signed()
        if kind == _BINARY:
            return self._take(self._unsigned())
        if kind == _STRUCT:
            return self.structure(depth)
        if kind in (_LIST, _SET):
            head = self._take(1)[0]
            count = self._unsigned() if head >> 4 == 15 else head >> 4
            if count > len(self._data) - self.at:  # a value has a byte at least
                raise ValueError("a list in it is longer than it is")
            return [self._one(head & 15, depth + 1) for _ in range(count)]
        if kind in (_TRUE, _FALSE, _BYTE):  # in a list, a truth value has a byte
            return self._take(1)[0]
        if kind == _DOUBLE:
            return self._take(8)
        raise ValueError(f"it has a value of the unknown kind {kind}")

    def _signed(self) -> int:
        number = self._unsigned()
        return number >> 1 if number % 2 == 0 else -(number >> 1) - 1

    def _unsigned(self) -> int:
        number = shift = 0
        while True:
            byte = self._take(1)[0]
            number |= (byte & 0x7F) << shift
            if byte < 0x80:
                return number
            shift += 7
            if shift > 63:
                raise ValueError("a number in it has no end")

    def _take(self, count: int) -> bytes:
        found = self._data[self.at : self.at + count]
        if len(found) < count:
            raise ValueError("it ends too early")
        self.at += count
        return found
