"""The LSL inlet and outlet: the same samples and decisions as the file, loss and return, streams that are refused."""

import contextlib
import os
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bowden.core.errors import StreamError
from bowden.hardware.emg.lsl import LslStream
from bowden.hardware.emg.lsl_info import channel_names, check_info, library, unit_of
from bowden.hardware.emg.lsl_outlet import LslOutlet
from bowden.hardware.emg.sources import open_source
from bowden.hardware.ports import EmgChunk, EmgStream
from bowden.identify.emg.log import read_emg
from bowden.sensing.stream import OnsetDetector
from bowden.sim.emg import background, contractions

RATE = 1000.0
HERE = f"{os.getpid()}"


def drained(stream: EmgStream, count: int, limit: float = 20.0) -> EmgChunk:
    """What comes until there are `count` samples."""
    until, chunks = time.monotonic() + limit, []
    while sum(len(chunk.times) for chunk in chunks) < count and time.monotonic() < until:
        chunks.append(stream.read(time.monotonic()))
        time.sleep(0.002)
    return EmgChunk(*(np.concatenate(parts) for parts in zip(*chunks, strict=True)))


@contextlib.contextmanager
def sending(outlet: LslOutlet, values: np.ndarray, rate: float = RATE, speed: float = 1.0) -> Iterator[None]:
    """Send once there is a reader, each sample stamped with its place in time."""
    stop = threading.Event()

    def run() -> None:
        while not outlet.has_readers() and not stop.is_set():
            time.sleep(0.005)
        begin, sent = time.monotonic(), 0
        while sent < len(values) and not stop.is_set():
            due = min(len(values), int((time.monotonic() - begin) * rate * speed) + 1)
            outlet.push(values[sent:due], time.monotonic() - (begin + (due - 1) / rate))
            sent = due
            time.sleep(0.004)

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()


