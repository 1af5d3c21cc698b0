"""What a kill of the recorder costs: kills at random moments, and a cut at every byte of a log's last 64 KiB."""

import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from mcap.records import Message
from mcap.stream_reader import StreamReader

from bowden.live.mcap_log import LogFile, about
from bowden.live.mcap_read import read
from bowden.live.mcap_recover import recover
from bowden.live.ring import Description, RingWriter, create
from bowden.live.ring_status import RecorderState
from kept import Kept
from measure import Figure

KILLS, CUTS, MOST_LOST = 500, 2**16, 0.2
BASE = 34
COLUMNS = ("time", *(f"c{i}" for i in range(1, BASE)), *(f"law.x{i}" for i in range(16)))
ABOUT = Description(COLUMNS, ("s", *["rad"] * (len(COLUMNS) - 1)), {"seed": 1})
_ROW = 2 * (31 + 4) + 8 * len(COLUMNS)
"""Two messages [bytes]."""
_MEMORY = Path("/dev/shm")  # no disk between the cuts; a kill loses nothing that the kernel has


def kills(numbers: list[int]) -> Iterator[list[Any]]:
    """Number, seconds before the kill, seconds between the last rows saved and written, whether all is right."""
    for number in numbers:
        with tempfile.TemporaryDirectory() as folder:
            yield [number, *_kill(Path(folder), random.Random(number).uniform(0.0, 1.2))]


def _kill(folder: Path, moment: float) -> tuple[float, float, bool]:
    ring, file = folder / "a.ring", folder / "a.mcap"
    create(ring, ABOUT)
    writer, rows = RingWriter(ring), []
    process = subprocess.Popen([sys.executable, "-m", "bowden.live.recorder", str(ring), str(file)])
    try:
        while writer.recorder.state(time.monotonic_ns()) != RecorderState.OK:
            time.sleep(0.001)
        begin = time.monotonic()
        while (now := time.monotonic() - begin) < moment:
            row = np.sin(len(rows) + np.arange(len(COLUMNS)))
            row[0] = now
            writer.write(row)
            rows.append(row)
            time.sleep(max(0.0, begin + 1e-3 * len(rows) - time.monotonic()))
    finally:
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
    saved = recover(file, folder / "saved.mcap")
    found = read(folder / "saved.mcap")
    right = (
        found.whole and saved.missing == 0 and found.rows.tobytes() == b"".join(r.tobytes() for r in rows[: saved.rows])
    )
    stamps = [0.0, *(float(row[0]) for row in rows)]
    return moment, stamps[-1] - stamps[saved.rows], bool(right) and _strictly(folder / "saved.mcap") == saved.rows


def cuts(lengths: list[int]) -> Iterator[list[Any]]:
    """Bytes kept, rows that were there whole, rows recovered, seconds lost, whether everything in the file is right."""
    with tempfile.TemporaryDirectory(dir=_MEMORY if _MEMORY.is_dir() else None) as name:
        folder = Path(name)
        data, rows, ends = _log(folder / "a.mcap")
        for length in lengths:
            cut, out = folder / "cut.mcap", folder / "out.mcap"
            cut.write_bytes(data[:length])
            saved = recover(cut, out)
            found = read(out)
            right = (
                found.whole
                and found.rows.tobytes() == rows[: saved.rows].tobytes()
                and cut.read_bytes() == data[:length]
            )
            there = int((ends <= length).sum())
            begun = int((ends - _ROW < length).sum())  # rows of which a byte is there
            lost = 1e-3 * (begun - saved.rows)
            yield [length, there, saved.rows, lost, bool(right) and _strictly(out) == saved.rows]
            out.unlink()


def _log(path: Path) -> tuple[bytes, np.ndarray, np.ndarray]:
    """A log with an end, its rows, and where the last byte of each stands."""
    rows = np.random.default_rng(1).standard_normal((300, len(COLUMNS)))
    rows[:, 0] = 1e-3 * np.arange(300)
    ends = []
    with path.open("xb") as file:
        log = LogFile(file.fileno(), about(ABOUT, {}))
        for first in range(0, 300, 100):
            before = log.size
            log.write(np.arange(first, first + 100), rows[first : first + 100])
            ends += [before + 49 + _ROW * (i + 1) for i in range(100)]
        log.finish({})
    return path.read_bytes(), rows, np.array(ends)


def size_of_log() -> int:
    """Bytes of the log that is cut."""
    with tempfile.TemporaryDirectory() as folder:
        return len(_log(Path(folder) / "a.mcap")[0])


def _strictly(path: Path) -> int:
    """Rows that mcap's own reader finds, checksums and end checked."""
    with path.open("rb") as file:
        records = list(StreamReader(file, validate_crcs=True).records)
    return sum(isinstance(record, Message) and record.channel_id == 1 for record in records)


def figures(share: float) -> tuple[list[Figure], str]:
    """Figures of kills and cuts; of the cuts, every so-manieth byte."""
    end = size_of_log()
    wanted = list(range(end - CUTS, end, max(1, round(1.0 / share))))
    chosen, kept = set(wanted), Kept("recorder_cuts")
    there = {row[0] for row in kept.rows()}
    cut = [row for row in kept.filled(cuts([k for k in wanted if k not in there]), len(wanted)) if row[0] in chosen]
    kept, count = Kept("recorder_kills"), max(1, round(share * KILLS))
    there = {row[0] for row in kept.rows()}
    killed = kept.filled(kills([k for k in range(count) if k not in there]), count)[:count]
    lost, cut_lost = (np.array([row[i] for row in rows]) for rows, i in ((killed, 2), (cut, 3)))
    wrong = sum(not row[-1] for row in killed + cut) + sum(row[1] != row[2] for row in cut)
    p50, p99 = np.percentile(lost, (50, 99))
    after = f"{p50:.3f} s in the median, {p99:.3f} s in 99 of 100, {lost.max():.3f} s at most"
    most = f"≤ {MOST_LOST} s"
    return [
        Figure(f"lost, {len(killed)} kills at random moments", after, most, bool(lost.max() <= MOST_LOST)),
        Figure(f"lost, {len(cut)} cuts", f"{cut_lost.max():.3f} s at most", most, bool(cut_lost.max() <= MOST_LOST)),
        Figure(
            "recovered files that a strict reader does not read whole, or with a wrong row", str(wrong), "0", not wrong
        ),
    ], "- Real processes at 1 kHz in real time; the cuts are of one log, at every byte of its last 64 KiB."
