"""The log's bytes: strict readers of another hand read every number; what is cut or flipped is lost, never wrong."""

import contextlib
import errno
import os
import random
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.data_stream import RecordBuilder
from mcap.reader import make_reader
from mcap.records import Chunk, Message, Metadata
from mcap.stream_reader import StreamReader
from mcap_ros2.decoder import DecoderFactory

from bowden.core.errors import BowdenError, LogError
from bowden.live.events import Changes
from bowden.live.figures import Damage, LogFacts, RunStop, TimedText
from bowden.live.mcap_log import MAGIC, Event, LogFile, about, checksum, topics
from bowden.live.mcap_read import read, recover
from bowden.live.ring import Description
from bowden.safety.faults import Fault
from bowden.views.log import lines
from support.blank import blank

_MANY = tuple(f"supervisor.x{i}" for i in range(40))
COLUMNS = (
    "time",
    "motor",
    "joint",
    "current",
    "mode",
    "faults",
    "law.width",
    "law.Slope",
    "supervisor.winding",
    *_MANY,
)
UNITS = ("s", "rad", "rad", "A", "1", "1", "1", "1", "°C", *["1"] * len(_MANY))
NAMES = {"mode": ["stopped", "armed"], "faults": ["slack", "late"]}
ABOUT = Description(
    COLUMNS, UNITS, {"law": "bowden", "seed": 3, "gains": {"k": 0.1}, "names": NAMES}, 1_700_000_000 * 10**9
)
CHUNK = 100


def made_up(n: int) -> np.ndarray:
    rows = np.random.default_rng(1).standard_normal((n, len(COLUMNS)))
    rows[:, 0] = np.arange(n) * 1e-3
    rows[::7, 3] = np.nan
    rows[1::50, 2] = -np.inf
    rows[:, 4], rows[:, 5] = np.arange(n) >= n // 2, 3.0 * (np.arange(n) == n // 3)
    return rows


def write_log(
    path: Path,
    n: int = 400,
    *,
    begin: int = 0,
    lost: int = 0,
    run: Description = ABOUT,
    close: bool = True,
    write: Any = os.write,
) -> np.ndarray:
    rows, changes = made_up(n), Changes(run)
    handle = os.open(path, os.O_CREAT | os.O_EXCL | os.O_RDWR)
    try:
        file = LogFile(handle, about(run, {"software": "bowden 1"}), write)
        for first in range(begin, n, CHUNK):
            part = np.arange(first, min(n, first + CHUNK))
            events, changes = changes.find(part, rows[part])
            file.write(part, rows[part], events)
        if close:
            file.finish({"lost": str(lost), "dropped": "0"})
    finally:
        os.close(handle)
    return rows


def strictly(path: Path, *, indexed_too: bool = True) -> int:
    """Read a file with mcap's own readers, checksums checked, along its records and along its index; rows in it."""
    with path.open("rb") as file:
        along = [r for r in StreamReader(file, validate_crcs=True).records if isinstance(r, Message)]
    if not indexed_too:
        return sum(message.channel_id == 1 for message in along)
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        indexed = [message for _, _, message in reader.iter_messages(log_time_order=False)]
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        assert summary.statistics.message_count == len(along)
        assert len(list(reader.iter_metadata())) == 2
    assert along == indexed
    return sum(message.channel_id == 1 for message in along)


