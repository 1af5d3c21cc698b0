"""Processes of this package beside the one that starts them: a module each, which says what happens as lines of JSON.

They are apart from this terminal's signals: what ends one is our word, the end of its standard input, or our death.
"""

import contextlib
import json
import subprocess
import sys
import threading
from collections.abc import Callable
from typing import Any

from bowden.core.errors import BowdenError
from bowden.live.left_behind import sweep

Process = subprocess.Popen[str]


def started(*words: str, stdin: int = subprocess.PIPE, stderr: int | None = subprocess.PIPE) -> Process:
    """``python -m WORDS``.

    Args:
        words: the module and its arguments.
        stdin: its standard input.
        stderr: where its errors go; None for where ours do, of one whose last words nobody reads.
    """
    pipe, command = subprocess.PIPE, [sys.executable, "-P", "-m", *words]
    return subprocess.Popen(command, stdin=stdin, stdout=pipe, stderr=stderr, text=True, start_new_session=True)


def tell(process: Process, text: str) -> None:
    """Write to its standard input; one that has died already says so itself."""
    assert process.stdin is not None
    with contextlib.suppress(OSError):
        process.stdin.write(text)
        process.stdin.flush()


def listen(process: Process, take: Callable[[dict[str, Any] | None], object]) -> threading.Thread:
    """Have a thread take what it says, line by line, and None once nothing comes any more."""

    def listening() -> None:
        assert process.stdout is not None
        for line in process.stdout:
            with contextlib.suppress(ValueError):
                take(json.loads(line))
        take(None)

    thread = threading.Thread(target=listening, daemon=True)
    thread.start()
    return thread


def complaint(process: Process) -> str:
    """The reason that a process gave before it ended."""
    assert process.stderr is not None
    return process.stderr.read().strip().removeprefix("bowden: ")


def last_words(process: Process, patience: float) -> str:
    """The last line of that, or the exit code, of one that ends within a time [s]."""
    code = process.wait(patience)
    return complaint(process).rpartition("\n")[2] or f"exit code {code}"


def end(process: Process, patience: float = 0.0) -> None:
    """Close its standard input, and end it where it lasts longer than that by a time [s]; safe to call twice."""
    with contextlib.suppress(OSError):
        if process.stdin is not None:
            process.stdin.close()
    try:
        process.wait(patience)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    for pipe in (process.stdout, process.stderr):
        if pipe is not None:
            with contextlib.suppress(OSError):  # what nobody reads any more
                pipe.close()


def say(what: str, value: Any) -> None:
    """The process' side: a line of JSON."""
    print(json.dumps({what: value}, ensure_ascii=False), flush=True)


def spoken(run: Callable[[], int], failed: str) -> int:
    """The process' side: the exit code of what it does, whose failure it says, so that its starter learns why.

    Args:
        run: all that it does.
        failed: what is said before the name of an exception of no kind of ours.
    """
    try:
        return run()
    except BowdenError as error:
        say("error", str(error))
    except Exception as error:
        say("error", f"{failed}: {type(error).__name__}: {error}")
        raise
    finally:
        sweep()
    return 2
