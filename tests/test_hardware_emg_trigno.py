"""The Trigno client against a server that speaks the protocol: bytes, times, faults of every kind, and refusals."""

import contextlib
import itertools
import re
import socket
import threading
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bowden.core.errors import ParameterError, StreamError
from bowden.hardware.emg import trigno_protocol
from bowden.hardware.emg.sources import open_source
from bowden.hardware.emg.trigno import TrignoStream
from bowden.hardware.emg.trigno_dialogue import Address
from bowden.hardware.emg.trigno_protocol import (
    EMG_PORT,
    LEGACY_EMG_PORT,
    Lines,
    Samples,
    SensorAnswers,
    columns_of,
    rate_of,
)
from bowden.hardware.emg.trigno_server import TrignoServer, read_faults
from bowden.hardware.ports import EmgChunk
from bowden.identify.emg.log import read_emg
from bowden.sensing.stream import OnsetDetector

RATE = 2000.0


def cut(data: bytes, at: Sequence[int]) -> list[bytes]:
    edges = [0, *sorted(k % (len(data) + 1) for k in at), len(data)]
    return [data[a:b] for a, b in itertools.pairwise(edges)]


@given(st.integers(0, 40), st.lists(st.integers(0, 10_000), max_size=20))
def test_samples_are_the_same_however_their_bytes_are_cut(count: int, at: list[int]) -> None:
    sent = np.random.default_rng(count).normal(size=(count, 16)).astype("<f4")
    parser = Samples()
    found = np.concatenate([np.empty((0, 16), "<f4"), *(parser.feed(piece) for piece in cut(sent.tobytes(), at))])
    assert np.array_equal(found, sent)


@given(
    st.lists(st.text(st.characters(min_codepoint=33, max_codepoint=126), min_size=1, max_size=30), max_size=8),
    st.lists(st.integers(0, 500), max_size=12),
)
def test_lines_are_the_same_however_they_are_cut(sent: list[str], at: list[int]) -> None:
    lines = Lines()
    data = "".join(line + "\r\n\r\n" for line in sent).encode()
    assert [line for piece in cut(data, at) for line in lines.feed(piece)] == sent


@given(st.lists(st.binary(max_size=300), max_size=10))
def test_bytes_that_are_no_lines_are_refused_and_nothing_else_happens(pieces: list[bytes]) -> None:
    lines = Lines()
    with contextlib.suppress(StreamError):
        for piece in pieces:
            lines.feed(piece)


def answers(*given: tuple[int, str, str, str]) -> list[SensorAnswers]:
    return [SensorAnswers(*one) for one in given]


def test_channels_are_found_where_the_server_has_them() -> None:
    plain = columns_of(answers((1, "1", "1", "V"), (3, "3", "1", "Volts")))
    assert [(c.name, c.place, c.factor) for c in plain] == [("sensor1", 0, 1e3), ("sensor3", 2, 1e3)]
    assert columns_of(answers((1, "0", "1", "V"), (3, "2", "1", "V"))) == plain
    old = columns_of(answers((1, *["INVALID COMMAND"] * 3), (3, *["INVALID COMMAND"] * 3)))
    assert old == plain
    several = columns_of(answers((1, "1", "4", "mV"), (2, "5", "1", "V"), (3, "6", "0", "g")))
    assert [(c.name, c.place) for c in several] == [
        *(("sensor1", 0), ("sensor1.2", 1), ("sensor1.3", 2), ("sensor1.4", 3)),
        ("sensor2", 4),
    ]
    for bad in (((1, "1", "1", "V"), (2, "1", "1", "V")), ((2, "17", "1", "V"),), ((1, "1", "x", "V"),)):
        with pytest.raises(StreamError):
            columns_of(answers(*bad))
    with pytest.raises(StreamError, match="is in 'g'; expected volts"):
        columns_of(answers((1, "1", "1", "g")))


@pytest.mark.parametrize(
    ("given", "rate"),
    [
        ((EMG_PORT, "NO", "NO", "0.0135", "26"), 26 / 0.0135),
        ((EMG_PORT, "NO", "UPSAMPLING OFF", "0.0135", "29"), 29 / 0.0135),
        ((EMG_PORT, "YES", "UPSAMPLING ON", "0.0135", "26"), 2000.0),
        ((EMG_PORT, "YES", "NO", "0.0135", "15"), 15 / 0.0135),
        ((LEGACY_EMG_PORT, "YES", "OFF", "0.0135", "26"), 26 / 0.0135),
        ((LEGACY_EMG_PORT, *["INVALID COMMAND"] * 4), 2000.0),
    ],
)
def test_the_rate_is_that_of_the_port_and_its_settings(given: tuple[int, str, str, str, str], rate: float) -> None:
    assert rate_of(*given) == pytest.approx(rate, rel=1e-12)


