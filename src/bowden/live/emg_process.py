"""The process that reads EMG, from the operator's side: started, listened to, ended."""

import json
import queue
from typing import Any

from bowden.core.errors import StreamError
from bowden.hardware.emg import intent_block
from bowden.live import child, left_behind
from bowden.live.ring import FOLDER
from bowden.rig.rig import Rig

_START = 300.0
"""A process that has not said anything after this has failed; a slow computer compiles for a minute at first [s]."""
_END = 5.0
"""From the request to end to the process' end [s]."""


class EmgProcess:
    """A process that reads EMG.

    Args:
        rig: that EMG moves.
    """

    def __init__(self, rig: Rig) -> None:
        self.block = FOLDER / f"{left_behind.name_of_this()}.intent"
        """Where its words go; removed by `close`."""
        self.stream = self.channel = self.unit = self.lost = ""
        """`lost` is why nothing comes any more; empty while the stream is alive."""
        self._said: queue.Queue[dict[str, Any]] = queue.Queue()
        intent_block.create(self.block)
        self._process = child.started("bowden.live.intent_process")
        child.tell(self._process, json.dumps({"rig": rig.document(), "block": str(self.block)}) + "\n")
        child.listen(self._process, self._take)

    def _take(self, said: dict[str, Any] | None) -> None:
        self.lost = (said or {}).get("lost", self.lost)
        self._said.put(said or {})

    def await_ready(self) -> None:
        """Wait until the stream is open.

        Raises:
            StreamError: it cannot be opened, or is not what was asked for.
        """
        try:
            said = self._said.get(timeout=_START)
        except queue.Empty:
            raise StreamError(f"the process that reads EMG did not answer for {_START:g} s") from None
        if "ready" not in said:
            ended = "the process that reads EMG ended"
            raise StreamError(said.get("error") or f"{ended}: {child.last_words(self._process, _END)}")
        ready = said["ready"]
        self.stream, self.channel, self.unit = ready["stream"], ready["channel"], ready["unit"]

    def go(self) -> None:
        """Let it begin to listen."""
        child.tell(self._process, "go\n")

    def close(self) -> None:
        """End it, and give its memory back; safe to call twice."""
        child.end(self._process, _END)
        self.block.unlink(missing_ok=True)
