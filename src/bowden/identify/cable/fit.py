"""From three signals to a recommended model: each family fitted to a log's first half and judged on its second.

What is reported of a model, and what a rig takes, was fitted again to the whole log; its errors are those of the same
family fitted to the first half, since nothing is left to judge the other on.
"""

import math
import time as clock
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bowden.core.arguments import path_of as path_of_file
from bowden.core.errors import LogError, ParameterError
from bowden.core.guesses import answering
from bowden.core.units import DEGREES
from bowden.drawing import shown
from bowden.identify.cable import advice
from bowden.identify.cable.cycles import Cycles, drift, whole_cycles
from bowden.identify.cable.forecast import Forecast, forecast
from bowden.identify.cable.lag import earlier, time_lag
from bowden.identify.cable.loop import HysteresisLoop, loop_lines, loop_of
from bowden.identify.cable.model import CableModel
from bowden.identify.cable.part import Progress, fit_part, refit_whole
from bowden.identify.cable.path import Path, path_of
from bowden.identify.cable.trust import parameter_lines, trust
from bowden.identify.cable.trusted import Trust
from bowden.identify.cable.turns import motor_noise, peak_speed
from bowden.identify.cable.uncertainty import all_shown, standard_errors
from bowden.identify.cable.validation import simplest_of_the_best
from bowden.identify.log.angles import SIDES, angle_units, angles_of
from bowden.identify.log.read import Log, checked_rate, prepare
from bowden.records.metrics import rmse

if TYPE_CHECKING:
    import pathlib

    from matplotlib.axes import Axes

Array = NDArray[np.float64]

_OUTWARD = ("line", "play", "prandtl_ishlinskii")
"""What is offered where one reversal was seen: left-out stretches then do not show how a bent loop goes on."""
_TAKEN_OUT = 3
"""Times that a lag is taken out: a loop's model takes a part of it for hysteresis, the less the smaller it is."""
_WORSE, _SLIGHT = 1.3, 0.01 / DEGREES
"""A model fitted to the whole log is not taken where its error on it exceeds that of the fit to the first half by this
factor and by this much [rad]: weights that fade towards the past cost less."""


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
        return forecast(self.log, self.split, self.predicted, self.chosen, self.models["line"])

    @property
    def trust(self) -> Trust:
        """Whether to trust the recommended model, and why."""
        return trust(self)

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
        from bowden.identify.cable.model_file import write_model

        write_model(path_of_file(path, "Fit.write: path"), self, self.log.name)

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
        from bowden.identify.cable.plot import draw_loop

        found = shown.axes_for(axes, 1, 2, 7.0, 3.4)
        draw_loop(found, self)
        return found

    def __repr__(self) -> str:
        """One screen: the recommended model, its error and its parameters, the other models, and what to know."""
        return shown.screen(self._title(), self._rows())

    def _repr_html_(self) -> str:
        from bowden.drawing.style import new_figure
        from bowden.identify.cable.plot import draw_loop

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


def identify(
    time: Array | None,
    motor: Array,
    joint: Array,
    *,
    unit: str | None = None,
    counts_per_turn: float | Sequence[float] | None = None,
    rate: float | None = None,
    name: str = "log",
    seed: int = 0,
    progress: Progress | None = None,
) -> Fit:
    """Fit every family of cable models to a log's first half, judge it on the second, and fit it again to the whole.

    Args:
        time: (n,) increasing and even [s]; None where a rate is given.
        motor: motor-side angle (n,).
        joint: joint-side angle (n,).
        unit: of the angles, ``rad``, ``deg`` or ``counts``, or one each (``counts,deg``); radians if not given.
        counts_per_turn: of the encoders, one number for both or one each.
        rate: samples a second of signals without times [Hz].
        name: of the log, for messages.
        seed: of the global search; with the same seed the result is the same.
        progress: called with what is being done and the share of the work that is behind.

    Returns:
        The models with their uncertainties and errors, and the name of the one to use.

    Raises:
        LogError: signals that nothing can be fitted to; see `bowden.identify.cable.checks`.
        ParameterError: an unknown unit, or signals of different lengths.

    >>> t = np.arange(0.0, 20.0, 0.01)
    >>> motor = 0.5 * np.sin(2.0 * t)
    >>> fit = identify(t, motor, 0.9 * motor + 0.1)
    >>> fit.best.name, round(fit.models["line"].parameters["slope"], 6)
    ('line', 0.9)
    """
    units = angle_units(unit, counts_per_turn)
    checked_rate(rate, time)
    x, y = (np.ascontiguousarray(values, dtype=np.float64) for values in (motor, joint))
    if time is None and rate is None:
        raise ParameterError("identify: neither times nor a rate", expected="one of them", do="give rate=, in Hz")
    t = np.arange(x.size) / (rate or 1.0) if time is None else np.ascontiguousarray(time, dtype=np.float64)
    if not (t.ndim == 1 and t.shape == x.shape == y.shape):
        raise ParameterError(f"identify: shapes {t.shape}, {x.shape}, {y.shape}", expected="three of one length")
    angles, _ = angles_of({side: (side, None) for side in SIDES}, {"motor": x, "joint": y}, units)
    angles = {side: replace(one, guessed=False) for side, one in angles.items()}  # radians are what arrays are in
    ready = prepare(t, angles, name, lambda sample: f"{name}, sample {sample + 1}", units.apart)
    return identify_log(ready, seed, progress)


