"""EMG from the Lab Streaming Layer: an inlet that never waits once it is open, with times of this computer's clock.

A sample's stamp is the sender's; liblsl's time correction takes it to this computer's LSL clock, and an offset that is
measured once to its monotonic clock; `SampleTimes` takes the jitter out. A silence in the stamps becomes missing
samples (NaN), at most a second of them. liblsl finds a stream that has died again by its source id.

Nothing on the network says who it is. What can be noticed is: stamps that are none, of the future, or of a time that
is over; a rate that is not kept; a second stream of the name; a stream that comes back from another computer. Such a
stream is lost, and nothing of it is handed on, until it is in order again.
"""

import contextlib
import math
from collections import deque
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.clock import SECOND, MonotonicClock, TimeSource
from bowden.core.errors import StreamError, counted
from bowden.hardware.emg.lsl_info import channel_names, check_info, library, shown, unit_of, which
from bowden.hardware.emg.sample_times import SampleTimes
from bowden.hardware.ports import EmgChunk, one_chunk
from bowden.identify.emg.log import largest

SILENCE = 0.25
"""A stream that has sent nothing for this long is lost, and a gap in its stamps of more is filled [s]."""
_OTHERS = 0.6
"""How long others of the same name are looked for [s]."""
_ANSWER = 5.0
"""How long a stream that was found may take to answer about itself and its clock [s]."""
_TRIAL, _LONGEST_TRIAL = 0.5, 3.0
"""What comes in this time shows whether the rate is what was said; the longer one where it does not at first [s]."""
_RATE_ERROR = 0.1
"""How far it may be off."""
_CORRECTIONS = 5
"""The median of this many of liblsl's estimates of the sender's clock is taken: a busy computer spoils single ones."""
_OFF = 10.0
"""Stamps that are further off when the stream is opened are of another clock [s]."""
_AHEAD = SILENCE
"""Stamps that are further in the future are of no sample that has been taken [s]."""
_BLOCK = 3.0
"""The rate is counted over this time; what stamps may be late by, `SILENCE`, is less than a tenth of it [s]."""
_LOOK = 1.0
"""How often it is looked for a second stream of the name, and what is wrong is said again [s]."""
_FORGET = 3.0
"""A stream that has gone is still listed for this long; two that are listed for longer are two [s]."""
_BUFFER = 10
"""What liblsl keeps of samples that are not read [s]."""
_MOST = 8192
"""Samples taken in one look."""


_LEAST = float(np.finfo(np.float64).tiny)
"""A smaller number, but 0, is no sample."""

Array = NDArray[np.float64]


class _Block(NamedTuple):
    """Over what the rate is counted."""

    first: float = math.nan
    """When its first sample was taken [s]."""
    last: float = math.nan
    """And its last until now [s]."""
    samples: int = 0
    rate: float = 0.0
    """Of the block before [Hz]."""


