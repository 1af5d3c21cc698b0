"""Self-contained HTML pages: text, tables and figures in one file that needs no network and no script.

On a screen they are light or dark, as the reader's system is; on paper they are black on white, and no figure or short
table is broken between two pages.
"""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bowden import __version__
from bowden.core.files import write_text
from bowden.drawing import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_NUMBER = re.compile(
    r"[<>≤≥≈±+\-−(]?\s?\d[\d.,]*(e[+\-]?\d+)?(\s?[±…×]\s?\d[\d.,]*(e[+\-]?\d+)?)*\s?[^\s\d]{0,6}", re.I
)
_EMPTY = ("", "–", "—", "-")
_LONG, _LONGEST = 40, 200  # characters of a table's cell that deserve a wide column, and a wider one
_MOST_VALUES = 8  # of a list in settings; a longer one (way points of a recording) is cut
_BLOCK = re.compile(r"\s*<(p|ul|ol|dl|div|pre|blockquote|h3|details)\b")
_SHORT, _DENSE = 14, 9
"""Most rows of a table that is not broken between two printed pages; columns from which on cells stand closer."""

_DARK = {
    "#000000": "#e4e6e8",
    "#ffffff": "#15181c",
    "#222222": "#e4e6e8",
    "#666666": "#959ba2",
    "#e3e3e3": "#30353b",
    "#0072b2": "#4fa8e0",
    "#d55e00": "#f27b30",
    "#009e73": "#2dbf95",
    "#cc79a7": "#de93be",
    "#e69f00": "#f0b429",
    "#56b4e9": "#86cdf5",
    "#8c8c8c": "#a6a6a6",
    "#5f6b76": "#97a4b1",
    "#b3b3b3": "#7a8087",
    "#882255": "#d7709f",
    "#6a51a3": "#a48fe0",
    "#999933": "#c6c65e",
    "#8a5a2b": "#c99560",
    "#44aa99": "#6fd3c3",
    "#c9ced3": "#4d555d",
    "#b5d3e7": "#27506b",
    "#e8e8e8": "#3a3f45",
    "#cfe3f1": "#1f4560",
    "#a9d8c6": "#1f5a45",
    "#f6dfa8": "#6b5316",
    "#f3c39f": "#6e3f1c",
    "#efb0a8": "#6e2f28",
    "#d9ebf7": "#1b3850",
    "#fde3c8": "#4a3016",
}
"""A figure's colour on white paper → on a dark screen."""
_SHADE = re.compile(r"\b(fill|stroke): (" + "|".join(_DARK) + r")\b")


