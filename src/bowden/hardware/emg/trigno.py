"""EMG of a Delsys Trigno base station, over the TCP protocol of its SDK server; our own client.

A thread receives, so that a sample's arrival is known to well below a millisecond and `read` never waits. Samples carry
no numbers and no times: `SampleTimes` makes times of their count and arrival. A connection that breaks, falls silent or
sends what no electrode can have is given up and made again, once a second; the silence becomes missing samples (NaN).
"""

import contextlib
import math
import threading
from collections import deque
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bowden.core.clock import SECOND, MonotonicClock, TimeSource
from bowden.core.errors import StreamError, counted
from bowden.hardware.emg.lsl_info import check_rate, check_wanted
from bowden.hardware.emg.sample_times import SampleTimes
from bowden.hardware.emg.trigno_dialogue import Address, Base, TrignoDialogue
from bowden.hardware.emg.trigno_protocol import LARGEST, LEAST, Samples
from bowden.hardware.ports import EmgChunk, one_chunk

SILENCE = 0.25
"""A server that has sent nothing sensible for this long is lost [s]."""
_GIVE_UP = 1.0
"""After a loss of this length the connection is made again, and once in this time tried again [s]."""
_WAIT = 5.0
"""How long the first samples may take [s]."""
_TRIAL, _LONGEST_TRIAL = 0.5, 3.0
"""What comes in this time shows whether the rate is what was said; the longer one where it does not at first [s]."""
_RATE_ERROR = 0.2
"""How far it may be off; frames of 13.5 ms are counted whole."""
_BLOCK = 4.0
"""Later the rate is counted over this time; frames that are late by half a second are an eighth of it [s]."""
_BURST = 0.5
"""After a silence what was held back comes in this time, and is not counted [s]."""
_BUFFER = 10.0
"""What is kept of samples that are not read [s]."""
_JUDGED = 500.0
"""So many values are looked at before what comes is called no EMG, or EMG again."""
_LOOK = 0.02
"""How long the thread waits for data at most [s]."""


