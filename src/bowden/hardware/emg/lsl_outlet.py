"""A stream of EMG on the network by the Lab Streaming Layer, as our own inlet and anybody's reads it."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from bowden.core.clock import SECOND, MonotonicClock, TimeSource
from bowden.core.errors import StreamError
from bowden.hardware.emg.lsl_info import library

Array = NDArray[np.float64]

_TICK = SECOND // 250
"""How often a replay sends [ns]."""
_DELIVERY = 2 * SECOND
"""How long a stream that has come to its end is kept for its readers: what is on its way ends with it [ns]."""
_LSL_UNITS = {"µV": "microvolts", "mV": "millivolts", "V": "volts"}
"""As LSL's description of EMG spells them."""

_LOOK = 0.6
"""How long others of the same name are looked for [s]."""


def check_alone(name: str, source: str) -> None:
    """See that there is no stream of this name and source id yet: readers could not distinguish them.

    Raises:
        StreamError: there is one, or liblsl is not there.
    """
    found = library().resolve_bypred(f"name='{name}' and source_id='{source}'", 1, _LOOK)
    if found:
        raise StreamError(
            f"there is an LSL stream {name!r} with the source id {source!r} already, of {found[0].hostname()}",
            do="end it, or choose another --name or --source-id",
        )


class LslOutlet:
    """One stream, from its making to `close`.

    Args:
        name: of the stream.
        rate: samples a second [Hz].
        channels: their names.
        unit: of the values.
        source: its source id, by which readers find it again after it has died.

    Raises:
        StreamError: liblsl is not there, or does not make the stream.
    """

    def __init__(self, name: str, rate: float, channels: Sequence[str], unit: str, source: str) -> None:
        lsl = library()
        try:
            info = lsl.StreamInfo(name, "EMG", len(channels), rate, "double64", source)
            info.desc().append_child_value("manufacturer", "bowden")
            described = info.desc().append_child("channels")
            for channel in channels:
                one = described.append_child("channel")
                one.append_child_value("label", channel)
                one.append_child_value("unit", _LSL_UNITS.get(unit, unit))
                one.append_child_value("type", "EMG")
            self._outlet = lsl.StreamOutlet(info, 0, 10)
        except (RuntimeError, ValueError, OSError) as error:
            raise StreamError(f"the LSL stream {name!r} cannot be made: {error}") from error
        self._clock = lsl.local_clock

    def push(self, values: Array, age: float = 0.0) -> None:
        """Send samples (n, channels); the last was taken `age` seconds ago, the others at the rate before it."""
        if len(values):
            self._outlet.push_chunk(np.ascontiguousarray(values), self._clock() - age)

    def has_readers(self) -> bool:
        """True if anybody reads it."""
        return bool(self._outlet is not None and self._outlet.have_consumers())

    def close(self) -> None:
        """End the stream; safe to call twice."""
        self._outlet = None


def replay(
    outlet: LslOutlet,
    values: Array,
    rate: float,
    loop: bool,
    until: Callable[[], bool],
    progress: Callable[[float], None],
    wait: bool = False,
    clock: TimeSource | None = None,
) -> int:
    """Send samples in real time, each stamped with its place in time; how many were sent.

    After the last one the readers have two seconds to take what is on its way, since LSL drops it when a stream ends.

    Args:
        outlet: where to.
        values: (n, channels).
        rate: samples a second [Hz].
        loop: whether it begins again at its end.
        until: whether to end now.
        progress: called with how much was sent [s].
        wait: whether to begin when somebody reads.
        clock: the pace.
    """
    clock = MonotonicClock() if clock is None else clock
    while wait and not outlet.has_readers() and not until():
        clock.sleep_until(clock.now() + _TICK)
    begin, sent = clock.now(), 0
    while not until() and (loop or sent < len(values)):
        since = (clock.now() - begin) / SECOND
        due = int(since * rate) + 1
        due = due if loop else min(due, len(values))
        while sent < due:
            first = sent % len(values)
            piece = values[first : first + due - sent]
            sent += len(piece)
            outlet.push(piece, since - (sent - 1) / rate)
        progress(sent / rate)
        clock.sleep_until(clock.now() + _TICK)
    end = clock.now() + _DELIVERY
    while outlet.has_readers() and not until() and clock.now() < end:
        clock.sleep_until(clock.now() + _TICK)
    return sent
