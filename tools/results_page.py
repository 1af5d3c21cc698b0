"""The tables of results in docs, made from the files in benchmarks/results."""

import re
import tomllib
from pathlib import Path
from typing import Any

import made_tables
import safety_page
from bowden.core.files import write_text

RESULTS = Path(__file__).parents[1] / "benchmarks" / "results"
"""NAME.toml: `what` (the caption), `date` of the run (of the commit that recorded it, where the run's is not known),
`commit`, `command`, `how` (conditions), `columns`, `rows`; `shown_columns`, `shown_rows`: what pages show of them."""
MADE_FROM_CODE = {mark for mark, _ in safety_page.TABLES.values()}
_NAMED = re.compile(r"<!-- (\w+): made by make docs -->")


def results(name: str) -> dict[str, Any]:
    """A results file, with its numbers as they are written there."""
    return tomllib.loads((RESULTS / f"{name}.toml").read_text(encoding="utf-8"), parse_float=str)


def results_table(name: str) -> str:
    """The rows as a Markdown table above its caption, the date and the command."""
    found = results(name)
    columns = [int(k) for k in found.get("shown_columns", range(len(found["columns"])))]
    shown = [found["rows"][int(k)] for k in found.get("shown_rows", range(len(found["rows"])))]
    head, *rows = [" | ".join(str(row[k]) or "–" for k in columns) for row in (found["columns"], *shown)]
    command = f", `{found['command']}`" if "command" in found else ""
    how = f" {found['how']}" if "how" in found else ""
    caption = f"*{found['what']}. {found['date']}{command}.{how}*"
    return "\n".join([head, "|".join(["---"] * len(columns)), *rows, "", caption])


def with_tables(page: str) -> str:
    """The page with what stands between its markers of results made anew; others are made from the code."""
    named = [name for name in _NAMED.findall(page) if name not in MADE_FROM_CODE]
    return made_tables.with_tables(page, {name: results_table(name) for name in named})


def write_docs(docs: Path) -> None:
    """Write the tables where they belong.

    Raises:
        OutputError: a page cannot be written.
    """
    for page in (*sorted(docs.glob("*.md")), *sorted((docs / "background").glob("*.md"))):
        write_text(page, with_tables(page.read_text(encoding="utf-8")))