def test_another_decoder_reads_every_number_and_every_unit(tmp_path: Path) -> None:
    rows = write_log(tmp_path / "a.mcap")
    assert strictly(tmp_path / "a.mcap") == len(rows)
    found = {topic.name: topic for topic in topics(COLUMNS, UNITS)}
    assert list(found) == ["/cycle", "/law", "/supervisor"]
    seen = {name: np.full((len(rows), len(topic.columns)), 9.0) for name, topic in found.items()}
    texts = []
    with (tmp_path / "a.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for schema, channel, message, decoded in reader.iter_decoded_messages():
            assert schema is not None
            if channel.topic == "/event":
                texts.append((round(1e3 * decoded.time), decoded.text))
                continue
            fields = found[channel.topic].fields
            seen[channel.topic][message.sequence] = [getattr(decoded, name) for name in fields]
            assert message.log_time == ABOUT.start_utc_ns + message.sequence * 10**6
            lines = schema.data.decode().splitlines()
            expected = zip(fields, found[channel.topic].units, strict=True)
            assert lines == [f"float64 {name}  # [{unit}]" for name, unit in expected]
    for name, topic in found.items():
        assert seen[name].tobytes() == rows[:, topic.columns].tobytes()
    assert texts == [
        (0, "mode: stopped"),
        (133, "fault: slack; fault: late"),
        (134, "fault gone: slack; fault gone: late"),
        (200, "mode: stopped → armed"),
    ]


def test_our_reader_reads_what_was_written(tmp_path: Path) -> None:
    rows = write_log(tmp_path / "a.mcap")
    found = read(tmp_path / "a.mcap")
    assert found.whole
    assert found.rows.tobytes() == rows.tobytes()
    assert found.numbers.tolist() == list(range(len(rows)))
    assert (found.columns, found.units, found.settings) == (COLUMNS, UNITS, dict(ABOUT.settings))
    assert found.closing == {"lost": "0", "dropped": "0", "given_up": "0", "rows": "400"}
    assert [event.number for event in found.events] == [0, 133, 134, 200]
    trace = found.trace()
    assert trace.units["supervisor.winding"] == "°C"
    assert trace.seed == 3
    assert trace.settings["log"]["software"] == "bowden 1"


def test_names_become_fields_of_ros_and_none_is_lost() -> None:
    names = ["time", "Lage φ", "2nd", "law.a", "law.A", "sensor_x.b.c"]
    assert [(t.name, t.fields) for t in topics(names, ["1"] * 6)] == [
        ("/cycle", ("time", "lage", "x_2nd")),
        ("/law", ("a", "a_2")),
        ("/sensor_x", ("b_c",)),
    ]


def test_a_cut_at_any_byte_of_the_end_loses_nothing_that_was_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every 601st of the last 64 KiB; `make soak` takes every byte."""
    monkeypatch.setattr(os, "fsync", lambda handle: None)  # hundreds of them are not what is tested
    rows = write_log(tmp_path / "a.mcap", 200)
    data = (tmp_path / "a.mcap").read_bytes()
    assert len(data) > 1.3 * 2**16
    ends = row_ends(tmp_path / "a.mcap")
    for at in range(len(data) - 2**16, len(data), 601):
        lost_of_cut(data[:at], rows, ends, tmp_path)


def row_ends(path: Path) -> np.ndarray:
    """Where the chunk of each row ends in a file, known from mcap's own reader."""
    with path.open("rb") as file:
        chunks = [one.data for one in StreamReader(file, emit_chunks=True).records if isinstance(one, Chunk)]
    data = path.read_bytes()
    return np.repeat([data.index(one) + len(one) for one in chunks], CHUNK)


def test_the_files_of_two_recorders_of_a_run_are_joined(tmp_path: Path) -> None:
    first, second, out = tmp_path / "a.mcap", tmp_path / "a-again1.mcap", tmp_path / "whole.mcap"
    rows = write_log(first, 400)
    ends = row_ends(first)
    write_log(second, 400, begin=150, lost=150)  # it has seen no earlier row in the ring
    whole = first.read_bytes()
    first.write_bytes(whole[: ends[130] + 5000])
    assert len(read(first).rows) == 200  # of the chunk that was cut, none
    assert read(second).missing == 150
    for one, other in ((first, second), (second, first)):
        saved = recover(one, out, [other])
        assert (saved.rows, saved.missing, saved.tail_seconds) == (400, 0, 0.0)
        found = read(out)
        assert found.whole
        assert found.missing == 0
        assert found.rows.tobytes() == rows.tobytes()
        out.unlink()
    first.write_bytes(whole[: ends[0]])
    assert recover(first, out, [second]).missing == 150 - 100 == read(out).missing
    out.unlink()
    first.unlink()
    write_log(first, run=replace(ABOUT, start_utc_ns=1))
    with pytest.raises(LogError, match="of two runs"):
        recover(first, out, [second])


def lost_of_cut(left: bytes, rows: np.ndarray, ends: np.ndarray, folder: Path) -> None:
    cut, out = folder / "cut.mcap", folder / "out.mcap"
    cut.write_bytes(left)
    out.unlink(missing_ok=True)
    saved = recover(cut, out)
    assert saved.rows == strictly(out, indexed_too=len(left) % 512 == 0) == int((ends <= len(left)).sum())
    assert cut.read_bytes() == left
    again = read(out)
    assert again.whole
    assert again.rows.tobytes() == rows[: saved.rows].tobytes()


@given(seed=st.integers(0, 2**32))
@settings(max_examples=60)
def test_flipped_bytes_are_left_out_or_refused_never_believed(
    tmp_path_factory: pytest.TempPathFactory, seed: int
) -> None:
    folder = tmp_path_factory.mktemp("flip")
    rows, chance = write_log(folder / "a.mcap", 300), random.Random(seed)
    data = bytearray((folder / "a.mcap").read_bytes())
    for _ in range(chance.choice([1, 1, 2, 5, 50])):
        data[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
    if chance.random() < 0.3:
        del data[chance.randrange(len(data)) :]
    if chance.random() < 0.3:
        at = chance.randrange(len(data) + 1)
        data[at:at] = chance.randbytes(chance.randrange(1, 3000))
    (folder / "b.mcap").write_bytes(data)
    try:
        recover(folder / "b.mcap", folder / "c.mcap")
    except BowdenError:
        assert not (folder / "c.mcap").exists()
        return
    again = read(folder / "c.mcap")
    assert strictly(folder / "c.mcap") == len(again.rows)
    assert again.rows.tobytes() == rows[again.numbers].tobytes()


def test_a_chunk_that_changed_is_left_out_and_the_rest_is_read(tmp_path: Path) -> None:
    rows = write_log(tmp_path / "a.mcap")
    data = bytearray((tmp_path / "a.mcap").read_bytes())
    data[row_ends(tmp_path / "a.mcap")[150] - 99] ^= 1
    (tmp_path / "b.mcap").write_bytes(data)
    saved = recover(tmp_path / "b.mcap", tmp_path / "c.mcap")
    assert saved.damage == Damage(1, 0, 0)
    assert (saved.rows, saved.missing, saved.tail_seconds) == (300, 100, 0.0)
    assert saved.missing_seconds == pytest.approx(0.1)
    found = read(tmp_path / "c.mcap")
    assert found.numbers.tolist() == [*range(100), *range(200, 400)]
    assert found.rows.tobytes() == rows[found.numbers].tobytes()


class Disk:
    """Takes so many bytes, and then none; a write may end partway."""

    def __init__(self, room: int) -> None:
        self.room = room

    def write(self, handle: int, data: bytes) -> int:
        part = min(len(data), self.room - os.lseek(handle, 0, os.SEEK_CUR), 10_000)
        if part <= 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return os.write(handle, data[:part])


@pytest.mark.parametrize("room", [80_000, 120_000, 170_100, 216_000])
def test_a_full_disk_leaves_a_whole_file_of_what_it_took(tmp_path: Path, room: int) -> None:
    disk, rows = Disk(room), made_up(400)
    with (tmp_path / "a.mcap").open("wb") as opened:
        file = LogFile(opened.fileno(), about(ABOUT, {}), disk.write)
        written = 0
        with contextlib.suppress(OSError):
            for first in range(0, 400, CHUNK):
                file.write(np.arange(first, first + CHUNK), rows[first : first + CHUNK], [Event(first, 0.0, "a")])
                written += CHUNK
        given_up = file.finish({})
    assert file.rows < 400
    assert (tmp_path / "a.mcap").stat().st_size <= room
    assert strictly(tmp_path / "a.mcap") == file.rows == written - given_up
    assert read(tmp_path / "a.mcap").whole


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "is empty"),
        (b"time,motor,joint\n0,1,2\n", "is no MCAP file"),
        (b"\x89MCAP0\r\n", "does not say what its rows are"),
        (b"\x89MCAP0\r\n\x01\xff\xff\xff\xff\xff\xff\xff\x7f", "does not say what its rows are"),
    ],
)
def test_what_is_no_log_is_refused_in_one_line(tmp_path: Path, content: bytes, said: str) -> None:
    (tmp_path / "a.mcap").write_bytes(content)
    with pytest.raises(BowdenError, match=said):
        read(tmp_path / "a.mcap")


