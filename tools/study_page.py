"""The tables of docs/campaign.md, made from what a study declares."""

from pathlib import Path

import made_tables
from bowden.core.files import write_text
from bowden.study.rows import FIGURES, SUIT_FIGURES
from bowden.study.study import SENSOR_FAULTS


def figures_table() -> str:
    """Every figure of a row."""
    rows = ["column | meaning", "---|---"]
    suits = {name: (unit, f"{meaning}, of a suit") for name, (unit, meaning) in SUIT_FIGURES.items()}
    for name, (unit, meaning) in (FIGURES | suits).items():
        rows.append(f"`{name}` | {meaning.replace('|', chr(92) + '|')} [{unit}]")
    return "\n".join(rows)


def faults_list() -> str:
    """The sensor faults."""
    return ", ".join(f"`{name}`" for name in ("nothing", *SENSOR_FAULTS))


def with_tables(page: str) -> str:
    """The page with what stands between its markers made anew."""
    tables = {
        "faults": faults_list(),
        "figures": figures_table(),
    }
    return made_tables.with_tables(page, tables)


def write_docs(docs: Path) -> None:
    """Write the tables where they belong.

    Raises:
        OutputError: a file cannot be written.
    """
    page = docs / "campaign.md"
    write_text(page, with_tables(page.read_text(encoding="utf-8")))
