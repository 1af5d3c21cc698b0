"""What logs say of their cable: every family's best member, the recommended one, how each log is predicted.

What is reported of a model, and what a rig takes, was fitted again to all of the log, or of the logs; its errors are
those of the same family fitted to first halves, since nothing is left to judge the other on.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bowden.core.arguments import path_of as path_of_file
from bowden.core.errors import ParameterError
from bowden.core.files import write_text
from bowden.core.guesses import answering
from bowden.core.units import DEGREES
from bowden.drawing import shown
from bowden.identify.cable.cycles import Cycles
from bowden.identify.cable.drawing import draw_fit
from bowden.identify.cable.forecast import Forecast, forecast
from bowden.identify.cable.loop import HysteresisLoop, loop_lines
from bowden.identify.cable.turns import peak_speed
from bowden.identify.log.read import Log
from bowden.plants.cable_parameters import parameter_lines, shown_value
from bowden.plants.identified import CableModel
from bowden.plants.trust import Trust

if TYPE_CHECKING:
    import pathlib

    from matplotlib.axes import Axes

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ModelFit:
    """One family's best member."""

    model: CableModel
    """The model itself, fitted to the whole log: its parameters, and the joint angle that it predicts. Where that fit
    is clearly worse on the log than the one to the first half, it is the latter, and a warning says so."""
    uncertainty: Mapping[str, float] = field(default_factory=dict)
    """One standard deviation of each parameter, in its unit; infinite where the log does not show it, NaN where none is
    stated: of a setting that was not fitted, and of ``generalised_play``, whose parameters trade with one another.
    Nothing of a model that several logs schedule, nor of a known one."""
    loop: HysteresisLoop | None = None
    """Slope, offset, height and curve of the loop that it draws along the log, with their deviations; None where the
    motor has not gone both ways through the middle of its stroke."""
    fitted_count: int = 0
    """How many parameters were fitted."""
    train_rms: float = math.nan
    """Error on what was fitted of the first half, of the family fitted to it, at the log's full rate, each sample
    counting as it does in the fit; of several logs and of a known model, on all that was fitted [rad]."""
    test_rms: float = math.nan
    """Error on the second half of the family fitted to the first [rad]. No decision has seen it, but for a first half
    of fewer than four strokes, where the whole log says which family is recommended."""
    left_out_rms: float = math.nan
    """Error on stretches of strokes that were left out in turn; the recommendation rests on it [rad]."""

    @property
    def parameters(self) -> Mapping[str, float]:
        """Every parameter by name; SI and radians."""
        return self.model.parameters


@dataclass(frozen=True)
class FittedLog:
    """One of the logs, and how the recommended model predicts it."""

    log: Log = field(compare=False)
    """What was fitted."""
    cycles: Cycles
    """Whole cycles in it, and how many more to record."""
    split: int
    """First sample of the second half."""
    predicted: Array = field(compare=False)
    """Joint angle by the recommended family, fitted to first halves, simulated through the whole log; of a known model,
    by it with its new gain and offset (n,) [rad]."""
    train_rms: float
    """Error of what was fitted to this part, or to this log too [rad]."""
    test_rms: float
    """Error on its second half, of what was fitted to first halves [rad]."""
    reversals: int = 0
    """Of the motor."""
    line_rms: float = math.nan
    """Error on the second half of the straight line through the first [rad]."""
    loop: HysteresisLoop | None = None
    """That the recommended model draws along it."""
    drift: float = 0.0
    """Of the joint's reading, at one place of the motor; zero where it is none [rad/s]."""
    lag: tuple[float, float] = (0.0, 0.0)
    """Of the joint behind the motor [s], and the share of what the recommended model leaves that it explains [–]."""
    fitted_from: int = 0
    """First sample that was fitted; above zero where the cable was still settling."""
    values: tuple[float, ...] = ()
    """Of what schedules the model, its means."""
    same_rms: float = math.nan
    """Error of a model fitted to all logs but this one; NaN where no other has its load [rad]."""
    same_offset_rms: float = math.nan
    """The same on the second half, once the offset was fitted again to the first [rad]."""
    unseen_rms: float = math.nan
    """Error of a model fitted to all logs but those of this load, and of this bend where both schedule; NaN where fewer
    than two values of either are left [rad]."""
    unseen_offset_rms: float = math.nan
    """The same on the second half, once the offset was fitted again to the first [rad]."""

    @property
    def name(self) -> str:
        """The log's."""
        return self.log.name

    @property
    def samples(self) -> int:
        """In the log."""
        return len(self.log.time)

    @property
    def motion(self) -> str:
        """How long the log is, and how fast its motor and its joint move."""
        time, *angles = self.log.time, self.log.motor, self.log.joint
        motor, joint = (peak_speed(time, one) * DEGREES for one in angles)
        return f"{time[-1] - time[0]:.4g} s, up to {motor:.3g}°/s at the motor and {joint:.3g}°/s at the joint"


