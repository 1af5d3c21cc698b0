"""Long parts: rows kept while they run, progress on a terminal, and looks at judging sets counted."""

import json
import sys
from collections.abc import Iterable, Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import track

from bowden.core.kernel_cache import source_hash

FOLDER = Path(__file__).parents[1] / "out" / "bench"


def progress(items: Iterable[Any], total: int, what: str) -> Iterator[Any]:
    """The items, with progress where standard error is a terminal."""
    yield from track(items, what, total, console=Console(stderr=True), disable=not sys.stderr.isatty())


def numbers_in(text: str, count: int) -> range:
    """``COUNT`` or ``FIRST:END`` of a command line; `count` numbers of an empty text."""
    first, _, last = text.rpartition(":")
    return range(int(first or 0), int(last)) if text else range(count)


def finite(value: Any) -> Any:
    """The value for JSON: infinities and NaN are null."""
    if isinstance(value, dict):
        return {key: finite(part) for key, part in value.items()}
    if isinstance(value, list):
        return [finite(part) for part in value]
    return None if isinstance(value, float) and value - value != 0.0 else value


class Kept:
    """Rows in a file of `out/bench`, which is named after the package's source: what older code gave does not count.

    Args:
        name: of the part, with all that its rows depend on.
        folder: where the file is.
    """

    def __init__(self, name: str, folder: Path = FOLDER) -> None:
        self._name = name
        self._file = folder / f"{name}-{source_hash()}.jsonl"

    def rows(self) -> list[list[Any]]:
        """What is there; a last line that an interruption cut off is left out."""
        if not self._file.is_file():
            return []
        text = self._file.read_text(encoding="utf-8")
        return [json.loads(line) for line in text[: text.rfind("\n") + 1].splitlines()]

    def replace(self, rows: list[list[Any]]) -> None:
        """Keep these rows and no others."""
        self._file.parent.mkdir(parents=True, exist_ok=True)
        self._file.write_text("".join(json.dumps(row) + "\n" for row in rows), encoding="utf-8")

    def filled(self, missing: Iterable[list[Any]], wanted: int) -> list[list[Any]]:
        """All rows, after the missing ones have been computed and kept, with progress."""
        rows = self.rows()
        self.replace(rows)  # without a line cut off
        try:
            with self._file.open("a", encoding="utf-8") as file:
                for row in progress(missing, wanted - len(rows), f"rows of {self._name}"):
                    file.write(json.dumps(row) + "\n")
                    file.flush()
                    rows.append(row)
        except KeyboardInterrupt:
            raise SystemExit(
                f"\n{self._name}: {len(rows)} of {wanted} are kept in {self._file}; run it again"
            ) from None
        return rows


def counted(file: Path, set_name: str, told: Mapping[str, str | list[str]]) -> int:
    """Record a look at a set before it is run; how many there have been, 0 of the development set.

    Args:
        file: TOML, a table for each look.
        set_name: of the set.
        told: what is run on what of it, by key.
    """
    if set_name == "development":
        return 0
    before = file.read_text(encoding="utf-8") if file.is_file() else ""
    count = before.count(f'set = "{set_name}"') + 1
    entry = [
        "[[look]]",
        f'set = "{set_name}"',
        f"count = {count}",
        *(f"{key} = {json.dumps(value)}" for key, value in told.items()),
        f'source = "{source_hash()}"',
        f'time = "{datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ}"',
    ]
    file.write_text(before + ("\n" if before else "") + "\n".join(entry) + "\n", encoding="utf-8")
    return count
