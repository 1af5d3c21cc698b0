"""Listening to one channel of a stream for a while."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from bowden.core.clock import SECOND, MonotonicClock, TimeSource
from bowden.core.errors import StreamError
from bowden.hardware.ports import EmgStream
from bowden.identify.emg.log import check_signal

Array = NDArray[np.float64]


def listen(
    stream: EmgStream,
    channel: str,
    lasting: float,
    progress: Callable[[float], None],
    check: bool = True,
    clock: TimeSource | None = None,
) -> Array:
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
