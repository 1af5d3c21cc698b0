"""The tables of docs/safety.md, made from the code: every fault, every limit."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import made_tables
from bowden.core.files import write_text
from bowden.core.quantity import declared
from bowden.safety.faults import Fault
from bowden.safety.limits import Limits

_REACTIONS = {(0, 0): "warns", (1, 2): "R1, then R2", (1, 3): "R1, then R3", (2, 2): "R2", (3, 3): "R3"}


def faults_table() -> str:
    """Every fault, in the order of its bits."""
    rows = ["| bit | fault | what it means | detector | reaction | within | latched | what to do |", "|---" * 8 + "|"]
    for fault in Fault:
        within = f"{fault.within * 1e3:.0f} ms" if fault.then else "–"
        cells = (
            *(str(int(fault)), f"`{fault.name}`", fault.meaning, fault.detector.replace("|", "\\|")),
            *(_REACTIONS[fault.at_once, fault.then], within, "yes" if fault.latched else "no", fault.remedy),
        )
        rows.append(f"| {' | '.join(cells)} |")
    return "\n".join(rows)


def limits_table() -> str:
    """Every limit with its default, unit and meaning, and its key in rig.toml."""
    rows = ["| limit | default | unit | meaning | key of [limits] |", "|---" * 5 + "|"]
    rows += _rows(Limits(), "", "")
    return "\n".join(rows)


def _rows(values: Any, dotted: str, prefix: str) -> Iterator[str]:
    found = {one.name: one.quantity for one in declared(type(values))}
    for name, value in values._asdict().items():
        if hasattr(value, "_asdict"):
            yield from _rows(value, f"{name}.", f"{name}_")
            continue
        about = found[name]
        meaning = f"{about.meaning}, {about.symbol}" if about.symbol else about.meaning
        key = "" if about.key is None else f"`{prefix}{about.named(name)}`"
        yield f"| `{dotted}{name}` | {value:g} | {about.unit} | {meaning} | {key} |"


def with_tables(page: str) -> str:
    """The page with what stands between its markers made anew."""
    return made_tables.with_tables(page, {"faults": faults_table(), "limits": limits_table()})


def write_docs(docs: Path) -> None:
    """Write the tables where they belong.

    Raises:
        OutputError: the page cannot be written.
    """
    path = docs / "safety.md"
    text = with_tables(path.read_text(encoding="utf-8"))
    write_text(path, text)