def test_a_stream_decides_as_the_file_does(lsl: Any, shared_data: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ten times as quick as it was recorded, every value and every decision of the detector is the file's."""
    monkeypatch.setattr("bowden.hardware.emg.lsl._AHEAD", np.inf)
    log = read_emg(shared_data / "emg" / "biceps_bursts.csv.gz")
    outlet = LslOutlet(f"bursts-{HERE}", log.rate, [log.channel], "mV", f"bursts-{HERE}")
    stream = LslStream(f"bursts-{HERE}")
    with sending(outlet, log.values[:, None], log.rate, speed=10.0):
        assert "1 channel, 1000 Hz, mV" in stream.open()
        assert (stream.channels, stream.rate, stream.unit) == ((log.channel,), log.rate, "mV")
        found = drained(stream, len(log.values))
    assert np.array_equal(found.values[:, 0], log.values)
    assert np.all(np.diff(found.times) > 0.0)
    detector, cuts = OnsetDetector(log.rate), np.array_split(found.values[:, 0], 400)
    live = np.concatenate([detector.feed(piece).active for piece in cuts])
    assert np.array_equal(live, OnsetDetector(log.rate).feed(log.values).active)
    stream.close()
    stream.close()
    assert stream.lost() == "it is closed"
    assert len(stream.read(0.0).times) == 0


def test_values_that_no_amplifier_gives_are_missing_samples(lsl: Any) -> None:
    values = np.arange(4000.0)[:, None] % 7.0
    values[500::100] = [[1e300], [-np.inf], [1.1e5], [np.nan], [9e4]] * 7
    outlet = LslOutlet(f"huge-{HERE}", RATE, ["a"], "mV", f"huge-{HERE}")
    stream = LslStream(f"huge-{HERE}")
    with sending(outlet, values):
        stream.open()
        found = drained(stream, 1500).values[:, 0]
    expected = np.where(np.abs(values[: len(found), 0]) <= 1e5, values[: len(found), 0], np.nan)
    assert np.isnan(expected).sum() >= 8
    assert np.array_equal(found, expected, equal_nan=True)
    stream.close()


def test_times_are_those_of_this_computers_clock_and_channels_keep_their_names(lsl: Any) -> None:
    values = np.arange(4000.0)[:, None] + np.array([0.0, 0.5])
    outlet = LslOutlet(f"times-{HERE}", RATE, ["biceps", "triceps"], "µV", f"times-{HERE}")
    stream = open_source(f"lsl:times-{HERE}#times-{HERE}", ["triceps"])
    begin = time.monotonic()
    with sending(outlet, values):
        stream.open()
        found = drained(stream, 1500)
    assert (stream.channels, stream.unit) == (("biceps", "triceps"), "µV")
    assert np.array_equal(found.values, values[: len(found.values)])
    assert begin < found.times[0]
    assert found.times[-1] <= time.monotonic()
    assert np.diff(found.times) == pytest.approx(1.0 / RATE, rel=0.05)
    stream.close()


def test_a_stream_that_dies_is_lost_and_comes_back_with_a_gap_of_missing_samples(lsl: Any) -> None:
    def make() -> LslOutlet:
        return LslOutlet(f"dies-{HERE}", RATE, ["a"], "mV", f"dies-{HERE}")

    outlet, stream = make(), LslStream(f"dies-{HERE}")
    with sending(outlet, np.arange(1, 60000.0)[:, None]):
        stream.open()
        before = drained(stream, 600)
    assert stream.lost() == ""
    outlet.close()
    until = time.monotonic() + 10.0
    while not stream.lost() and time.monotonic() < until:
        stream.read(time.monotonic())
        time.sleep(0.01)
    assert "nothing from the LSL stream" in stream.lost()
    again = make()
    with sending(again, -np.arange(1, 60000.0)[:, None]):
        after = drained(stream, 2000, 40.0)
    assert stream.lost() == ""
    values = np.concatenate([before.values, after.values])[:, 0]
    missing = np.isnan(values)
    assert 200 <= missing.sum() <= 1000
    assert np.all(np.diff(np.flatnonzero(missing)) == 1)
    first = int(np.flatnonzero(missing)[0])
    assert np.all(values[:first] > 0.0)
    assert np.array_equal(values[first + missing.sum() :], -1.0 - np.arange(len(values) - first - missing.sum()))
    times = np.concatenate([before.times, after.times])
    assert np.all(np.diff(times) > 0.0)
    stream.close()


def test_streams_that_cannot_be_used_are_one_line(lsl: Any) -> None:
    name = f"bad-{HERE}"
    with pytest.raises(StreamError, match=f"no LSL stream '{name}' in 0.3 s; there"):
        LslStream(name, wait=0.3).open()
    first = LslOutlet(name, RATE, ["a"], "mV", "one")
    with pytest.raises(StreamError, match="has no channel 'b'; expected one of 'a'"):
        LslStream(name, wanted=["b"]).open()
    with pytest.raises(StreamError, match=r"is there, but sends nothing in 0.3 s"):
        LslStream(name, wait=0.3).open()
    second = LslOutlet(name, RATE, ["a"], "mV", "two")
    with pytest.raises(StreamError, match=r"2 LSL streams are named .*; choose one by its source id, lsl:.*#ID"):
        LslStream(name).open()
    with sending(second, np.zeros((4000, 1)), RATE / 2):
        stream = LslStream(name, "two")
        with pytest.raises(StreamError, match=r"declares 1000 Hz and sends .* samples a second"):
            stream.open()
    old = LslOutlet(f"old-{name}", RATE, ["a"], "mV", "old")

    def stamp_with_another_clock() -> None:
        while not old.has_readers():
            time.sleep(0.01)
        old.push(np.zeros((10, 1)), 1e5)

    thread = threading.Thread(target=stamp_with_another_clock)
    thread.start()
    with pytest.raises(StreamError, match=r"are -1e\+05 s off this computer's clock; expected stamps of LSL's"):
        LslStream(f"old-{name}").open()
    thread.join()
    old.close()
    with pytest.raises(StreamError, match="a name without quotes"):
        LslStream("it's").open()
    first.close()
    second.close()


def info(lsl: Any, kind: str = "EMG", channels: int = 2, rate: float = RATE, form: str = "float32") -> Any:
    return lsl.StreamInfo("x", kind, channels, rate, form, "id")


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"form": "string"}, "holds text; expected numbers"),
        ({"kind": "EEG"}, "has the type 'EEG'; expected EMG"),
        ({"rate": 0.0}, "has an irregular rate; expected a rate that it declares"),
        ({"rate": 100.0}, "100 samples a second; expected 900 to 5000 Hz"),
        ({"rate": 20000.0}, "20000 samples a second; expected 900 to 5000 Hz"),
    ],
)
def test_what_a_stream_says_of_itself_is_checked(lsl: Any, given: dict[str, Any], said: str) -> None:
    with pytest.raises(StreamError, match=said):
        check_info(info(lsl, **given), "x")
    check_info(info(lsl), "x")


