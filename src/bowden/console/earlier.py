"""Earlier runs: the logs in the console's folder, what each came to, and what can be made of them."""

import base64
import contextlib
import re
import stat
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from bowden.console.access import Refused
from bowden.console.jobs import Jobs
from bowden.console.stream import MOST_COLUMNS, PIXELS
from bowden.core.arguments import format_value
from bowden.core.documented import finite

NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.:-]{0,99}")
"""Of a log without its ending, as an address may have it; and it has to be in the folder."""
KINDS = {"mcap": "application/octet-stream", "parquet": "application/octet-stream", "csv": "text/csv"}
"""What a log can be had as."""
_SEARCHED = ("id", "time", "law", "rig", "subject", "session", "notes", "how")
_MOST = 500
"""Runs in the list, the newest of those that are there."""
_LONGEST = 1e6
"""Of a log's time [s]."""


class EarlierRuns:
    """Those in one folder.

    Args:
        folder: of the logs.
        jobs: reads them.
        going: names of the logs that are being written.
    """

    def __init__(self, folder: Path, jobs: Jobs, going: Callable[[], tuple[str, ...]]) -> None:
        self._folder, self._jobs, self._going = folder, jobs, going
        self._made = tempfile.TemporaryDirectory(prefix="bowden-console-")
        self._known: dict[str, tuple[tuple[int, int], dict[str, Any]]] = {}

    def close(self) -> None:
        """Remove what was made for downloads."""
        self._made.cleanup()

    def _files(self) -> dict[str, tuple[Path, tuple[int, int]]]:
        """Name → log, with when it was changed [ns] and its size, the newest first; no link and no log that is being
        written.
        """
        going = {*self._going()}
        found = []
        for one in self._folder.glob("*.mcap"):
            if NAME.fullmatch(one.stem) and one.name not in going:
                with contextlib.suppress(OSError):  # removed just now
                    about = one.lstat()
                    if stat.S_ISREG(about.st_mode):
                        found.append((one, (about.st_mtime_ns, about.st_size)))
        found.sort(key=lambda file: file[1], reverse=True)
        return {file[0].stem: file for file in found[:_MOST]}

    async def listed(self, search: str = "") -> list[dict[str, Any]]:
        """The runs whose words have all that is searched for."""
        files = self._files()
        new = [name for name, (_, stamp) in files.items() if self._known.get(name, ((0, 0), {}))[0] != stamp]
        if new:
            found = await self._jobs.do("summaries", paths=[str(files[name][0].absolute()) for name in new])
            for name in new:
                self._known[name] = files[name][1], finite(found[str(files[name][0].absolute())])
        runs = [{"id": name, **self._known[name][1]} for name in files if name in self._known]
        words = search.casefold().split()
        return [run for run in runs if all(_has(run, word) for word in words)]

    def _file(self, name: str) -> tuple[Path, int]:
        """The log of that name, and when it was changed [ns].

        Raises:
            Refused: there is none.
        """
        found = self._files().get(name) if NAME.fullmatch(name) else None
        if found is None:
            raise Refused(404, f"there is no run {format_value(name)}", do="choose one of the list")
        path, (changed, _) = found
        return path.absolute(), changed

    async def details(self, name: str) -> dict[str, Any]:
        """All of one but its curves."""
        found: dict[str, Any] = finite(await self._jobs.do("details", path=str(self._file(name)[0])))
        return {"id": name, **found}

    async def page(self, name: str) -> Path:
        """Its page, as HTML."""
        return await self._derived(name, "html", "page")

    async def download(self, name: str, kind: str) -> Path:
        """It as a file of one of `KINDS`.

        Raises:
            Refused: no such run or kind.
        """
        if kind not in KINDS:
            raise Refused(404, "a log is not to be had like this", expected=", ".join(KINDS), do="choose one of them")
        return self._file(name)[0] if kind == "mcap" else await self._derived(name, kind, "export")

    async def _derived(self, name: str, ending: str, work: str) -> Path:
        log, changed = self._file(name)
        to = Path(self._made.name) / f"{name}-{changed}.{ending}"
        if not to.exists():
            await self._jobs.do(work, path=str(log), to=str(to))
        return to

    async def curves(self, name: str, query: Mapping[str, str]) -> bytes:
        """Curves of it as a frame.

        Raises:
            Refused: what is asked for cannot be.
        """
        columns = [one for one in query.get("columns", "").split(",") if one]
        try:
            begin, end, pixels = (float(query[key]) for key in ("from", "to", "pixels"))
        except (KeyError, ValueError):
            begin = end = pixels = 0.0
        within = 0.0 <= begin < end <= _LONGEST and PIXELS[0] <= pixels <= PIXELS[1]
        if not within or not 1 <= len(columns) <= MOST_COLUMNS:
            raise Refused(
                400,
                "these curves cannot be had",
                expected=f"1 to {MOST_COLUMNS} columns, from, to and {PIXELS[0]} to {PIXELS[1]} pixels",
                do="choose others",
            )
        named: dict[str, Any] = {"columns": columns, "begin": begin, "end": end, "pixels": round(pixels)}
        return base64.b64decode(await self._jobs.do("curves", path=str(self._file(name)[0]), **named))


def _has(run: dict[str, Any], word: str) -> bool:
    return any(word in str(run.get(key, "")).casefold() for key in _SEARCHED)
