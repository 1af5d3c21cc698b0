"""What logs say of their cable: every family's best member, the recommended one, how each log is predicted; model.toml.

What is reported of a model, and what a rig takes, was fitted again to all of the log, or of the logs; its errors are
those of the same family fitted to first halves, since nothing is left to judge the other on.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from bowden import __version__
from bowden.core.arguments import path_of as path_of_file
from bowden.core.errors import ParameterError
from bowden.core.files import write_text
from bowden.core.guesses import answering
from bowden.core.toml_text import quoted
from bowden.core.units import DEGREES
from bowden.drawing import shown
from bowden.drawing.shown import Panels
from bowden.identify.cable.cycles import Cycles
from bowden.identify.cable.fitted import FittedLog, Forecast, ModelFit, Recalibration, forecast
from bowden.identify.cable.hysteresis_loop import HysteresisLoop, loop_lines
from bowden.identify.log.read import Log
from bowden.plants.cable_parameters import check_parameters, meaning, parameter_lines, shown_value
from bowden.plants.identified import CableModel
from bowden.plants.model_file import log_lines
from bowden.plants.trust import Trust, trust_lines

if TYPE_CHECKING:
    import pathlib

    from matplotlib.axes import Axes

_MOST_NOTES = 4
"""Of a fit, on its screen."""
_UNJUDGED = Trust("no", ("nothing was judged",))


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
class Fit(shown.Plotted):
    """What logs say about their cable.

    What is drawn is the loop: joint over motor, as recorded and as the recommended model draws it in the second half,
    and the same without the straight line. Of several logs, both branches at the least, the middle and the largest
    load; of a known model, what it leaves.
    """

    models: Mapping[str, ModelFit]
    """Of one log ``line``, ``play``, ``bouc_wen``, ``bouc_wen_static``, ``prandtl_ishlinskii``, ``generalised_play``;
    of several ``scheduled`` and ``bouc_wen``; of a known model those that it had."""
    best: CableModel
    """The recommended model; ``best.name`` says which it is, and a rig takes it as its cable."""
    logs: tuple[FittedLog, ...]
    """In the order in which they were given."""
    judged_rms: float
    """Error to expect of motion that was not seen: on the second half; of several logs, on unseen loads where those
    were judged, then on unseen logs, their offsets known; of a known model as its file says [rad]."""
    warnings: tuple[str, ...]
    """What the logs cannot show, what was mended in them, and what to record instead."""
    trust: Trust = _UNJUDGED
    """Whether to trust it, and why."""
    units: Mapping[str, str] = field(default_factory=dict)
    """What schedules the model, ``load``, ``bend`` or both, and its unit; empty where nothing says it."""
    recalibration: Recalibration | None = None
    """Of a known model; None where all was fitted."""
    chosen_on_whole: bool = False
    """True if the whole log says which family is recommended, its first half having fewer than four strokes."""
    seconds: float = field(default=0.0, compare=False)
    """Time that the identification took [s]."""

    @property
    def log(self) -> Log:
        """What was fitted; of several, the first."""
        return self.logs[0].log

    @property
    def chosen(self) -> ModelFit:
        """The recommended model with its uncertainties and errors."""
        return self.models[self.best.name]

    @property
    def cycles(self) -> Cycles:
        """Whole cycles in the log, and how many more to record; of several logs, in the shortest."""
        return min((one.cycles for one in self.logs), key=lambda one: one.whole)

    @property
    def samples(self) -> int:
        """In all logs."""
        return sum(one.samples for one in self.logs)

    @property
    def name(self) -> str:
        """Of the log, or of all logs."""
        return ", ".join(one.name for one in self.logs)

    @cached_property
    def forecast(self) -> Forecast | None:
        """The joint's error with the recommended model as feed-forward, and without any; None of several logs and of a
        known model."""
        if "line" not in self.models or self.recalibration:
            return None
        line = self.models["line"]
        return forecast(self.logs[0], line.parameters["slope"], self.chosen.test_rms, line.test_rms)

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
    def _panels(self) -> Panels:  # type: ignore[override]
        return Panels(1, 1 if self.recalibration or len(self.logs) > 1 else 2, 7.0, 3.4)

    def _draw(self, axes: "Sequence[Axes]") -> None:
        from bowden.identify.cable import drawing

        if self.recalibration:
            drawing.draw_residual(axes[0], self.logs[0])
        elif len(self.logs) > 1:
            drawing.draw_loads(axes[0], self.best.parameters, self.units)
        else:
            drawing.draw_loop(axes, self.logs[0], self.models["line"].model, self.chosen.loop)

    def _title(self) -> str:
        if self.recalibration:
            return f"Recalibration of {self.best.name} on {self.name}"
        if len(self.logs) > 1:
            by = " and ".join(self.units)
            return f"Fit of {len(self.logs)} logs{f', scheduled by {by}' if by else ''}"
        error = shown.number(self.chosen.test_rms * DEGREES, "°")
        do = "do not use" if self.trust.level == "no" else "use"
        return f"Fit of {self.name}: {do} {self.best.name}, {error} RMS on the unseen half"

    def _rows(self) -> list[tuple[str, str]]:
        rows = []
        for one in self.logs:
            errors = (("second half", one.test_rms), ("left out", one.same_rms), ("load left out", one.unseen_rms))
            said = [f"{what} {shown.number(v * DEGREES, '°')}" for what, v in errors if np.isfinite(v)]
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
            f"{name} {shown.number(model.test_rms * DEGREES, '°')}"
            for name, model in self.models.items()
            if name != self.best.name and np.isfinite(model.test_rms)
        ]
        rows.append(("others", ", ".join(others)))
        if ahead := self.forecast:
            left, without = (shown.number(v * DEGREES, "°") for v in (ahead.compensated, ahead.uncompensated))
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


def model_text(fit: Fit) -> str:
    """The content of model.toml."""
    best = fit.best
    lines = [
        f"# The cable of {one_line(fit.name)}, identified by bowden {__version__}. All angles are in radians.",
        "# Each value is followed by its unit, one standard deviation of it where one is stated, and what it is. The",
        "# models were fitted to all; test_rms_deg is the error on second halves of what was fitted to first halves.",
        "",
        "# Recommended: the simplest whose error on stretches left out of the fit is not clearly above the least.",
        f"best = {quoted(best.name)}",
        f"source = {quoted(one_line(fit.name))}",
        f"samples = {fit.samples}",
        _cycles_row(fit.cycles),
        "warnings = [" + "".join(f"\n  {quoted(one_line(warning))}," for warning in fit.warnings) + "\n]",
        *trust_lines(fit.trust),
        *log_lines(best.covered, best.encoders),
    ]
    if found := fit.recalibration:
        lines += [
            "",
            "[recalibration]  # gain and offset of a known model, fitted to this log; all else is that model's",
            f"from = {quoted(one_line(found.source))}",
            f"gain = {found.gain!r}",
            f"gain_error = {found.gain_error!r}",
            f"offset_deg = {_number(found.offset * DEGREES)}",
        ]
    if ahead := fit.forecast:
        left, without, counts = (_number(value * DEGREES) for value in ahead)
        lines += [
            "",
            "[forecast]  # error of the joint on a motion like the log's; the servo is taken to follow at once",
            f"compensated_rms_deg = {left}  # with the recommended model's inverse as feed-forward",
            f"uncompensated_rms_deg = {without}  # with a straight line's",
            f"resolution_rms_deg = {counts}  # of both encoders' counts; 0 where the log shows none",
        ]
    lines += _loop_lines(fit.chosen.loop)
    for name, fitted in fit.models.items():
        if name not in (best.name, "bouc_wen") and not usable(name, fitted):
            lines += ["", f"# {name} is left out: the log does not show its parameters; no cable has what they came to"]
            continue
        recommended = {"judged_rms": fit.judged_rms} if name == best.name else {}
        units = [f"{one}_unit = {quoted(unit)}" for one, unit in fit.units.items()] if recommended else []
        lines += _model_lines(name, fitted, recommended, units)
    for one in fit.logs if len(fit.logs) > 1 else ():
        lines += _lines_of_log(fit, one)
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
    for key, value in list(vars(loop).items())[:-1]:  # the curve's error follows from the others
        said = "[" + ", ".join(_number(one) for one in value) + "]" if isinstance(value, tuple) else _number(value)
        lines.append(f"{key} = {said}" + (f"  # {texts[key]}" if key in texts else ""))
    return lines


def usable(name: str, fitted: ModelFit) -> bool:
    """True if a rig takes the parameters: else the log does not show them, and only its page has the model."""
    try:
        check_parameters(name, fitted.parameters, name)
    except ParameterError:
        return False
    return True


def _model_lines(name: str, fitted: ModelFit, judged: Mapping[str, float], units: list[str]) -> list[str]:
    errors = {"train_rms": fitted.train_rms, "test_rms": fitted.test_rms, **judged}
    lines = ["", f"[models.{name}]", *_error_lines(errors), *units, "", f"[models.{name}.parameters]"]
    for key, value in fitted.parameters.items():
        unit, text = meaning(key)
        spread = f" {_spread(fitted.uncertainty[key])};" if fitted.uncertainty else ""
        lines.append(f"{key} = {float(value)!r}  # [{unit}]{spread} {text}")
    if not fitted.uncertainty:
        return lines
    lines += [
        "",
        f"[models.{name}.uncertainty]  # one standard deviation; inf: the log does not show it; not here: none stated",
    ]
    return lines + [f"{key} = {_number(value)}" for key, value in fitted.uncertainty.items() if not math.isnan(value)]


def _lines_of_log(fit: Fit, one: FittedLog) -> list[str]:
    names = ("train", "test", "same", "same_offset", "unseen", "unseen_offset")
    return [
        "",
        "[[logs]]",
        f"name = {quoted(one_line(one.name))}",
        *(f"{name} = {value!r}" for name, value in zip(fit.units, one.values, strict=True)),
        _cycles_row(one.cycles),
        *_error_lines({f"{name}_rms": getattr(one, f"{name}_rms") for name in names}),
    ]


def _cycles_row(cycles: Cycles) -> str:
    return f"whole_cycles = {cycles.whole}  # up and down; {cycles.to_record or 'enough'}"


def _error_lines(given: Mapping[str, float]) -> list[str]:
    return [f"{name}_deg = {_number(value * DEGREES)}" for name, value in given.items() if math.isfinite(value)]


def _spread(uncertainty: float) -> str:
    if math.isnan(uncertainty):
        return "no deviation stated"
    return "not identifiable from this log" if math.isinf(uncertainty) else f"± {uncertainty:.2g}"


def _number(value: float) -> str:
    return f"{value:.6g}"


def one_line(text: str) -> str:
    """The text without breaks and what cannot be printed."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())
