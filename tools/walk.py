"""Run all commands of README and of every page as a new user would: `make walk`, or `python tools/walk.py [PAGE...]`.

Each page has a fresh folder. The package is built and installed into a fresh environment, without extras; a page that
says ``pip install 'bowden[…]'`` has an environment of its own. ``make`` runs in a copy of the repository. A command
passes if its exit code is the one that the page says; see `page_steps`.

What is walked is the last commit. With ``--write`` each page's result is kept as soon as the page is done; a walk that
is begun again leaves out the pages that have passed, as long as page and package are the same.
"""

import argparse
import hashlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import venv
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from bowden.core.files import whole_file
from page_steps import PageCommand, PageFile, commands, steps

ROOT = Path(__file__).parents[1]
WHAT = "Every command of the pages, each page in a fresh folder and the wheel in a fresh environment"
KEPT = ROOT / "out" / "walk.json"
"""What became of each page when it was last walked: its `key`, the day, and its `rows`."""
_SOURCE = ("src", "pyproject.toml", "Makefile", "requirements")
"""Of the repository, what a page's commands build on."""
Row = dict[str, Any]
"""A command and what became of it, for JSON; see `rows`."""
_LONGEST = 3600.0
"""A command that takes longer has failed [s]."""
_ENDING = 30.0
"""What runs beside the others is given this time to end [s]."""
_SETTLED = 3.0
"""What runs beside the others has this time before the next command [s]."""
_TRIES = 5
"""Of a run in real time, which other work on the same computer may end."""
_REPOSITORY = re.compile(r"make (?!-C)|pip install .*(-r requirements/|\s\.$)")
"""A command that runs in the repository, not in the page's folder."""
_PACKAGE = re.compile(r"""['"]?(?<![\w/])bowden(\[[\w,]+\])?['"]?(?=\s|$)""")
"""The package, with or without extras, as pip is given it."""


class Tried(NamedTuple):
    """What became of a command."""

    command: PageCommand
    exit_code: int | None
    """None where it was not tried, or did not end in time."""
    seconds: float
    why_not: str
    """Why it was not tried; empty where it was."""
    said: str
    """The end of what it printed."""
    again: int = 0
    """How often it was tried again."""

    @property
    def passed(self) -> bool:
        """Whether it ended as the page says."""
        return not self.why_not and self.exit_code == self.command.exits


def pages() -> list[Path]:
    """README, and all pages but decisions, which say what was so when they were made."""
    written = sorted((ROOT / "docs").rglob("*.md"))
    return [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(one for one in written if one.parent.name != "decisions")]


def walk_page(
    page: Path, folder: Path, environment: Mapping[str, str], *, repository: Path | None = None, wheel: str = ""
) -> Iterator[Tried]:
    """Try every command of a page, in its order.

    Args:
        page: to walk.
        folder: empty, in which the commands run.
        environment: of the commands.
        repository: a copy, for ``make``; without one such commands are not tried.
        wheel: what ``bowden`` stands for in ``pip install``; without one such commands are not tried.
    """
    found = steps(page)
    for one in reversed(found):  # of a file that the page writes twice, the first one is there at the beginning
        if isinstance(one, PageFile) and not one.added:
            _write(folder, one)
    own = {"XDG_STATE_HOME": str(folder / ".state")}
    with ExitStack() as beside:
        for one in found:
            if isinstance(one, PageFile):
                _write(folder, one)
                continue
            why = one.elsewhere
            if (_REPOSITORY.match(one.text) and repository is None) or (one.text.startswith("pip") and not wheel):
                why = why or "is tried in a fresh environment alone"
            if why:
                yield Tried(one, None, 0.0, why, "")
                continue
            text = _PACKAGE.sub(rf"'{wheel}\1'", one.text) if wheel and one.text.startswith("pip") else one.text
            where = repository if repository and _REPOSITORY.match(one.text) else folder
            if one.beside:
                yield beside.enter_context(_beside(one, text, where, dict(environment) | own))
                continue
            for again in range(_TRIES if "--twin" in text else 1):
                tried = _tried(one, text, where, dict(environment) | own)._replace(again=again)
                if tried.passed:
                    break
            yield tried


def _write(folder: Path, one: PageFile) -> None:
    path = folder / one.name
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a" if one.added else "w", encoding="utf-8") as file:
        file.write(one.text)


def _tried(one: PageCommand, text: str, where: Path, environment: Mapping[str, str]) -> Tried:
    begun, code = time.perf_counter(), None
    with tempfile.TemporaryFile() as output:
        process = _started(text, where, environment, output.fileno())
        try:
            code = process.wait(_LONGEST)
        except subprocess.TimeoutExpired:
            _end(process)
        output.seek(0)
        said = output.read().decode(errors="replace")
    return Tried(one, code, time.perf_counter() - begun, "", said[-2000:])


