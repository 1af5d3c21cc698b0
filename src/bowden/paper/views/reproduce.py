"""The paper's claims: a table in a terminal, and the report."""

from pathlib import Path
from typing import TYPE_CHECKING

from bowden.operations.support.operation import Folder
from bowden.views.text import Call, table

if TYPE_CHECKING:
    from bowden.paper.operations.reproduce import Reproduced

_COLOURS = {
    "fitted": "cyan",
    "reproduced": "green",
    "better": "green",
    "not determined": "yellow",
    "differs": "red",
    "misprint": "magenta",
}


def write_reproduce(found: "Reproduced", call: Call, *, out: Folder = Path("out/reproduce")) -> list[Path]:
    """Write the report.

    Args:
        found: the judged claims.
        call: of the command.
        out: folder for the report.
    """
    from bowden.core.files import whole_files
    from bowden.paper.report import write_report

    with whole_files(out) as folder:
        write_report(found.value, folder / "reproduce.html")
    return [out / "reproduce.html"]


def show_reproduce(found: "Reproduced", call: Call) -> None:
    """A row for each claim."""
    from bowden.paper.claims import number, span

    rows = [
        [one.id, number(one.published), number(one.computed), span(one.interval), one.unit, _coloured(one.verdict)]
        for one in found.claims
    ]
    titles = ("claim", "published", "computed", "interval", "unit", "verdict")
    table(titles, rows, left=("unit", "verdict"), width=110)
    print(f"\nReport: {call.files[-1]}  ({call.seconds:.0f} s)")


def _coloured(verdict: str) -> str:
    return f"[{_COLOURS[verdict]}]{verdict}[/]"
