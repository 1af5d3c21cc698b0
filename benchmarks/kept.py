"""Results of a long part, kept one a line while it runs: interrupted, it goes on where it was left."""

import json
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import screen
from bowden.core.kernel_cache import source_hash

FOLDER = Path(__file__).parents[1] / "out" / "bench"


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
        """All rows, after those that are missing have been worked out and kept, with progress on standard error."""
        rows = self.rows()
        before, start, said = len(rows), time.perf_counter(), 0.0
        self.replace(rows)  # without a line cut off
        try:
            with self._file.open("a", encoding="utf-8") as file:
                for row in missing:
                    file.write(json.dumps(row) + "\n")
                    file.flush()
                    rows.append(row)
                    taken = time.perf_counter() - start
                    if taken > said + 2.0:
                        said, left = taken, taken / (len(rows) - before) * (wanted - len(rows))
                        screen.line(f"{self._name}: {len(rows)} of {wanted}, {left:.0f} s left")
        except KeyboardInterrupt:
            raise SystemExit(
                f"\n{self._name}: {len(rows)} of {wanted} are kept in {self._file}; run it again"
            ) from None
        finally:
            screen.end()
        return rows
