"""`bowden emg stream`, `serve` and `calibrate --source`, in processes of their own; the doctor's list of streams."""

import contextlib
import json
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

from bowden.core.clock import SECOND
from bowden.core.errors import LogError, StreamError
from bowden.hardware.emg.lsl_outlet import LslOutlet, replay
from bowden.hardware.emg.sources import listen, open_source
from bowden.hardware.ports import EmgChunk
from bowden.operations.schema import json_schema
from bowden.sensing import wearer_file
from bowden.sim.emg import background, contractions
from support.command import Command

RATE = 1000.0
NAME = f"app-{os.getpid()}"


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def recording(path: str = "a.csv", seconds: float = 12.0, times: bool = True) -> np.ndarray:
    """Rest, and a contraction from 3.6 s on; three columns are written: time, biceps, triceps."""
    count = round(seconds * RATE)
    random = np.random.default_rng(1)
    biceps = background(RATE, count, random) + contractions(RATE, [(3.6, seconds - 0.1, 0.4)], count, 1)
    values = np.column_stack([biceps, background(RATE, count, random)])
    table = np.column_stack([np.arange(count) / RATE, values]) if times else values
    head = "time_s,biceps_mV,triceps_mV" if times else "biceps_mV,triceps_mV"
    np.savetxt(path, table, delimiter=",", header=head, comments="", fmt="%.17g")
    return values


