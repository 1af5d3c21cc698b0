"""`bowden run` by EMG, the whole of it: bench and suit behind their twins, moved by a recording, LSL and Trigno."""

import contextlib
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bowden.app.main import run
from bowden.core.errors import StreamError
from bowden.core.units import RADIANS
from bowden.cycle.one_cycle import TargetSource
from bowden.hardware.emg.lsl_info import library
from bowden.hardware.emg.lsl_outlet import LslOutlet, replay
from bowden.hardware.emg.trigno_server import TrignoServer
from bowden.live.mcap_read import read
from live_runs import SHARED, assert_replays, finished, finished_well, on_a_shared_computer, started, tries

pytestmark = [pytest.mark.live, pytest.mark.usefixtures("state")]

RATE = 1000.0
CHANNELS = ("biceps_mV", "triceps_mV")
WEARER = '[emg]\nchannel = "sensor1_mV"\nrest = 0.008\nmvc = 0.32\nsource = "made up"\n'
"""Envelopes of what `made_up` makes: √(2/π) of each standard deviation, the louder one being half a maximum's."""


def made_up(seconds: float) -> np.ndarray:
    """Noise of 0.01 mV; the biceps contracts (0.2 mV) in the second second of every four, the triceps in the fourth."""
    time_s = np.arange(round(seconds * RATE)) / RATE
    noise = 0.01 * np.random.default_rng(1).standard_normal((len(time_s), 2))
    loud = [np.where((time_s % 4.0 >= begin) & (time_s % 4.0 < begin + 1.0), 20.0, 1.0) for begin in (1.0, 3.0)]
    return noise * np.column_stack(loud)


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("emg") / "emg.csv"
    values = made_up(9.0)
    table = np.column_stack([np.arange(len(values)) / RATE, values])
    np.savetxt(path, table, ["%.3f", "%.5f", "%.5f"], ",", header=f"time_s,{','.join(CHANNELS)}", comments="")
    return path


def bench(folder: Path, keys: str = "") -> Path:
    path = folder / "rig.toml"
    path.write_text(f"[limits]\n{SHARED}[emg]\nhigh_deg = 60.0\nduration_s = 1.0\n{keys}\n")
    return path


def suit(folder: Path, keys: str, worn: str = "") -> Path:
    """The rig of ``bowden init --suit``, with more keys in [emg] and in [suit]."""
    path = folder / "suit.toml"
    assert run(["init", str(path), "--suit"]) == 0
    path.write_text(
        f"{on_a_shared_computer(path.read_text())}\n{keys}\n".replace("worn = true", f"worn = true\n{worn}", 1)
    )
    return path


def run_well(path: Path, folder: Path, source: str, *options: str) -> dict[str, Any]:
    """A run that came to its end, with nothing lost, whose log replays without a difference."""
    found = finished_well(path, folder, "--twin", "--emg", source, *options)
    assert found["emg"]["lost"] == 0
    assert_replays(found["log"])
    return found


@contextlib.contextmanager
def in_a_thread(play: Callable[[Callable[[], bool]], Any]) -> Iterator[None]:
    """`play` until the end of the block; it asks what it is given whether to end."""
    over = threading.Event()
    thread = threading.Thread(target=play, args=(over.is_set,))
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


@pytest.mark.long
def test_a_recording_moves_the_bench(tmp_path: Path, recording: Path) -> None:
    found = run_well(bench(tmp_path), tmp_path, f"file:{recording}")
    assert found["emg"]["motions"] >= 1
    assert found["emg"]["onset_to_cycle_ms"]["p50"] < 100.0
    assert found["rmse_deg"] < 5.0


def test_two_muscles_over_lsl_move_the_suit(tmp_path: Path) -> None:
    name = f"suit-{os.getpid()}"
    try:
        lsl = library()
    except StreamError as error:
        pytest.skip(str(error))
    outlet = LslOutlet(name, RATE, CHANNELS, "mV", name)
    if not lsl.resolve_byprop("name", name, 1, 5.0):
        pytest.skip("LSL finds no stream on this machine: no multicast and no unicast on 127.0.0.1")
    path, values = suit(tmp_path, 'flexor = "biceps_mV"\nextensor = "triceps_mV"'), made_up(4.0)
    with contextlib.closing(outlet), in_a_thread(lambda over: replay(outlet, values, RATE, True, over, lambda _: None)):
        found = run_well(path, tmp_path, f"lsl:{name}", "--duration", "7")
    assert found["emg"]["motions"] >= 2
    assert found["emg"]["samples"] > 4000
    assert found["rmse_deg"] < 10.0


@pytest.mark.long
def test_trigno_moves_the_suit_as_far_as_the_muscle_contracts(tmp_path: Path) -> None:
    """With a drive that is told to push against friction."""
    server = TrignoServer(made_up(4.0), RATE, loop=True)
    (tmp_path / "wearer.toml").write_text(WEARER)
    path = suit(tmp_path, 'mode = "proportional"\nwearer = "wearer.toml"', "friction_feedforward_nm = 1.0")
    source = f"trigno:127.0.0.1:{server.ports.command}:{server.ports.emg}"
    with contextlib.closing(server), in_a_thread(server.serve):
        found = run_well(path, tmp_path, source, "--duration", "7")
    assert found["emg"]["motions"] is None
    assert found["emg"]["samples"] > 4000
    log = read(Path(found["log"]), ("source", "reference", "joint", "push.torque"))
    led = log["source"] >= TargetSource.LAW_BEGINS
    assert np.ptp(log["reference"][led]) > 20.0 * RADIANS
    assert np.ptp(log["joint"][led]) > 15.0 * RADIANS
    assert 0.5 < np.abs(log["push.torque"]).max() <= 1.0


_SECONDS_LED = 4_500_000
"""Size of a log in which the law has had the motor for some seconds."""


def test_a_stream_that_dies_ends_the_run_in_a_release(tmp_path: Path, recording: Path) -> None:
    path = bench(tmp_path)
    for number in tries():
        logs = tmp_path / f"out{number}"
        process = started(path, logs, "--twin", "--emg", f"file:{recording}")
        while process.poll() is None and sum(log.stat().st_size for log in logs.glob("*.mcap")) < _SECONDS_LED:
            time.sleep(0.05)
        with contextlib.suppress(ProcessLookupError):  # a run that a stall has ended
            os.kill(_reading(process.pid), signal.SIGKILL)
        found = finished(process)
        if found["faults"] == ["EMG lost"]:
            break
    assert process.returncode == 1
    assert found["faults"] == ["EMG lost"], found
    assert found["mode"] == "latched"
    assert "the process that reads the stream stalled or ended" in found["remedies"][0]


def _reading(parent: int) -> int:
    """The process of a run that reads EMG."""
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            words = (folder / "cmdline").read_bytes().split(b"\0")
            fields = (folder / "stat").read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[1]) == parent and b"bowden.live.intent_process" in words:
            return int(folder.name)
    raise ProcessLookupError
