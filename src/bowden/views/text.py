"""Tables, lines and next steps in a terminal."""

import shlex
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Call:
    """Call of an operation."""

    given: dict[str, Any]
    """Parameter → value, of the operation and of what writes its files."""
    options: dict[str, str]
    """Parameter → its switch."""
    clock: Callable[[], float] = lambda: 0.0
    """Time since the command began [s]."""
    write: Callable[["Call"], Sequence[Path]] = lambda call: ()
    """Writes the files of the result, and says which."""

    @cached_property
    def files(self) -> tuple[Path, ...]:
        """Files that are written, the page last, when first asked for: figures are printed even if a disk is full."""
        return tuple(self.write(self))

    @property
    def seconds(self) -> float:
        """Since the command began [s]."""
        return self.clock()

    def __getitem__(self, name: str) -> Any:
        return self.given[name]

    def repeated(self, *names: str) -> Iterator[str]:
        """The options of these names that were given, for another command."""
        for name in names:
            value = self.given.get(name)
            for one in value if isinstance(value, list) else [] if value is None else [value]:
                yield from (self.options[name], str(one))

    def page(self) -> None:
        """Say where the page is, and how long it took."""
        print(f"\nPage: {self.files[-1]}  ({self.seconds:.1f} s)")


def say_next(*words: Any, why: str = "") -> None:
    """Print the command that comes next.

    Args:
        words: after ``bowden``.
        why: what it does, where that is not plain.

    >>> say_next("simulate", "my rig.toml")
    Next: bowden simulate 'my rig.toml'
    """
    print(next_line(*words, why=why))


def next_line(*words: Any, why: str = "") -> str:
    """The line that `say_next` prints."""
    return f"Next: {shlex.join(['bowden', *map(str, words)])}{f'  # {why}' if why else ''}"


def free_name(path: Path) -> Path:
    """The path itself, or one with a number, under which nothing is."""
    found, count = path, 1
    while found.exists():
        count += 1
        found = path.with_name(f"{path.stem}-{count}{path.suffix}")
    return found


def say(*lines: str) -> None:
    """Print to standard error."""
    for line in lines:
        print(line, file=sys.stderr, flush=True)


def rows(found: Iterable[tuple[str, str]], least: int = 0, indent: str = "") -> None:
    """A label and a text on each line, without those that say nothing."""
    shown = [(label, text) for label, text in found if text]
    width = max([least, *(len(label) for label, _ in shown)])
    for label, text in shown:
        print(f"{indent}{label:<{width}} {text}")


def table(titles: Sequence[str], lines: Iterable[Sequence[Any]], *, left: Sequence[str] = (), width: int = 120) -> None:
    """A table: the first column is text, the others are figures; ``–`` for one that does not exist.

    Args:
        titles: of the columns.
        lines: cells; numbers are rounded to three digits.
        left: titles of further columns of text.
        width: where the output is no terminal [characters].
    """
    from rich import box
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    drawn = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for i, title in enumerate(titles):
        text = i == 0 or title in left
        drawn.add_column(escape(title), justify="left" if text else "right", no_wrap=i > 0, overflow="fold")
    for line in lines:
        drawn.add_row(*(escape(cell(value)) for value in line))
    Console(width=None if sys.stdout.isatty() else width).print(drawn)


def cell(value: Any) -> str:
    """A figure with three digits; ``–`` for one that does not exist.

    >>> cell(0.12345), cell(None), cell("law")
    ('0.123', '–', 'law')
    """
    return "–" if value is None else f"{value:.3g}" if isinstance(value, float) else str(value)