def identify_log(log: Log, seed: int = 0, progress: Progress | None = None) -> Fit:
    """`identify` for a log that was read and checked. A lag of the joint that shows is taken out of it.

    Raises:
        LogError: the motor's or the joint's motion cannot be distinguished from its noise.
    """
    found, late = _identify(log, seed, progress), 0.0
    for _ in range(_TAKEN_OUT):
        if not advice.lags(found.lag):
            break
        late += found.lag[0]
        found = _identify(earlier(log, late), seed, progress)
    return found


def _identify(log: Log, seed: int, progress: Progress | None) -> Fit:
    begin = clock.perf_counter()
    tell = progress or (lambda what, share: None)
    split = int(np.searchsorted(log.time, 0.5 * (log.time[0] + log.time[-1])))
    noise = motor_noise(log.motor[:split])
    _check_motion(log, "motor", log.motor[:split], "check its column, or record a larger motion from the start")
    _check_motion(log, "joint", log.joint[:split], "check its column, its encoder and the cable")
    half = fit_part(log, split, noise, seed, tell)
    few = half.fine.strokes < advice.TOLD
    tell("fitting the whole log", 0.6)
    whole = (
        fit_part(log, len(log.time), noise, seed, lambda what, share: None) if few else refit_whole(log, noise, half)
    )
    seen = whole if few else half
    tell("comparing on left-out stretches", 0.7)
    errors = seen.left_out_errors(log)
    shown_by_log = seen.fine.strokes > 1 and advice.following(log, split) >= advice.FOLLOWS  # a reversal, and a cable
    names = ("line",) if not shown_by_log else _OUTWARD if seen.fine.strokes < 3 else tuple(errors)
    offered = {name: errors[name] for name in names}
    unseen = [family.name for family in seen.families if not all_shown(seen.fine, seen.estimates[family.name])]
    complexity = {name: len(seen.estimates[name].slopes) for name in offered}
    trading = [family.name for family in seen.families if seen.estimates[family.name].prior is not None]
    best: str = simplest_of_the_best(offered, complexity, unseen, trading)

    fine, start = half.fine, half.settling.start
    fitted_from = int(np.searchsorted(log.time, fine.time[np.flatnonzero(fine.weight)[0]])) if start else 0
    path = path_of(log.time, log.motor, log.joint, len(log.time), noise)
    models: dict[str, ModelFit] = {}
    counts = half.counted_at(log.time)
    predicted, kept = np.empty(0), []
    for done, family in enumerate(half.families):
        tell("judging on the second half", 0.9 + 0.02 * done)
        joint = follow(CableModel(family.name, half.estimates[family.name].parameters), path, log.time)
        predicted = joint if family.name == best else predicted
        error = joint - log.joint
        part, before = whole, rmse(error[fitted_from:])
        final = follow(CableModel(family.name, whole.estimates[family.name].parameters), path, log.time)
        after = rmse((final - log.joint)[fitted_from:])
        if after > _WORSE * before + _SLIGHT:
            part = half
            kept.append(f"{family.name} ({after * DEGREES:.2g}° against {before * DEGREES:.2g}°)")
        estimate = part.estimates[family.name]
        models[family.name] = ModelFit(
            model=CableModel(family.name, estimate.parameters),
            uncertainty=standard_errors(part.fine, estimate, family),
            loop=loop_of(part.fine, estimate.fitted),
            fitted_count=len(estimate.slopes),
            train_rms=math.sqrt(float(np.average(error[fitted_from:split] ** 2, weights=counts[fitted_from:split]))),
            test_rms=rmse(error[split:]),
            left_out_rms=math.sqrt(float(np.mean(errors[family.name]))),
        )
    cycles, lag = whole_cycles(path), time_lag(fine, half.estimates[best])
    warnings = advice.advise(log, split, fine, fitted_from, half.rest_until, models, best, cycles.whole)
    if kept:
        warnings.append(
            f"fitted to the whole log a model was worse on it than fitted to the first half, and stays as it was: "
            f"{', '.join(kept)}; its error beyond the first half's range is not known to be small"
        )
    tell("done", 1.0)
    found = Fit(
        models=models,
        best=replace(
            models[best].model,
            others={name: dict(one.parameters) for name, one in models.items() if name != best},
            covered=log.covered,
            encoders=log.encoders,
        ),
        warnings=(*log.warnings, *warnings),
        samples=len(log.time),
        cycles=cycles,
        seconds=clock.perf_counter() - begin,
        split=split,
        chosen_on_whole=few,
        fitted_from=fitted_from,
        reversals=path.strokes - 1,
        lag=lag,
        drift=drift(path),
        predicted=predicted,
        log=log,
    )
    return replace(found, best=replace(found.best, trust=found.trust))


def follow(model: CableModel, path: Path, time: Array) -> Array:
    """The model's joint angle at each sample (n,) [rad], simulated straight through a path at the log's full rate.

    The path is the motor's motion freed of encoder noise. Bouc–Wen needs that: its small loops do not close, so that a
    flicker of the encoder, at rest most of all, drives h towards zero, which the cable itself does not do.
    """
    counted = path.weight > 0
    return np.interp(time, path.time[counted], model.joint_angle(path.motor)[counted])


def _check_motion(log: Log, what: str, values: Array, do: str) -> None:
    noise = motor_noise(values)
    span = float(np.ptp(np.convolve(values, np.full(9, 1.0 / 9.0), "valid")))  # nine outweigh the noise
    if not span > max(8.0 * noise, 1e-9):
        raise LogError(
            f"{log.name}: in the first half the {what} moves {np.rad2deg(span):.3g}° with {np.rad2deg(noise):.2g}° of "
            "noise",
            expected="strokes well above the encoder's noise",
            do=do,
        )
