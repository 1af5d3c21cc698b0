"""Results: the page of `make bench`, `make soak` and `make walk`, and the files behind tables of docs/background."""

import json
import time
from collections.abc import Iterable, Sequence
from pathlib import Path

from bowden.core.files import whole_file

PAGE = Path(__file__).parent / "RESULTS.md"
HEAD = (
    "# Benchmarks\n\nWritten by `make bench`, `make soak` and `make walk`, section by section; the numbers are one "
    "run's.\n"
)
ORDER = [
    *("Speed", "What a user waits for", "A cycle of each law", "A sample of the detector"),
    "How far `bowden check` can be trusted",
    *("Identification against others", "Time of an identification"),
    *("Our law on random plants", "The suit on random wearers"),
    *("Stops among other requests", "Loss of a process", "Faults", "A thousand releases", "Hours without a fault"),
    *("EMG streams", "Hostile streams of EMG", "Inputs that nobody would write"),
    "Every command of the pages",
]
"""Titles of sections that a program writes; those of studies that are done stand after them."""


def write(title: str, text: str, page: Path = PAGE) -> None:
    """Put a section, without its title, in its place among the others."""
    there = page.read_text(encoding="utf-8") if page.is_file() else ""
    known = {part.partition("\n")[0]: part.partition("\n")[2].strip() for part in there.split("\n## ")[1:]}
    known[title] = text.strip()
    titles = [*ORDER, *(name for name in known if name not in ORDER)]
    with whole_file(page) as part:
        part.write_text(
            "\n".join([HEAD, *(f"## {name}\n\n{known[name]}\n" for name in titles if name in known)]), encoding="utf-8"
        )


def write_rows(
    name: str,
    what: str,
    command: str,
    columns: Sequence[str],
    rows: Iterable[Sequence[str | float]],
    folder: Path = PAGE.parent / "results",
) -> None:
    """Write the rows of an experiment, of which `make docs` makes a table.

    Args:
        name: of the file, and of the table's markers on a page.
        what: the table's caption.
        command: that made the rows.
        columns: heads of the table.
        rows: cells.
        folder: for the file.
    """
    head = {"what": what, "command": command, "columns": list(columns)}
    lines = [f"{key} = {json.dumps(value, ensure_ascii=False)}" for key, value in head.items()]
    lines.insert(1, f"date = {time.strftime('%Y-%m-%d', time.gmtime())}")
    lines += ["rows = [", *(f"  {json.dumps(list(row), ensure_ascii=False)}," for row in rows), "]", ""]
    with whole_file(folder / f"{name}.toml") as part:
        part.write_text("\n".join(lines), encoding="utf-8")
