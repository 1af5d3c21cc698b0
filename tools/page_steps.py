"""What a written page asks its reader to do: files to write and commands to type, in the order in which they stand.

Files are code blocks that follow a line with nothing but the file's name, as `` `rig.toml`: ``, and Python that begins
with ``# name.py``; after ``Add to `rig.toml`:`` a block is added to the file. Commands are lines that begin with a
program's name in indented blocks, lines after ``$ `` in ``console`` blocks, with the output shown below them, and in
``text`` blocks, whose output is not to be compared, and lines of ``bash`` blocks. A command's comment may say with
which exit code it ends: ``# exit code 1``.

A comment that no reader sees says what is special about the next block:

    <!-- walk: exit 2 -->                 its commands end with this code, and not with 0
    <!-- walk: not here: REASON -->       its commands cannot be tried
    <!-- walk: beside -->                 its commands run until the page ends

What needs a thing that no computer has by itself can be seen by the command: see `ELSEWHERE`.
"""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

_PROGRAMS = "bowden|make|pip|python|cat|sudo"
_INDENTED = re.compile(rf" {{4,}}(?:\$ )?((?:{_PROGRAMS}) .*)")
_NAMED = re.compile(r"(Add to )?`([\w./-]+\.(?:toml|py|csv))`:")
_EXITS = re.compile(r"#.*\bexit code (\d+)")
_MARK = re.compile(r"<!-- walk: (.+?) -->")
_FENCE = re.compile(r"```(\w*)")

ELSEWHERE = (
    (r"bowden (?:run|measure)\b(?!.*--twin)(?!.*--help)", "needs a drive"),
    (r"bowden confirm\b", "needs a drive, and a hand that turns the motor"),
    (r"bowden .*\b(?:lsl:NAME|trigno:HOST)", "needs a stream of EMG"),
    (r"bowden campaign .*--cluster tcp://", "needs a scheduler on other computers"),
    (r"sudo ip\b", "needs an interface of CAN, and root"),
    (r"make demo LOG=", "needs a log of the reader"),
    (r"make (?:test|long|bench|soak|walk)\b", "is a run of tests or benchmarks of its own"),
    (r"python (?:benchmarks/|-m coverage)", "is a benchmark or a measurement of tests, of minutes to hours"),
)
"""What a command that cannot be tried looks like → why not."""
_BESIDE = re.compile(r"bowden (?:twin (?!.*--(?:status|inject|clear))|emg (?:stream|serve)\b)")
"""What runs until it is ended."""


class PageFile(NamedTuple):
    """A file that the reader writes."""

    line: int
    name: str
    text: str
    added: bool = False
    """Whether it is added to what the file has."""


class PageCommand(NamedTuple):
    """A command that the reader types."""

    line: int
    text: str
    """Without its comment."""
    shown: str | None
    """The output that stands below it; None where none does."""
    exits: int
    """The code that it ends with."""
    elsewhere: str
    """Why it cannot be tried; empty where it can."""
    beside: bool
    """Whether it runs until the page ends."""


def steps(path: Path) -> list[PageFile | PageCommand]:
    """What a page asks for, in its order."""
    return list(_steps(path.read_text(encoding="utf-8").split("\n")))


def commands(path: Path) -> list[PageCommand]:
    """The commands of a page."""
    return [one for one in steps(path) if isinstance(one, PageCommand)]


def _steps(lines: list[str]) -> Iterator[PageFile | PageCommand]:
    mark, i = "", 0
    named: re.Match[str] | None = None
    while i < len(lines):
        fence, begin = _FENCE.match(lines[i]), i
        if fence:
            i = next((k for k in range(i + 1, len(lines)) if lines[k].startswith("```")), len(lines))
            yield from _fenced(fence[1], lines[begin + 1 : i], begin + 2, named, mark)
        elif re.match(r" {4,}\S", lines[i]) and not lines[i - 1].strip():
            while i + 1 < len(lines) and re.match(r"    |$", lines[i + 1]):
                i += 1
            for k, text in _joined(lines[begin : i + 1], begin + 1):
                inside, one = _MARK.fullmatch(text.strip()), _INDENTED.fullmatch(text)
                mark = inside[1] if inside else mark
                if one:
                    yield _command(k, one[1], None, mark)
        if lines[i].strip():
            marked, named = _MARK.fullmatch(lines[i].strip()), _NAMED.fullmatch(lines[i].strip())
            mark = marked[1] if marked else ""
        i += 1


def _fenced(
    language: str, block: list[str], first: int, named: re.Match[str] | None, mark: str
) -> Iterator[PageFile | PageCommand]:
    """A code block's steps, from its lines and the number of the first of them."""
    own = re.fullmatch(r"# (\w+\.py)", block[0]) if language == "python" and block else None
    text = "".join(f"{line}\n" for line in block)
    if named:
        yield PageFile(first, named[2], f"\n{text}" if named[1] else text, bool(named[1]))
    elif own:
        yield PageFile(first, own[1], text)
    elif language in ("console", "text"):
        starts = [k for k, line in enumerate(block) if line.startswith("$ ")]
        for k, after in zip(starts, [*starts[1:], len(block)], strict=True):
            shown = "".join(f"{line}\n" for line in block[k + 1 : after]) if language == "console" else None
            yield _command(first + k, block[k][2:], shown, mark)
    elif language in ("bash", "sh", "shell"):
        yield from (_command(k, text, None, mark) for k, text in _joined(block, first) if text and text[0] != "#")


def _joined(block: list[str], first: int) -> Iterator[tuple[int, str]]:
    """Lines with their numbers, those that end in a backslash with the next ones."""
    whole, number = "", first
    for k, line in enumerate(block, first):
        number = number if whole else k
        whole += line.strip() if whole else line
        if line.endswith("\\"):
            whole = whole[:-1]
            continue
        yield number, whole
        whole = ""


def _command(line: int, text: str, shown: str | None, mark: str) -> PageCommand:
    exits = re.fullmatch(r"exit (\d+)", mark) or _EXITS.search(text)
    text = re.sub(r"\s+#.*$", "", text).strip()
    said = re.fullmatch(r"not here: (.+)", mark)
    if mark and not (re.fullmatch(r"exit \d+|beside", mark) or said):
        raise ValueError(f"line {line}: <!-- walk: {mark} --> says nothing that is known")
    elsewhere = said[1] if said else next((why for form, why in ELSEWHERE if re.match(form, text)), "")
    beside = mark == "beside" or bool(_BESIDE.match(text))
    return PageCommand(line, text, shown, int(exits[1]) if exits else 0, elsewhere, beside)
