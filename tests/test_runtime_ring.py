"""The ring: what comes out is what went in, or it is counted as lost."""

import multiprocessing
import os
import signal
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bowden.core.errors import BowdenError
from bowden.live import ring
from bowden.live.ring import RecorderState, Report

COLUMNS = ("time", "motor", "law.width")
ABOUT = ring.Description(COLUMNS, ("s", "rad", "1"), {"law": "bowden", "gains": {"a": 1.5}}, 10**18, 5 * 10**9)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "a.ring"


def row(number: int) -> np.ndarray:
    return np.array([number, -number, 0.5 * number])


def test_what_it_is_told_about_a_run_it_tells_again(path: Path) -> None:
    ring.create(path, ABOUT, capacity=4)
    assert ring.RingReader(path).description == ABOUT


@given(
    capacity=st.integers(1, 20), bursts=st.lists(st.integers(0, 50), max_size=12), most=st.none() | st.integers(1, 9)
)
@settings(deadline=None)
def test_every_row_is_read_once_or_counted_lost(
    tmp_path_factory: pytest.TempPathFactory, capacity: int, bursts: list[int], most: int | None
) -> None:
    path = tmp_path_factory.mktemp("ring") / "a.ring"
    ring.create(path, ABOUT, capacity)
    writer, reader = ring.RingWriter(path), ring.RingReader(path)
    written, read = 0, []
    for burst in bursts:
        for _ in range(burst):
            writer.write(row(written))
            written += 1
        batch = reader.read(most)
        assert np.array_equal(batch.rows, [row(n) for n in batch.numbers]) or not len(batch.numbers)
        read += batch.numbers.tolist()
    while len(batch := reader.read(most)[0]) if bursts else 0:
        read += batch.tolist()
    assert read == sorted(set(read))
    assert len(read) + reader.lost == written
    assert read[-capacity:] == list(range(written))[-capacity:]


def test_a_row_in_the_making_is_not_seen_and_one_being_overwritten_is_lost(path: Path) -> None:
    ring.create(path, ABOUT, capacity=4)
    writer, reader = ring.RingWriter(path), ring.RingReader(path)
    for n in range(4):
        writer.write(row(n))
    writer.next_row()[:2] = 99.0  # over row 0, and not published: as a writer killed in the middle leaves it
    batch = reader.read()
    assert batch.numbers.tolist() == [1, 2, 3]
    assert reader.lost == 1
    assert reader.read().numbers.tolist() == []
    again = ring.RingWriter(path)
    again.write(row(4))
    assert reader.read().rows.tolist() == [row(4).tolist()]


def test_a_reader_that_comes_late_has_all_that_is_left_or_only_what_is_new(path: Path) -> None:
    ring.create(path, ABOUT, capacity=8)
    writer = ring.RingWriter(path)
    for n in range(20):
        writer.write(row(n))
    late, fresh = ring.RingReader(path), ring.RingReader(path, from_now=True)
    assert (late.read().numbers.tolist(), late.lost) == (list(range(12, 20)), 12)
    assert (fresh.read().numbers.tolist(), fresh.lost) == ([], 0)
    writer.write(row(20))
    assert fresh.read().numbers.tolist() == [20]
    last = fresh.last()
    assert last is not None
    assert last.tolist() == row(20).tolist()
    assert not fresh.closed
    writer.close()
    assert late.closed


def write_without_end(path: Path) -> None:
    writer, n = ring.RingWriter(path), 0
    while True:
        writer.write(row(n))
        n += 1


@pytest.mark.parametrize("capacity", [3, 64, 4096])
def test_another_process_writes_at_full_speed_and_is_killed(path: Path, capacity: int) -> None:
    ring.create(path, ABOUT, capacity)
    reader = ring.RingReader(path)
    process = multiprocessing.get_context("spawn").Process(target=write_without_end, args=(path,))
    process.start()
    read, first = 0, -1
    try:
        while read < 2000 or reader.head < 20_000:
            batch = reader.read()
            assert np.array_equal(batch.rows[:, 0], batch.numbers)
            assert np.array_equal(batch.rows[:, 1], -batch.numbers)
            assert np.array_equal(batch.rows[:, 2], 0.5 * batch.numbers)
            assert (np.diff(batch.numbers) > 0).all()
            assert not len(batch.numbers) or batch.numbers[0] > first
            read, first = read + len(batch.numbers), int(batch.numbers[-1]) if len(batch.numbers) else first
            time.sleep(0.0)
    finally:
        assert process.pid is not None
        os.kill(process.pid, signal.SIGKILL)
        process.join()
    read += len(reader.read().numbers)
    assert read + reader.lost == reader.head
    assert len(reader.read().numbers) == 0


def test_the_recorder_is_seen_alive_and_seen_dead(path: Path) -> None:
    ring.create(path, ABOUT)
    writer, reader = ring.RingWriter(path), ring.RingReader(path)
    assert writer.recorder.state(10**15) == RecorderState.ABSENT
    said = Report(RecorderState.OK, 5 * 10**9, 100, 2, 3, 4)
    reader.recorder.write(said)
    assert writer.recorder.read() == said
    assert writer.recorder.state(6 * 10**9) == RecorderState.OK
    assert writer.recorder.state(6 * 10**9 + 1) == RecorderState.DEAD
    reader.recorder.write(said._replace(state=RecorderState.ENDED))
    assert writer.recorder.state(10**15) == RecorderState.ENDED
    assert not reader.recorder.stopping
    writer.recorder.stop()
    assert reader.recorder.stopping


def test_what_is_no_ring_is_refused(path: Path, tmp_path: Path) -> None:
    with pytest.raises(BowdenError, match="cannot open the ring"):
        ring.RingReader(path)
    path.write_bytes(b"short")
    with pytest.raises(BowdenError, match="5 bytes"):
        ring.RingReader(path)
    path.write_bytes(bytes(10_000))
    with pytest.raises(BowdenError, match="no ring"):
        ring.RingWriter(path)
    with pytest.raises(BowdenError, match="exists"):
        ring.create(path, ABOUT)
    path.unlink()
    ring.create(path, ABOUT, 10)
    with path.open("r+b") as file:
        file.seek(512 + 5)
        file.write(b"\0")
    with pytest.raises(BowdenError, match="does not say what its rows are"):
        ring.RingReader(path)
    with pytest.raises(BowdenError, match="cannot make"):
        ring.create(tmp_path / "none" / "a.ring", ABOUT)
    path.unlink(missing_ok=True)
    with pytest.raises(BowdenError, match="no room"):
        ring.create(path, ABOUT, capacity=10**15)
    assert not path.exists()
    with pytest.raises(ValueError, match="units"):
        ring.Description(("a", "a"), ("s", "s"))
    with pytest.raises(ValueError, match="no column time"):
        ring.Description(("a",), ("s",))
