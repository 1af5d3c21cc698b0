"""A twin in a process of its own, for tests and for commands that need one."""

import contextlib
import json
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from bowden.core.errors import DriveError
from bowden.hardware.twin.control import TwinControl
from bowden.rig.rig import Rig


class RunningTwin(NamedTuple):
    """A twin that runs."""

    process: subprocess.Popen[str]
    channel: str
    """Of its bus."""
    control: TwinControl
    said: Mapping[str, Any]
    """What `bowden twin --json` says once it runs."""


@contextlib.contextmanager
def running_twin(rig: Path | Rig, channel: Path, options: Sequence[str] = ()) -> Iterator[RunningTwin]:
    """Start `bowden twin` and end it afterwards, whatever happens.

    Args:
        rig: a rig, which is handed on as it is, or the path of a rig.toml.
        channel: folder of its bus; made if need be.
        options: further ones of the command.

    Raises:
        DriveError: it does not start; with what it said.
    """
    command = [
        sys.executable,
        "-P",
        "-c",
        "from bowden.app.main import main; main()",
        "twin",
        str(rig) if isinstance(rig, Path) else "-",
        "--json",
    ]
    command += ["--until-orphaned"]
    process = subprocess.Popen(
        [*command, "--channel", str(channel), *options],
        stdin=subprocess.DEVNULL if isinstance(rig, Path) else subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,  # Ctrl-C is for the run, which still needs a drive to release the cable
    )
    try:
        if isinstance(rig, Rig):
            assert process.stdin is not None
            with contextlib.suppress(OSError):  # one that has died already says so itself
                process.stdin.write(rig.pack().decode())
                process.stdin.close()
            process.stdin = None  # so that `communicate` leaves it alone
        assert process.stdout is not None
        assert process.stderr is not None
        lines = []
        for line in process.stdout:
            lines.append(line)
            if line.rstrip() == "}":
                break
        else:
            raise DriveError(f"bowden twin did not start: {process.stderr.read().strip()}")
        said = json.loads("".join(lines))
        with TwinControl(Path(said["control"])) as control:
            yield RunningTwin(process, str(channel), control, said)
    finally:
        process.terminate()
        try:
            process.communicate(timeout=10.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()
