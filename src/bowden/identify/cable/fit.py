"""What a log says of its cable: every family's best member, the recommended one, and how it is shown and written.

What is reported of a model, and what a rig takes, was fitted again to the whole log; its errors are those of the same
family fitted to the first half, since nothing is left to judge the other on.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bowden import __version__
from bowden.core.arguments import path_of as path_of_file
from bowden.core.files import write_text
from bowden.core.guesses import answering
from bowden.core.toml_text import quoted
from bowden.core.units import DEGREES
from bowden.drawing import shown
from bowden.drawing.style import COLOURS, legend, thin
from bowden.identify.cable.cycles import Cycles
from bowden.identify.cable.file_lines import cycles_row, one_line, warning_lines
from bowden.identify.cable.forecast import Forecast, forecast
from bowden.identify.cable.loop import HysteresisLoop, loop_lines
from bowden.identify.cable.turns import peak_speed
from bowden.identify.log.read import Log
from bowden.plants.cable_parameters import meaning, parameter_lines
from bowden.plants.identified import CableModel
from bowden.plants.model_file import log_lines
from bowden.plants.predicted import NAMES
from bowden.plants.trust import Trust, trust_lines

if TYPE_CHECKING:
    import pathlib

    from matplotlib.axes import Axes

Array = NDArray[np.float64]

_POINTS = 1500
"""Of a curve: more make no visible difference."""
PARTS = {"first half": "#c9ced3", "second half": "#b5d3e7"}
"""Half of the log → its colour: pale and broad, so that the model's thin line hides nothing of it."""


@dataclass(frozen=True)
class ModelFit:
    """One family's best member."""

    model: CableModel
    """The model itself, fitted to the whole log: its parameters, and the joint angle that it predicts. Where that fit
    is clearly worse on the log than the one to the first half, it is the latter, and a warning says so."""
    uncertainty: Mapping[str, float]
    """One standard deviation of each parameter, in its unit; infinite where the log does not show it, NaN where none is
    stated: of a setting that was not fitted, and of ``generalised_play``, whose parameters trade with one another."""
    loop: HysteresisLoop | None
    """Slope, offset, height and curve of the loop that it draws along the log, with their deviations; None where the
    motor has not gone both ways through the middle of its stroke."""
    fitted_count: int
    """How many parameters were fitted."""
    train_rms: float
    """Error on what was fitted of the first half, of the family fitted to it, at the log's full rate, each sample
    counting as it does in the fit [rad]."""
    test_rms: float
    """Error on the second half of the family fitted to the first [rad]. No decision has seen it, but for a first half
    of fewer than four strokes, where the whole log says which family is recommended."""
    left_out_rms: float
    """Error on stretches of strokes that were left out in turn; the recommendation rests on it [rad]."""

    @property
    def parameters(self) -> Mapping[str, float]:
        """Every parameter by name; SI and radians."""
        return self.model.parameters


_MOST_NOTES = 4
"""Of a fit, on its screen."""


