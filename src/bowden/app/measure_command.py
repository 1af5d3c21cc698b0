"""``bowden measure``: move the motor under supervision, and leave logs that identify and identify-servo take."""

import contextlib
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bowden.app.console import folder_argument, print_json, seconds
from bowden.core.errors import SafetyError
from bowden.core.files import whole_files

if TYPE_CHECKING:
    from bowden.app.live_session import Session


def measure(
    rig: Annotated[Path, typer.Argument(help="The rig, with its [drive] and [limits].")],
    out: Annotated[Path, typer.Option(parser=folder_argument, metavar="FOLDER", help="Folder for the logs.")] = Path(
        "out/measure"
    ),
    auto: Annotated[bool, typer.Option("--auto", help="Arm and move without keys, once, and end.")] = False,
    twin: Annotated[bool, typer.Option("--twin", help="Start bowden twin as well, on a bus of its own.")] = False,
    channel: Annotated[str | None, typer.Option(help="The bus, in place of the rig's.")] = None,
    json: Annotated[
        bool, typer.Option("--json", help="Print one JSON document and nothing else; needs --auto.")
    ] = False,
) -> None:
    """Move the motor through ramps, sines and a chirp within the limits, and write cable.csv and servo.csv.

    No law takes part; the joint follows as the cable lets it. Everything is supervised as in bowden run.
    """
    from bowden.app.compose_live import Asked, compose_live
    from bowden.app.live_session import Session, own_twin
    from bowden.app.live_summary import document, print_summary
    from bowden.app.operator import operate, refuse_without_keys
    from bowden.app.run_command import new_log
    from bowden.hardware.buses import UNIX
    from bowden.runtime.preflight import require

    refuse_without_keys(auto, json)
    asked = Asked(rig, channel=channel, measure=True)
    live = compose_live(asked)
    require(live.limits, live.drive.sample_time, "holds")  # no gains take part
    for note in live.setup.notes:
        print(f"bowden: note: {note}", file=sys.stderr)
    with contextlib.ExitStack() as stack:
        if twin:
            asked = replace(asked, channel=stack.enter_context(own_twin(rig, None)), interface=UNIX)
            live = compose_live(asked)
        session = stack.enter_context(Session(asked, live, new_log(out, "measure")))
        operate(session, auto=auto, quiet=json)
    found = document(session)
    if not found["ended_well"]:
        print_summary(found)
        raise typer.Exit(1)
    files = _write(session, out)
    if json:
        print_json({"log": found["log"], "files": [str(file) for file in files], "seconds": seconds()})
    else:
        print_summary(found)
        print(f"Next: bowden identify {files[0]}, and bowden identify-servo {files[1]}")


def _write(session: "Session", folder: Path) -> list[Path]:
    """The cable's and the servo's part of the excitation as CSV."""
    import numpy as np

    from bowden.runtime.cycle import Source
    from bowden.runtime.mcap_read import read
    from bowden.safety.supervisor import Mode

    log = read(session.log)
    moving = np.flatnonzero((log["source"] == Source.MOTION) & (log["mode"] == Mode.RUNNING))
    last, wanted = len(session.live.table) - 1, len(session.live.table)
    passed = np.cumsum(1.0 + log["overruns"][moving])  # periods, skipped ones too
    place = last - (passed[-1] - passed) if len(moving) else passed  # in the table; before it is the approach
    if not len(moving) or place[0] > 0.0:
        raise SafetyError(
            f"the motion was stopped after {int(passed[-1]) if len(moving) else 0} of {wanted} cycles",
            do="let it run to its end; the log so far is kept",
        )
    servo = session.live.servo_from
    parts = {"cable.csv": moving[(place >= 0.0) & (place < servo)], "servo.csv": moving[place >= servo]}
    with whole_files(folder) as stage:
        for name, rows in parts.items():
            # even in time: a cycle that was skipped on this computer is drawn in between its neighbours
            time = log["time"][rows]
            even = np.arange(time[0], time[-1], session.live.drive.sample_time)
            columns = [np.interp(even, time, log[key][rows]) for key in ("command", "motor", "joint")]
            table = np.column_stack([even - even[0], *columns])
            np.savetxt(stage / name, table, "%.9g", ",", header="time_s,command_rad,motor_rad,joint_rad", comments="")
    return [folder / name for name in parts]