@contextlib.contextmanager
def playing(schema: str, *words: str) -> Iterator[tuple[dict[str, Any], subprocess.Popen[str]]]:
    """A command that plays until it is told to end; its document, of that schema."""
    command = [sys.executable, "-c", "from bowden.app.main import main; main()", "emg", *words, "--json"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        text = ""
        for line in process.stdout:
            text += line
            if line.startswith("}"):
                break
        document = json.loads(text)
        jsonschema.validate(document, json_schema(schema))
        yield document, process
    finally:
        if process.poll() is None:
            process.terminate()
        process.communicate(timeout=20)


def received(source: str, count: int) -> EmgChunk:
    stream = open_source(source)
    stream.open()
    until, chunks = time.monotonic() + 20.0, []
    while sum(len(chunk.times) for chunk in chunks) < count and time.monotonic() < until:
        chunks.append(stream.read(time.monotonic()))
        time.sleep(0.005)
    stream.close()
    return EmgChunk(*(np.concatenate(parts) for parts in zip(*chunks, strict=True)))


def test_a_recording_is_played_as_a_stream_and_again_and_ends_at_ctrl_c(lsl: Any) -> None:
    values = recording(seconds=2.5)
    with playing("emg stream", "stream", "a.csv", "--name", NAME, "--loop", "--wait") as (document, process):
        assert document["source"] == f"lsl:{NAME}#bowden-{NAME}"
        assert (document["channels"], document["unit"]) == (["biceps_mV", "triceps_mV"], "mV")
        found = received(document["source"], 3000)
        process.send_signal(signal.SIGINT)
        assert process.wait(10) == 0
    twice = np.concatenate([values, values, values])
    assert len(found.values) >= 3000
    assert np.array_equal(found.values, twice[: len(found.values)])


def test_a_stream_that_is_there_already_is_not_made_again(lsl: Any, command: Command) -> None:
    recording(seconds=2.5)
    outlets = [LslOutlet(NAME, RATE, ["a"], "mV", f"bowden-{NAME}") for _ in range(2)]
    words = ["emg", "stream", "a.csv", "--name", NAME, "--speed", "100"]
    said = command(*words, code=2).err
    assert f"there is an LSL stream '{NAME}' with the source id 'bowden-{NAME}' already" in said
    assert "end it, or choose another --name or --source-id" in said
    for source in (f"lsl:{NAME}", f"lsl:{NAME}#bowden-{NAME}"):
        stream = open_source(source)
        with pytest.raises(StreamError, match=r"2 LSL streams are named .*; end all of them but one, or give each"):
            stream.open()
    for outlet in outlets:
        outlet.close()


def test_speed_is_declared_and_one_channel_may_be_chosen(lsl: Any) -> None:
    values = recording(seconds=4.0)
    words = ("a.csv", "--name", NAME, "--speed", "2.5", "--channel", "triceps_mV", "--wait")
    with playing("emg stream", "stream", *words) as (document, process):
        assert (document["rate_hz"], document["duration_s"]) == (2500.0, 1.6)
        found = received(document["source"], 4000)
        assert process.wait(10) == 0
    assert np.array_equal(found.values[:, 0], values[:, 1])


def test_a_recording_is_served_as_a_base_station(command: Command) -> None:
    values = recording()
    with playing("emg serve", "serve", "a.csv", "--port", "0", "--emg-port", "0") as (document, process):
        found = received(document["source"], 1000)
        assert "cannot listen at 127.0.0.1" in command.refused(
            "emg", "serve", "a.csv", "--port", document["source"].split(":")[2]
        )
        process.send_signal(signal.SIGINT)
        assert process.wait(10) == 0
    assert found.values == pytest.approx(values[: len(found.values)], rel=1e-6)


def test_a_wearer_is_calibrated_from_a_stream_and_told_what_to_do(command: Command) -> None:
    """A second to make ready, two of rest, a second, two of contraction: the recording contracts from 3.6 s on."""
    recording()
    words = ["emg", "calibrate", "--source", "file:a.csv", "--seconds", "2", "--out", "b.toml", "--json"]
    said = command(*words)
    document = json.loads(said.out)
    jsonschema.validate(document, json_schema("emg calibrate"))
    wearer = wearer_file.read(Path("b.toml"))
    assert (wearer.channel, wearer.source) == ("biceps_mV", "file:a.csv")
    assert 0.002 < wearer.rest < 0.006
    assert 0.3 < wearer.mvc < 0.6
    assert said.err.index("REST") < said.err.index("get ready") < said.err.index("CONTRACT") < said.err.index("let go")


class Fake:
    """A stream that brings what it is given, and is lost then."""

    rate, channels, unit = RATE, ("a",), "mV"

    def __init__(self, values: np.ndarray) -> None:
        self._values = values

    def open(self) -> str:
        return "fake"

    def read(self, now: float) -> EmgChunk:
        values, self._values = self._values[:100], self._values[100:]
        return EmgChunk(values[:, None], now + np.arange(len(values)) / RATE)

    def lost(self) -> str:
        return "" if len(self._values) else "it is over"

    def close(self) -> None:
        pass


@pytest.mark.parametrize(
    ("values", "error", "said"),
    [
        (np.ones(200), StreamError, "the stream was lost: it is over; check its sender"),
        (np.full(600, 0.25), LogError, "the stream: a is 0.25 in every sample"),
        (np.where(np.arange(600) == 99, np.nan, np.arange(600.0)), StreamError, "1 of 500 samples of 'a' did not come"),
        (np.clip(300.0 * np.sin(0.4 * np.arange(600.0)), -150.0, 150.0), LogError, "are at an end of its range"),
    ],
)
def test_what_cannot_be_calibrated_from_is_one_line(values: np.ndarray, error: type[Exception], said: str) -> None:
    with pytest.raises(error, match=said):
        listen(Fake(values), "a", 0.5, lambda share: None)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["calibrate"], "neither a recording nor a --source is given; expected one of them"),
        (
            ["calibrate", "a.csv", "--source", "file:a.csv"],
            "both a recording and a --source are given; expected one of them",
        ),
        (["calibrate", "--source", "file:a.csv", "--rest", "a.csv"], "--rest and --rate are for recordings"),
        (["calibrate", "--source", "file:a.csv", "--seconds", "0"], "--seconds is 0; expected a number from 2 to 60"),
        (["score", "bare.csv"], "no column of times among 'biceps_mV', 'triceps_mV'; expected a column such as time_s"),
        (["score", "a.csv", "--rate", "-1"], "--rate is -1"),
        (["stream", "a.csv", "--speed", "0"], "--speed is 0"),
        (["stream", "a.csv", "--name", "it's"], "expected a name; no quotes in either"),
        (["stream", "nan.csv"], "nan.csv, line 2002: triceps_mV is nan"),
        (["stream", "huge.csv"], "huge.csv: biceps_mV reaches"),
        (["serve", "a.csv", "--fault", "missing=2"], "--fault is 'missing=2'"),
        (["serve", "a.csv", "--port", "70000"], "--port is 70000; expected a number from 0 to 65535"),
    ],
)
def test_what_makes_no_sense_is_one_line(words: list[str], said: str, command: Command) -> None:
    recording(seconds=3.0)
    recording("bare.csv", 3.0, times=False)
    lines = Path("a.csv").read_text().splitlines()
    huge = [line.partition(",")[0] + ",1e300," + line.rpartition(",")[2] for line in lines[2:]]
    Path("huge.csv").write_text("\n".join([*lines[:2], *huge]))
    lines[2001] = lines[2001].rpartition(",")[0] + ",nan"
    Path("nan.csv").write_text("\n".join(lines))
    captured = command("emg", *words, code=2)
    assert said in captured.err
    assert len(captured.err.strip().splitlines()) == 1
    assert not Path("wearer.toml").exists()


