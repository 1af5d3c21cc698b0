"""What tests of whole live runs share: the command, tries on a machine that others use too, a document, replay."""

import contextlib
import io
import json
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np

from bowden.app.main import run
from bowden.hardware.realtime import Settings
from bowden.live.lateness import bare_loop_apart
from bowden.safety.faults import Fault

ROOT = Path(__file__).parents[1]
COMMAND = [sys.executable, "-c", "from bowden.app.main import main; main()"]

_TRIES, _WAITING, _LATE_ONCE, _LATE_IN_ALL = 6, 60.0, 5e-3, 10e-3


def tries() -> Iterator[int]:
    """Numbers of the tries at a run; the test leaves the loop when one came through.

    A machine that is busy with other things stops a run by right. Each try but the first therefore waits until a bare
    loop, which does nothing, is woken in time, or for a minute.
    """
    yield 0
    for number in range(1, _TRIES):
        deadline = time.monotonic() + _WAITING
        while _busy() and time.monotonic() < deadline:
            pass
        yield number


def _busy() -> bool:
    late, _ = bare_loop_apart(0.5, 1e-3, Settings())
    return float(late.max()) > _LATE_ONCE or float(np.sum(late[late > 0.5e-3])) > _LATE_IN_ALL


def pushed_rig() -> str:
    """The rig of docs/admittance.md that follows its wearer's push."""
    text = (ROOT / "docs" / "admittance.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"^`pushed.toml`:\n\n```toml\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)
    return str(block)


def started(rig: Path, out: Path, *options: str) -> "subprocess.Popen[str]":
    """`bowden run`, armed and run by itself, in a session of its own."""
    words = [*COMMAND, "run", str(rig), "--auto", "--json", "--out", str(out), *options]
    return subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True)


class NotBegunError(AssertionError):
    """A run that was refused; with what it said."""


def finished(process: "subprocess.Popen[str]") -> dict[str, Any]:
    """What a run that comes to its end says, as its schema has it."""
    try:
        said, errors = process.communicate(timeout=300.0)
    finally:
        process.kill()
    if not said:
        raise NotBegunError(errors)
    found: dict[str, Any] = json.loads(said)
    schema = json.loads((ROOT / "docs" / "json" / "run.schema.json").read_text(encoding="utf-8"))
    jsonschema.validate(found, schema)
    return found


def finished_well(rig: Path, folder: Path, *options: str) -> dict[str, Any]:
    """What the first run says that comes to its end; one that a late loop does not let begin is a try as well."""
    for number in tries():
        process = started(rig, folder / f"out{number}", *options)
        try:
            found = finished(process)
        except NotBegunError as error:
            if Fault.LATE.meaning not in str(error):
                raise
            found = {"ended_well": False, "error": str(error)}
        if found["ended_well"]:
            break
    assert found["ended_well"], json.dumps(found)
    return found


def assert_replays(log: str, *, pushed: bool = False) -> None:
    """The log replays without a difference; of a drive that is `pushed` by a torque offset, in that too."""
    with contextlib.redirect_stdout(io.StringIO()) as said:
        assert run(["log", "replay", log, "--json"]) == 0
    again = json.loads(said.getvalue())
    assert [again[name] for name in ("wish_largest", "verdicts_differing", "command_largest")] == [0, 0, 0]
    assert again["torque_largest"] == 0.0 if pushed else not again["torque_largest"]
    assert again["law_cycles"] > 1000
