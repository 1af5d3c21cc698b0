"""The process that reads EMG for the loop, which `live_session` starts: a stream in, a few words of shared memory out.

It says what happens as lines of JSON on standard output: ``ready`` once the stream is open and everything is compiled,
or ``error``. It listens from the word ``go`` on its standard input on, so that a recording begins with the loop, and
ends when that input is closed.
"""

import contextlib
import json
import os
import select
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bowden.live.child import say, spoken

if TYPE_CHECKING:
    from bowden.rig.emg_run import EmgRun

_CLOSED = ""
"""What a closed input says."""
_PRIORITY = 10
"""Of SCHED_FIFO; the twin has 20, the loop 80 [–]."""
_LOOK = 0.002
"""Between two looks at the stream [s]."""


def main() -> int:
    """``python -m bowden.live.intent_process``; the first line of its standard input is JSON: rig and block."""
    given = json.loads(sys.stdin.readline())
    return spoken(lambda: _run(given), "reading EMG failed")


def _run(given: dict[str, Any]) -> int:
    from bowden.core.clock import SECOND, MonotonicClock
    from bowden.hardware.emg.intent_block import IntentWriter
    from bowden.hardware.emg.listener import Listener
    from bowden.hardware.emg.recorded import columns
    from bowden.hardware.emg.sources import open_source
    from bowden.hardware.ports import EmgChunk
    from bowden.rig.emg_run import check_recording
    from bowden.rig.rig import Rig

    clock, run = MonotonicClock(), Rig.unpack(given["rig"]).emg_run
    assert run is not None
    check_recording(run)
    stream = open_source(run.source, run.wanted)
    try:
        what = stream.open()
        flexor, extensor = columns(run, stream)
        listener = Listener(stream.rate, flexor, extensor, run.wearer, run.detector)
        listener.take(EmgChunk(np.zeros((2, len(stream.channels))), np.zeros(2)), 0.0)  # compiles
        listener = Listener(stream.rate, flexor, extensor, run.wearer, run.detector)
        block = IntentWriter(Path(given["block"]))
        lasts, lost = _lasts(run), ""
        _raise_priority()
        say("ready", {"stream": what, "unit": stream.unit, "channel": stream.channels[flexor]})
        while (word := _word(_LOOK)) is None:
            if lasts is None:
                stream.read(clock.now() / SECOND)  # what comes before the loop is there is not kept
        now = clock.now() / SECOND
        ends = 0 if lasts is None else round((now + lasts) * SECOND)
        while word != _CLOSED:
            said = listener.take(stream.read(now), now)
            block.write(said._replace(ends=ends, looked=clock.now()))
            if stream.lost() != lost:
                lost = stream.lost()
                say("lost", lost)
            word, now = _word(_LOOK), clock.now() / SECOND
        return 0
    finally:
        stream.close()


def _raise_priority() -> None:
    """Run under SCHED_FIFO where that is allowed, the stream's own threads too: below loop and twin, above all else.

    A computer with much else to do would otherwise starve the stream for longer than `emg_age` now and then.
    """
    with contextlib.suppress(OSError):
        for thread in Path("/proc/self/task").iterdir():
            os.sched_setscheduler(int(thread.name), os.SCHED_FIFO, os.sched_param(_PRIORITY))


def _lasts(run: "EmgRun") -> float | None:
    """Length of a recording [s]; None of a stream."""
    from bowden.identify.emg.log import read_channels

    kind, _, path = run.source.partition(":")
    if kind != "file":
        return None
    found = read_channels(Path(path), run.wanted)
    return len(found.values) / found.rate


def _word(seconds: float) -> str | None:
    """What standard input says within that time: nothing, ``go``, or `_CLOSED`."""
    return sys.stdin.readline() if select.select([sys.stdin], [], [], seconds)[0] else None


if __name__ == "__main__":
    sys.exit(main())
