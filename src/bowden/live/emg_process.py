"""The process that reads EMG, from the operator's side: started, listened to, ended."""

import contextlib
import json
import queue
import subprocess
import sys
import threading
from typing import Any

from bowden.core.errors import StreamError
from bowden.hardware.emg import intent_block
from bowden.live import left_behind
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
        given = json.dumps({"rig": rig.document(), "block": str(self.block)})
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", "bowden.live.intent_process"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,  # Ctrl-C is for the run, which still needs its EMG to end well
        )
        assert self._process.stdin is not None
        with contextlib.suppress(OSError):  # one that has died already says so itself
            self._process.stdin.write(f"{given}\n")
            self._process.stdin.flush()
        threading.Thread(target=self._listen, daemon=True).start()

    def _listen(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            with contextlib.suppress(ValueError):
                said = json.loads(line)
                self.lost = said.get("lost", self.lost)
                self._said.put(said)
        self._said.put({})

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
            raise StreamError(said.get("error") or f"the process that reads EMG ended: {self._last_words()}")
        ready = said["ready"]
        self.stream, self.channel, self.unit = ready["stream"], ready["channel"], ready["unit"]

    def _last_words(self) -> str:
        assert self._process.stderr is not None
        code = self._process.wait(_END)
        lines = self._process.stderr.read().strip().splitlines()
        return lines[-1] if lines else f"exit code {code}"

    def go(self) -> None:
        """Let it begin to listen."""
        assert self._process.stdin is not None
        with contextlib.suppress(OSError):
            self._process.stdin.write("go\n")
            self._process.stdin.flush()

    def close(self) -> None:
        """End it, and give its memory back; safe to call twice."""
        process = self._process
        with contextlib.suppress(OSError):
            if process.stdin is not None:
                process.stdin.close()
        try:
            process.wait(_END)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        for pipe in (process.stdout, process.stderr):
            if pipe is not None:
                pipe.close()
        self.block.unlink(missing_ok=True)