@contextmanager
def _beside(one: PageCommand, text: str, where: Path, environment: Mapping[str, str]) -> Iterator[Tried]:
    """A command that runs while the page goes on; it passes if it runs after a moment."""
    with tempfile.TemporaryFile() as output:
        process = _started(text, where, environment, output.fileno())
        try:
            code: int | None = process.wait(_SETTLED)
        except subprocess.TimeoutExpired:
            code = one.exits  # as it is to be: it runs
        output.seek(0)
        try:
            yield Tried(one, code, _SETTLED, "", output.read().decode(errors="replace")[-2000:])
        finally:
            _end(process)


def _started(text: str, where: Path, environment: Mapping[str, str], output: int) -> "subprocess.Popen[bytes]":
    return subprocess.Popen(
        ["bash", "-c", text],
        cwd=where,
        env=dict(environment),
        stdin=subprocess.DEVNULL,
        stdout=output,
        stderr=subprocess.STDOUT,
        start_new_session=True,
    )


def _end(process: "subprocess.Popen[bytes]") -> None:
    """Interrupt a command and what it started, and end what does not end by itself."""
    for how in (signal.SIGINT, signal.SIGKILL):
        if process.poll() is None:
            os.killpg(process.pid, how)
            try:
                process.wait(_ENDING)
            except subprocess.TimeoutExpired:
                continue


class FreshComputer:
    """A home, an environment with the package alone, and a copy of the repository; all in one folder."""

    def __init__(self, folder: Path) -> None:
        """Build the package and install it; takes a minute or more."""
        self._folder = folder
        self.repository = folder / "repository"
        self.repository.mkdir()
        archive = subprocess.run(["git", "archive", "HEAD"], cwd=ROOT, check=True, capture_output=True)
        subprocess.run(["tar", "x"], cwd=self.repository, input=archive.stdout, check=True)
        pip = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir"]
        subprocess.run([*pip, str(folder / "wheel"), str(self.repository)], check=True)
        self.wheel = str(next((folder / "wheel").glob("*.whl")))
        self._common = self._environment("common")

    def environment(self, page: Path) -> dict[str, str]:
        """Of a page's commands: one of its own if it installs anything, and else the common one."""
        installs = any(one.text.startswith("pip") for one in commands(page))
        return self._environment(page.stem) if installs else self._common

    def _environment(self, name: str) -> dict[str, str]:
        place, home = self._folder / name, self._folder / "home"
        venv.create(place, with_pip=True)
        home.mkdir(exist_ok=True)
        subprocess.run([place / "bin" / "python", "-m", "pip", "install", "--quiet", self.wheel], check=True)
        kept = {key: value for key, value in os.environ.items() if not key.startswith(("PYTHON", "VIRTUAL_ENV", "XDG"))}
        caches = {"PIP_CACHE_DIR": os.environ.get("PIP_CACHE_DIR", str(Path.home() / ".cache" / "pip"))}
        return kept | caches | {"HOME": str(home), "PATH": f"{place / 'bin'}{os.pathsep}{kept['PATH']}"}


def rows(walked: Sequence[Tried]) -> list[Row]:
    """What became of a page's commands, for JSON."""
    return [
        {
            "line": one.command.line,
            "command": one.command.text,
            "expected": one.command.exits,
            "exit_code": one.exit_code,
            "passed": one.passed,
            "not_tried": one.why_not,
            "again": one.again,
            "seconds": round(one.seconds, 1),
        }
        for one in walked
    ]


def table(found: Mapping[str, Sequence[Row]]) -> str:
    """Pages, commands and what became of them, in Markdown."""
    lines = ["| page | commands | ended as the page says | not tried here | s |", "|---|---|---|---|---|"]
    lines += [f"| {page} | {_counts(tried)} |" for page, tried in found.items()]
    everything = [(page, one) for page, tried in found.items() for one in tried]
    lines.append(f"| **all** | {_counts([one for _, one in everything])} |")
    reasons = Counter(one["not_tried"] for _, one in everything if one["not_tried"])
    if reasons:
        said = "; what ".join(f"{why} ({count})" for why, count in reasons.most_common())
        lines += ["", f"Not tried: what {said}."]
    again = sum(one["passed"] and one["again"] > 0 for _, one in everything)
    if again:
        said = "ended as they should when they were tried again: other work had ended them before"
        lines += ["", f"Of the runs in real time {again} {said}."]
    failed = [(page, one) for page, one in everything if not one["passed"] and not one["not_tried"]]
    lines += ["", "Not as the page says:", ""] if failed else []
    for page, one in failed:
        ended = f"ended with {one['exit_code']}, not {one['expected']}"
        lines.append(f"- {page}:{one['line']}: `{one['command']}` {ended}")
    return "\n".join(lines)


def _name(page: Path) -> str:
    """As from the repository, where it is a page of it."""
    return str(page.relative_to(ROOT) if page.is_relative_to(ROOT) else page.name)


def _counts(tried: Sequence[Row]) -> str:
    passed, left = sum(one["passed"] for one in tried), sum(bool(one["not_tried"]) for one in tried)
    return f"{len(tried)} | {passed} | {left} | {sum(one['seconds'] for one in tried):.0f}"


def key(page: Path, package: str) -> str:
    """Changes with the page, and with the package."""
    return hashlib.sha256(f"{package}\n{page.read_text(encoding='utf-8')}".encode()).hexdigest()[:16]


