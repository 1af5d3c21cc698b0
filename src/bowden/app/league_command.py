"""``bowden league``: every law on every plant in every scenario."""

import sys
from collections.abc import Callable, Mapping
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bowden.app.console import InterruptedPartway, folder_argument, print_json, progress_bar, seconds
from bowden.core.files import output_folder

if TYPE_CHECKING:
    from bowden.control.law import Law
    from bowden.design.league import Played, Standing
    from bowden.design.league_cells import LeaguePlant, LeagueScenario

_Names = list[str] | None


def league(
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
    """Compare laws, each with one set of gains, on plants that nobody tuned them for.

    A plant or scenario that needs a recording is left out where the data folder has none. Ctrl-C ends the league with a
    page of what has been played.
    """
    from bowden.control import user_law
    from bowden.core.files import whole_files
    from bowden.design import league as design
    from bowden.report.league_page import league_page

    entered = _laws(laws, law or [])
    makers, notes = _plants(data)
    makers |= _own_plants(plants)
    played_in, more = _scenarios(data)
    chosen = _chosen("plant", makers, plants)
    motions = _chosen("scenario", played_in, scenarios)
    output_folder(out)
    played: list[Played] = []
    interrupted = False
    with progress_bar(quiet=json) as progress:
        try:
            for cell in design.play(entered, chosen, motions, progress, guard=user_law.explained):
                played.append(cell)
        except KeyboardInterrupt:
            interrupted = True
    standings = design.standings([one.cell for one in played])
    if not json:
        _print_table(standings)  # drawing takes a while
    with progress_bar(quiet=json) as progress:
        progress("drawing the page", 1.0)
        page = league_page(played, standings, motions, interrupted=interrupted)
        with whole_files(out) as folder:
            page.write(folder / "league.html")
    for note in (*notes, *more):
        print(f"bowden: note: {note}", file=sys.stderr)
    if json:
        print_json({"cells": [asdict(one.cell) for one in played], "seconds": seconds()})
    else:
        print(f"\nPage: {out / 'league.html'}  ({seconds():.1f} s)")
    if interrupted:
        raise InterruptedPartway(f"{len(played)} cells played and written to {out}")


def _laws(wanted: _Names, own: list[str]) -> list["Law"]:
    """The laws that play: those of `LAWS` that are wanted, all where none is, and the user's own."""
    from bowden.control import LAWS, user_law
    from bowden.core.errors import ParameterError

    found = list(_chosen("law", LAWS, wanted))
    for file in own:
        law = user_law.load(file)
        if law.name in {one.name for one in found}:
            raise ParameterError(f"{file}: there is a law {law.name!r} already", do="give yours another name")
        found.append(law)
    return found


def _chosen(what: str, known: Mapping[str, Any], wanted: _Names) -> list[Any]:
    """Those of `known` that are wanted, in the order of `known`; all where nothing is wanted.

    Raises:
        ParameterError: one that is not known.
    """
    from bowden.core.errors import ParameterError, near

    asked = _asked(wanted)
    for name in asked:
        if name not in known:
            raise ParameterError(f"there is no {what} {name!r} in the league", expected=near(name, known))
    return [value for name, value in known.items() if not asked or name in asked]


def _plants(data: Path) -> tuple[dict[str, Callable[[], "LeaguePlant"]], list[str]]:
    """Plant → what makes it, and notes."""
    from bowden.design import league_cells, league_identified
    from bowden.plants.cables import as_cable_plant
    from bowden.rig.presets.bench import default_bench, moved_sheath

    bench = default_bench()
    ready = league_cells.plants(bench, moved_sheath())
    makers: dict[str, Callable[[], LeaguePlant]] = {one.name: partial(_itself, one) for one in ready}
    logs = {file.name.removesuffix(".csv.gz"): file for file in sorted((data / "cable").glob("*.csv.gz"))}
    base = as_cable_plant(bench)
    for name in league_identified.names(logs):
        makers[name] = partial(league_identified.identified_plant, base, name, logs)
    return makers, [] if logs else [f"no cable logs in {data / 'cable'}, so no plant that was identified from one"]


def _own_plants(wanted: _Names) -> dict[str, Callable[[], "LeaguePlant"]]:
    """The user's own plants among those that are wanted, by what they are called there."""
    from bowden.control import user_law
    from bowden.design.league_cells import LeaguePlant
    from bowden.plants import user_plant
    from bowden.sim.scenario import constant_bend

    found: dict[str, Callable[[], LeaguePlant]] = {}
    for name in _asked(wanted):
        if user_law.is_file(name):
            plant = user_plant.load(name)
            what = f"a plant of your own, from {plant.path.name}"
            found[name] = partial(_itself, LeaguePlant(plant.name, what, plant, constant_bend(plant.sheath.bend)))
    return found


def _asked(wanted: _Names) -> list[str]:
    return [name.strip() for text in wanted or [] for name in text.split(",")]


def _itself(plant: "LeaguePlant") -> "LeaguePlant":
    return plant


def _scenarios(data: Path) -> tuple[dict[str, "LeagueScenario"], list[str]]:
    """Scenario by name, and notes."""
    from bowden.design import league_cells

    files = sorted((data / "elbow").glob("*.csv.gz"))
    if not files:
        found, notes = league_cells.scenarios(), [f"no recording in {data / 'elbow'}, so no scenario of an elbow"]
    else:
        from bowden.rig.recorded import read_motion  # brings pyarrow
        from bowden.rig.sections import RecordedFile

        said = RecordedFile(files[0].name, position_column="elbow_deg")
        found, notes = league_cells.scenarios(read_motion(said, files[0].parent).motion), []
    return {one.name: one for one in found}, notes


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
