"""`bowden measure` on a twin of its own goes on where it was after a stall of the computer, and its log is good."""

import contextlib
import json
import os
import signal
import subprocess
import time
from pathlib import Path

import jsonschema
import numpy as np
import pytest

import bowden
from bowden.operations.schema import json_schema
from live_runs import COMMAND, tries
from support.command import Command

pytestmark = [pytest.mark.live, pytest.mark.usefixtures("state")]

STALL = 0.05
"""More than a rig's loop may be late, and than the time after which a drive takes its torque off [s]."""


def children(process: "subprocess.Popen[str]") -> list[int]:
    """The loop and the twin."""
    found = []
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        with contextlib.suppress(OSError):
            words = path.read_text().split("\0")
            parent = (path.parent / "stat").read_text().rpartition(")")[2].split()[1]
            if int(parent) == process.pid and ("twin" in words or "bowden.live.loop_process" in words):
                found.append(int(path.parent.name))
    return found


@pytest.mark.long
def test_a_measurement_on_a_twin_bears_stalls(tmp_path: Path, command: Command) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text("")
    for number in tries():
        out = tmp_path / f"out{number}"
        words = [*COMMAND, "measure", str(rig), "--twin", "--auto", "--json", "--out", str(out)]
        process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        time.sleep(20.0)
        while process.poll() is None:
            both = children(process)
            for signal_ in (signal.SIGSTOP, signal.SIGCONT):
                for child in both:
                    with contextlib.suppress(ProcessLookupError):
                        os.kill(child, signal_)
                time.sleep(STALL if signal_ == signal.SIGSTOP else 6.0)
        said, error = process.communicate()
        if process.returncode == 0:
            break
    assert process.returncode == 0, said + error
    found = json.loads(said)
    jsonschema.validate(found, json_schema("measure"))
    assert found["twin"]
    assert found["cycles_left_out"] >= 1e3 * STALL
    for file in found["files"]:
        time_s = np.loadtxt(file, delimiter=",", skiprows=1, usecols=0)
        np.testing.assert_allclose(np.diff(time_s), 1e-3, atol=1e-7)
    assert bowden.identify(found["files"][0]).trust.level != "no"
    servo = command.document("identify-servo", found["files"][1], "--out", tmp_path / "servo")
    assert servo["natural_frequency_hz"]["value"] == pytest.approx(8.527, rel=0.03)
