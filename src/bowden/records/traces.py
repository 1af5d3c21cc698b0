"""Traces side by side: the runs of several laws on one rig."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from bowden.core.errors import UnknownNameError, near
from bowden.core.units import DEGREES
from bowden.drawing import shown
from bowden.records.trace import Trace

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_COLUMNS = ("RMSE", "after 10 s", "peak", "delay", "hysteresis width")

_DRAWN = {"time", "reference", "joint"}
"""Columns without which a trace has no figures of merit, and no curves."""


class Traces(dict[str, Trace]):
    """A dictionary, name → trace, that shows itself as a table of figures of merit and can be drawn.

    >>> import numpy as np
    >>> t = np.linspace(0.0, 10.0, 1001)
    >>> units = {"time": "s", "reference": "rad", "joint": "rad"}
    >>> one = Trace({"time": t, "reference": np.sin(t), "joint": 0.99 * np.sin(t)}, units)
    >>> Traces({"mine": one, "yours": one})
    2 traces
      mine   RMSE 0.396°, after 10 s 0.312°, peak 0.573°, delay 0.373 ms, hysteresis width 0°
      yours  RMSE 0.396°, after 10 s 0.312°, peak 0.573°, delay 0.373 ms, hysteresis width 0°
    """

    def __missing__(self, name: Any) -> Trace:
        raise UnknownNameError(f"there is no trace {name!r}", expected=near(str(name), self), do="name one of them")

    def plot(self, axes: "Axes | Sequence[Axes] | None" = None) -> "list[Axes]":
        """Draw all joints over time beside the first one's reference and, on second axes, their errors.

        Args:
            axes: matplotlib's, one or two; a new figure is made where they are not given.

        Returns:
            The axes; ``axes[0].figure`` is theirs.

        Raises:
            ParameterError: something else than axes, or a trace without reference or joint.
        """
        found = shown.axes_for(axes, 2, 1, 7.0, 4.2)
        self._draw(found)
        return found

    def _draw(self, axes: "Sequence[Axes]") -> None:
        from bowden.drawing.style import COLOURS, colours_for, legend, stay_near, thin

        references = [trace["reference"] * DEGREES for trace in self.values()]
        joints = [trace["joint"] * DEGREES for trace in self.values()]
        colours = colours_for(list(self))
        for (name, trace), joint in zip(self.items(), joints, strict=True):
            axes[0].plot(*thin(trace.time, joint), color=colours[name], lw=1.1, label=name)
        for trace, reference in zip([*self.values()][:1], references, strict=False):
            drawn = thin(trace.time, reference)
            axes[0].plot(*drawn, color=COLOURS["reference"], lw=1.0, ls="--", label="reference")
        stay_near(axes[0], references, joints)
        axes[0].set_ylabel("angle [°]")
        legend(axes[0], 5)
        for below in axes[1:]:
            steady = [trace.error * DEGREES for trace in self.values() if trace.stable]
            errors = [trace.error * DEGREES for trace in self.values()]
            for (name, trace), error in zip(self.items(), errors, strict=True):
                below.plot(*thin(trace.time, error), color=colours[name], lw=1.0)
            stay_near(below, steady, errors)
            below.set_ylabel("error [°]")
        axes[-1].set_xlabel("time [s]")

    def __repr__(self) -> str:
        """One screen: a line of figures of merit for each."""
        rows = []
        for name, cells in self._table():
            named = zip(_COLUMNS, cells, strict=False)
            rows.append((name, shown.listed(f"{what} {text}" for what, text in named if text) or "–"))
        return shown.screen(self._title(), rows)

    def _repr_html_(self) -> str:
        from bowden.drawing.style import new_figure

        figure = None
        if self and all(set(trace.columns) >= _DRAWN for trace in self.values()):
            figure, axes = new_figure(2, 1, height=4.2, share_x=True)
            self._draw(axes)
        rows = [(name, *(text or "–" for text in cells)) for name, cells in self._table()]
        return shown.table(self._title(), ["law", *_COLUMNS], rows, figure)

    def _title(self) -> str:
        return f"{len(self)} trace{'s' if len(self) != 1 else ''}"

    def _table(self) -> list[tuple[str, list[str]]]:
        rows = []
        for name, trace in self.items():
            if not set(trace.columns) >= _DRAWN:
                rows.append((name, [""] * len(_COLUMNS)))
                continue
            if not trace.stable:
                rows.append((name, ["unstable", *[""] * (len(_COLUMNS) - 1)]))
                continue
            figures = trace.metrics().shown()
            rows.append((name, [shown.number(*figures[column]) for column in _COLUMNS]))
        return rows
