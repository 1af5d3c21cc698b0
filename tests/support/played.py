"""Twins of drives of any family, in a thread of this process."""

import threading
import time
from collections.abc import Sequence
from typing import Any

from bowden.hardware.twin.twin import Twin
from bowden.rig.families import family_of
from support.memory_bus import bench_at


class Played:
    """A drive's twin on its bus; a context manager.

    Args:
        drive: parameters of the family.
        channel: folder of its bus, where that is not the drive's own.
        options: what of it is otherwise, as ``bowden twin --object`` has it.
    """

    def __init__(self, drive: Any, channel: object = None, options: Sequence[str] = ()) -> None:
        drive = drive if channel is None else drive._replace(channel=str(channel))
        self.channel, self.plant = drive.channel, bench_at(time.monotonic())
        self.twin: Twin = family_of(drive).twin(drive, self.plant, time.monotonic, options)  # type: ignore[assignment]
        self._thread = threading.Thread(target=self.twin.run, daemon=True)

    def __enter__(self) -> "Played":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.twin.stop()
        self._thread.join(10.0)
        assert not self._thread.is_alive()
