"""``bowden reproduce``: the paper's bench, claim by claim."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bowden.app.console import make_folder, output_folder, print_json, seconds

if TYPE_CHECKING:
    from bowden.paper.reproduce import Reproduction


def reproduce(
    only: Annotated[
        list[str] | None,
        typer.Option(help="Only this claim or figure: fig16, table1.adaptive, erratum.chirp, … May be repeated."),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for the report.")] = Path("out/reproduce"),
    json: Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")] = False,
) -> None:
    """Reproduce the paper's bench: published and computed figures, and a report with every figure."""
    from bowden.paper.claims import select
    from bowden.paper.reproduce import claims_of, write_report
    from bowden.paper.reproduce import reproduce as run

    select(claims_of(only or []))
    output_folder(out)
    with _bar(quiet=json) as progress:
        outcome = run(only or [], progress)
    path = make_folder(out) / "reproduce.html"
    write_report(outcome, path)
    if json:
        print_json(outcome.json() | {"report": str(path), "seconds": seconds()})
    else:
        _print_table(outcome)
        print(f"\nReport: {path}  ({seconds():.0f} s)")


@contextmanager
def _bar(quiet: bool) -> Iterator[Callable[[str, float], None] | None]:
    """A progress bar on standard error where that is a terminal."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description:24}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("compiling", total=1.0)
        yield lambda what, share: bar.update(task, description=what, completed=share)


def _print_table(outcome: "Reproduction") -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table

    from bowden.paper.reproduce import number

    colours = {"fitted": "cyan", "reproduced": "green", "better": "green", "differs": "yellow", "erratum": "magenta"}
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("claim", no_wrap=True)
    for name in ("published", "computed"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("unit")
    table.add_column("verdict", no_wrap=True)
    for result in outcome.results:
        verdict = f"[{colours[result.verdict]}]{result.verdict}[/]"
        table.add_row(
            result.claim.id, number(result.claim.published), number(result.computed), result.claim.unit, verdict
        )
    Console(width=None if sys.stdout.isatty() else 100).print(table)
