"""The page of results, which `make bench`, `make soak` and `make walk` write section by section."""

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
    *("Identification against others", "Time of an identification", "Twelve recorded cables, from log to running law"),
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
