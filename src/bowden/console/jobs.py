"""Work that takes more than an instant, each piece in a process of its own, so that neither page nor run waits for it.

The process gets one JSON document on standard input, keeps it open as a sign that somebody waits, and says lines of
JSON: ``{"progress": [what, share]}``, and at its end ``{"done": …}`` or ``{"error": {"what", "expected", "do"}}``.
"""

import asyncio
import contextlib
import json
import os
import signal
import sys
from collections.abc import Callable
from typing import Any

from bowden.core.errors import BowdenError, ParameterError

_LARGEST = 1 << 24
"""Of a line that a process says [bytes]."""


class Jobs:
    """Starts them, two at a time; what comes then waits."""

    def __init__(self) -> None:
        self._places = asyncio.Semaphore(2)
        self._running: set[asyncio.subprocess.Process] = set()

    async def do(self, work: str, progress: Callable[[str, float], None] | None = None, **given: Any) -> Any:
        """What a piece of work comes to; see `bowden.app.job_process` for what there is.

        Raises:
            BowdenError: what it raised there, or that it died.
        """
        async with self._places:
            words = [sys.executable, "-P", "-m", "bowden.app.job_process"]
            pipe = asyncio.subprocess.PIPE
            process = await asyncio.create_subprocess_exec(
                *words, stdin=pipe, stdout=pipe, start_new_session=True, limit=_LARGEST
            )
            self._running.add(process)
            try:
                return await _listened(process, {"work": work, **given}, progress or (lambda what, share: None))
            finally:
                self._running.discard(process)
                _kill(process)
                await process.wait()

    def close(self) -> None:
        """End all of them."""
        for process in tuple(self._running):
            _kill(process)


def _kill(process: asyncio.subprocess.Process) -> None:
    if process.returncode is None:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)


async def _listened(
    process: asyncio.subprocess.Process, given: dict[str, Any], progress: Callable[[str, float], None]
) -> Any:
    assert process.stdin is not None
    assert process.stdout is not None
    with contextlib.suppress(OSError):  # one that has died already says so itself
        process.stdin.write(json.dumps(given).encode() + b"\n")
        await process.stdin.drain()
    async for line in process.stdout:
        with contextlib.suppress(ValueError, KeyError, TypeError):
            message = json.loads(line)
            if "progress" in message:
                progress(str(message["progress"][0]), float(message["progress"][1]))
            elif "done" in message:
                return message["done"]
            elif "error" in message:
                error = message["error"]
                raise ParameterError(error["what"], expected=error["expected"], do=error["do"])
    raise BowdenError(
        "the work ended without a result", do="look at the terminal that started the console, and try again"
    )
