"""A recording of EMG as a stream: played in real time from the first look on."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from bowden.core.errors import LogError, StreamError, counted
from bowden.hardware.emg.lsl_info import check_rate, check_wanted
from bowden.hardware.ports import EmgChunk
from bowden.identify.emg.log import EmgRecording, read_channels


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
