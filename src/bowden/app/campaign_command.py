"""``bowden campaign``: thousands of closed loops, and what comes of them."""

import shlex
import sys
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bowden.app.command import Command
from bowden.app.console import InterruptedPartway, folder_argument, print_json, progress_bar, say_note, seconds
from bowden.app.given_rig import read_alone
from bowden.core.files import output_folder

if TYPE_CHECKING:
    from bowden.study.figures import Summary


def campaign(
    study: Annotated[Path, typer.Argument(help="The study, a TOML file (docs/campaign.md).")],
    out: Annotated[
        Path | None,
        typer.Option(parser=folder_argument, metavar="FOLDER", help="Folder for the results; out/campaign/STUDY."),
    ] = None,
    rig: Annotated[
        Path | None, typer.Option(help="A rig.toml, or the log of a run, for a study that names no rig.")
    ] = None,
    workers: Annotated[int | None, typer.Option(min=1, help="Processes on this machine; one for each core.")] = None,
    cluster: Annotated[
        str | None, typer.Option(help="A dask scheduler's address, or local:N for N processes, in place of these.")
    ] = None,
    run: Annotated[int | None, typer.Option(min=0, help="Only this run, with traces and a page.")] = None,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")] = False,
) -> None:
    """Run laws on plants drawn at random, thousands of them: figures as Parquet, and a page with what they show.

    Every run is made of its number alone, so that neither the number of workers nor their order matters. Interrupted
    or killed, the same command goes on where it was; with more runs in the study it adds those.
    """
    from bowden.face.campaign import Partway, computed, require_parquet
    from bowden.study.load import load

    loaded = load(study, None if rig is None else read_alone(rig))
    folder = out or Path("out/campaign") / study.stem
    if run is None:
        require_parquet()
    output_folder(folder)
    if run is not None:
        from bowden.app.campaign_one import run_alone

        run_alone(loaded, run, folder / f"run-{run}", json=json)
        return
    more = [*(["--rig", str(rig)] if rig else []), *(["--out", str(out)] if out else [])]
    again = shlex.join(["bowden", "campaign", str(study), *more, "--run"])
    with progress_bar(quiet=json) as progress:
        try:
            found = computed(loaded, folder, workers=workers, cluster=cluster, again=again, progress=progress)
        except Partway as partway:
            raise InterruptedPartway(str(partway)) from None
    for note in filter(None, (found.enlarged, *found.notes)):
        say_note(note)
    summary, files = found.summary, found.files
    if json:
        counts = {
            "chunks_computed": found.computed,
            "chunks_kept": found.kept,
            "chunks_set_aside": len(found.notes),
        }
        about = {"rig": loaded.rig.hash}
        print_json(about | summary.document() | counts | {"files": [str(file) for file in files], "seconds": seconds()})
        return
    _print_table(summary)
    print(f"\nRows: {loaded.file.runs * len(loaded.laws)} in {files[0]}, SHA-256 {summary.digest}")
    print(f"Page: {files[-1]}  ({seconds():.1f} s)")


_TITLES = (
    "unstable\n%",
    "oscil.\n%",
    "worse\n%",
    "RMSE\nmedian",
    "\n90 %",
    "\n99 %",
    "\nworst",
    "peak\nworst",
    "worst\nrun",
)
"""Of the columns after the first, angles in degrees."""


def _print_table(summary: "Summary") -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table

    from bowden.study.figures import MOVING, UNSTABLE

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("law", no_wrap=True)
    for title in _TITLES:
        table.add_column(title, justify="right", no_wrap=True)
    for one in summary.laws:
        found, peak = one.figures.get("rmse_deg"), one.figures.get("peak_deg")
        counts = (one.unstable, one.oscillating, one.worse)
        values: list[Any] = [None if count is None else 100.0 * count / one.runs for count in counts]
        values += [found.median, found.q90, found.q99, found.most] if found else [None] * 4
        values.append(peak.most if peak else None)
        shown = ("–" if value is None else f"{value:.3g}" for value in values)
        table.add_row(one.law, *shown, str(one.worst[0].number) if one.worst else "–")
    Console(width=None if sys.stdout.isatty() else 100).print(table)
    print(textwrap.fill(f"Errors in degrees. {UNSTABLE} {MOVING}", 100))
    for one in summary.laws:
        varied = [found for found in one.sensitivities if found.taken and found.chance]
        if not varied:
            continue
        named = ", ".join(f"{found.name} {100.0 * found.share:.0f} %" for found in varied if found.above_chance)
        chance = 100.0 * max(found.chance for found in varied)
        print(
            f"{one.law}: its RMSE depends on {named or 'nothing that shows'} "
            f"(shares of up to {chance:.2g} % are not more than chance with {one.runs} runs)"
        )


COMMANDS = (
    Command(
        "campaign",
        campaign,
        "Run thousands of closed loops with random plants, gains and faults.",
        (
            "bowden campaign study.toml",
            "bowden campaign study.toml --out out/study --workers 2 --json",
            "bowden campaign study.toml --cluster tcp://127.0.0.1:8786",
            "bowden campaign study.toml --run 17",
        ),
        place=100,
    ),
)
