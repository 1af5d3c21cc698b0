"""``bowden run``: a law on a rig's own drive, live, under the supervisor, with every cycle in a log."""

import contextlib
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bowden.app.command import Command
from bowden.app.console import folder_argument, print_json, say_note, seconds
from bowden.app.given_rig import read_given, shortened
from bowden.app.next_step import free_name, say_next

if TYPE_CHECKING:
    from bowden.live.session import Session


def run(
    rig: Annotated[Path, typer.Argument(help="The rig; bowden init writes one.")],
    law: Annotated[
        str | None, typer.Option(help="A law's name, or FILE.py:NAME of your own, in place of the rig's.")
    ] = None,
    preset: Annotated[str | None, typer.Option(help="A named set of gains of that law.")] = None,
    duration: Annotated[float | None, typer.Option(help="Length of the run in seconds.")] = None,
    axis: Annotated[str | None, typer.Option(help="One axis alone, of a rig with several.")] = None,
    out: Annotated[Path, typer.Option(parser=folder_argument, metavar="FOLDER", help="Folder for the log.")] = Path(
        "out/run"
    ),
    auto: Annotated[bool, typer.Option("--auto", help="Arm and run without keys, once, and end.")] = False,
    twin: Annotated[bool, typer.Option("--twin", help="Start bowden twin as well, on a bus of its own.")] = False,
    channel: Annotated[str | None, typer.Option(help="The bus, in place of the rig's.")] = None,
    emg: Annotated[
        str | None, typer.Option(help="EMG moves the joint: lsl:NAME, trigno:HOST or file:PATH, in place of the rig's.")
    ] = None,
    attended: Annotated[
        bool, typer.Option("--attended", help="Over ssh: somebody at the rig has the emergency stop in hand.")
    ] = False,
    console: Annotated[
        bool, typer.Option("--console", help="Serve a page as well, on which others look on and may stop the run.")
    ] = False,
    foxglove: Annotated[
        int | None, typer.Option(metavar="PORT", help="Serve live data for Foxglove at this port; 0 for a free one.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Run a law that fails the check on the rig.")] = False,
    json: Annotated[
        bool, typer.Option("--json", help="Print one JSON document and nothing else; needs --auto.")
    ] = False,
) -> None:
    """Run a law live: starts stopped; keys arm, run, stop and acknowledge; ends in a controlled release.

    Exit code 0 when the run ended as asked, 1 when a fault or an error ended it or cycles of it are in no log, 2 when
    it could not begin.
    """
    from bowden.face.run import live_session
    from bowden.live.foxglove_process import require
    from bowden.live.operator import ending_signals, operate, refuse_over_ssh, refuse_without_keys
    from bowden.live.summary import document, print_summary

    refuse_without_keys(auto, json)
    if foxglove is not None:
        require(foxglove)
    if console:
        from bowden.console.open import beside  # now: it takes longer than an operator may be silent
    given = shortened(read_given(rig, axis, several=True), duration).with_law(law, preset).on_bus(channel)
    given = given if emg is None else given.with_emg(emg)
    if not twin:
        refuse_over_ssh(given, attended=attended)
    with (
        ending_signals() as ending,
        live_session(given, rig.name, twin=twin, out=out, force=force, tell=say_note, alone=axis or "") as session,
    ):
        if not json:
            say_note(session.live.losses())
        with _live_data(session, foxglove), contextlib.ExitStack() as page:
            if console:
                page.enter_context(beside(session, rig.name, twin=twin, notes=[session.live.losses()]))
            operate(session, ending, auto=auto, quiet=json)
    found = document(session)
    if json:
        print_json(found | {"seconds": seconds()})
    else:
        print_summary(found)
        _say_next(rig, found, law, preset, axis)
    if not found["ended_well"] or found["cycles_logged"] < (found["cycles"] or 0):
        raise typer.Exit(1)


@contextlib.contextmanager
def _live_data(session: "Session", port: int | None) -> Iterator[None]:
    """Serve live data for Foxglove where a port is given."""
    if port is None:
        yield
        return
    from bowden.live.foxglove_process import served

    with served(session.rows.path, port, session.beat) as address:
        print(f"Live data for Foxglove: {address}", file=sys.stderr, flush=True)
        yield


def _say_next(rig: Path, found: dict[str, Any], law: str | None, preset: str | None, axis: str | None) -> None:
    """The export of what has run, of each axis; what ended a run that did not end as asked; a log that is in parts."""
    if found["log_lost"]:
        return
    if not (found["ended_well"] and found["log_whole"]):
        say_next("log", "info" if found["log_whole"] else "recover", found["log"])
        return
    given = (("--law", law), ("--preset", preset))
    options = [word for name, one in given if one is not None for word in (name, one)]
    for one in found.get("axes", [{"name": axis, "law": found["law"]}]):
        of_axis = [] if one["name"] is None else ["--axis", one["name"]]
        folder = Path("firmware", one["law"] if axis == one["name"] else one["name"])
        say_next("export", rig, *options, *of_axis, "--to", free_name(folder))


COMMANDS = (
    Command(
        "run",
        run,
        "Run a law live on a rig's drive, under the supervisor.",
        (
            "bowden run rig.toml",
            "bowden run rig.toml --twin --auto --duration 20",
            "bowden run rig.toml --law bowden",
        ),
        place=60,
    ),
)
