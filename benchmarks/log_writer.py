"""Our writer of logs against the library's own, `mcap.writer.Writer`, on the same rows: cost, bytes, kills, full disk.

``python benchmarks/log_writer.py`` prints the table; what follows from it is in docs/decisions/0025.
"""

import contextlib
import errno
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from io import RawIOBase
from pathlib import Path
from typing import Protocol

import numpy as np
from mcap.exceptions import McapError
from mcap.records import Chunk, Message
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import CompressionType, Writer

from bowden.control import LAWS
from bowden.live.mcap_layout import declarations, topics
from bowden.live.mcap_log import ABOUT, CLOSING, MAGIC, LogFile, about
from bowden.live.mcap_read import read
from bowden.live.mcap_recover import recover
from bowden.live.row import description
from measure import Figure, by_turns, table

RUN = description(LAWS["bowden"], {}, 0, 0)
TOPICS = topics(RUN.columns, RUN.units)
CHUNK, SECONDS, KILLS = 50, 20, 20
"""Rows of a chunk (the recorder's, 20 a second), seconds of a timed log, kills of each writer."""


class Log(Protocol):
    """What the recorder asks of a writer."""

    def write(self, numbers: np.ndarray, rows: np.ndarray) -> None: ...

    def finish(self, closing: dict[str, str]) -> int: ...


class Library:
    """The same file by the library: a message a topic and row, each chunk ended and flushed at once.

    Args:
        handle: of an empty file.
        write: in place of `os.write`.
    """

    def __init__(self, handle: int, write: Callable[[int, bytes], int] = os.write) -> None:
        self._writer = Writer(_Raw(handle, write), chunk_size=1 << 30, compression=CompressionType.NONE)
        self._writer.start("ros2", "bowden")
        for schema, channel in declarations(TOPICS):
            self._writer.register_schema(schema.name, schema.encoding, schema.data)
            self._writer.register_channel(channel.topic, channel.message_encoding, schema.id)
        self._writer.add_metadata(ABOUT, about(RUN, {}))

    def write(self, numbers: np.ndarray, rows: np.ndarray) -> None:
        stamps = np.rint(1e9 * rows[:, 0]).astype(np.int64).tolist()
        parts = []
        for topic in TOPICS:
            packed = np.empty(len(rows), [("cdr", "<u4"), ("data", "<f8", (len(topic.columns),))])
            packed["cdr"], packed["data"] = 0x00000100, rows[:, topic.columns]
            parts.append((packed.tobytes(), packed.dtype.itemsize))
        for i, (number, stamp) in enumerate(zip(numbers.tolist(), stamps, strict=True)):
            for channel, (data, size) in enumerate(parts, 1):
                self._writer.add_message(channel, stamp, data[i * size : (i + 1) * size], stamp, number)
        self._writer.flush()

    def finish(self, closing: dict[str, str]) -> int:
        self._writer.add_metadata(CLOSING, closing)
        self._writer.finish()
        self._writer.flush()
        return 0


class _Raw(RawIOBase):
    """A descriptor as a stream."""

    def __init__(self, handle: int, write: Callable[[int, bytes], int]) -> None:
        self._handle, self._write, self._at = handle, write, 0

    def writable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def tell(self) -> int:
        return self._at

    def seek(self, offset: int, whence: int = 0) -> int:
        return self._at  # asked for by the buffer only to learn where it is

    def write(self, data) -> int:  # type: ignore[no-untyped-def,override]
        taken = self._write(self._handle, data)
        self._at += taken
        return taken


def ours(handle: int, write: Callable[[int, bytes], int] = os.write) -> Log:
    return LogFile(handle, about(RUN, {}), write)


WRITERS: dict[str, Callable[..., Log]] = {"ours": ours, "the library": Library}


