"""The results of a campaign on disk: one Parquet file a chunk of runs, each written whole, together one data set.

FOLDER/study.json               what the rows depend on
FOLDER/runs/part-000000.parquet the runs of a chunk, by number and law; units and a digest of the rows in its schema
FOLDER/aside/                   chunks that could not be read, or are not what they say
"""

import contextlib
import hashlib
import json
import shutil
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bowden.core.errors import OutputError, ParameterError
from bowden.core.files import whole_file, whole_files

if TYPE_CHECKING:
    import pyarrow as pa

_KEY = b"bowden"


class Store:
    """A folder with the results of one study.

    Args:
        folder: made when the study is first written there.
        identity: all that the rows depend on, as JSON values.
        rows: how many rows each chunk has, in their order.
    """

    def __init__(self, folder: Path, identity: Mapping[str, Any], rows: list[int]) -> None:
        self.folder, self._identity, self._rows = folder, dict(identity), rows
        self.study_hash = _hash(self._identity)
        """A short name of the identity."""
        self.enlarged = ""
        """What was kept of the same study with fewer runs, where it has been enlarged since."""

    def open(self) -> list[str]:
        """Begin, or go on; returns notes on chunks that were set aside because they are damaged.

        The rows of the same study with fewer runs are kept, cut into the chunks that it has now.

        Raises:
            ParameterError: the folder has the results of another study.
            OutputError: it cannot be written.
        """
        file = self.folder / "study.json"
        if file.is_file():
            self._compare(file)
        else:
            self._write_identity()
        with whole_files(self.folder / "runs"):
            pass  # makes the folder
        for rest in (self.folder / "runs").glob(".bowden-*"):  # of a process that was killed while it wrote
            shutil.rmtree(rest, ignore_errors=True)
        return [note for chunk in range(len(self._rows)) if (note := self._checked(chunk))]

    def missing(self) -> list[int]:
        """The chunks that are not there."""
        return [chunk for chunk in range(len(self._rows)) if not self.path(chunk).is_file()]

    def path(self, chunk: int) -> Path:
        """The file of a chunk."""
        return self.folder / "runs" / f"part-{chunk:06d}.parquet"

    def write(self, chunk: int, table: "pa.Table") -> None:
        """Write a chunk, whole or not at all.

        Raises:
            OutputError: it cannot be written.
        """
        import pyarrow.parquet as pq

        about = {"study": self.study_hash, "chunk": chunk, "sha256": hashlib.sha256(row_bytes(table)).hexdigest()}
        held = dict(table.schema.metadata or {}) | {_KEY: json.dumps(about).encode()}
        with whole_file(self.path(chunk)) as part, part.open("wb") as file:
            pq.write_table(table.replace_schema_metadata(held), file)

    def tables(self) -> Iterator["pa.Table"]:
        """The chunks that are there, in their order.

        Raises:
            OutputError: one of them cannot be read.
        """
        for chunk in range(len(self._rows)):
            if self.path(chunk).is_file():
                yield self._read(chunk)

    def columns(self, names: Sequence[str]) -> "pa.Table":
        """Some columns of all chunks, in their order; unlike `tables` it trusts the files."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        files = [self.path(chunk) for chunk in range(len(self._rows))]
        parts = [pq.read_table(file, columns=list(names), partitioning=None) for file in files if file.is_file()]
        return pa.concat_tables([part.replace_schema_metadata() for part in parts]).combine_chunks()

    def digest(self) -> str:
        """SHA-256 of all rows, by number and law; it does not depend on how the runs are cut into chunks."""
        found = hashlib.sha256()
        for table in self.tables():
            found.update(row_bytes(table))
        return found.hexdigest()

    def _read(self, chunk: int) -> "pa.Table":
        path = self.path(chunk)
        table = _table(path, {self.study_hash}, chunk)
        if len(table) != self._rows[chunk]:
            reason = f"it has {len(table)} rows and should have {self._rows[chunk]}"
            raise OutputError(f"cannot read {path}: {reason}", do=_AGAIN)
        return table

    def _checked(self, chunk: int) -> str:
        """A note where a chunk was damaged; it stands in another folder then."""
        if not self.path(chunk).is_file():
            return ""
        try:
            self._read(chunk)
        except OutputError as error:
            aside = self.folder / "aside"
            with contextlib.suppress(FileExistsError):
                aside.mkdir()
            count = len(list(aside.glob(f"{self.path(chunk).stem}*")))
            target = aside / f"{self.path(chunk).stem}{f'-{count}' if count else ''}.parquet"
            self.path(chunk).replace(target)
            return f"{error.what}; it is set aside as {target}, and its runs are computed again"
        return ""

    def _compare(self, file: Path) -> None:
        try:
            there = json.loads(file.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise ParameterError(
                f"cannot read {file}: {error}", do="give another folder with --out, or delete this one"
            ) from error
        if _fewer(there, self._identity):
            self._enlarge(there)
        elif there != self._identity:
            says = "; ".join(differences(there, self._identity)) or "its form"
            raise ParameterError(
                f"{self.folder} has the results of another study: {says}",
                do="give another folder with --out, or delete this one",
            )

    def _write_identity(self) -> None:
        with whole_files(self.folder) as stage:
            (stage / "study.json").write_text(json.dumps(self._identity, ensure_ascii=False, indent=2) + "\n")

    def _enlarge(self, there: Mapping[str, Any]) -> None:
        """Keep the rows of the same study with fewer runs: a run depends on its number alone.

        They are cut into this study's chunks, which have no fewer runs than theirs; so what a file had that is
        overwritten is written already, should this be interrupted. A chunk that is not whole is computed anew.
        """
        import pyarrow as pa

        laws, known = sum(self._rows) // self._identity["runs"], {_hash(there), self.study_hash}
        parts = {int(file.stem[5:]): file for file in sorted((self.folder / "runs").glob("part-[0-9]*.parquet"))}
        tables = []
        for chunk, file in parts.items():
            with contextlib.suppress(OutputError):
                tables.append(_table(file, known, chunk))
        written: set[int] = set()
        if tables:
            rows = pa.concat_tables(table.replace_schema_metadata() for table in tables)
            numbers = rows["number"].to_numpy()
            order = np.argsort(numbers, kind="stable")
            numbers, begin = numbers[order], 0
            for chunk, count in enumerate(self._rows):
                wanted = np.arange(begin, begin + count // laws)
                found = (np.searchsorted(numbers, wanted)[:, None] + np.arange(laws)).ravel()
                begin += len(wanted)
                if found[-1] < len(numbers) and np.array_equal(numbers[found], np.repeat(wanted, laws)):
                    self.write(chunk, rows.take(order[found]))
                    written.add(chunk)
        for chunk, file in parts.items():
            if chunk not in written:
                file.unlink()
        self._write_identity()
        kept = sum(self._rows[chunk] for chunk in written) // laws
        self.enlarged = f"the study had {there['runs']} runs and has {self._identity['runs']}: {kept} of them are kept"


_AGAIN = "delete it, and run the command again"


def _hash(identity: Mapping[str, Any]) -> str:
    text = json.dumps(identity, sort_keys=True, ensure_ascii=False)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _fewer(there: Any, here: Mapping[str, Any]) -> bool:
    """True if a study differs from another one in that it has fewer runs, and in nothing else."""
    if not isinstance(there, dict) or not isinstance(there.get("runs"), int) or "runs" not in here:
        return False
    return there["runs"] < here["runs"] and {**there, "runs": here["runs"]} == here


def _table(path: Path, studies: Collection[str], chunk: int) -> "pa.Table":
    """The rows of a chunk of one of these studies, by their hashes.

    Raises:
        OutputError: they cannot be read, or are not those that were written.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        with path.open("rb") as file:
            table = pq.read_table(file)
        about = json.loads((table.schema.metadata or {})[_KEY])
        right = (chunk, hashlib.sha256(row_bytes(table)).hexdigest())
        if about["study"] not in studies or (about["chunk"], about["sha256"]) != right:
            raise ValueError("its rows are not those that were written")
    except (OSError, pa.ArrowException, KeyError, TypeError, ValueError, UnicodeDecodeError) as error:
        reason = " ".join(str(error).split())[:120] or type(error).__name__
        raise OutputError(f"cannot read {path}: {reason}", do=_AGAIN) from error
    return table


