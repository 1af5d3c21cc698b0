"""Twins of serial servos on a line, in a thread of this process."""

import threading
import time
from typing import Any

from bowden.hardware.drives.on_can import place
from bowden.hardware.twin.twin import Twin
from support.memory_bus import NODES, bench_at


class Line:
    """A twin on a pseudo terminal; a context manager.

    Args:
        drive: parameters of the family.
        channel: folder of its bus.
    """

    def __init__(self, drive: Any, channel: str) -> None:
        drive = drive._replace(channel=channel)
        self.twin = Twin(
            place(drive),
            drive.node_id,
            time.monotonic,
            lambda send, note: NODES[drive.family](drive, bench_at(time.monotonic()), send, note),
        )
        self._thread = threading.Thread(target=self.twin.run, daemon=True)

    def __enter__(self) -> "Line":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.twin.stop()
        self._thread.join()

    def wait(self, seconds: float) -> None:
        """Let time pass [s]."""
        time.sleep(seconds)