class LslStream:
    """One stream of EMG on the network; see `bowden.hardware.ports.EmgStream`.

    Args:
        name: of the stream.
        source: its source id, where there may be several of one name.
        wanted: names of channels that it must have.
        wait: how long to look for it, and then for its first samples [s].
        clock: the monotonic clock that times are given in.
    """

    def __init__(
        self,
        name: str,
        source: str = "",
        wanted: Sequence[str] = (),
        wait: float = 5.0,
        clock: TimeSource | None = None,
    ) -> None:
        self.rate, self.channels, self.unit = 0.0, tuple[str, ...](), ""
        self._name, self._source, self._wanted, self._wait = name, source, tuple(wanted), wait
        self._clock = MonotonicClock() if clock is None else clock
        self._inlet: Any = None
        self._gone: type[Exception] = RuntimeError
        self._lost = "it is not open"
        self._corrections: deque[float] = deque(maxlen=_CORRECTIONS)
        self._offset = self._correction = 0.0
        self._first = self._last = self._came_at = self._said_at = -math.inf
        self._kept: list[EmgChunk] = []
        self._counted = 0
        self._others: Any = None
        self._host, self._looked_at, self._two_since, self._another = "", 0.0, math.inf, ""
        self._known, self._other_channels = set[str](), ""

    def open(self) -> str:
        """See `EmgStream.open`."""
        lsl = library()
        found = self._resolve(lsl)
        self._gone = lsl.util.LostError
        self._inlet = lsl.StreamInlet(found, max_buflen=_BUFFER, recover=bool(found.source_id()))
        try:
            info = self._inlet.info(_ANSWER)
            check_info(info, self._name)
            self.channels = channel_names(info, self._wanted)
            self.rate, self.unit = info.nominal_srate(), unit_of(info)
            self._most = largest(self.unit)
            self._times, self._block = SampleTimes(self.rate), _Block(rate=self.rate)
            self._inlet.open_stream(_ANSWER)
            self._correct(self._inlet.time_correction(_ANSWER))
            ours, theirs = min((self._now(), lsl.local_clock()) for _ in range(3))
            self._offset = ours - theirs
            self._listen()
            self._host, self._known = found.hostname(), {found.uid()}
            self._others = lsl.ContinuousResolver(pred=self._where(), forget_after=_FORGET)
        except StreamError:
            self.close()
            raise
        except RuntimeError as error:  # all of liblsl's own
            self.close()
            raise StreamError(
                f"the LSL stream {self._name!r} does not answer: {error}", do="look at its sender, and at the network"
            ) from error
        return (
            f"LSL stream {self._name!r} ({shown([found.source_id() or 'no source id'])}) of {shown([self._host])}: "
            f"{counted(len(self.channels), 'channel')}, {self.rate:g} Hz, {self.unit or 'no unit'}"
        )

    def _now(self) -> float:
        return self._clock.now() / SECOND

    def _where(self) -> str:
        """What is looked for, as liblsl takes it."""
        return " and ".join([f"name='{self._name}'"] + ([f"source_id='{self._source}'"] if self._source else []))

    def _resolve(self, lsl: Any) -> Any:
        """The one stream that is meant."""
        if "'" in self._name + self._source:
            raise StreamError(f"an LSL stream {self._name!r} cannot be looked for", expected="a name without quotes")
        where = self._where()
        if not lsl.resolve_bypred(where, 1, self._wait):
            there = lsl.resolve_streams(_OTHERS)
            if not any(info.name() == self._name and self._source in ("", info.source_id()) for info in there):
                raise StreamError(
                    f"no LSL stream {self._said()} in {self._wait:g} s; there "
                    f"{_there(sorted({info.name() for info in there}))}",
                    do="start its sender, or check the network (bowden doctor lists streams)",
                )
        found = lsl.resolve_bypred(where, 2, _OTHERS) or lsl.resolve_bypred(where, 1, self._wait)
        if len(found) > 1:
            sources = shown([f"{info.source_id() or 'no id'} of {info.hostname()}" for info in found])
            raise StreamError(
                f"{len(found)} LSL streams are named {self._said()}: {sources}",
                do=which(self._name, [info.source_id() for info in found]),
            )
        if not found:
            raise StreamError(f"the LSL stream {self._said()} has gone", do="look at its sender")
        return found[0]

    def _said(self) -> str:
        return repr(self._name) + (f" with the source id {self._source!r}" if self._source else "")

    def _listen(self) -> None:
        """Wait for the first samples, and see whether they come at the rate that was said; they are kept."""
        until, trial = self._now() + self._wait, math.inf
        while self._now() < until and not (self._now() > trial and self._keeps_rate()):
            chunk = self.read(self._now())
            if len(chunk.times):
                self._check_clock()
                if trial == math.inf:
                    trial, until = self._now() + _TRIAL, self._now() + _LONGEST_TRIAL
                self._kept, self._counted = [chunk], len(chunk.times)
            self._clock.sleep_until(self._clock.now() + SECOND // 100)
        if not self._kept:
            if self._came_at > -math.inf:
                raise StreamError(self._lost, do="look at its sender")
            raise StreamError(
                f"the LSL stream {self._name!r} is there, but sends nothing in {self._wait:g} s",
                do="start its recording",
            )
        if not self._keeps_rate():
            raise StreamError(
                f"the LSL stream {self._name!r} declares {self.rate:g} Hz and sends {self._measured():.4g} samples a "
                "second",
                expected="a stream that keeps its rate",
            )

    def _measured(self) -> float:
        """Samples a second since the first, by their stamps [Hz]."""
        span = self._last - self._first
        return (self._counted - 1) / span if span > 0.0 else 0.0

    def _keeps_rate(self) -> bool:
        return abs(self._measured() / self.rate - 1.0) <= _RATE_ERROR

    def _correct(self, estimate: float) -> None:
        """Take liblsl's latest estimate of the sender's clock into account."""
        if not self._corrections or estimate != self._corrections[-1]:
            self._corrections.append(estimate)
            self._correction = float(np.median(self._corrections))

    def _check_clock(self) -> None:
        """See that stamps are of LSL's clock, as its senders agree on."""
        off = self._first - self._now()
        if abs(off) > _OFF:
            raise StreamError(
                f"the stamps of the LSL stream {self._name!r} are {off:.3g} s off this computer's clock",
                expected="stamps of LSL's local_clock",
                do="let its sender use that clock for its stamps, or send none",
            )

    def read(self, now: float) -> EmgChunk:
        """See `EmgStream.read`."""
        chunks, self._kept = self._kept, []
        if self._inlet is not None:
            chunks.extend(self._pull(now))
        return one_chunk(chunks, len(self.channels))

    def _pull(self, now: float) -> list[EmgChunk]:
        try:
            values, stamps = self._inlet.pull_chunk(0.0, max_samples=_MOST, as_numpy=True)
        except self._gone:  # liblsl finds streams again by their source id alone
            self._lost = f"the sender of {self._name!r} has ended; it has no source id by which it could be found again"
            self._inlet = None
            return []
        with contextlib.suppress(RuntimeError):  # there is none for a moment after a stream has come back
            self._correct(self._inlet.time_correction(0.0))
        if len(stamps) and now - self._came_at > SILENCE:
            self._looked_at = -math.inf  # who comes back is looked at before anything of it is believed
        self._look_for_others(now)
        if not len(stamps):
            if now - self._came_at > SILENCE:
                self._lost = f"nothing from the LSL stream {self._name!r} for {1e3 * SILENCE:g} ms"
            return []
        self._came_at = now
        at = stamps + self._correction + self._offset
        wrong = self._wrong_stamps(at, now) or self._wrong_rate(at) or self._another
        if wrong:
            self._corrections.clear()  # it may be another sender, of another clock
            if not self._lost or now > self._said_at + _LOOK:  # its figures change all the time
                self._lost, self._said_at = f"the LSL stream {self._name!r} {wrong}", now
            return []
        values = values.astype(np.float64)
        size = np.abs(values)
        values[~((size <= self._most) & ((size == 0.0) | (size >= _LEAST)))] = np.nan
        if not math.isfinite(self._last):
            self._first = float(at[0])
        chunks, begin = [], 0
        for after in [*np.flatnonzero(np.diff(at, prepend=self._last) > SILENCE), len(at)]:
            if after > begin:
                times = self._times.next(int(after) - begin, float(at[after - 1]), now)
                chunks.append(EmgChunk(values[begin:after], times))
            if after < len(at) and math.isfinite(self._last):
                self._corrections.clear()
                missing = self._times.gap(float(at[after]), now)
                chunks.append(EmgChunk(np.full((len(missing), values.shape[1]), np.nan), missing))
            begin = int(after)
        self._last, self._lost = float(at[-1]), ""
        return chunks

    def _wrong_stamps(self, at: Array, now: float) -> str:
        """What is wrong with the times (n,) at which samples were taken by their stamps [s], in words."""
        if not np.isfinite(at).all():
            return "sends stamps that are no numbers"
        back = -float(np.diff(at, prepend=self._last).min())
        if back > SILENCE:
            return f"sends stamps that go back by {back:.3g} s"
        ahead = float(at.max()) - now
        return f"sends stamps that are {ahead:.3g} s in the future" if ahead > _AHEAD else ""

    def _wrong_rate(self, at: Array) -> str:
        """Whether the rate was not kept over the last whole block of samples or of their times, in words."""
        if not abs(float(at[0]) - self._block.last) <= SILENCE:
            self._block = self._block._replace(first=float(at[0]), samples=0)
        block = self._block = self._block._replace(last=float(at[-1]), samples=self._block.samples + len(at))
        span = block.last - block.first
        if span >= _BLOCK or block.samples >= (1.0 + 2.0 * _RATE_ERROR) * _BLOCK * self.rate:
            self._block = _Block(block.last, block.last, 0, block.samples / max(span, 1.0 / self.rate))
        if abs(self._block.rate / self.rate - 1.0) <= _RATE_ERROR:
            return ""
        return f"declares {self.rate:g} Hz and sends {self._block.rate:.4g} samples a second"

    def _look_for_others(self, now: float) -> None:
        """See whether the stream is still the only one of its name, and of the computer that it was found on."""
        if self._others is None or now < self._looked_at + _LOOK:
            return
        self._looked_at = now
        there = self._others.results()
        hosts = [info.hostname() for info in there]
        for info in there:
            if info.uid() not in self._known:
                self._look_at_channels(info)
        self._two_since = min(self._two_since, now) if len(hosts) > 1 else math.inf
        self._another = ""
        if now - self._two_since > _FORGET:
            self._another = f"shares its name and source with another one, of {shown(hosts)}"
        elif hosts and self._host not in hosts:
            self._another = f"has come back from another computer, {shown(hosts)}"
        self._another = self._another or self._other_channels

    def _look_at_channels(self, info: Any) -> None:
        """See whether a sender that has begun anew says the same of its channels; liblsl finds it again unasked.

        This waits for its answer; the stream is old meanwhile, as one is that nobody reads.
        """
        inlet = library().StreamInlet(info, recover=False)
        try:
            channels = channel_names(inlet.info(_LOOK))
        except (StreamError, RuntimeError):  # it has gone again, or is none: the next look finds out
            return
        finally:
            inlet.close_stream()
        self._known.add(info.uid())
        same = channels == self.channels
        self._other_channels = "" if same else f"has come back with other channels, {shown(channels)}"

    def lost(self) -> str:
        """See `EmgStream.lost`."""
        return self._lost

    def close(self) -> None:
        """See `EmgStream.close`."""
        if self._inlet is not None:
            self._inlet.close_stream()
        self._inlet, self._others, self._kept, self._lost = None, None, [], "it is closed"


def _there(names: Sequence[str]) -> str:
    return f"{'is' if len(names) == 1 else 'are'} {', '.join(map(repr, names))}" if names else "is none at all"