def differences(there: Any, here: Any, key: str = "") -> list[str]:
    """Differences between two JSON values, at most three.

    >>> differences({"seed": 1, "laws": ["a"]}, {"seed": 2, "laws": ["a"]})
    ['seed was 1 and is 2']
    """
    if there == here:
        return []
    if isinstance(there, dict) and isinstance(here, dict):
        found = []
        for name in [*there, *(name for name in here if name not in there)]:
            found += differences(there.get(name), here.get(name), f"{key}.{name}" if key else name)
        return found[:3]
    return [f"{key} was {_said(there)} and is {_said(here)}"]


def _said(value: Any) -> str:
    text = "not there" if value is None else json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 60 else text[:57] + "..."


def row_bytes(table: "pa.Table") -> bytes:
    """The rows as bytes, row after row, sorted by number and law: eight for each number, a word's own for each word."""
    columns = []
    for name in table.column_names:
        values = table[name].combine_chunks()
        if str(values.type) in ("string", "dictionary<values=string, indices=int32, ordered=0>"):
            columns.append(np.array([_word(word) for word in values.to_pylist()], dtype=np.uint64))
        elif str(values.type) == "double":
            numbers = values.to_numpy(zero_copy_only=False).astype(np.float64)
            columns.append(np.where(np.isnan(numbers), np.nan, numbers).view(np.uint64))
        else:
            columns.append(values.to_numpy(zero_copy_only=False).astype(np.int64).view(np.uint64))
    block = np.stack(columns, axis=1) if columns else np.empty((0, 0), np.uint64)
    order = np.lexsort((columns[1], columns[0]))
    return np.ascontiguousarray(block[order]).astype("<u8").tobytes()


def _word(word: str) -> int:
    return int.from_bytes(hashlib.sha256(word.encode()).digest()[:8], "little")