@pytest.mark.parametrize(
    ("labels", "said"),
    [
        (["a", "b", "c"], "has 2 channels and describes 3"),
        (["a", ""], "channel 2 .* has no name"),
        (["a", "a"], "two channels .* are named 'a'"),
    ],
)
def test_names_of_channels_are_checked(lsl: Any, labels: list[str], said: str) -> None:
    given = info(lsl)
    channels = given.desc().append_child("channels")
    for label in labels:
        channels.append_child("channel").append_child_value("label", label)
    with pytest.raises(StreamError, match=said):
        channel_names(given)
    assert channel_names(info(lsl)) == ("ch1", "ch2")
    assert unit_of(info(lsl)) == ""


@pytest.mark.parametrize(
    "text", ["", "lsl:", "udp:x", "biceps.csv", "trigno:", "trigno:host:x", "trigno:host:1:2:3", "trigno:host:99999"]
)
def test_what_names_no_source_is_one_line(text: str) -> None:
    with pytest.raises(StreamError, match=r"is not a source of EMG; expected lsl:NAME.*trigno:HOST.*file:PATH"):
        open_source(text)


def test_without_the_extra_the_line_names_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "pylsl", None)
    library.cache_clear()
    with pytest.raises(StreamError, match=r'not installed; pip install "bowden\[lsl\]"'):
        LslStream("x").open()
    library.cache_clear()


def test_a_recording_plays_in_the_time_that_is_handed_in(tmp_path: Path) -> None:
    values = background(RATE, 3000, np.random.default_rng(1)) + contractions(RATE, [(1.0, 2.0, 0.3)], 3000, 1)
    table = np.column_stack([np.arange(3000) / RATE, values, -values])
    np.savetxt(tmp_path / "a.csv", table, delimiter=",", header="time_s,a_mV,b_mV", comments="", fmt="%.17g")
    stream = open_source(f"file:{tmp_path / 'a.csv'}", ["b_mV"])
    assert "2 channels" in stream.open()
    chunks = [stream.read(50.0 + 0.01 * k) for k in range(302)]
    found = EmgChunk(*(np.concatenate(parts) for parts in zip(*chunks, strict=True)))
    assert stream.unit == "mV"
    assert np.array_equal(found.values[:, stream.channels.index("b_mV")], -values)
    assert found.times == pytest.approx(50.0 + np.arange(3000) / RATE)
    assert [len(chunk.times) for chunk in chunks[:3]] == [1, 10, 10]
    assert "is over" in stream.lost()
    stream.close()
    table[:, 2] = 0.5
    np.savetxt(tmp_path / "b.csv", table, delimiter=",", header="time_s,a_mV,b_mV", comments="", fmt="%.17g")
    stream = open_source(f"file:{tmp_path / 'b.csv'}", ["a_mV"])
    stream.open()
    assert stream.channels == ("a_mV",)
    with pytest.raises(StreamError, match=r"b_mV is 0\.5 in every sample"):
        open_source(f"file:{tmp_path / 'b.csv'}").open()
    for text, said in ((f"file:{tmp_path / 'none.csv'}", "cannot read"), (f"file:{tmp_path / 'a.csv'}", "no channel")):
        with pytest.raises(StreamError, match=said):
            open_source(text, ["c"]).open()
