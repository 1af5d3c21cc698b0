"""``bowden measure``: move the motor under supervision, and leave logs that identify and identify-servo take."""

import contextlib
import shlex
import sys
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from bowden.app.command import Command
from bowden.app.console import folder_argument, print_json, say_note, seconds
from bowden.app.given_rig import read_given


def measure(
    rig: Annotated[Path, typer.Argument(help="The rig, with its [drive] and [limits].")],
    out: Annotated[Path, typer.Option(parser=folder_argument, metavar="FOLDER", help="Folder for the logs.")] = Path(
        "out/measure"
    ),
    auto: Annotated[bool, typer.Option("--auto", help="Arm, move once and end, without keys.")] = False,
    twin: Annotated[bool, typer.Option("--twin", help="Start bowden twin as well, on a bus of its own.")] = False,
    axis: Annotated[str | None, typer.Option(help="The axis, of a rig with several: one after the other.")] = None,
    channel: Annotated[str | None, typer.Option(help="The bus, in place of the rig's.")] = None,
    attended: Annotated[
        bool, typer.Option("--attended", help="Over ssh: somebody at the rig has the emergency stop in hand.")
    ] = False,
    json: Annotated[
        bool, typer.Option("--json", help="Print one JSON document and nothing else; needs --auto.")
    ] = False,
) -> None:
    """Move the motor through ramps, sines and a chirp within the limits, and write cable.csv and servo.csv.

    No law takes part; the joint follows as the cable lets it. Everything is supervised as in bowden run.
    """
    from bowden.face.run import new_log
    from bowden.live.by_hand import require_confirmed, require_watch, unseen_watch
    from bowden.live.left_behind import await_host
    from bowden.live.live_run import live_run
    from bowden.live.mcap_read import read
    from bowden.live.measured import NEEDED, stalls, write_motions
    from bowden.live.operator import ending_signals, operate, refuse_over_ssh, refuse_without_keys
    from bowden.live.preflight import require
    from bowden.live.session import Session, own_twin, prepared_loop
    from bowden.live.summary import document, print_summary
    from bowden.rig.families import family_of

    refuse_without_keys(auto, json)
    given = read_given(rig, axis).on_bus(channel)
    if not twin:
        refuse_over_ssh(given, attended=attended)
    live = live_run(given, measure=True)
    require(live.limits, live.rig.sample_time, "holds")  # no gains take part
    if not twin:
        await_host(partial(family_of(given.drive).claim, given.drive), say_note)
        require_watch(given)
        require_confirmed(given, axis or "")
    for note in filter(None, (*live.notes, unseen_watch(given))):
        say_note(note)
    with contextlib.ExitStack() as stack:
        ending = stack.enter_context(ending_signals())
        loop = stack.enter_context(prepared_loop())
        if twin:
            live = live_run(
                stack.enter_context(own_twin(given, measure=True, alone=axis or "")), measure=True, logged=given
            )
        session = stack.enter_context(Session(live, new_log(out, "measure"), remembers=not twin, loop=loop))
        if not json:
            say_note(live.losses())
        operate(session, ending, auto=auto, quiet=json)
    session.require_log()
    found = document(session)
    files = write_motions(session.live, session.log, out) if found["ended_well"] else []
    left_out = stalls(read(session.log, NEEDED), session.live.rig.sample_time)
    if json:
        shown = {name: found[name] for name in _KEYS} | {"cycles_left_out": left_out.drawn}
        print_json({**shown, "files": [str(file) for file in files], "seconds": seconds()})
    else:
        print_summary(found)
        if files and left_out.note:
            print(f"bowden: note: {left_out.note}", file=sys.stderr)
    if not files:
        raise typer.Exit(1)
    if not json:
        first, second = (shlex.quote(str(file)) for file in files[:2])
        print(f"Next: bowden identify {first}, and bowden identify-servo {second}")


_KEYS = (
    *("log", "rig", "twin", "ended_well", "mode", "faults", "remedies", "stops", "unattended", "preflight"),
    *("emergencies", "error"),
)
"""What the JSON document says of the run, in addition to its files."""


COMMANDS = (
    Command(
        "measure",
        measure,
        "Move the motor of a rig, and leave logs for identify and identify-servo.",
        (
            "bowden measure rig.toml",
            "bowden measure rig.toml --twin --auto",
        ),
        place=50,
    ),
)
