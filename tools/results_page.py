"""The tables of docs/background and of benchmarks/RESULTS.md, made from the files in benchmarks/results."""

import re
import tomllib
from pathlib import Path
from typing import Any

import made_tables
from bowden.core.files import write_text

RESULTS = Path(__file__).parents[1] / "benchmarks" / "results"
"""NAME.toml: `what` (the caption), `date` of the run (of the commit that recorded it, where the run's is not known),
`commit`, `command`, `how` (conditions), `columns`, `rows`."""
BENCHMARKS = RESULTS.parent / "RESULTS.md"
_NAMED = re.compile(r"<!-- (\w+): made by make docs -->")


def results(name: str) -> dict[str, Any]:
    """A results file, with its numbers as they are written there."""
    return tomllib.loads((RESULTS / f"{name}.toml").read_text(encoding="utf-8"), parse_float=str)


def results_table(name: str) -> str:
    """The rows as a Markdown table above its caption, the date and the command."""
    found = results(name)
    head, *rows = [" | ".join(str(cell) or "–" for cell in row) for row in (found["columns"], *found["rows"])]
    command = f", `{found['command']}`" if "command" in found else ""
    how = f" {found['how']}" if "how" in found else ""
    caption = f"*{found['what']}. {found['date']}{command}.{how}*"
    return "\n".join([head, "|".join(["---"] * len(found["columns"])), *rows, "", caption])


def with_tables(page: str) -> str:
    """The page with what stands between its markers made anew."""
    return made_tables.with_tables(page, {name: results_table(name) for name in _NAMED.findall(page)})


def write_docs(docs: Path) -> None:
    """Write the tables where they belong.

    Raises:
        OutputError: a page cannot be written.
    """
    for page in (*sorted((docs / "background").glob("*.md")), BENCHMARKS):
        write_text(page, with_tables(page.read_text(encoding="utf-8")))
