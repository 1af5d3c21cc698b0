"""Parts of a fit: the models fitted, how each log is predicted, how a known model has changed, and a forecast.

**Forecast.** A law that commands the motor to where the model has the joint at its reference r leaves

    joint(motor) − r = joint(motor) − model(motor),    motor = model⁻¹(r)

which is the model's own error along that motion. On a motion like the log's it is what the model errs by on the half
that it has not seen, but for the time spent at each place: the inverse runs through the play at once, where the log's
motor took its time. At a place where the model's joint moves by dm per dx of the motor, the law spends dm/(c·dx) of the
log's time (c: slope of the straight line), and there the error counts by this much. Without compensation the motor goes
to where the straight line has the joint at r, and the line's error is left. Neither counts the servo: it is taken to
follow at once.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.units import DEGREES
from bowden.drawing import shown
from bowden.identify.cable.cycles import Cycles, drift, whole_cycles
from bowden.identify.cable.hysteresis_loop import HysteresisLoop
from bowden.identify.cable.path import Path
from bowden.identify.cable.turns import motor_noise, peak_speed
from bowden.identify.log.read import Log
from bowden.plants.identified import CableModel
from bowden.records.metrics import rmse

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
    one_amplitude: float = 0.0
    """Span of the motor where all strokes have one amplitude, so that no smaller loop is seen; else 0 [rad]."""
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


def described(log: Log, path: Path, split: int, predicted: Array, **found: Any) -> FittedLog:
    """A log, and how it is predicted (n,) [rad], with what its path says of it; `found` are the other fields."""
    return FittedLog(
        log=log,
        cycles=whole_cycles(path),
        split=split,
        predicted=predicted,
        test_rms=rmse(predicted[split:] - log.joint[split:]),
        reversals=path.strokes - 1,
        drift=drift(path),
        **found,
    )


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
    """True if the cable has changed; None where the file does not say how good the model was, and where the motor went
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


_PLACES = 500
"""Pieces of the second half, in each of which the motions of motor and model are compared."""


class Forecast(NamedTuple):
    """Root mean square error of the joint on a motion like the log's second half."""

    compensated: float
    """With the inverse of the recommended model commanded exactly [rad]."""
    uncompensated: float
    """With the inverse of the straight line [rad]."""
    resolution: float
    """Of both encoders' counts, at the joint: √((slope·motor count)² + (joint count)²)/√12. What is below it neither
    shows in this log nor can be commanded; zero where the log shows no counts [rad]."""


def forecast(one: FittedLog, slope: float, error: float, of_line: float) -> Forecast:
    """See `Forecast`.

    Args:
        one: what was fitted, and how the recommended model predicts it.
        slope: of the straight line [rad/rad].
        error: of the recommended model on the second half [rad].
        of_line: the straight line's [rad].
    """
    of_motor, of_joint = one.log.resolutions
    counts = math.hypot(slope * of_motor, of_joint)
    motor, predicted, joint = (values[one.split :] for values in (one.log.motor, one.predicted, one.log.joint))
    return Forecast(_share(motor, predicted, joint - predicted, abs(slope)) * error, of_line, counts / math.sqrt(12.0))


def _share(motor: Array, model: Array, error: Array, slope: float) -> float:
    """Error along the inverse's motion over that along the log's, both root mean square."""
    pieces = max(1, min(_PLACES, len(motor) // 4))
    edges = np.linspace(0, len(motor) - 1, pieces + 1).astype(int)
    moved, went = (np.abs(np.diff(one[edges])) for one in (model, motor))
    resting = went <= 4.0 * motor_noise(motor)
    spent = np.where(resting, 1.0, moved / np.where(resting, 1.0, slope * went)) * np.diff(edges)
    square = np.add.reduceat(error[:-1] ** 2, edges[:-1]) / np.diff(edges)
    whole = float(np.diff(edges) @ square) / float(edges[-1])
    if not (whole > 0.0 and spent.sum() > 0.0):
        return 1.0
    return math.sqrt(float(spent @ square) / float(spent.sum()) / whole)