@dataclass(frozen=True)
class Recalibration:
    """Gain and offset of a known model, fitted again to seconds of motion."""

    source: str
    """The known model's file, or its name."""
    gain: float
    """a, over the old model's [–]."""
    gain_error: float
    """Its standard error [–]."""
    offset: float
    """b, what was added to a·m [rad]."""
    before_rms: float
    """Error of the old model on the new log [rad]."""
    after_rms: float
    """The same with gain and offset fitted again [rad]."""
    judged_rms: float
    """Error of the old model on data that it had not seen, as its file says; NaN where it does not [rad]."""
    changed: bool | None
    """Whether the cable has changed; None where the file does not say how good the model was, and where the motor went
    outside the identified stroke."""
    beyond: float
    """How far the motor went outside the identified stroke, 0 within a twentieth of it [rad]."""

    @property
    def verdict(self) -> str:
        """What came out, in one sentence."""
        if self.beyond > 0.0:
            return (
                f"the motor goes {self.beyond * DEGREES:.3g}° outside the identified stroke, so it is not known "
                "whether the cable has changed"
            )
        if self.changed is None:
            return "the model's file does not say how good it was, so it is not known whether the cable has changed"
        if self.changed:
            return "the cable has changed: identify it again"
        return "the same cable: use the recalibrated model"

    @property
    def lines(self) -> list[tuple[str, str]]:
        """What is said of it on a screen and a page: name and text of each figure."""
        judged = (self.before_rms, self.after_rms, self.judged_rms)
        before, after, unseen = (shown.number(v * DEGREES, "°") if math.isfinite(v) else "not known" for v in judged)
        return [
            ("gain", f"{self.gain:.4f} ± {self.gain_error:.2g}"),
            ("offset", shown.number(self.offset * DEGREES, "°")),
            ("RMS before and after", f"{before}, {after}"),
            ("RMS judged before", unseen),
        ]


_UNJUDGED = Trust("no", ("nothing was judged",))
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
        "gain": "fit.recalibration.gain",
        "changed": "fit.recalibration.changed",
        "summary": "print(fit)",
        "rig": "bowden.init(fit).rig",
    },
    "identify a log again",
    lambda fit, name: f"fit.best.parameters[{name!r}]" if name in fit.__dict__["best"].parameters else "",
)
@dataclass(frozen=True, repr=False)
class Fit:
    """What logs say about their cable."""

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
    """Whether the whole log says which family is recommended, its first half having fewer than four strokes."""
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

    @property
    def forecast(self) -> Forecast | None:
        """The joint's error with the recommended model as feed-forward, and without any; None of several logs and of a
        known model."""
        if "line" not in self.models or self.recalibration:
            return None
        (one,), line = self.logs, self.models["line"]
        return forecast(
            one.log, one.split, one.predicted, line.parameters["slope"], self.chosen.test_rms, line.test_rms
        )

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
        from bowden.identify.cable.model_text import model_text

        write_text(path_of_file(path, "Fit.write: path"), model_text(self))

    def plot(self, axes: "Axes | Sequence[Axes] | None" = None) -> "list[Axes]":
        """Draw the loop: joint over motor, as recorded and as the recommended model draws it in the second half.

        Of several logs, both branches at the least, the middle and the largest load; of a known model, what it leaves.

        Args:
            axes: matplotlib's, one or two, of which the second shows the same without the straight line; a new figure
                is made where they are not given.

        Returns:
            The axes; ``axes[0].figure`` is theirs.

        Raises:
            ParameterError: something else than axes.
        """
        found = shown.axes_for(axes, 1, self._panels, 7.0, 3.4)
        draw_fit(found, self)
        return found

    @property
    def _panels(self) -> int:
        return 1 if self.recalibration or len(self.logs) > 1 else 2

    def __repr__(self) -> str:
        """One screen: the recommended model, its error and its parameters, the other models, and what to know."""
        return shown.screen(self.title, self._rows())

    def _repr_html_(self) -> str:
        from bowden.drawing.style import new_figure

        figure, axes = new_figure(1, self._panels, height=3.4)
        draw_fit(axes, self)
        return shown.fragment(self.title, self._rows(), figure)

    @property
    def title(self) -> str:
        """The result in one line."""
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