def package_of_head() -> str:
    """Names of what the last commit's package is made of, which change with it."""
    return _git("rev-parse", *(f"HEAD:{one}" for one in _SOURCE))


def _git(*words: str) -> str:
    return subprocess.run(["git", *words], cwd=ROOT, check=True, capture_output=True, text=True).stdout


def kept() -> dict[str, dict[str, Any]]:
    """What became of each page, in the pages' order; of pages that are no more, nothing."""
    found = json.loads(KEPT.read_text(encoding="utf-8")) if KEPT.is_file() else {}
    return {_name(page): found[_name(page)] for page in pages() if _name(page) in found}


def _done(page: Path, package: str) -> bool:
    """Whether the page passed when it was last walked, and nothing has changed since."""
    last = kept().get(_name(page))
    if last is None or last["key"] != key(page, package):
        return False
    return all(one["passed"] or one["not_tried"] for one in last["rows"])


def _keep(page: Path, package: str, commit: str, walked: list[Row]) -> None:
    """Remember a page's walk, and write the table of all pages' last walks."""
    day = time.strftime("%d %B %Y", time.gmtime())
    KEPT.parent.mkdir(exist_ok=True)
    with whole_file(KEPT) as part:
        one = {"key": key(page, package), "day": day, "commit": commit, "rows": walked}
        part.write_text(json.dumps(kept() | {_name(page): one}, indent=1), encoding="utf-8")
    write(package)


def write(package: str) -> None:
    """Write the result file of all pages' last walks, of which `make docs` makes the table."""
    from measure import write_rows

    found = kept()
    columns, _, *rows = (line.strip("| ").split(" | ") for line in made_of(found).split("\n\n")[0].splitlines())
    said = made_of(found).partition("\n\n")[2].replace("\n", " ")
    commits = ", ".join(dict.fromkeys(one["commit"] for one in found.values()))
    how = [said, f"Walked {_days(found)}, with the wheel of {commits}."]
    older = [_name(one) for one in pages() if _name(one) in found and found[_name(one)]["key"] != key(one, package)]
    missing = [_name(one) for one in pages() if commands(one) and _name(one) not in found]
    how += [f"Changed since, itself or the package: {', '.join(older)}."] if older else []
    how += [f"Not walked yet: {', '.join(missing)}."] if missing else []
    write_rows("walk", WHAT, "make walk", columns, rows, " ".join(how))


def made_of(found: Mapping[str, Mapping[str, Any]]) -> str:
    """The table of what is kept."""
    return table({name: one["rows"] for name, one in found.items()})


def _days(found: Mapping[str, Mapping[str, Any]]) -> str:
    """Of all walks, in their order."""
    days = sorted({one["day"] for one in found.values()}, key=lambda day: time.strptime(day, "%d %B %Y"))
    return f"on {days[0]}" if len(days) == 1 else f"from {days[0]} to {days[-1]}"


def main() -> int:
    """The command; its exit code is 1 where a command did not end as its page says."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("pages", nargs="*", type=Path, help="files; all pages without them")
    parser.add_argument("--here", action="store_true", help="in the environment of this Python, not in a fresh one")
    parser.add_argument(
        "--write",
        action="store_true",
        help="keep what became of each page, write benchmarks/results/walk.toml, leave out what has passed",
    )
    parser.add_argument("--json", action="store_true", help="one JSON document, nothing else")
    given = parser.parse_args()
    chosen = [one.resolve() for one in given.pages] or pages()
    package, commit = package_of_head(), _git("rev-parse", "--short", "HEAD").strip()
    chosen = [page for page in chosen if commands(page) and not (given.write and _done(page, package))]
    folder = Path(tempfile.mkdtemp(prefix="bowden-walk-"))
    found: dict[str, list[Row]] = {}
    try:
        fresh = FreshComputer(folder) if chosen and not given.here else None
        for page in chosen:
            place = folder / "pages" / _name(page)
            place.mkdir(parents=True)
            if fresh:
                walked = walk_page(page, place, fresh.environment(page), repository=fresh.repository, wheel=fresh.wheel)
            else:
                path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
                walked = walk_page(page, place, dict(os.environ) | {"PATH": path})
            found[_name(page)] = rows(list(_reported(page, walked)))
            if given.write:
                _keep(page, package, commit, found[_name(page)])
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    print(json.dumps(found, indent=2) if given.json else table(found))
    return int(any(not one["passed"] and not one["not_tried"] for tried in found.values() for one in tried))


def _reported(page: Path, walked: Iterator[Tried]) -> Iterator[Tried]:
    for one in walked:
        state = (one.why_not and "not tried") or ("passed" if one.passed else f"FAILED with {one.exit_code}")
        where = f"{_name(page)}:{one.command.line}"
        print(f"{where}: {one.command.text}: {state}, {one.seconds:.1f} s", file=sys.stderr, flush=True)
        if not one.passed and not one.why_not:
            print(one.said, file=sys.stderr, flush=True)
        yield one


if __name__ == "__main__":
    sys.path.append(str(ROOT / "benchmarks"))
    sys.exit(main())
