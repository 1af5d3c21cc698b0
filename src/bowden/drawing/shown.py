"""How a result shows itself: one screen of text in a terminal, a table and a picture in a notebook."""

import hashlib
import html
import shutil
import textwrap
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import numpy as np

from bowden.core.errors import ParameterError, article

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Rows = Iterable[tuple[str, str]]
"""Label and text of each line."""

_WIDEST = 100
_MOST_LINES = 4
_IDS = "shown-ids-"
_NOTHING = 1e-9
"""A figure below this is rounding."""


class Panels(NamedTuple):
    """The axes on which a result is drawn."""

    rows: int
    columns: int
    width: float
    """Of the figure [inch]."""
    height: float
    """Of the figure [inch]."""


class Shown:
    """A result that shows itself: one screen of text in a terminal, a table in a notebook."""

    def _title(self) -> str:
        raise NotImplementedError

    def _rows(self) -> Rows:
        raise NotImplementedError

    def _picture(self) -> "Figure | None":
        """Stands below the table."""
        return None

    def __repr__(self) -> str:
        return screen(self._title(), self._rows())

    def _repr_html_(self) -> str:
        return fragment(self._title(), self._rows(), self._picture())


class Plotted(Shown):
    """A result that can be drawn, too; its picture is of all its panels."""

    _panels: ClassVar[Panels]

    def _draw(self, axes: "Sequence[Axes]") -> None:
        """Draw on one pair of axes, or on those of all panels."""
        raise NotImplementedError

    def _drawable(self) -> bool:
        """True if a table of it has a picture."""
        return True

    def _picture(self) -> "Figure | None":
        if not self._drawable():
            return None
        from bowden.drawing import style

        rows, columns, width, height = self._panels
        figure, axes = style.new_figure(rows, columns, width, height, share_x=True)
        self._draw(axes)
        return figure

    def plot(self, axes: "Axes | Sequence[Axes] | None" = None) -> "list[Axes]":
        """Draw it; what is drawn, its class says.

        Args:
            axes: matplotlib's, one or as many as are made; a new figure is made where they are not given.

        Returns:
            The axes; ``axes[0].figure`` is theirs.

        Raises:
            ParameterError: something else than axes, or nothing that can be drawn.
        """
        found = axes_for(axes, *self._panels)
        self._draw(found)
        return found


def screen(title: str, rows: Rows) -> str:
    """A title, and a line for each row; a long text is wrapped, and cut after four lines.

    >>> print(screen("a thing", [("verdict", "holds"), ("gains", "")]))
    a thing
      verdict  holds
    """
    shown = [(label, text) for label, text in rows if text]
    room = max((len(label) for label, _ in shown), default=0)
    width = max(40, min(_WIDEST, shutil.get_terminal_size((_WIDEST, 24)).columns))
    lines = [title]
    for label, text in shown:
        first, hanging = f"  {label:<{room}}  ", " " * (room + 4)
        lines += textwrap.wrap(
            text,
            width,
            initial_indent=first,
            subsequent_indent=hanging,
            break_on_hyphens=False,
            break_long_words=False,
            max_lines=_MOST_LINES,
            placeholder=" …",
        )
    return "\n".join(lines)


def fragment(title: str, rows: Rows, figure: "Figure | None" = None) -> str:
    """The same as HTML for a notebook, with a picture below where there is one.

    >>> fragment("a < b", [("verdict", "holds")])  # doctest: +ELLIPSIS
    '<div><b>a &lt; b</b><table><tr><td style="white-space:nowrap">verdict</td><td style="text-align:left">holds...
    """
    label_style, text_style = 'style="white-space:nowrap"', 'style="text-align:left"'
    cells = "".join(
        f"<tr><td {label_style}>{html.escape(label)}</td><td {text_style}>{html.escape(text)}</td></tr>"
        for label, text in rows
        if text
    )
    return _titled(title, cells, figure)


def table(title: str, names: Sequence[str], rows: Iterable[Sequence[str]], figure: "Figure | None" = None) -> str:
    """A table as HTML for a notebook, with a picture below where there is one.

    >>> table("two", ["law", "RMSE"], [("a", "1°")])
    '<div><b>two</b><table><tr><th>law</th><th>RMSE</th></tr><tr><td>a</td><td>1°</td></tr></table></div>'
    """
    head = "".join(f"<th>{html.escape(name)}</th>" for name in names)
    cells = "".join(f"<tr>{''.join(f'<td>{html.escape(text)}</td>' for text in row)}</tr>" for row in rows)
    return _titled(title, f"<tr>{head}</tr>{cells}", figure)


def _titled(title: str, cells: str, figure: "Figure | None") -> str:
    drawn = "" if figure is None else _svg(figure)
    return f"<div><b>{html.escape(title)}</b><table>{cells}</table>{drawn}</div>"


def _svg(figure: "Figure") -> str:
    """A figure whose ids are its own on any page, and the same whenever it is drawn."""
    from bowden.drawing import style

    text = style.svg(figure, _IDS)
    return text.replace(_IDS, f"shown-{hashlib.sha256(text.encode()).hexdigest()[:12]}-")


def axes_for(
    given: "Axes | Sequence[Axes] | None", rows: int, columns: int, width: float, height: float
) -> "list[Axes]":
    """Axes to draw on: those handed in, or a new figure's, made through pyplot so that ``plt.show()`` shows it.

    Args:
        given: one or several; None to make `rows` × `columns` of them.
        rows: rows of axes that are made.
        columns: columns of axes that are made.
        width: of the figure that is made [inch].
        height: of the figure that is made [inch].

    Raises:
        ParameterError: something else than axes, or more than can be drawn on.
    """
    from matplotlib.axes import Axes

    if given is None:
        from matplotlib import pyplot

        from bowden.drawing import style

        with style.drawing():
            _, made = pyplot.subplots(
                rows, columns, figsize=(width, height), layout="constrained", squeeze=False, sharex="col"
            )
        return list(made.flat)
    found = [given] if isinstance(given, Axes) else list(np.ravel(np.asarray(given, dtype=object)))
    wrong = next((one for one in found if not isinstance(one, Axes)), None)
    if wrong is not None or not 1 <= len(found) <= rows * columns:
        most = "" if rows * columns == 1 else f", or a list of up to {rows * columns}"
        what = f"{len(found)} axes" if wrong is None else article(type(wrong).__name__)
        raise ParameterError(f"plot: axes is {what}", expected=f"matplotlib axes{most}", do="leave it out for new ones")
    return found


def number(value: float | None, unit: str = "", digits: int = 3) -> str:
    """A number with its unit; empty where there is none.

    >>> number(0.12345, "°"), number(12.0, "ms"), number(None, "s")
    ('0.123°', '12 ms', '')
    """
    if value is None:
        return ""
    value = 0.0 if abs(value) < _NOTHING else value
    return f"{value:.{digits}g}{'' if unit in ('', '°') else ' '}{unit}"


def listed(parts: Iterable[str], between: str = ", ") -> str:
    """The parts that say something, in a row."""
    return between.join(part for part in parts if part)
