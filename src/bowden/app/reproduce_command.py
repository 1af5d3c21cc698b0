"""``bowden reproduce``: the paper's bench, claim by claim."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bowden.app.command import Command
from bowden.app.console import folder_argument, print_json, progress_bar, seconds
from bowden.core.files import output_folder, whole_files

if TYPE_CHECKING:
    from bowden.paper.reproduce import Reproduction


def reproduce(
    only: Annotated[
        list[str] | None,
        typer.Option(help="Only this claim or figure: fig16, table1.adaptive, fig17.adaptive, … May be repeated."),
    ] = None,
    out: Annotated[Path, typer.Option(parser=folder_argument, metavar="FOLDER", help="Folder for the report.")] = Path(
        "out/reproduce"
    ),
    json: Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")] = False,
) -> None:
    """Reproduce the paper's bench: published and computed figures, and a report with every figure."""
    from bowden.paper.claims import select
    from bowden.paper.report import write_report
    from bowden.paper.reproduce import claims_of
    from bowden.paper.reproduce import reproduce as run

    select(claims_of(only or []))
    output_folder(out)
    with progress_bar(quiet=json) as progress:
        outcome = run(only or [], progress)
    path = out / "reproduce.html"
    with whole_files(out) as folder:
        write_report(outcome, folder / path.name)
    if json:
        print_json(outcome.json() | {"report": str(path), "seconds": seconds()})
    else:
        _print_table(outcome)
        print(f"\nReport: {path}  ({seconds():.0f} s)")


def _print_table(outcome: "Reproduction") -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table

    from bowden.paper.claims import is_remark, number, span

    colours = {
        "fitted": "cyan",
        "reproduced": "green",
        "better": "green",
        "not determined": "yellow",
        "differs": "red",
        "misprint": "magenta",
    }
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("claim", no_wrap=True)
    for name in ("published", "computed", "interval"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("unit")
    table.add_column("verdict", no_wrap=True)
    for result in outcome.results:
        if not is_remark(result.claim):
            verdict = f"[{colours[result.verdict]}]{result.verdict}[/]"
            figures = number(result.claim.published), number(result.computed), span(result.interval)
            table.add_row(result.claim.id, *figures, result.claim.unit, verdict)
    Console(width=None if sys.stdout.isatty() else 110).print(table)


COMMANDS = (
    Command(
        "reproduce",
        reproduce,
        "Reproduce the paper's bench, claim by claim.",
        (
            "bowden reproduce",
            "bowden reproduce --only table1 --only fig16",
            "bowden reproduce --json",
        ),
        place=140,
    ),
)