def rows_of(first: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Numbers and rows at 1 kHz, the time in column 0."""
    numbers = np.arange(first, first + count)
    rows = np.sin(numbers[:, None] + np.arange(len(RUN.columns)))
    rows[:, 0] = 1e-3 * numbers
    return numbers, rows


def log(make: Callable[..., Log], path: Path, chunks: list[tuple[np.ndarray, np.ndarray]]) -> int:
    """Write a log; its size [bytes]."""
    with path.open("wb") as file:
        writer = make(file.fileno())
        for numbers, rows in chunks:
            writer.write(numbers, rows)
        writer.finish({})
    return path.stat().st_size


def read_by_the_library(path: Path) -> int:
    """Rows of all chunks before the first thing that the library's own reader cannot read."""
    count = 0
    try:
        with path.open("rb") as file:
            for record in StreamReader(file, emit_chunks=True, validate_crcs=True).records:
                if isinstance(record, Chunk):
                    inside = breakup_chunk(record, validate_crc=True)
                    count += sum(isinstance(one, Message) and one.channel_id == 1 for one in inside)
    except (McapError, ValueError, EOFError, OSError):
        pass
    return count


def lost_to_a_kill(name: str, folder: Path, seed: int) -> float:
    """Seconds between the kill and the last row that can be read of the file."""
    path, clock = folder / f"{seed}.mcap", folder / f"{seed}.begin"
    process = subprocess.Popen([sys.executable, __file__, name, str(path), str(clock)])
    while not clock.is_file() or not clock.read_text().endswith("\n"):
        time.sleep(0.002)
    begin = float(clock.read_text())
    time.sleep(random.Random(seed).uniform(0.3, 0.8))
    killed = time.monotonic() - begin
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    if name == "ours":
        recover(path, folder / f"{seed}.out")
        found = len(read(folder / f"{seed}.out").rows)
    else:
        found = read_by_the_library(path)
    return killed - 1e-3 * found


def in_real_time(name: str, path: Path, clock: Path) -> None:
    """What is killed: chunks of 1 kHz rows as they become due."""
    with path.open("wb") as file:
        writer = WRITERS[name](file.fileno())
        begin = time.monotonic()
        clock.write_text(f"{begin!r}\n")
        for first in range(0, 100_000, CHUNK):
            time.sleep(max(0.0, begin + 1e-3 * (first + CHUNK) - time.monotonic()))
            writer.write(*rows_of(first, CHUNK))


def on_a_full_disk(make: Callable[..., Log], path: Path, again: bool) -> tuple[int, int, bool]:
    """Rows that a strict reader finds, rows that the writer took, and whether the file has an end.

    The disk is full at 1 MiB, in the middle of a chunk; the chunk is tried three times, as the recorder does.

    Args:
        make: the writer.
        path: of the file.
        again: whether there is room again after that.
    """
    size = [1 << 20]

    def write(handle: int, data: bytes) -> int:
        room = size[0] - os.fstat(handle).st_size
        if len(data) and room <= 0:
            raise OSError(errno.ENOSPC, "No space left on device")
        return os.write(handle, data[:room])

    with path.open("wb") as file:
        writer, taken, refused = make(file.fileno(), write), 0, 0
        while refused < 3 or (again and taken < 6000):
            try:
                writer.write(*rows_of(taken, CHUNK))
                taken += CHUNK
            except OSError:
                refused += 1
                if refused == 3 and again:
                    size[0] = 1 << 30
        with contextlib.suppress(OSError):
            taken -= writer.finish({})
    return read_by_the_library(path), taken, path.read_bytes().endswith(MAGIC)


def figures() -> list[Figure]:
    """All of it, in one run."""
    chunks = [rows_of(first, CHUNK) for first in range(0, 1000 * SECONDS, CHUNK)]
    found = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        sizes = {who: log(make, folder / "a.mcap", chunks) for who, make in WRITERS.items()}
        timed = by_turns(
            5,
            ours=lambda: log(ours, folder / "b.mcap", chunks),
            library=lambda: log(Library, folder / "c.mcap", chunks),
        )
        share = {"ours": timed["ours"].median / SECONDS, "the library": timed["library"].median / SECONDS}
        ratio = timed["library"].over(timed["ours"]).median
        what = f"{len(RUN.columns)} columns in {len(TOPICS)} topics at 1 kHz"
        for who in WRITERS:
            found.append(Figure(f"{who}: share of a processor, {what}", f"{100.0 * share[who]:.2f} %", "–"))
        found.append(Figure("the library's cost over ours", f"{ratio:.1f}", "–"))
        for who in WRITERS:
            found.append(Figure(f"{who}: bytes a row", f"{sizes[who] / (1000 * SECONDS):.1f}", "–"))
        for who in WRITERS:
            lost = [lost_to_a_kill(who, folder, seed + 1000 * (who == "ours")) for seed in range(KILLS)]
            text = f"{np.median(lost):.3f} s in the median, {max(lost):.3f} s at most"
            found.append(Figure(f"{who}: lost to {KILLS} kills", text, "≤ 0.2 s", max(lost) <= 0.2))
        for again, when in ((True, "room again after three tries"), (False, "no room any more")):
            for who, make in WRITERS.items():
                there, taken, ended = on_a_full_disk(make, folder / f"{who} {again}.mcap", again)
                text = f"{there} rows of {taken}, {'an' if ended else 'no'} end"
                found.append(Figure(f"{who}: disk full, {when}", text, "each once, an end", there == taken and ended))
    return found


if __name__ == "__main__":
    if len(sys.argv) > 1:
        in_real_time(sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3]))
    else:
        print(table(figures()))
