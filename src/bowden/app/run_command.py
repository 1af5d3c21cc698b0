"""``bowden run``: a law on a rig's own drive, live, under the supervisor, with every cycle in a log."""

import contextlib
import sys
from pathlib import Path
from typing import Annotated

import typer

from bowden.app.console import folder_argument, output_folder, print_json, seconds
from bowden.app.given_rig import read_given, shortened
from bowden.core.errors import OutputError


def run(
    rig: Annotated[Path, typer.Argument(help="The rig; bowden init writes one.")],
    law: Annotated[
        str | None, typer.Option(help="A law's name, or FILE.py:NAME of your own, in place of the rig's.")
    ] = None,
    preset: Annotated[str | None, typer.Option(help="A named set of gains of that law.")] = None,
    duration: Annotated[float | None, typer.Option(help="Length of the run in seconds.")] = None,
    out: Annotated[Path, typer.Option(parser=folder_argument, metavar="FOLDER", help="Folder for the log.")] = Path(
        "out/run"
    ),
    auto: Annotated[bool, typer.Option("--auto", help="Arm and run without keys, once, and end.")] = False,
    twin: Annotated[bool, typer.Option("--twin", help="Start bowden twin as well, on a bus of its own.")] = False,
    channel: Annotated[str | None, typer.Option(help="The bus, in place of the rig's.")] = None,
    emg: Annotated[
        str | None, typer.Option(help="EMG moves the joint: lsl:NAME, trigno:HOST or file:PATH, in place of the rig's.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Run a law that does not hold on the rig.")] = False,
    json: Annotated[
        bool, typer.Option("--json", help="Print one JSON document and nothing else; needs --auto.")
    ] = False,
) -> None:
    """Run a law live: starts stopped; keys arm, run, stop and acknowledge; ends in a controlled release.

    Exit code 0 when the run ended as asked, 1 when a fault or an error ended it, 2 when it could not begin.
    """
    from bowden.design.verdict import verdicts
    from bowden.hardware.drives.family import family_of
    from bowden.live.emg_ear import Ear
    from bowden.live.live_run import live_run
    from bowden.live.operator import ending_signals, operate, refuse_without_keys
    from bowden.live.preflight import require
    from bowden.live.session import Session, own_twin
    from bowden.live.summary import document, print_summary

    refuse_without_keys(auto, json)
    given = shortened(read_given(rig), duration).with_law(law, preset).on_bus(channel)
    given = given if emg is None else given.with_emg(emg)
    live = live_run(given)
    if not twin:  # another run's bus is told at once; the drive claims it for good
        family_of(given.drive).claim(given.drive)()
    with contextlib.ExitStack() as stack:
        ending = stack.enter_context(ending_signals())
        ear = None if live.emg is None else stack.enter_context(contextlib.closing(Ear(given)))
        checked = verdicts(given, [live.law], rig.name, force=force)
        pushing = live.pushing.notes([live.law], force=force) if live.pushing else []
        for note in (*live.notes, *pushing, *(verdict.note for verdict in checked if verdict.note)):
            print(f"bowden: note: {note}", file=sys.stderr)
        require(live.limits, live.rig.sample_time, "little_margin" if force else checked[0].name or "little_margin")
        if ear is not None:
            ear.await_ready()  # a stream that cannot be used is told before anything else is started
        if twin:
            live = live_run(stack.enter_context(own_twin(given)))
        session = stack.enter_context(Session(live, new_log(out, live.law.name), ear, remembers=not twin))
        operate(session, ending, auto=auto, quiet=json)
    found = document(session)
    if json:
        print_json(found | {"seconds": seconds()})
    else:
        print_summary(found)
    if not found["ended_well"]:
        raise typer.Exit(1)


def new_log(folder: Path, name: str) -> Path:
    """A name for a log that is not taken yet, in a folder that is there.

    Raises:
        OutputError: the folder cannot be made or written.
    """
    output_folder(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"cannot make the folder {folder}: {error.strerror}", do="choose another one") from error
    number = 1
    while (path := folder / f"{name}-{number}.mcap").exists():
        number += 1
    return path
