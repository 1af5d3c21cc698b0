"""Self-contained HTML pages: text, tables and figures in one file that needs no network and no script."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from bowden import __version__
from bowden.core import style
from bowden.core.files import write_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_NUMBER = re.compile(r"[<>≤≥≈±+\-−]?\s?\d[\d.,]*(e[+\-]?\d+)?(\s?[±…×]\s?\d[\d.,]*(e[+\-]?\d+)?)*\s?[^\s\d]{0,6}", re.I)
_EMPTY = ("", "–", "—", "-")
_LONG = 40  # characters of a table's cell that deserve a wide column
_BLOCK = re.compile(r"\s*<(p|ul|ol|dl|div|pre|blockquote|h3|details)\b")


class _Heading(NamedTuple):
    text: str
    anchor: str
    level: int
    kind: str = "heading"


class _Text(NamedTuple):
    html: str
    kind: str


class _Figure(NamedTuple):
    svg: str
    caption: str
    number: int
    kind: str = "figure"


class _Cell(NamedTuple):
    text: str
    css: str


class _Table(NamedTuple):
    header: list[_Cell]
    rows: list[tuple[str, list[_Cell]]]
    caption: str
    kind: str = "table"


class Page:
    """A page that is filled from top to bottom and then written.

    Args:
        title: plain text.
        lead: one or two sentences under the title, plain text.
    """

    def __init__(self, title: str, lead: str = "") -> None:
        self._title, self._lead = title, lead
        self._parts: list[_Heading | _Text | _Figure | _Table] = []

    def heading(self, text: str, level: int = 2) -> None:
        """A heading, plain text; those of level 2 make up the page's contents."""
        count = sum(part.kind == "heading" for part in self._parts)
        self._parts.append(_Heading(text, f"part-{count + 1}", level))

    def text(self, html: str, **values: object) -> None:
        """A paragraph, or blocks, of HTML; `values` are escaped and put where the HTML names them in braces.

        What comes from outside (the name of a log, a column) must come as one of `values`.
        """
        from markupsafe import Markup

        filled = str(Markup(html).format(**values)) if values else html
        self._parts.append(_Text(filled if _BLOCK.match(filled) else f"<p>{filled}</p>", "text"))

    def notice(self, text: str) -> None:
        """A warning or remark that must not be overlooked, plain text."""
        self._parts.append(_Text(text, "notice"))

    def figure(self, figure: "Figure | str", caption: str = "") -> None:
        """A figure as inline SVG, numbered; the caption is plain text.

        Args:
            figure: matplotlib's, or what `inline` made of the figure of this number.
            caption: plain text.
        """
        number = 1 + sum(part.kind == "figure" for part in self._parts)
        svg = figure if isinstance(figure, str) else inline(figure, number)
        self._parts.append(_Figure(svg, caption, number))

    def table(
        self, header: Sequence[str], rows: Sequence[Sequence[str]], caption: str = "", classes: Sequence[str] = ()
    ) -> None:
        """A table of plain text; columns in which every cell is a number, blank or a dash are set to the right.

        A line break in a cell is kept.

        Args:
            header: one name a column.
            rows: one cell a column.
            caption: plain text.
            classes: a CSS class for each row; `fitted`, `reproduced`, `better`, `differs`, `erratum` and `best`
                have colours.

        Raises:
            ValueError: a row or `classes` of another length.
        """
        classes = classes or [""] * len(rows)
        if len(classes) != len(rows) or any(len(row) != len(header) for row in rows):
            raise ValueError(f"a table of {len(header)} columns and {len(classes)} classes, with rows of other lengths")
        css = [_column_class([row[i] for row in rows]) for i in range(len(header))]

        def cells(row: Sequence[str]) -> list[_Cell]:
            return [_Cell(text, name) for text, name in zip(row, css, strict=True)]

        marked = [(name, cells(row)) for name, row in zip(classes, rows, strict=True)]
        self._parts.append(_Table(cells(header), marked, caption))

    def html(self) -> str:
        """The page as text; the same content gives the same bytes."""
        from jinja2 import Environment, FileSystemLoader, StrictUndefined
        from markupsafe import Markup

        folder = Path(__file__).with_name("templates")
        environment = Environment(
            loader=FileSystemLoader(folder),
            autoescape=True,
            undefined=StrictUndefined,
            trim_blocks=True,
            lstrip_blocks=True,
        )
        return environment.get_template("page.html").render(
            title=self._title,
            lead=self._lead,
            parts=self._parts,
            contents=[part for part in self._parts if isinstance(part, _Heading) and part.level == 2],
            style=Markup((folder / "page.css").read_text(encoding="utf-8")),
            version=__version__,
        )

    def write(self, path: Path | str) -> None:
        """Write the page, whole or not at all.

        Raises:
            OutputError: the file cannot be written.
        """
        text = self.html()
        write_text(path, text)


def inline(figure: "Figure", number: int) -> str:
    """The SVG of a page's figure; its ids begin with the figure's number."""
    return style.svg(figure, f"figure-{number}-")


def _column_class(cells: Sequence[str]) -> str:
    """How a column of a table is set: numbers to the right, long texts with room."""
    filled = [cell for cell in cells if cell not in _EMPTY]
    if filled and all(_NUMBER.fullmatch(cell) for cell in filled):
        return "number"
    return "long" if max(map(len, filled), default=0) > _LONG else ""
