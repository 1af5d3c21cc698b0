"""What logs say of their cable: every family's best member, the recommended one, how each log is predicted.

What is reported of a model, and what a rig takes, was fitted again to all of the log, or of the logs; its errors are
those of the same family fitted to first halves, since nothing is left to judge the other on.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from bowden.core.arguments import path_of as path_of_file
from bowden.core.errors import ParameterError
from bowden.core.files import write_text
from bowden.core.guesses import answering
from bowden.core.units import DEGREES
from bowden.drawing.shown import Grid, Plotted, number
from bowden.identify.cable.drawing import draw_fit
from bowden.identify.cable.fitted import Fitted
from bowden.identify.cable.loop import loop_lines
from bowden.identify.cable.model_text import model_text
from bowden.plants.cable_parameters import parameter_lines, shown_value
from bowden.plants.identified import CableModel

if TYPE_CHECKING:
    import pathlib

    from matplotlib.axes import Axes

_MOST_NOTES = 4
"""Of a fit, on its screen."""


@answering(
    {
        **dict.fromkeys(("predict", "simulate"), "fit.best.joint_angle(motor)"),
        **dict.fromkeys(("save", "to_file", "to_toml"), "fit.write(path)"),
        **dict.fromkeys(("load", "read"), "bowden.CableModel.read(path)"),
        **dict.fromkeys(("parameters", "params"), "fit.best.parameters"),
        **dict.fromkeys(("rms", "rmse", "error", "score"), "fit.chosen.test_rms, in rad"),
        **dict.fromkeys(("residual", "residuals"), "fit.log.joint - fit.logs[0].predicted"),
        **dict.fromkeys(("play", "backlash", "width", "half_width", "hysteresis"), "fit.chosen.loop.height, in rad"),
        "model": "fit.best",
        "name": "fit.best.name",
        "loop": "fit.chosen.loop",
        "gain": "bowden.identify(log, model=fit).recalibration.gain",
        "changed": "bowden.identify(log, model=fit).recalibration.changed",
        "summary": "print(fit)",
        "rig": "bowden.init(fit).rig",
    },
    "identify a log again",
    lambda fit, name: f"fit.best.parameters[{name!r}]" if name in fit.__dict__["best"].parameters else "",
)
@dataclass(frozen=True, repr=False)
class Fit(Fitted, Plotted):
    """What logs say about their cable.

    `plot` draws the loop: joint over motor, as recorded and as the recommended model draws it in the second half; on
    second axes the same without the straight line. Of several logs it draws both branches at the least, the middle and
    the largest load; of a known model, what it leaves.
    """

    def at(self, **values: float) -> CableModel:
        """The model at a load, at a bend, or both.

        Raises:
            ParameterError: it is not scheduled by that.
        """
        for name in values:
            if name not in self.units:
                raise ParameterError(
                    f"the model is scheduled by {', '.join(self.units) or 'nothing'}, not by {name!r}",
                    expected="values of its variables",
                    do="identify logs that differ in it",
                )
        return replace(self.best, parameters={**self.best.parameters, **values})

    def write(self, path: "pathlib.Path | str") -> None:
        """Write all models with units, uncertainties and errors, as the model.toml of ``bowden identify``.

        `CableModel.read` reads the recommended one back.

        Raises:
            OutputError: the file cannot be written.
        """
        write_text(path_of_file(path, "Fit.write: path"), model_text(self))

    @property
    def _grid(self) -> Grid:
        return Grid(1, 1 if self.recalibration or len(self.logs) > 1 else 2, 7.0, 3.4)

    def _draw(self, axes: "Sequence[Axes]") -> None:
        draw_fit(axes, self)

    def _title(self) -> str:
        if self.recalibration:
            return f"Recalibration of {self.best.name} on {self.name}"
        if len(self.logs) > 1:
            by = " and ".join(self.units)
            return f"Fit of {len(self.logs)} logs{f', scheduled by {by}' if by else ''}"
        error = number(self.chosen.test_rms * DEGREES, "°")
        do = "do not use" if self.trust.level == "no" else "use"
        return f"Fit of {self.name}: {do} {self.best.name}, {error} RMS on the unseen half"

    def _rows(self) -> list[tuple[str, str]]:
        rows = []
        for one in self.logs:
            errors = (("second half", one.test_rms), ("left out", one.same_rms), ("load left out", one.unseen_rms))
            said = [f"{what} {number(v * DEGREES, '°')}" for what, v in errors if np.isfinite(v)]
            at = [f"{name} {shown_value(name, value)}" for name, value in zip(self.units, one.values, strict=True)]
            alone = [f"{one.samples} samples", one.motion]
            text = [*at, *said, one.cycles.counted] if len(self.logs) > 1 else [*alone, str(self.cycles)]
            rows.append((one.name if len(self.logs) > 1 else "log", ", ".join(text)))
        rows += [("cycles", line) for line in to_record(self)]
        rows.append(("trust", str(self.trust)))
        if self.recalibration:
            rows += [*self.recalibration.lines, ("verdict", self.recalibration.verdict)]
        chosen = self.chosen
        if chosen.uncertainty:
            given = [f"{name} {text}" for name, text in parameter_lines(self.best.parameters, chosen.uncertainty)]
            rows.append(("parameters", ", ".join(given)))
        loop, of = loop_lines(chosen.loop) if chosen.loop else [], "loop's "
        rows.append(("loop", ", ".join(f"{name.removeprefix(of)} {text}" for name, text in loop)))
        others = [
            f"{name} {number(model.test_rms * DEGREES, '°')}"
            for name, model in self.models.items()
            if name != self.best.name and np.isfinite(model.test_rms)
        ]
        rows.append(("others", ", ".join(others)))
        if ahead := self.forecast:
            left, without = (number(v * DEGREES, "°") for v in (ahead.compensated, ahead.uncompensated))
            rows.append(("forecast", f"{left} RMS with the model as feed-forward, {without} without"))
        return [*rows, *(("note", warning) for warning in self.warnings[:_MOST_NOTES])]


def to_record(fit: Fit) -> list[str]:
    """What more is to be recorded: of several logs a line for all that lack as many cycles; nothing where none does."""
    if len(fit.logs) == 1:
        return []
    lines = []
    for cycles in dict.fromkeys(one.cycles for one in fit.logs if one.cycles.more):
        names = [one.name for one in fit.logs if one.cycles == cycles]
        has = "has" if len(names) == 1 else "have"
        lines.append(f"{cycles.to_record}: {', '.join(names)} {has} {cycles.counted}")
    return lines
