"""``bowden league``: every law on every plant in every scenario."""

import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bowden.app.command import Command
from bowden.app.console import InterruptedPartway, folder_argument, print_json, progress_bar, say_note, seconds
from bowden.app.given_rig import read_alone
from bowden.core.files import output_folder

if TYPE_CHECKING:
    from bowden.design.league import Standing

_Names = list[str] | None


def league(
    rig: Annotated[
        Path | None,
        typer.Argument(help="A rig (or a log): all plants get its servo and clock, and its own plant plays too."),
    ] = None,
    laws: Annotated[_Names, typer.Option(help="Only these laws; commas between them, or repeat the option.")] = None,
    plants: Annotated[_Names, typer.Option(help="Only these plants; FILE.py:NAME is one of your own.")] = None,
    scenarios: Annotated[_Names, typer.Option(help="Only these scenarios.")] = None,
    law: Annotated[_Names, typer.Option(help="FILE.py:NAME of your own law, to join the others.")] = None,
    data: Annotated[
        Path, typer.Option(help="Folder with cable/*.csv.gz and elbow/*.csv.gz; without it there are fewer cells.")
    ] = Path("../shared/data"),
    out: Annotated[Path, typer.Option(parser=folder_argument, metavar="FOLDER", help="Folder for the page.")] = Path(
        "out/league"
    ),
    json: Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")] = False,
) -> None:
    """Compare laws, each with one set of gains, on plants for which they were not tuned.

    A plant or scenario that needs a recording is left out where the data folder has none. Ctrl-C ends the league with a
    page of what has been played.
    """
    from bowden.core.files import whole_files
    from bowden.face.league import played
    from bowden.report.league_page import league_page

    given = None if rig is None else read_alone(rig)
    asked = None if laws is None else _asked(laws)
    wanted = {"plants": _asked(plants), "scenarios": _asked(scenarios)}
    with progress_bar(quiet=json) as progress:
        found = played(
            given,
            asked,
            own_laws=law or (),
            **wanted,
            data=data,
            progress=progress,
            begin=lambda: output_folder(out),
        )
    if not json:
        _print_table(found.standings)  # drawing takes a while
    with progress_bar(quiet=json) as progress:
        progress("drawing the page", 1.0)
        page = league_page(found.played, found.standings, found.scenarios, rig=found.rig, interrupted=found.interrupted)
        with whole_files(out) as folder:
            page.write(folder / "league.html")
    for note in found.notes:
        say_note(note)
    if json:
        print_json({"rig": found.rig, "cells": [asdict(cell) for cell in found.cells], "seconds": seconds()})
    else:
        print(f"\nPage: {out / 'league.html'}  ({seconds():.1f} s)")
    if found.interrupted:
        raise InterruptedPartway(f"{len(found.cells)} cells played and written to {out}")


def _asked(wanted: _Names) -> list[str]:
    return [name.strip() for text in wanted or [] for name in text.split(",")]


def _print_table(standings: list["Standing"]) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table

    from bowden.design.league import BASELINE

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("law", no_wrap=True)
    titles = ("cells\nwon", "RMSE\n°", f"over\n{BASELINE}", "chatter", "most\nchatter", "unstable\ncells", "cells")
    for title in titles:
        table.add_column(title, justify="right", no_wrap=True)
    for one in standings:
        values = (one.rmse_deg, one.ratio, one.chatter, one.most_chatter)
        shown = ("–" if value is None else f"{value:.3g}" for value in values)
        table.add_row(one.law, f"{100.0 * one.won:.0f} %", *shown, str(one.unstable), str(one.cells))
    Console(width=None if sys.stdout.isatty() else 100).print(table)


COMMANDS = (
    Command(
        "league",
        league,
        "Compare control laws on plants for which they were not tuned.",
        (
            "bowden league",
            "bowden league --laws adaptive --laws bowden --plants bench --plants play",
            "bowden league --law my_law.py:MINE --scenarios periodic,fast --json",
        ),
        place=90,
    ),
)