@pytest.mark.parametrize("most", ["0", "spam", "", "nan"])
def test_a_frame_that_cannot_be_is_refused(most: str) -> None:
    with pytest.raises(StreamError):
        rate_of(EMG_PORT, "NO", "NO", "0.0135", most)


@pytest.mark.parametrize(
    "text", ["late", "late=x", "torn=1", "garbage=tea", "spam", "missing=-1", "missing=nan", "missing=2"]
)
def test_faults_that_are_none_are_one_line(text: str) -> None:
    with pytest.raises(ParameterError, match=r"--fault is .*; expected torn, late=SECONDS"):
        read_faults([text])


@contextlib.contextmanager
def serving(values: np.ndarray, rate: float = RATE, faults: Sequence[str] = ()) -> Iterator[Address]:
    server, stop = TrignoServer(values, rate, faults=read_faults(faults)), threading.Event()
    thread = threading.Thread(target=server.serve, args=(stop.is_set,))
    thread.start()
    try:
        yield Address("127.0.0.1", *server.ports)
    finally:
        stop.set()
        thread.join()
        server.close()


def counter(seconds: float = 30.0, channels: int = 16) -> np.ndarray:
    """Samples known by their content: 1, 2, 3 … µV, every channel with its own offset in mV."""
    count = np.arange(1, round(seconds * RATE) + 1)
    return 1e-3 * count[:, None] + np.arange(channels)


def counted(chunk: EmgChunk, channel: int = 0) -> np.ndarray:
    return np.round(1e3 * (chunk.values[:, channel] - channel))


def drained(stream: TrignoStream, count: int = 10**9, seconds: float = 20.0) -> tuple[EmgChunk, list[str]]:
    """What comes until there are `count` samples or `seconds` are over, and what was said of loss meanwhile."""
    until, chunks, said = time.monotonic() + seconds, [], [""]
    while sum(len(chunk.times) for chunk in chunks) < count and time.monotonic() < until:
        chunks.append(stream.read(time.monotonic()))
        if stream.lost() != said[-1]:
            said.append(stream.lost())
        time.sleep(0.002)
    return EmgChunk(*(np.concatenate(parts) for parts in zip(*chunks, strict=True))), said


@pytest.mark.parametrize("faults", [[], ["torn", "late=0.5"]], ids=["well", "torn and late"])
def test_every_sample_comes_once_in_its_column_with_increasing_times(faults: list[str]) -> None:
    begin = time.monotonic()
    with serving(counter(), faults=faults) as address:
        stream = open_source(f"trigno:{address.host}:{address.command}:{address.emg}", ["sensor16"])
        assert isinstance(stream, TrignoStream)
        assert "16 channels" in stream.open()
        found, _ = drained(stream, 3000)
        stream.close()
    assert (stream.rate, stream.unit, stream.channels[15]) == (RATE, "mV", "sensor16")
    for channel in (0, 7, 15):
        assert np.array_equal(counted(found, channel), np.arange(1, len(found.times) + 1))
    assert np.all(np.diff(found.times) > 0.0)
    assert begin < found.times[0]
    assert found.times[-1] <= time.monotonic()
    assert stream.lost() == "it is closed"
    stream.close()


def test_a_recording_through_the_server_decides_as_the_file_does(shared_data: Path) -> None:
    """The wire has single precision and volts; what the detector makes of that is the same."""
    log = read_emg(shared_data / "emg" / "adductor_pollicis_twitches.csv.gz")
    values = log.values[:4004, None]  # whole frames of 13 samples and of 14
    with serving(values, log.rate) as address:
        stream = TrignoStream(address)
        stream.open()
        found, _ = drained(stream, len(values))
        stream.close()
    wired = (1e-3 * values[:, 0]).astype(np.float32).astype(np.float64) * 1e3
    assert np.array_equal(found.values[:, 0], wired)
    live = np.concatenate([OnsetDetector(log.rate).feed(found.values[:, 0]).active])
    offline = OnsetDetector(log.rate).feed(values[:, 0]).active
    assert live.sum() > 0.0
    assert np.array_equal(live, offline)


@pytest.fixture(scope="module")
def faulty() -> dict[str, tuple[EmgChunk, list[str]]]:
    """Some seconds of servers with one fault each, at the same time: what came, and what was said of loss."""

    def one(fault: str) -> tuple[EmgChunk, list[str]]:
        with serving(counter(), faults=[fault]) as address:
            stream = TrignoStream(address)
            stream.open()
            found = drained(stream, seconds=3.5)
            stream.close()
            return found

    faults = ("missing=0.03", "disconnect=0.8", "silent=0.8", "garbage=data", "garbage=values")
    with ThreadPoolExecutor(len(faults)) as pool:
        return dict(zip(faults, pool.map(one, faults), strict=True))


