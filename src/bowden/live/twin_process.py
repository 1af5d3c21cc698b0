"""A twin in a process of its own: for tests, for commands that need one, and as the drive of a run."""

import contextlib
import json
import math
import shlex
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from bowden.core.errors import DriveError, note
from bowden.hardware.twin.control import TwinControl
from bowden.live import child, left_behind
from bowden.rig.declaration import at, items_of
from bowden.rig.families import family_of
from bowden.rig.rig import Rig, RigMotor
from bowden.safety.limits import Limits


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


@contextlib.contextmanager
def own_twin(rig: Rig, *, measure: bool = False, alone: str = "") -> Iterator[Rig]:
    """A twin of the rig on a bus of its own, whatever the rig's is; the rig on that bus, see `relax_twin_limits`.

    Args:
        rig: to be played.
        measure: whether the motor moves through the excitation, in place of a law; the twin waits for a loop then that
            this computer does not let run.
        alone: name of the motor that the rig is, of a file with several; for how the twin is reached.
    """
    from bowden.hardware.buses.opening import UNIX

    with left_behind.bus_of_this() as folder, contextlib.ExitStack() as stack:
        file = rig.origin if Path(rig.origin).suffix else "RIG.toml"
        buses: dict[tuple[str, str], Path] = {}
        motors: dict[str, RigMotor] = {}
        twins: list[RunningTwin] = []
        for joint in rig.each_joint:
            places = [family_of(one.rig.drive).address(one.rig.drive) for one in joint.motors]
            channels = []
            for one, place in zip(joint.motors, places, strict=True):
                bus = (place.get("interface", ""), place.get("channel", one.name))
                channels.append(buses.setdefault(bus, folder / f"{len(buses)}" if rig.motors else folder))
                named = one.name or alone
                options = [*(["--motor", named] if named else []), "--channel", str(channels[-1])]
                options += [] if place.get("interface") == UNIX else ["--interface", UNIX]
                asked = shlex.join(["bowden", "twin", file, *options])
                note(f"the twin's bus is {channels[-1]}: {asked}")
            whole = rig.replace(motors=joint.motors, joints=(joint.settings,)) if joint.shared else joint.first
            twin = stack.enter_context(running_twin(whole, channels[0], ["--interface", UNIX]))
            twins.append(twin)
            if measure:
                twin.control.wait(PATIENCE)
            for one in joint.motors:
                beside = relax_twin_limits(one.rig, measure=measure)
                wider, usual = beside.supervisor_limits, one.rig.supervisor_limits
                allowed = ", ".join(
                    f"{item.key} = {at(wider, item.path):.3g} (in place of {at(usual, item.path):g})"
                    for item in items_of(Limits)
                    if at(wider, item.path) != at(usual, item.path)
                )
                if allowed and not motors:
                    note(f"the twin shares this computer, so it may be late: {allowed} in [limits]")
                motors[one.name] = one._replace(rig=beside.on_bus(twin.channel, UNIX))
        try:
            yield rig.replace(motors=tuple(motors[one.name] for one in rig.motors)) if rig.motors else motors[""].rig
        finally:
            for one in twins:  # the supervisor sees a twin that ended before its run did as a drive that is silent
                if one.process.poll() is not None:
                    last = child.complaint(one.process).rpartition("\n")[2]
                    how = f"with exit code {one.process.returncode}{f': {last}' if last else ''}"
                    note(f"the twin on {one.channel} ended before the run, {how}; begin again, with a new twin")


def relax_twin_limits(rig: Rig, *, measure: bool = False) -> Rig:
    """The rig with the limits of a run on a twin of the command's own.

    This computer plays the drive as well. If it stalls, the twin answers late, which a drive does not; and no motor
    moves meanwhile. So its answers may be as late as the loop itself, `lateness`, and the command may be silent for
    `PATIENCE`. A motion to measure by, which goes on where it was after a stall, may be late as well. A limit that the
    rig sets otherwise than by default stays.

    Args:
        rig: of the run.
        measure: see `own_twin`.
    """
    given, limits, usual, cell = rig.limits, rig.supervisor_limits, Limits()._asdict(), rig.load_cell
    late = math.floor(limits.lateness / rig.sample_time + 1e-9)
    wider: dict[str, Any] = {
        "reading_age": max(limits.reading_age, float(min(late, _OLDEST))),
        "operator_age": PATIENCE,
    }
    if measure:
        wider |= {"reading_age": float(_OLDEST), "lateness": 0.5 * PATIENCE}
        wider |= {"heartbeat_age": 0.6 * PATIENCE, "clock_gap": PATIENCE}
    changed = {
        name: value
        for name, value in wider.items()
        if getattr(given, name) == usual[name] or math.isnan(getattr(given, name))
    }
    if cell.enabled and cell.silence == type(cell)().silence:
        cell = cell._replace(silence=min(late * rig.sample_time, _SILENT))
    return rig.replace(limits=given._replace(**changed), load_cell=cell)


PATIENCE = 1.0
"""How long a run on a twin of the command's own goes on without a sign of life [s]; on hardware `operator_age`."""
_SILENT = 50e-3
"""What the load cell's `silence` may be at most [s]."""
_OLDEST = 50
"""Cycles; what `reading_age` may be at most."""