def test_a_description_that_is_none_is_refused(tmp_path: Path) -> None:
    said = {"columns": "[]", "units": "[]", "settings": "{}", "start_utc_ns": "0"}
    for change in ({"columns": "7"}, {"units": '["s"]'}, {"settings": "x"}, {"start_utc_ns": "now"}):
        builder = RecordBuilder()
        Metadata("bowden", said | change | {"crc32": checksum(said | change)}).write(builder)
        (tmp_path / "a.mcap").write_bytes(MAGIC + builder.end())
        with pytest.raises(BowdenError, match="does not say what its rows are"):
            read(tmp_path / "a.mcap")


def test_a_log_without_a_row_is_whole(tmp_path: Path) -> None:
    write_log(tmp_path / "a.mcap", 0)
    assert strictly(tmp_path / "a.mcap") == 0
    assert recover(tmp_path / "a.mcap", tmp_path / "b.mcap").rows == 0
    with pytest.raises(BowdenError, match="has no row"):
        read(tmp_path / "b.mcap").trace()


def test_recovery_overwrites_nothing(tmp_path: Path) -> None:
    write_log(tmp_path / "a.mcap")
    with pytest.raises(BowdenError, match="exists"):
        recover(tmp_path / "a.mcap", tmp_path / "a.mcap")
    with pytest.raises(BowdenError, match="cannot read"):
        recover(tmp_path / "b.mcap", tmp_path / "c.mcap")
    assert not (tmp_path / "c.mcap").exists()


