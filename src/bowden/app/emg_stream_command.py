"""``bowden emg stream`` and ``bowden emg serve``: a recording in real time, as LSL or as a Trigno base station."""

import contextlib
import math
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated, Any

import typer

from bowden.app.command import Command
from bowden.app.console import print_json, progress_bar, seconds
from bowden.app.emg_command import JsonOption, RateOption, checked_rate
from bowden.core.errors import ParameterError, counted

RecordingArgument = Annotated[
    Path, typer.Argument(help="CSV, csv.gz, NPZ or Parquet with time_s and one or more channels.")
]
ChannelsOption = Annotated[list[str] | None, typer.Option("--channel", help="Play this one; may be repeated.")]
LoopOption = Annotated[bool, typer.Option("--loop", help="Begin again at the end.")]


def stream(
    recording: RecordingArgument,
    name: Annotated[str | None, typer.Option(help="Of the stream; the recording's name by default.")] = None,
    source_id: Annotated[
        str | None, typer.Option(help="Identifier by which readers find it again; made from its name by default.")
    ] = None,
    channel: ChannelsOption = None,
    rate: RateOption = None,
    speed: Annotated[
        float,
        typer.Option(
            help="Speed as a multiple of real time; the stream declares a rate that is higher by this factor."
        ),
    ] = 1.0,
    loop: LoopOption = False,
    wait: Annotated[bool, typer.Option("--wait", help="Start when a reader has connected.")] = False,
    json: JsonOption = False,
) -> None:
    """Play a recording in real time as a stream of the Lab Streaming Layer, until its end or Ctrl-C."""
    from bowden.hardware.emg.lsl_outlet import LslOutlet, check_alone, replay
    from bowden.identify.emg.log import read_channels

    if not 0.01 <= speed <= 100.0:
        raise ParameterError(f"--speed is {speed:g}", expected="a number from 0.01 to 100")
    log = read_channels(recording, channel or (), checked_rate(rate))
    called = recording.name.partition(".")[0] if name is None else name
    source = f"bowden-{called}" if source_id is None else source_id
    if not called or "'" in called + source:
        raise ParameterError(f"--name is {called!r} and --source-id {source!r}", expected="a name; no quotes in either")
    check_alone(called, source)
    outlet = LslOutlet(called, log.rate * speed, log.channels, log.unit, source)
    lasting = len(log.values) / (log.rate * speed)
    document = {
        "source": f"lsl:{called}#{source}",
        "name": called,
        "source_id": source,
        "channels": list(log.channels),
        "unit": log.unit,
        "rate_hz": log.rate * speed,
        "duration_s": lasting,
    }
    _begin(document, log.warnings, json)
    with _until_stopped() as stopped, _bar(json, lasting) as progress:
        try:
            sent = replay(outlet, log.values, log.rate * speed, loop, stopped, progress, wait)
        finally:
            outlet.close()
    if not json:
        print(f"{counted(sent, 'sample')} of {counted(len(log.channels), 'channel')} sent")


def serve(
    recording: RecordingArgument,
    host: Annotated[str, typer.Option(help="Address of this computer to listen on.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(help="Of commands; 0 for any that is free.")] = 50040,
    emg_port: Annotated[int, typer.Option(help="Of samples; 0 for any that is free.")] = 50043,
    channel: ChannelsOption = None,
    rate: RateOption = None,
    loop: LoopOption = False,
    fault: Annotated[
        list[str] | None, typer.Option(help="Simulate a fault, such as late=0.1 or torn; may be repeated.")
    ] = None,
    json: JsonOption = False,
) -> None:
    """Play a recording as a Trigno base station would, for trying things without one, until Ctrl-C.

    Each client's START plays it from its beginning. The recording is taken to be in its channels' unit, in mV where
    they have none.
    """
    from bowden.hardware.emg.trigno_faults import read_faults
    from bowden.hardware.emg.trigno_server import Ports, TrignoServer
    from bowden.identify.emg.log import read_channels

    for number in (port, emg_port):
        if not 0 <= number < 65536:
            raise ParameterError(f"a port is {number}", expected="a number from 0 to 65535")
    faults = read_faults(fault or [])
    log = read_channels(recording, channel or (), checked_rate(rate))
    values = log.values * {"V": 1e3, "µV": 1e-3, "uV": 1e-3}.get(log.unit, 1.0)
    server = TrignoServer(values, log.rate, Ports(port, emg_port), host, loop, faults)
    document = {
        "source": f"trigno:{host}:{server.ports.command}:{server.ports.emg}",
        "channels": list(log.channels),
        "rate_hz": log.rate,
        "duration_s": len(values) / log.rate,
    }
    _begin(document, log.warnings, json)
    try:
        with _until_stopped() as stopped, _bar(json, len(values) / log.rate) as progress:
            server.serve(stopped, progress)
    finally:
        server.close()


def _begin(document: dict[str, Any], warnings: tuple[str, ...], json: bool) -> None:
    if json:
        print_json(document | {"seconds": seconds()})
    else:
        for warning in warnings:
            print(f"note: {warning}", file=sys.stderr)
        channels = ", ".join(document["channels"])
        print(f"{document['source']}: {channels}, {document['rate_hz']:g} Hz; Ctrl-C ends it")
    sys.stdout.flush()


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
def _bar(quiet: bool, lasting: float) -> Iterator[Callable[[float], None]]:
    """What is played, on a terminal, given the time from the beginning [s]."""
    with progress_bar(quiet) as progress:
        shown = [-1.0]

        def show(played: float) -> None:
            if abs(played - shown[0]) >= 0.1:
                shown[0] = played
                share = math.fmod(played, lasting) / lasting
                progress(f"{played:.0f} s played", share)

        yield show


COMMANDS = (
    Command(
        "emg stream",
        stream,
        "Play a recording in real time as a stream of LSL.",
        (
            "bowden emg stream biceps.csv",
            "bowden emg stream biceps.csv --name EMG --loop --wait",
        ),
        place=30,
    ),
    Command(
        "emg serve",
        serve,
        "Play a recording in real time as a Trigno base station.",
        (
            "bowden emg serve biceps.csv",
            "bowden emg serve biceps.csv --loop --fault late=0.1 --fault torn",
        ),
        place=40,
    ),
)