class Page:
    """A page that is filled from top to bottom and then written.

    Args:
        title: plain text.
        lead: one or two sentences under the title, plain text.
    """

    def __init__(self, title: str, lead: str = "") -> None:
        self._title, self._lead = title, lead
        self._parts: list[dict[str, Any]] = []
        """Of each its kind, heading, text, notice, figure or table, and what the template takes of that kind."""

    def heading(self, text: str, level: int = 2) -> None:
        """A heading, plain text; those of level 2 make up the page's contents."""
        self._parts.append({"kind": "heading", "text": text, "anchor": f"part-{self._next('heading')}", "level": level})

    def _next(self, kind: str) -> int:
        """Number of the next part of a kind, from 1."""
        return 1 + sum(part["kind"] == kind for part in self._parts)

    def text(self, html: str, **values: object) -> None:
        """A paragraph, or blocks, of HTML; `values` are escaped and put where the HTML names them in braces.

        What comes from outside (the name of a log, a column) must come as one of `values`.
        """
        from markupsafe import Markup

        filled = str(Markup(html).format(**values)) if values else html
        self._parts.append({"kind": "text", "html": filled if _BLOCK.match(filled) else f"<p>{filled}</p>"})

    def notice(self, text: str) -> None:
        """A warning or remark that must not be overlooked, plain text."""
        self._parts.append({"kind": "notice", "html": text})

    def warnings(self, warnings: Iterable[str]) -> None:
        """Notices that begin with a small letter and have no full stop."""
        for warning in warnings:
            self.notice(f"{warning[0].upper()}{warning[1:]}.")

    def figure(self, figure: "Figure", caption: str = "") -> None:
        """A figure of matplotlib's as inline SVG, numbered; the caption is plain text."""
        number = self._next("figure")
        self._parts.append({"kind": "figure", "svg": _inline(figure, number), "caption": caption, "number": number})

    def part(self, heading: str, figure: "Figure | None", caption: str) -> None:
        """A heading with a figure below it; nothing of what has no figure."""
        if figure is not None:
            self.heading(heading)
            self.figure(figure, caption)

    def table(
        self, header: Sequence[str], rows: Sequence[Sequence[str]], caption: str = "", classes: Sequence[str] = ()
    ) -> None:
        """A table of plain text; columns in which every cell is a number, blank or a dash are set to the right.

        A line break in a cell is kept.

        Args:
            header: one name a column.
            rows: one cell a column.
            caption: plain text.
            classes: a CSS class for each row; `fitted`, `reproduced`, `better`, `not-determined`, `differs`,
                `misprint` and `best` have colours.

        Raises:
            ValueError: a row or `classes` of another length.
        """
        classes = classes or [""] * len(rows)
        if len(classes) != len(rows) or any(len(row) != len(header) for row in rows):
            raise ValueError(f"a table of {len(header)} columns and {len(classes)} classes, with rows of other lengths")
        css = [_column_class([row[i] for row in rows]) for i in range(len(header))]

        def cells(row: Sequence[str]) -> list[dict[str, str]]:
            return [{"text": text, "css": name} for text, name in zip(row, css, strict=True)]

        marked = [(name, cells(row)) for name, row in zip(classes, rows, strict=True)]
        kinds = ("short", len(rows) <= _SHORT), ("dense", len(header) >= _DENSE)
        table = {"header": cells(header), "rows": marked, "caption": caption}
        self._parts.append({"kind": "table", **table, "css": " ".join(name for name, so in kinds if so)})

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
            contents=[part for part in self._parts if part.get("level") == 2],
            style=Markup((folder / "page.css").read_text(encoding="utf-8") + _dark_figures()),
            version=__version__,
        )

    def write(self, path: Path | str) -> None:
        """Write the page, whole or not at all.

        Raises:
            OutputError: the file cannot be written.
        """
        text = self.html()
        write_text(path, text)


def _inline(figure: "Figure", number: int) -> str:
    """The SVG of a page's figure; its ids begin with the figure's number.

    A colour that has another one on a dark screen becomes a variable of the page, with the colour as its default.
    """
    drawn = style.svg(figure, f"figure-{number}-")
    return _SHADE.sub(lambda found: f"{found[1]}: var(--c{found[2][1:]}, {found[2]})", drawn)


def _dark_figures() -> str:
    """CSS: the figures' colours on a dark screen. Paper stays white, whatever the screen is."""
    shades = " ".join(f"--c{light[1:]}: {dark};" for light, dark in _DARK.items())
    return f"@media screen and (prefers-color-scheme: dark) {{ :root {{ {shades} }} }}\n"


def _column_class(cells: Sequence[str]) -> str:
    """How a column of a table is set: numbers to the right, long texts with room."""
    filled = [cell for cell in cells if cell not in _EMPTY]
    if filled and all(_NUMBER.fullmatch(cell) for cell in filled):
        return "number"
    longest = max(map(len, filled), default=0)
    return "longest" if longest > _LONGEST else "long" if longest > _LONG else ""


def flat(value: Any, prefix: str = "") -> Iterator[tuple[str, str]]:
    """Nested settings as dotted names and short texts."""
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from flat(inner, f"{prefix}.{key}" if prefix else str(key))
    elif isinstance(value, float):
        yield prefix, f"{value:.6g}"
    elif isinstance(value, list | tuple):
        head = ", ".join(f"{item:.4g}" if isinstance(item, float) else str(item) for item in value[:_MOST_VALUES])
        yield prefix, f"{head}, … ({len(value)} values)" if len(value) > _MOST_VALUES else head
    else:
        text = "none" if value is None else str(value)
        yield prefix, text if len(text) <= _LONGEST else f"{text[: _LONGEST - 1]}…"