def test_a_recording_without_times_has_a_declared_rate(command: Command) -> None:
    recording("bare.csv", 6.0, times=False)
    found = command.document("emg score bare.csv --rate 1000")
    assert (found["rate_hz"], found["detections"]) == (1000.0, 1)
    assert found["contractions_s"][0][0] == pytest.approx(3.65, abs=0.1)


def test_the_doctor_lists_streams_and_what_is_wrong_with_them(lsl: Any, command: Command) -> None:
    outlets = [
        LslOutlet(NAME, RATE, ["a", "b"], "mV", "one"),
        LslOutlet(NAME, RATE, ["a"], "mV", "two"),
        LslOutlet(f"slow-{NAME}", 10.0, ["a"], "mV", "three"),
    ]
    found = command.document("doctor --seconds 0.2")
    ours = {one["source_id"]: one for one in found["emg"]["streams"] if NAME in one["name"]}
    assert (ours["one"]["channels"], ours["one"]["rate_hz"], ours["one"]["problem"]) == (2, 1000.0, "")
    assert "10 samples a second; expected 900 to 5000 Hz" in ours["three"]["problem"]
    assert any(f"2 LSL streams are named '{NAME}'" in advice for advice in found["advice"])
    for outlet in outlets:
        outlet.close()


class _Reader:
    """An outlet in memory, whose reader leaves some time after it has the last sample."""

    def __init__(self, clock: "_Clock", samples: int, leaves: float) -> None:
        self._clock, self._missing, self._leaves, self._last = clock, samples, leaves, math.inf

    def push(self, values: np.ndarray, age: float = 0.0) -> None:
        self._missing -= len(values)
        self._last = self._clock.now() / SECOND if self._missing == 0 else math.inf

    def has_readers(self) -> bool:
        return self._clock.now() / SECOND < self._last + self._leaves


class _Clock:
    def __init__(self) -> None:
        self._now = 0

    def now(self) -> int:
        return self._now

    def sleep_until(self, deadline: int) -> None:
        self._now = deadline


@pytest.mark.parametrize(("leaves", "lasting"), [(0.5, 1.5), (60.0, 3.0)])
def test_a_stream_that_ends_is_kept_until_its_readers_have_left_but_not_for_ever(leaves: float, lasting: float) -> None:
    clock = _Clock()
    outlet: Any = _Reader(clock, 1000, leaves)
    assert replay(outlet, np.zeros((1000, 1)), RATE, False, lambda: False, lambda _: None, clock=clock) == 1000
    assert clock.now() / SECOND == pytest.approx(lasting, abs=0.02)
