"""`emg stream` and `emg serve`: a recording in real time, as LSL or as a Trigno base station."""

import contextlib
import math
import signal
import threading
from collections.abc import Callable, Iterator
from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import Any

from bowden.operations.support.operation import GivenProgress, Operation, Progress
from bowden.operations.support.results import Result


@dataclass(frozen=True)
class EmgServed(Result["EmgServed"]):
    """A recording that is played."""

    source: str
    """What a reader of bowden is given."""
    channels: tuple[str, ...]
    """Their names; of a base station in the order of the sensors' slots."""
    rate_hz: float
    """That the stream declares: the recording's, times the speed."""
    duration_s: float
    """Duration of playing it once."""
    _: KW_ONLY
    sent: tuple[list[int], ...] = ()
    """How many samples were sent, once it has ended."""


@dataclass(frozen=True)
class EmgStreamed(EmgServed):
    """A recording that is played as a stream of LSL."""

    name: str
    """Name of the stream."""
    source_id: str
    """Identifier by which readers find it again."""
    unit: str
    """Unit of the values; empty where the recording's names have none."""


def emg_stream(
    recording: Path,
    *,
    name: str | None = None,
    source_id: str | None = None,
    channel: list[str] | None = None,
    rate: float | None = None,
    speed: float = 1.0,
    loop: bool = False,
    wait: bool = False,
    progress: GivenProgress = None,
) -> Iterator[EmgStreamed]:
    """Play a recording in real time as a stream of the Lab Streaming Layer, until its end or Ctrl-C.

    Args:
        recording: CSV, csv.gz, NPZ or Parquet with time_s and one or more channels.
        name: name of the stream; the recording's name by default.
        source_id: identifier by which readers find it again; made from its name by default.
        channel: play this one; may be repeated.
        rate: samples a second, where the recording has no times, or to check those it has.
        speed: as a multiple of real time; the stream declares a rate that is higher by this factor.
        loop: begin again at the end.
        wait: start when a reader has connected.

    Yields:
        What is played.

    Raises:
        LogError: a recording that cannot be used.
        ParameterError: a speed or a name that cannot be.

    Examples:
        bowden emg stream biceps.csv
        bowden emg stream biceps.csv --name EMG --loop --wait
    """
    from bowden.core.caller import argument
    from bowden.core.errors import ParameterError
    from bowden.hardware.emg.lsl_outlet import LslOutlet, check_alone, replay
    from bowden.identify.emg.log import read_channels
    from bowden.operations.support.given import check_number

    check_number("speed", speed, 0.01, 100.0)
    log = read_channels(recording, channel or (), None if rate is None else check_number("rate", rate, 1e-3, 1e6))
    called = recording.name.partition(".")[0] if name is None else name
    source = f"bowden-{called}" if source_id is None else source_id
    if not called or "'" in called + source:
        name_, id_ = (argument(one).rstrip("=") for one in ("name", "source_id"))
        what = f"{name_} is {called!r} and {id_} {source!r}"
        raise ParameterError(what, expected="a name; no quotes in either")
    check_alone(called, source)
    outlet = LslOutlet(called, log.rate * speed, log.channels, log.unit, source)
    lasting, sent = len(log.values) / (log.rate * speed), list[int]()
    said: dict[str, Any] = {"notes": tuple(log.warnings), "needless": tuple(log.warnings)}
    played = (f"lsl:{called}#{source}", tuple(log.channels), log.rate * speed, lasting)
    try:
        with _until_stopped() as stopped, _bar(progress, lasting) as show:
            yield EmgStreamed(*played, called, source, log.unit, **said, sent=(sent,))
            sent.append(replay(outlet, log.values, log.rate * speed, loop, stopped, show, wait))
    finally:
        outlet.close()


def emg_serve(
    recording: Path,
    *,
    host: str = "127.0.0.1",
    port: int = 50040,
    emg_port: int = 50043,
    channel: list[str] | None = None,
    rate: float | None = None,
    loop: bool = False,
    fault: list[str] | None = None,
    progress: GivenProgress = None,
) -> Iterator[EmgServed]:
    """Play a recording in real time as a Trigno base station, until Ctrl-C.

    Each client's START plays it from its beginning. The recording is taken to be in its channels' unit, in mV where
    they have none.

    Args:
        recording: CSV, csv.gz, NPZ or Parquet with time_s and one or more channels.
        host: address of this computer to listen on.
        port: port for commands; 0 for any that is free.
        emg_port: port for samples; 0 for any that is free.
        channel: play this one; may be repeated.
        rate: samples a second, where the recording has no times, or to check those it has.
        loop: begin again at the end.
        fault: simulate a fault, such as silent=7 (seconds), late=0.1 or torn; a wrong one is answered with all.

    Yields:
        What is played.

    Raises:
        LogError: a recording that cannot be used.
        ParameterError: a port or a fault that cannot be.

    Examples:
        bowden emg serve biceps.csv
        bowden emg serve biceps.csv --loop --fault late=0.1 --fault torn
    """
    from bowden.hardware.emg.trigno_server import Ports, TrignoServer, read_faults
    from bowden.identify.emg.log import read_channels
    from bowden.operations.support.given import check_number

    for name, number in (("port", port), ("emg_port", emg_port)):
        check_number(name, number, 0, 65535)
    faults = read_faults(fault or [])
    log = read_channels(recording, channel or (), None if rate is None else check_number("rate", rate, 1e-3, 1e6))
    values = log.values * {"V": 1e3, "µV": 1e-3, "uV": 1e-3}.get(log.unit, 1.0)
    server = TrignoServer(values, log.rate, Ports(port, emg_port), host, loop, faults)
    lasting = len(values) / log.rate
    said: dict[str, Any] = {"notes": tuple(log.warnings), "needless": tuple(log.warnings)}
    source = f"trigno:{host}:{server.ports.command}:{server.ports.emg}"
    try:
        with _until_stopped() as stopped, _bar(progress, lasting) as show:
            yield EmgServed(source, tuple(log.channels), log.rate, lasting, **said)
            server.serve(stopped, show)
    finally:
        server.close()


@contextlib.contextmanager
def _until_stopped() -> Iterator[Callable[[], bool]]:
    """Whether Ctrl-C or a signal to end has come."""
    stopped = threading.Event()
    before = {number: signal.signal(number, lambda *_: stopped.set()) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield stopped.is_set
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextlib.contextmanager
def _bar(given: Progress | bool | None, lasting: float) -> Iterator[Callable[[float], None]]:
    """What is played, given the time from the beginning [s]."""
    from bowden.operations.support.progress import reported

    with reported(given, "emg") as progress:
        shown = [-1.0]

        def show(played: float) -> None:
            if abs(played - shown[0]) >= 0.1:
                shown[0] = played
                progress(f"{played:.0f} s played", math.fmod(played, lasting) / lasting)

        yield show


OPERATIONS = (Operation("emg stream", emg_stream, 30), Operation("emg serve", emg_serve, 40))