@answering(
    {
        **dict.fromkeys(("predict", "simulate"), "fit.best.joint_angle(motor)"),
        **dict.fromkeys(("save", "to_file", "to_toml"), "fit.write(path)"),
        **dict.fromkeys(("load", "read"), "bowden.CableModel.read(path)"),
        **dict.fromkeys(("parameters", "params"), "fit.best.parameters"),
        **dict.fromkeys(("rms", "rmse", "error", "score"), "fit.chosen.test_rms, in rad"),
        **dict.fromkeys(("residual", "residuals"), "fit.log.joint - fit.predicted"),
        **dict.fromkeys(("play", "backlash", "width", "half_width", "hysteresis"), "fit.chosen.loop.height, in rad"),
        "model": "fit.best",
        "name": "fit.best.name",
        "loop": "fit.chosen.loop",
        "summary": "print(fit)",
        "rig": "bowden.init(fit).rig",
    },
    "identify a log again",
    lambda fit, name: f"fit.best.parameters[{name!r}]" if name in fit.__dict__["best"].parameters else "",
)
@dataclass(frozen=True, repr=False)
class Fit:
    """What a log says about its cable."""

    models: Mapping[str, ModelFit]
    """``line``, ``play``, ``bouc_wen``, ``bouc_wen_static``, ``prandtl_ishlinskii``, ``generalised_play``."""
    best: CableModel
    """The recommended model; ``best.name`` says which it is, and a rig takes it as its cable."""
    trust: Trust
    """Whether to trust it, and why."""
    warnings: tuple[str, ...]
    """What the log cannot show, what was mended in it, and what to record instead."""
    samples: int
    """Samples in the log."""
    cycles: Cycles
    """Whole cycles in the log, and how many more to record."""
    seconds: float = field(compare=False)
    """Time that the identification took [s]."""
    split: int
    """First sample of the second half."""
    chosen_on_whole: bool
    """Whether the whole log says which family is recommended, its first half having fewer than four strokes."""
    fitted_from: int
    """First sample that was fitted; above zero where the cable was still settling."""
    reversals: int
    """Of the motor."""
    lag: tuple[float, float]
    """Of the joint behind the motor [s], and the share of what the recommended model leaves that it explains [–]."""
    drift: float
    """Of the joint's reading, at one place of the motor; zero where it is none [rad/s]."""
    predicted: Array = field(compare=False)
    """Joint angle of the recommended family, fitted to the first half, simulated through the whole log (n,) [rad]."""
    log: Log = field(compare=False)
    """What was fitted."""

    @property
    def chosen(self) -> ModelFit:
        """The recommended model with its uncertainties and errors."""
        return self.models[self.best.name]

    @property
    def forecast(self) -> Forecast:
        """The joint's error with the recommended model as feed-forward, and without any."""
        line = self.models["line"]
        slope = line.parameters["slope"]
        return forecast(self.log, self.split, self.predicted, slope, self.chosen.test_rms, line.test_rms)

    @property
    def motion(self) -> str:
        """How long the log is, and how fast its motor and its joint move."""
        time, *angles = self.log.time, self.log.motor, self.log.joint
        motor, joint = (peak_speed(time, one) * DEGREES for one in angles)
        return f"{time[-1] - time[0]:.4g} s, up to {motor:.3g}°/s at the motor and {joint:.3g}°/s at the joint"

    def write(self, path: "pathlib.Path | str") -> None:
        """Write all models with units, uncertainties and errors, as the model.toml of ``bowden identify``.

        `CableModel.read` reads the recommended one back.

        Raises:
            OutputError: the file cannot be written.
        """
        write_text(path_of_file(path, "Fit.write: path"), model_text(self, self.log.name))

    def plot(self, axes: "Axes | Sequence[Axes] | None" = None) -> "list[Axes]":
        """Draw the loop: joint over motor, as recorded and as the recommended model draws it in the second half.

        Args:
            axes: matplotlib's, one or two, of which the second shows the same without the straight line; a new figure
                with both is made where they are not given.

        Returns:
            The axes; ``axes[0].figure`` is theirs.

        Raises:
            ParameterError: something else than axes.
        """
        found = shown.axes_for(axes, 1, 2, 7.0, 3.4)
        draw_loop(found, self)
        return found

    def __repr__(self) -> str:
        """One screen: the recommended model, its error and its parameters, the other models, and what to know."""
        return shown.screen(self._title(), self._rows())

    def _repr_html_(self) -> str:
        from bowden.drawing.style import new_figure

        figure, axes = new_figure(1, 2, height=3.4)
        draw_loop(axes, self)
        return shown.fragment(self._title(), self._rows(), figure)

    def _title(self) -> str:
        error = shown.number(self.chosen.test_rms * DEGREES, "°")
        do = "do not use" if self.trust.level == "no" else "use"
        return f"Fit of {self.log.name}: {do} {self.best.name}, {error} RMS on the unseen half"

    def _rows(self) -> list[tuple[str, str]]:
        given = [f"{name} {text}" for name, text in parameter_lines(self.best.parameters, self.chosen.uncertainty)]
        others = [
            f"{name} {shown.number(model.test_rms * DEGREES, '°')}"
            for name, model in self.models.items()
            if name != self.best.name
        ]
        notes = [("note", warning) for warning in self.warnings]
        loop, of = loop_lines(self.chosen.loop) if self.chosen.loop else [], "loop's "
        log = f"{self.samples} samples, {self.motion}, {self.cycles}"
        ahead = self.forecast
        left, without = (shown.number(one * DEGREES, "°") for one in (ahead.compensated, ahead.uncompensated))
        return [
            ("log", log),
            ("trust", str(self.trust)),
            ("parameters", ", ".join(given)),
            ("loop", ", ".join(f"{name.removeprefix(of)} {text}" for name, text in loop)),
            ("others", ", ".join(others)),
            ("forecast", f"{left} RMS with the model as feed-forward, {without} without"),
            *notes[:_MOST_NOTES],
        ]


def draw_loop(axes: "Sequence[Axes]", fit: Fit) -> None:
    """Joint over motor as recorded and as the recommended model has it, and on second axes without the line."""
    log = fit.log
    line = fit.models["line"].model.joint_angle(log.motor)
    motor = log.motor * DEGREES
    for panel, base in zip(axes, (np.zeros_like(line), line), strict=False):
        for part, (label, colour) in zip((slice(0, fit.split), slice(fit.split, None)), PARTS.items(), strict=True):
            shown = thin(motor[part], (log.joint - base)[part] * DEGREES, _POINTS)
            panel.plot(*shown, color=colour, lw=2.8, label=label)
        late = slice(fit.split, None)
        drawn = thin(motor[late], (fit.predicted - base)[late] * DEGREES, _POINTS)
        panel.plot(*drawn, color=COLOURS["model"], lw=0.8, label="model")
        panel.set_xlabel("motor [°]")
    axes[0].set_ylabel("joint [°]")
    if len(axes) > 1:
        if fit.chosen.loop is not None:
            _draw_deviations(axes[1], fit, fit.chosen.loop)
        axes[1].set_ylabel("joint − straight line [°]")
    legend(axes[-1], 3)


