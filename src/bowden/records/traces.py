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


class Traces(shown.Plotted, dict[str, Trace]):
    """A dictionary, name → trace, that shows itself as a table of figures of merit.

    Drawn, it has all joints over time beside the first one's reference, and their errors.

    >>> import numpy as np
    >>> t = np.linspace(0.0, 10.0, 1001)
    >>> units = {"time": "s", "reference": "rad", "joint": "rad"}
    >>> one = Trace({"time": t, "reference": np.sin(t), "joint": 0.99 * np.sin(t)}, units)
    >>> Traces({"mine": one, "yours": one})
    2 traces
      mine   RMSE 0.396°, after 10 s 0.312°, peak 0.573°, delay 0.373 ms, hysteresis width 0°
      yours  RMSE 0.396°, after 10 s 0.312°, peak 0.573°, delay 0.373 ms, hysteresis width 0°
    """

    _panels = shown.Panels(2, 1, 7.0, 4.2)

    def __missing__(self, name: Any) -> Trace:
        raise UnknownNameError(f"there is no trace {name!r}", expected=near(str(name), self), do="name one of them")

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

    def _rows(self) -> list[tuple[str, str]]:
        rows = []
        for name, cells in self._table():
            named = zip(_COLUMNS, cells, strict=False)
            rows.append((name, shown.listed(f"{what} {text}" for what, text in named if text) or "–"))
        return rows

    def _drawable(self) -> bool:
        return bool(self) and all(set(trace.columns) >= _DRAWN for trace in self.values())

    def _repr_html_(self) -> str:
        rows = [(name, *(text or "–" for text in cells)) for name, cells in self._table()]
        return shown.table(self._title(), ["law", *_COLUMNS], rows, self._picture())

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
