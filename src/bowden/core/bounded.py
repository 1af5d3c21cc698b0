"""Reading files that a user names: no pipe or device, and of each no more than a bound, packed or unpacked.

Whatever is refused is an `OSError` whose `strerror` says why, so that a caller reports it as a missing file.
"""

import errno
import gzip
import io
import os
import stat
import tomllib
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from bowden.core.quantity import SIZES, has_size

MOST_DATA = 512 << 20
"""Of a recording, unpacked [bytes]: twenty million rows of time, motor and joint, which are five hours at 1 kHz. Its
text and the numbers that are made of it still fit into 1.5 GB."""
MOST_TEXT = 1 << 20
"""Of what a person writes, a rig, a study, a law [bytes]: a hundred times the longest that bowden writes itself."""
MOST_PARTS = 64
"""Of a dotted key, and levels of a TOML document. A rig has four."""
GZIP = b"\x1f\x8b"
"""How a gzipped file begins."""
DAMAGED = (EOFError, zlib.error, gzip.BadGzipFile)
"""Exceptions of reading a damaged gzipped file."""

_PIECE = 1 << 20  # bytes
_TOO_LONG = "a whole number in it is beyond 64 bits"
_KINDS = {stat.S_ISFIFO: "a pipe", stat.S_ISCHR: "a device", stat.S_ISBLK: "a device", stat.S_ISSOCK: "a socket"}


def reason(error: Exception) -> str:
    """The system's message about a file, for the middle of a line."""
    said = (isinstance(error, OSError) and error.strerror) or str(error)
    return said[:1].lower() + said[1:]


def open_file(path: Path) -> io.BufferedReader:
    """A file, opened to be read; what may never end, or never begin, is refused at once.

    Raises:
        OSError: it cannot be opened, or is a folder, pipe or device.
        ValueError: a null byte in its name.
    """
    if "\0" in str(path):  # which every version of Python says in other words
        raise ValueError("embedded null byte")
    handle = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)  # a pipe is not waited for
    try:
        mode = os.fstat(handle).st_mode
        if stat.S_ISDIR(mode):
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
        if not stat.S_ISREG(mode):
            kind = next((name for test, name in _KINDS.items() if test(mode)), "no file")
            raise OSError(errno.EINVAL, f"it is {kind}, which may have no end: save it to a file", str(path))
    except BaseException:
        os.close(handle)
        raise
    return os.fdopen(handle, "rb")


class Bounded(io.RawIOBase):
    """The bytes of a file, unpacked where it is gzipped; reading beyond the bound raises `OSError`.

    Args:
        path: of the file.
        most: the bound [bytes].
        unpack: whether a gzipped file is unpacked, and not taken as it is.
    """

    def __init__(self, path: Path, most: int = MOST_DATA, *, unpack: bool = True) -> None:
        self._bytes: Any = None
        self._file: Any = None  # `close` is called of a file that could not be opened, too
        self._path, self._most, self._left = path, most, most
        self._file = open_file(path)
        packed = unpack and self._file.read(len(GZIP)) == GZIP
        self._file.seek(0)
        self._bytes = gzip.GzipFile(fileobj=self._file) if packed else self._file

    def readable(self) -> bool:
        """Always."""
        return True

    def readinto(self, buffer: Any) -> int:
        """See `io.RawIOBase`.

        Raises:
            OSError: the bound is passed, or the disk does not give it.
            EOFError: the file is damaged; so are `zlib.error` and `gzip.BadGzipFile`.
        """
        piece = self._bytes.read(min(len(buffer), self._left + 1))
        self._left -= len(piece)
        if self._left < 0:
            size = f"{self._most >> 20} MB" if self._most >> 20 else f"{self._most >> 10} kB"
            unpacked = " unpacked" if self._bytes is not self._file else ""
            do = "shorten it, or keep fewer rows" if self._most == MOST_DATA else "check whether it is the right file"
            raise OSError(errno.EFBIG, f"it has more than {size}{unpacked}: {do}", str(self._path))
        buffer[: len(piece)] = piece
        return len(piece)

    def close(self) -> None:
        """Close the file."""
        for one in (self._bytes, self._file):
            if one is not None:
                one.close()
        super().close()


def pieces(path: Path, most: int = MOST_DATA, *, unpack: bool = True) -> Iterator[bytes]:
    """The bytes of a file, some at a time; see `Bounded`."""
    with Bounded(path, most, unpack=unpack) as file:
        while piece := file.read(_PIECE):
            yield piece


def read_whole(path: Path, most: int = MOST_DATA, *, unpack: bool = True) -> bytes:
    """The bytes of a file; see `Bounded`."""
    return b"".join(pieces(path, most, unpack=unpack))


def read_text(path: Path) -> str:
    """Text of a file that a person has written.

    Raises:
        OSError: it cannot be read, or is too long to be that.
        ValueError: not UTF-8 (`UnicodeDecodeError`), or a null byte in its name.
    """
    return read_whole(path, MOST_TEXT, unpack=False).decode()


def read_toml(path: Path) -> dict[str, Any]:
    """A TOML file.

    Raises:
        OSError: see `read_text`.
        ValueError: likewise, or not TOML, nested without reason, or with a number beyond TOML's 64 bits.
    """
    text = read_text(path).replace("\r\n", "\n")
    for number, line in enumerate(text.split("\n"), 1):
        if line.count(".") >= MOST_PARTS and _parts(line) > MOST_PARTS:  # tomllib takes the square of their number
            raise ValueError(f"line {number} has a key of more than {MOST_PARTS} parts")
    try:
        found = tomllib.loads(text)
    except RecursionError:
        raise ValueError(f"it is nested deeper than {MOST_PARTS} levels") from None
    except tomllib.TOMLDecodeError:
        raise
    except ValueError:  # of Python, for an integer of some thousand digits
        raise ValueError(_TOO_LONG) from None
    _check_values(found)
    return found


def _parts(line: str) -> int:
    """How many parts the longest dotted word of a line has; a row of dots is none."""
    if line.lstrip().startswith("#"):
        return 0
    text = "".join(line.split())
    for separator in ("..", *"=,[]{}"):
        text = text.replace(separator, "\n")
    return max(word.count(".") for word in text.split("\n")) + 1


def _check_values(document: dict[str, Any]) -> None:
    """Refuse what no file of ours has and what later readers stumble over.

    Raises:
        ValueError: a table or list in more than `MOST_PARTS` others, or a number beyond 64 bits or of no size.
    """
    level: list[Any] = [document]
    for _ in range(MOST_PARTS):
        inner = [(name, one) for each in level for name, one in (each.items() if isinstance(each, dict) else _in(each))]
        for name, number in inner:
            if isinstance(number, int) and not -(1 << 63) <= number < 1 << 63:
                raise ValueError(_TOO_LONG)
            if isinstance(number, float) and not has_size(number):
                low, high = SIZES
                raise ValueError(f"{name!r} has the number {number:g}, and sizes are 0 or from {low:g} to {high:g}")
        level = [one for _, one in inner if isinstance(one, dict | list)]
        if not level:
            return
    raise ValueError(f"it is nested deeper than {MOST_PARTS} levels")


def _in(values: list[Any]) -> Iterator[tuple[str, Any]]:
    return ((f"item {place}", one) for place, one in enumerate(values, 1))