def _draw_deviations(axes: "Axes", fit: Fit, loop: HysteresisLoop) -> None:
    """Two deviations to either side of the loop, at each of its places."""
    ways = (loop.rising_place, loop.rising, loop.rising_error), (loop.falling_place, loop.falling, loop.falling_error)
    for way in ways:
        place, joint, error = (np.array(one)[np.isfinite(way[2])] for one in way)
        middle, reach = joint - fit.models["line"].model.joint_angle(place), 2.0 * error
        ends = (middle - reach) * DEGREES, (middle + reach) * DEGREES
        axes.vlines(place * DEGREES, *ends, color=COLOURS["model"], lw=1.6)


def model_text(fit: Fit, source: str) -> str:
    """The content of model.toml."""
    lines = [
        f"# The cable of {one_line(source)}, identified by bowden {__version__}. All angles are in radians.",
        "# Each value is followed by its unit, one standard deviation of it, and what it is. The models were fitted to",
        "# the whole log; test_rms_deg is the error on the second half of the same families fitted to the first.",
        "",
        "# Recommended: the simplest whose error on stretches left out of the fit is not clearly above the least.",
        f"best = {quoted(fit.best.name)}",
        f"source = {quoted(one_line(source))}",
        f"samples = {fit.samples}",
        cycles_row(fit.cycles, fit.cycles.advice),
        *warning_lines(fit.warnings),
    ]
    lines += trust_lines(fit.trust)
    lines += log_lines(fit.log.covered, fit.log.encoders)
    left, without, counts = (_number(value * DEGREES) for value in fit.forecast)
    lines += [
        "",
        "[forecast]  # error of the joint on a motion like the log's; the servo is taken to follow at once",
        f"compensated_rms_deg = {left}  # with the recommended model's inverse as feed-forward",
        f"uncompensated_rms_deg = {without}  # with a straight line's",
        f"resolution_rms_deg = {counts}  # of both encoders' counts; 0 where the log shows none",
    ]
    lines += _loop_lines(fit.chosen.loop)
    for name in NAMES:
        lines += _model_lines(name, fit.models[name])
    return "\n".join(lines) + "\n"


def _loop_lines(loop: HysteresisLoop | None) -> list[str]:
    """The section with the recommended model's loop; empty where the log shows none."""
    if loop is None:
        return []
    texts = {
        "slope": "[rad/rad] of the middle half of the stroke",
        "offset": "[rad] joint angle at motor angle 0 of the line through it",
        "height": "[rad] how far apart both ways are there, at the joint",
        "rising_place": "[rad] motor angles along the stroke while it rises",
        "rising": "[rad] joint angles there",
        "falling_place": "[rad] while it falls",
        "falling": "[rad] joint angles there",
    }
    lines = [
        "",
        "[loop]  # of the recommended model over this log; _error: one standard deviation, inf where not shown",
    ]
    for key, value in loop._asdict().items():
        said = "[" + ", ".join(_number(one) for one in value) + "]" if isinstance(value, tuple) else _number(value)
        lines.append(f"{key} = {said}" + (f"  # {texts[key]}" if key in texts else ""))
    return lines


def _model_lines(name: str, fitted: ModelFit) -> list[str]:
    lines = [
        "",
        f"[models.{name}]",
        f"train_rms_deg = {_number(fitted.train_rms * DEGREES)}",
        f"test_rms_deg = {_number(fitted.test_rms * DEGREES)}",
        "",
        f"[models.{name}.parameters]",
    ]
    for key, value in fitted.parameters.items():
        unit, text = meaning(key)
        lines.append(f"{key} = {float(value)!r}  # [{unit}] {_spread(fitted.uncertainty[key])}; {text}")
    lines += [
        "",
        f"[models.{name}.uncertainty]  # one standard deviation; inf: the log does not show it; not here: none stated",
    ]
    return lines + [f"{key} = {_number(value)}" for key, value in fitted.uncertainty.items() if not math.isnan(value)]


def _spread(uncertainty: float) -> str:
    if math.isnan(uncertainty):
        return "no uncertainty stated"
    return "not identifiable from this log" if math.isinf(uncertainty) else f"± {uncertainty:.2g}"


def _number(value: float) -> str:
    return f"{value:.6g}" if math.isfinite(value) else "nan" if math.isnan(value) else "inf"