def test_frames_that_are_missing_show_in_the_times(faulty: dict[str, tuple[EmgChunk, list[str]]]) -> None:
    found, _ = faulty["missing=0.03"]
    counts = counted(found)
    gone = counts[-1] - counts[0] + 1 - len(counts)
    assert gone > 0
    assert np.all(np.diff(counts) > 0.0)
    assert found.times[-1] - found.times[0] > (len(counts) - 1) / RATE
    assert found.times[-1] - found.times[0] == pytest.approx((counts[-1] - counts[0]) / RATE, abs=0.3)


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        ("disconnect=0.8", "has closed its EMG port|broke: |connection"),
        ("silent=0.8", "nothing comes from Trigno server"),
        ("garbage=data", "what comes from Trigno server .* is no EMG"),
    ],
)
def test_a_server_that_fails_is_lost_and_connected_anew_with_missing_samples_between(
    fault: str, said: str, faulty: dict[str, tuple[EmgChunk, list[str]]]
) -> None:
    found, losses = faulty[fault]
    assert any(re.search(said, loss) for loss in losses)
    assert losses[2] == ""
    missing = np.isnan(found.values[:, 0])
    assert missing.any()
    assert np.all(np.diff(found.times) > 0.0)
    assert np.array_equal(np.isnan(found.values).all(axis=1), missing)
    whole = counted(found)[~missing]
    assert (np.diff(whole) < 0.0).any(), "the recording begins again when the server is started again"


def test_single_values_that_no_electrode_gives_are_missing_samples(
    faulty: dict[str, tuple[EmgChunk, list[str]]],
) -> None:
    found, losses = faulty["garbage=values"]
    missing = np.isnan(found.values[:, 0])
    assert missing.mean() == pytest.approx(3 / 27, abs=0.01)
    assert np.array_equal(counted(found)[~missing], np.arange(1, len(found.times) + 1)[~missing])
    assert not any("no EMG" in loss for loss in losses)


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        ("garbage=greeting", "which is no text; expected a Trigno SDK server"),
        ("refuse=EMG", "no EMG port [0-9]+ at 127.0.0.1: Connection refused; start the Trigno Control Utility"),
    ],
)
def test_a_server_that_cannot_be_used_is_one_line(fault: str, said: str) -> None:
    with serving(counter(2.0), faults=[fault]) as address, pytest.raises(StreamError, match=said) as caught:
        TrignoStream(address).open()
    assert "\n" not in str(caught.value)


def test_an_older_server_that_knows_few_questions_will_do() -> None:
    with serving(counter(channels=2), faults=["refuse=questions"]) as address:
        stream = TrignoStream(address)
        stream.open()
        stream.close()
    assert stream.rate == 2000.0
    assert stream.channels == ("sensor1", "sensor2")


def test_where_the_emg_port_refuses_the_legacy_one_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    with serving(counter(channels=2)) as address, socket.create_server(("127.0.0.1", 0)) as other:
        monkeypatch.setattr(trigno_protocol, "EMG_PORT", other.getsockname()[1])
        other.close()
        monkeypatch.setattr(trigno_protocol, "LEGACY_EMG_PORT", address.emg)
        stream = TrignoStream(address._replace(emg=None))
        assert "legacy EMG port" in stream.open()
        assert np.array_equal(counted(drained(stream, 500)[0])[:500], np.arange(1, 501))
        stream.close()
        monkeypatch.setattr(trigno_protocol, "LEGACY_EMG_PORT", trigno_protocol.EMG_PORT)
        with pytest.raises(StreamError, match=f"no EMG port {trigno_protocol.EMG_PORT} at 127.0.0.1"):
            TrignoStream(address._replace(emg=None)).open()


def test_channels_and_rates_that_are_not_there_are_one_line() -> None:
    with (
        serving(counter(channels=2)) as address,
        pytest.raises(StreamError, match="has no channel 'sensor9'; expected one of 'sensor1', 'sensor2'"),
    ):
        TrignoStream(address, ["sensor9"]).open()
    with (
        serving(counter(channels=2), 200.0) as address,
        pytest.raises(StreamError, match="200 samples a second; expected 900 to 5000 Hz"),
    ):
        TrignoStream(address).open()
    with pytest.raises(StreamError, match=r"no command port [0-9]+ at 127.0.0.1: Connection refused"):
        TrignoStream(address).open()
    with pytest.raises(StreamError, match="17 channels; expected at most 16 sensors"):
        TrignoServer(counter(1.0, 17), RATE)
