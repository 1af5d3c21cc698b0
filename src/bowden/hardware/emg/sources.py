"""Sources of EMG: by their names, as the command line and rig.toml give them; a recording; listening for a while."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bowden.core.clock import SECOND, MonotonicClock, TimeSource
from bowden.core.errors import LogError, StreamError, counted
from bowden.hardware.emg.lsl_info import check_rate, check_wanted
from bowden.hardware.emg.trigno_dialogue import Address
from bowden.hardware.ports import EmgChunk, EmgStream
from bowden.identify.emg.log import EmgRecording, check_signal, read_channels

FORMS = "lsl:NAME, lsl:NAME#SOURCE_ID, trigno:HOST, trigno:HOST:COMMAND_PORT:EMG_PORT or file:PATH"
"""What can be written."""


def open_source(text: str, wanted: Sequence[str] = (), clock: TimeSource | None = None) -> EmgStream:
    """The source that `text` names, not yet opened.

    Args:
        text: one of `FORMS`.
        wanted: names of channels that it must have.
        clock: the monotonic clock of its times; this computer's where it is not given.

    Raises:
        StreamError: it names no source.
    """
    kind, _, rest = text.partition(":")
    if not rest.strip():
        there = f"write file:{text}" if text and Path(text).exists() else ""
        raise StreamError(f"{text!r} is not a source of EMG", expected=FORMS, do=there)
    if kind == "lsl":
        from bowden.hardware.emg.lsl import LslStream

        name, _, source = rest.rpartition("#") if "#" in rest else (rest, "", "")
        return LslStream(name, source, wanted, clock=clock)
    if kind == "trigno":
        from bowden.hardware.emg.trigno import TrignoStream

        return TrignoStream(_address(text, rest), wanted, clock)
    if kind == "file":
        return Playback(Path(rest), wanted)
    raise StreamError(f"{text!r} is not a source of EMG", expected=FORMS)


def _address(text: str, rest: str) -> Address:
    """Host and ports of a Trigno server."""
    host, *ports = rest.split(":")
    if not host or len(ports) > 2 or not all(port.isdecimal() and 0 < int(port) < 65536 for port in ports):
        raise StreamError(f"{text!r} is not a source of EMG", expected=FORMS)
    return Address(host, *map(int, ports))


class Playback:
    """A recording; see `bowden.hardware.ports.EmgStream`. It is lost when it is over.

    Args:
        path: of the recording, as `bowden.identify.emg.log.read_channels` takes it.
        wanted: names of channels that it must have. All are played, or these alone where another one is unfit.
    """

    def __init__(self, path: Path, wanted: Sequence[str] = ()) -> None:
        self.rate, self.channels, self.unit = 0.0, tuple[str, ...](), ""
        self._path, self._wanted = path, tuple(wanted)
        self._values = np.empty((0, 0))
        self._start: float | None = None
        self._played = 0
        self._lost = "it is not open"

    def open(self) -> str:
        """See `EmgStream.open`."""
        try:
            found = self._read()
        except LogError as error:
            raise StreamError(error.what, expected=error.expected, do=error.do) from error
        check_wanted(found.channels, self._wanted, str(self._path))
        check_rate(found.rate, str(self._path))
        self.rate, self.channels, self.unit = found.rate, found.channels, found.unit
        self._values, self._lost = found.values, ""
        self._start, self._played = None, 0
        return (
            f"recording {self._path.name}: {counted(len(self.channels), 'channel')}, {self.rate:g} Hz, "
            f"{len(self._values) / self.rate:.1f} s"
        )

    def _read(self) -> EmgRecording:
        try:
            return read_channels(self._path)
        except LogError:
            if not self._wanted:
                raise
            return read_channels(self._path, self._wanted)

    def read(self, now: float) -> EmgChunk:
        """See `EmgStream.read`; the first sample was taken at the first call's `now`."""
        if self._start is None:
            self._start = now
        until = min(len(self._values), int((now - self._start) * self.rate + 1e-6) + 1)
        begin, self._played = self._played, max(until, self._played)
        if self._played == len(self._values) and begin == self._played and not self._lost:
            self._lost = f"the recording {self._path.name} is over"
        return EmgChunk(
            self._values[begin : self._played],
            self._start + np.arange(begin, self._played, dtype=np.float64) / self.rate,
        )

    def lost(self) -> str:
        """See `EmgStream.lost`."""
        return self._lost

    def close(self) -> None:
        """See `EmgStream.close`."""
        self._values, self._lost = np.empty((0, len(self.channels))), "it is closed"


def listen(
    stream: EmgStream,
    channel: str,
    lasting: float,
    progress: Callable[[float], None],
    check: bool = True,
    clock: TimeSource | None = None,
) -> NDArray[np.float64]:
    """The samples of `channel` that come in `lasting` seconds.

    Args:
        stream: open.
        channel: one of its channels.
        lasting: time, and so the number of samples that is wanted [s].
        progress: called with the share that is done.
        check: whether a loss, missing samples, and a signal that no electrode gives are refused.
        clock: to wait by.

    Raises:
        StreamError: lost, or samples are missing.
        LogError: flat or clipped.
    """
    clock = MonotonicClock() if clock is None else clock
    begin, values, count = clock.now() / SECOND, [np.empty(0)], 0
    column, wanted = stream.channels.index(channel), round(lasting * stream.rate)
    while count < wanted:
        now = clock.now() / SECOND
        if stream.lost() or now - begin > 2.0 * lasting + 1.0:
            raise StreamError(
                f"the stream was lost: {stream.lost() or 'too few samples arrive'}",
                do="check its sender, and start again",
            )
        values.append(stream.read(now).values[:, column])
        count += len(values[-1])
        progress(min(1.0, count / wanted))
        clock.sleep_until(clock.now() + SECOND // 100)
    received = np.concatenate(values)
    if check:
        missing = int(np.sum(~np.isfinite(received)))
        if missing:
            raise StreamError(f"{missing} of {len(received)} samples of {channel!r} did not come", do="start again")
        check_signal(channel, received, stream.rate, "the stream")
    return received