def test_rows_that_are_missing_are_told() -> None:
    numbers = np.array([5, 6, 9])
    rows = np.zeros((3, len(COLUMNS)))
    events, after = Changes(Description(COLUMNS, UNITS)).find(numbers, rows)
    assert [event.text for event in events if "lost" in event.text] == [
        "5 rows lost before this one",
        "2 rows lost before this one",
    ]
    assert "mode: 0" in [event.text for event in events]
    assert after.find(np.array([10]), rows[:1])[0] == []
    assert after.find(np.array([], np.int64), rows[:0])[0] == []


def test_a_run_does_not_begin_with_faults_of_a_drive_that_is_not_read_yet() -> None:
    names = {"faults": [fault.name.lower() for fault in Fault]}
    about = Description(("time", "faults"), ("s", "1"), {"names": names}, 0)
    unread = float(1 << Fault.JOINT_LOST | 1 << Fault.MOTOR_STALE)
    rows = np.array([[40.465, unread + float(1 << Fault.BUS_ERRORS)], [40.466, 0.0]])
    events, _ = Changes(about).find(np.arange(2), rows)
    assert events[0].text == "not read yet: joint_lost, motor_stale; fault: bus_errors"
    stepped, quick = float(1 << Fault.JOINT_OVER_SPEED), float(1 << Fault.MOTOR_OVER_SPEED)
    rows = np.array([[40.465, unread], [40.466, stepped], [40.467, 0.0], [40.468, quick]])
    events, _ = Changes(about).find(np.arange(4), rows)
    assert events[1].text == "not settled yet: joint_over_speed; fault gone: joint_lost; fault gone: motor_stale"
    assert events[3].text == "fault: motor_over_speed"


def test_the_facts_of_a_log_end_with_what_ended_the_run() -> None:
    stop = RunStop(0.9, ("loop too late",), ("see",), ("drive silent",), None)
    events = tuple(TimedText(40.465 + k, f"event {k}") for k in range(40))
    about = {"begin_s": 40.465, "duration_s": 1.0, "cycles": 9, "missing": 0, "closed": True, "whole": True}
    whole = {"settings": {}, "software": {}, "motors": {}, "outcome": "ended by a fault at 0.900 s: loop too late"}
    said = list(lines(blank(LogFacts, **about, **whole, stops=(stop,), events=events)))
    assert ("stopped", "0.900 s: loop too late; see") in said
    assert ("stopped", "0.900 s: as a consequence: drive silent") in said
    assert [text for name, text in said if name == "event"][-1] == "39.000 s: event 39"
    assert len(said) < 25