class TrignoStream:
    """The paired, active sensors of a base station, in mV; see `bowden.hardware.ports.EmgStream`.

    Args:
        address: of the server.
        wanted: names of channels that it must have.
        clock: the monotonic clock that times are given in.
    """

    unit = "mV"

    def __init__(self, address: Address, wanted: Sequence[str] = (), clock: TimeSource | None = None) -> None:
        self.rate, self.channels = 0.0, tuple[str, ...]()
        self._address, self._wanted = address, tuple(wanted)
        self._clock = MonotonicClock() if clock is None else clock
        self._chunks: deque[EmgChunk] = deque()
        self._held = 0
        self._lost = "it is not open"
        self._closing = threading.Event()
        self._thread: threading.Thread | None = None
        self._received_at = math.inf
        self._block_from, self._block_count, self._measured, self._kept_rate = 0.0, 0, 0.0, True

    def open(self) -> str:
        """See `EmgStream.open`."""
        dialogue = TrignoDialogue(self._address, self._clock)
        try:
            base = self._base = dialogue.base
            check_rate(base.rate, self._address.said())
            channels = tuple(column.name for column in base.columns)
            check_wanted(channels, self._wanted, self._address.said())
            self.rate, self.channels = base.rate, channels
            self._places = np.array([column.place for column in base.columns])
            self._factors = np.array([column.factor for column in base.columns])
            self._times = SampleTimes(base.rate)
            dialogue.start()
        except BaseException:
            dialogue.close()
            raise
        self._closing.clear()
        self._lost, self._received_at, self._sensible = "", self._now(), False
        self._thread = threading.Thread(target=self._run, args=(dialogue,), name="trigno", daemon=True)
        self._thread.start()
        try:
            self._try_rate()
        except StreamError:
            self.close()
            raise
        idle = f"; paired and not active: {', '.join(map(str, base.idle))}" if base.idle else ""
        port = ", legacy EMG port" if base.legacy else ""
        return (
            f"{self._address.said()} {base.version}{port}: {counted(len(channels), 'channel')} "
            f"({', '.join(channels)}), {base.rate:.6g} Hz, mV{idle}"
        )

    def _now(self) -> float:
        return self._clock.now() / SECOND

    def _try_rate(self) -> None:
        """Wait for the first samples, and see whether they come at the rate that was said; they are kept."""
        until = self._now() + _WAIT
        while not self._sensible and self._now() < until:
            self._clock.sleep_until(self._clock.now() + SECOND // 200)
        if not self._sensible:
            said = self._lost or f"{self._address.said()} has started, but sends nothing"
            raise StreamError(f"{said}, in {_WAIT:g} s", do="check that the sensors are on and in range")
        first, begin = self._held, self._received_at
        measured, until = 0.0, self._now() + _LONGEST_TRIAL
        while abs(measured / self.rate - 1.0) > _RATE_ERROR and self._now() < until:  # a computer may stall meanwhile
            self._clock.sleep_until(self._clock.now() + int(_TRIAL * SECOND))
            measured = (self._held - first) / max(self._received_at - begin, 1e-3)
        if abs(measured / self.rate - 1.0) > _RATE_ERROR:
            raise StreamError(
                f"{self._address.said()} announces {self.rate:.6g} Hz and sends {measured:.4g} samples a second",
                do="look at the sensors' modes, and at UPSAMPLE and BACKWARDS COMPATIBILITY of the server",
            )

    def read(self, now: float) -> EmgChunk:
        """See `EmgStream.read`."""
        chunks = []
        while self._chunks:
            chunks.append(self._chunks.popleft())
        return one_chunk(chunks, len(self.channels))

    def lost(self) -> str:
        """See `EmgStream.lost`."""
        return self._lost

    def close(self) -> None:
        """See `EmgStream.close`."""
        self._closing.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        self._chunks.clear()
        self._lost = "it is closed"

    def _run(self, dialogue: TrignoDialogue | None) -> None:
        """The thread: receive, and connect again."""
        tried = -math.inf
        while not self._closing.is_set():
            if dialogue is None:
                self._closing.wait(max(0.0, tried + _GIVE_UP - self._now()))  # a server that drops us is not stormed
                tried = self._now()
                dialogue = self._again()
            else:
                self._receive(dialogue)
                dialogue.close(stop=True)
                dialogue = None
        if dialogue is not None:
            dialogue.close(stop=True)

    def _receive(self, dialogue: TrignoDialogue) -> None:
        """Take samples until the connection ends or is good for nothing."""
        samples = Samples()
        self._anew, self._sense = True, 1.0
        self._block_from, self._block_count = self._now() + _BURST, 0
        dialogue.data.settimeout(_LOOK)
        self._received_at = came = self._now()
        while not self._closing.is_set():
            data = b""
            try:
                data = dialogue.data.recv(1 << 16)
                if not data:
                    self._lost = f"{self._address.said()} has closed its EMG port"
                    return
            except TimeoutError:
                pass
            except OSError as error:
                self._lost = f"the connection to {self._address.said()} broke: {error.strerror or error}"
                return
            now = self._now()
            if data and now - came > SILENCE:
                self._block_from, self._block_count = now + _BURST, 0
            came = now if data else came
            if data and self._take(samples.feed(data), now):
                self._received_at, self._lost, self._sensible = now, "", True
            if now - self._received_at > SILENCE:
                self._lost = self._why_lost(now - came < SILENCE)
            if now - self._received_at > _GIVE_UP:
                return

    def _take(self, sent: NDArray[np.float32], now: float) -> bool:
        """Keep samples that have arrived; whether there is any sense in them."""
        if not len(sent):
            return False
        with np.errstate(invalid="ignore"):
            values = sent[:, self._places].astype(np.float64) * self._factors
            size = np.abs(values)
            known = (size == 0.0) | ((size >= LEAST) & (size <= LARGEST))
        self._sense += (float(known.mean()) - self._sense) * min(1.0, known.size / _JUDGED)
        good = self._sense > 0.5 and self._keeps_rate(len(sent), now)
        values[~known | (not good)] = np.nan
        if self._anew:  # a silence within a connection is lateness, as far as anybody can know: TCP loses nothing
            missing = self._times.gap(now - (len(sent) - 1) / self.rate)
            self._keep(EmgChunk(np.full((len(missing), len(self.channels)), np.nan), missing))
        self._anew = False
        self._keep(EmgChunk(values, self._times.next(len(sent), now, now)))
        return good

    def _keeps_rate(self, count: int, now: float) -> bool:
        """True if as many samples came in the last whole block of time as were announced, `count` of them now."""
        if now < self._block_from:
            return self._kept_rate
        self._block_count += count
        span = now - self._block_from
        if span >= _BLOCK or self._block_count > 2.0 * _BLOCK * self.rate:
            self._measured = self._block_count / max(span, _LOOK)
            self._block_from, self._block_count = now, 0
            self._kept_rate = abs(self._measured / self.rate - 1.0) <= _RATE_ERROR
        return self._kept_rate

    def _why_lost(self, comes: bool) -> str:
        """Why what is there is no stream, given whether anything comes."""
        if not comes:
            return f"nothing comes from {self._address.said()}"
        if self._sense > 0.5 and not self._kept_rate:
            return (
                f"{self._address.said()} announces {self.rate:.6g} Hz and sends {self._measured:.4g} samples a second"
            )
        return f"what comes from {self._address.said()} is no EMG"

    def _keep(self, chunk: EmgChunk) -> None:
        self._chunks.append(chunk)
        self._held += len(chunk.times)
        with contextlib.suppress(IndexError):  # `read` may take the last one meanwhile
            while chunk.times.size and chunk.times[-1] - self._chunks[0].times[-1] > _BUFFER:
                self._chunks.popleft()

    def _again(self) -> TrignoDialogue | None:
        """Try once to connect again."""
        dialogue = None
        try:
            dialogue = TrignoDialogue(self._address, self._clock)
            self._check_same(dialogue.base)
            dialogue.start(again=True)
            return dialogue
        except StreamError as error:
            self._lost = error.what
            if dialogue is not None:
                dialogue.close()
            return None

    def _check_same(self, base: Base) -> None:
        if (base.rate, base.columns) != (self._base.rate, self._base.columns):
            names = ", ".join(column.name for column in base.columns)
            raise StreamError(f"{self._address.said()} has come back as a different one: {names} at {base.rate:.6g} Hz")
