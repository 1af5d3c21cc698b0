"""The tables of faults in docs/safety.md and docs/troubleshooting.md, made from the code."""

from pathlib import Path

import made_tables
from bowden.core.files import write_text
from bowden.safety.faults import Fault

_REACTIONS = {(0, 0): "warns", (1, 2): "R1, then R2", (1, 3): "R1, then R3", (2, 2): "R2", (3, 3): "R3"}


def faults_table() -> str:
    """Every fault, in the order of its bits: what finds it, what is done."""
    rows = ["fault | detector | reaction | within", "---|---|---|---"]
    for fault in Fault:
        within = f"{fault.within * 1e3:.0f} ms" if fault.then else "–"
        found = fault.detector.replace("|", "\\|")
        rows.append(f"`{fault.name}` | {found} | {_REACTIONS[fault.at_once, fault.then]} | {within}")
    return "\n".join(rows)


def remedies_table() -> str:
    """Every fault by its name: what it means, what to do."""
    rows = ["fault | meaning | what to do", "---|---|---"]
    rows += [f"`{fault.name}` | {fault.meaning} | {fault.remedy}" for fault in sorted(Fault, key=lambda one: one.name)]
    return "\n".join(rows)


TABLES = {"safety.md": ("faults", faults_table), "troubleshooting.md": ("remedies", remedies_table)}
"""Page → the name of the markers on it, and what stands between them."""


def with_tables(name: str, page: str) -> str:
    """A page with what stands between its markers made anew."""
    mark, table = TABLES[name]
    return made_tables.with_tables(page, {mark: table()})


def write_docs(docs: Path) -> None:
    """Write the tables where they belong.

    Raises:
        OutputError: a page cannot be written.
    """
    for name in TABLES:
        write_text(docs / name, with_tables(name, (docs / name).read_text(encoding="utf-8")))
