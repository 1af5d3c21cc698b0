"""A known model of a cable fitted to a few seconds of new motion: gain and offset only, and whether the cable changed.

    joint = a·m(motor) + b

m is the joint as the old model has it, from the state in which its loop fits best (the motor may have come from either
side). Both are fitted by least squares. Where the motion is too short for a gain, a = 1 stays and only b is fitted: the
gain's standard error, from leaving out one block after the other (jackknife), must be at most `_VAGUE` of it.

The cable has changed where what is left is clearly more than the old model was judged to leave:

    mean − 2·(standard error of the mean) > max((`_WORSE`·judged)² + count²/12, `_LEAST`²)

mean and standard error of the squared residual over blocks (strokes, or eight stretches of time where there are fewer),
judged the error that the model's file states of data that it had not seen, count the new joint encoder's step. It has
changed as well where a differs from 1 by more than `_GAIN`, as a ratio and beyond two standard errors. Where the motor
leaves the stroke that was identified there is no verdict: the model says nothing of what is there.

Gain and offset are the recommended model's. The other families describe the same joint, so that theirs are the same.

Source: Efron and Tibshirani, *An Introduction to the Bootstrap*, 1993, Chapter 11, for the jackknife.
"""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import LogError, ParameterError
from bowden.core.units import DEGREES
from bowden.drawing import shown
from bowden.identify.cable.counting import Covered, fitted_range
from bowden.identify.cable.cycles import Cycles, whole_cycles
from bowden.identify.cable.model import SCHEDULED, CableModel, IdentifiedCable
from bowden.identify.cable.path import Path, path_of
from bowden.identify.cable.trusted import Trust, least
from bowden.identify.log.read import Log
from bowden.identify.log.variables import shown_value
from bowden.models.cable.scheduled import VARIABLES
from bowden.plants.cables import DISTRIBUTED
from bowden.records.metrics import rmse

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

_NODES = 1500
_CAME_FROM = np.array([0.0, -1.0, -0.3, -0.1, 0.1, 0.3, 1.0])
"""Where the motor may have come from before the log, beside its first sample, over the log's range [–]."""
_ARRIVAL = 40
"""Samples of that way."""
_BLOCKS = 8
_VAGUE = 0.02
"""Largest standard error of a gain that is used, over the gain [–]: over a stroke of 60° it is 0.3° RMS."""
_WORSE = 1.5
"""Of the judged error: from where `bowden identify` says of a second half that the cable changed [–]."""
_LEAST = 0.05 / DEGREES
"""What is left below this is no change, however good the model was judged [rad]; the same is said of a second half."""
_GAIN = 1.2
"""Largest ratio of a gain to 1, or of 1 to it, that is a recalibration [–]. A sheath bent twice as far takes 16 % of
the slope (the paper's Fig. 15) and a cable's stretch a few; beyond are another gear, another pulley or a wrong unit."""
_BEYOND = 0.05
"""How far the motor may leave the identified stroke on each side, over that stroke [–]: a knot's distance of the
scheduled model, whose knots leave out the outermost samples."""
_BEGUN = ("initial_h", "initial_lag")
_SCALED = re.compile(
    r"slope|offset|(weight|bend|gap)_\d+|hysteresis_gain(_\d+)?|static_\d+|(middle|height)_\d+(_(load|bend)_\d)?"
)
"""Parameters in which a model's joint is linear."""
_SHIFTED = re.compile(r"offset|middle_\d+")
"""Parameters to which an offset is added."""


@dataclass(frozen=True, repr=False)
class Recalibration:
    """What a few seconds of motion say of a known model."""

    best: CableModel
    """The model with its new gain and offset; a rig takes it as its cable."""
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
    warnings: tuple[str, ...]
    """What to know, and what to do."""
    samples: int
    """In the new log."""
    cycles: Cycles
    """Whole cycles in the new log, and how many more to record to identify the cable from it; a recalibration needs
    none."""
    log: Log = field(compare=False)
    """The new log."""
    predicted: Array = field(compare=False)
    """Joint angle of the recalibrated model (n,) [rad]."""
    units: Mapping[str, str] = field(default_factory=dict, compare=False)
    """Of what schedules the model, by name."""

    def plot(self, axes: "Axes | Sequence[Axes] | None" = None) -> "list[Axes]":
        """Draw what the recalibrated model leaves of the joint's angle, over time.

        Args:
            axes: matplotlib's; a new figure is made where they are not given.

        Returns:
            The axes; ``axes[0].figure`` is theirs.

        Raises:
            ParameterError: something else than axes.
        """
        from bowden.identify.cable.plot import draw_residual

        drawn = shown.axes_for(axes, 1, 1, 7.0, 2.8)
        draw_residual(drawn[0], self)
        return drawn

    def __repr__(self) -> str:
        """One screen: gain, offset, errors, verdict."""
        return shown.screen(self._title(), self._rows())

    def _repr_html_(self) -> str:
        from bowden.drawing.style import new_figure
        from bowden.identify.cable.plot import draw_residual

        figure, axes = new_figure(height=2.8)
        draw_residual(axes[0], self)
        return shown.fragment(self._title(), self._rows(), figure)

    def _title(self) -> str:
        return f"Recalibration of {self.best.name} on {self.log.name}"

    def _rows(self) -> list[tuple[str, str]]:
        errors = f"{shown.number(self.before_rms * DEGREES, '°')} before, {shown.number(self.after_rms * DEGREES, '°')}"
        known = math.isfinite(self.judged_rms)
        judged = f"; judged {shown.number(self.judged_rms * DEGREES, '°')}" if known else ""
        return [
            ("gain", f"{self.gain:.4f} ± {self.gain_error:.2g}"),
            ("offset", shown.number(self.offset * DEGREES, "°")),
            ("RMS", f"{errors} after{judged}"),
            ("verdict", verdict(self)),
            ("cycles", cycles_line(self)),
            *(("note", warning) for warning in self.warnings[:4]),
        ]


def to_identify(cycles: Cycles) -> str:
    """What more an identification asks for of a log that is enough to recalibrate by; nothing where it is enough."""
    return f"to identify the cable from this log, {cycles.to_record}" if cycles.to_record else ""


def cycles_line(found: Recalibration) -> str:
    """How many whole cycles the log has, and what more its own identification asks for."""
    return shown.listed((found.cycles.counted, to_identify(found.cycles)), "; ")


def verdict(found: Recalibration) -> str:
    """What came out, in one sentence."""
    if found.beyond > 0.0:
        return (
            f"the motor goes {found.beyond * DEGREES:.3g}° outside the identified stroke, so it is not known "
            "whether the cable has changed"
        )
    if found.changed is None:
        return "the model's file does not say how good it was, so it is not known whether the cable has changed"
    if found.changed:
        return "the cable has changed: identify it again"
    return "the same cable: use the recalibrated model"


def recalibrate(
    log: Log,
    cable: IdentifiedCable,
    judged: float = math.nan,
    values: Mapping[str, float] | None = None,
    units: Mapping[str, str] | None = None,
) -> Recalibration:
    """Fit gain and offset of a known cable's recommended model to a log; all its models get them.

    Args:
        log: seconds of motion with a reversal at least, read and checked.
        cable: as it was identified.
        judged: error of its recommended model on data that it had not seen [rad].
        values: load or bend of the log, of a scheduled model.
        units: of the values; what is left out or empty is not compared with the model's.

    Raises:
        LogError: no reversal, or a joint that moves the other way: another cable.
        ParameterError: a model that has no gain, or no such variable, or one in another unit.
    """
    if cable.best in DISTRIBUTED:
        raise ParameterError(
            f"the model {cable.best!r} is not identified from logs and has no gain or offset of its own",
            expected="a model.toml of `bowden identify`",
            do="identify the new log",
        )
    path = path_of(log.time, log.motor, log.joint, _NODES)
    if path.strokes < 2:
        raise LogError(
            f"{log.name}: the motor does not turn back, so that offset and half the loop cannot be separated",
            expected="at least one stroke back and forth",
            do="record some seconds more",
        )
    _check_units(cable, units or {})
    given, warnings = _placed(cable, values or {})
    gain, offset, error, drawn, known = _fit(path, given.model())
    models = {
        name: recalibrated(parameters, gain, offset)
        for name, parameters in given.models.items()
        if name not in DISTRIBUTED
    }
    if not gain > 0.0:
        raise LogError(
            f"{log.name}: the joint moves {gain:+.3g} times as far as the model {cable.file or given.best} says",
            expected="a gain near 1",
            do="check the columns and which cable it is, or identify this log",
        )
    counted = path.weight > 0
    predicted = np.interp(log.time, path.time[counted], (gain * drawn + offset)[counted])
    before = np.interp(log.time, path.time[counted], drawn[counted]) - log.joint
    squares = _block_means(log, path, (predicted - log.joint) ** 2)
    changed = None
    if math.isfinite(judged):
        scatter = float(np.std(squares, ddof=1)) / math.sqrt(len(squares))
        count = log.resolutions[1]
        most = max((_WORSE * judged) ** 2 + count**2 / 12.0, _LEAST**2)
        changed = bool(squares.mean() - 2.0 * scatter > most)
    after, ratio = rmse(predicted - log.joint), max(gain, 1.0 / gain)
    far = known and ratio * (1.0 - 2.0 * error / gain) > _GAIN
    beyond = _outside_stroke(log, given)
    if beyond > 0.0:
        changed = None
        warnings.append(
            f"the motor goes {beyond * DEGREES:.3g}° outside the identified stroke, where the model was fitted to "
            "nothing: gain and offset are those of both together; record a motion within it, or identify this log"
        )
    elif far:
        changed = True
        warnings.append(
            f"the gain is {gain:.3g}, further from 1 than a bend or stretch of the cable explains "
            f"({1.0 / _GAIN:.2g} to {_GAIN:g}): check the units and the gear, or identify the "
            "cable again (bowden identify NEW.csv)"
        )
    elif changed:
        warnings.append(
            f"with gain and offset fitted again {after * DEGREES:.2g}° are left, the model was judged to leave "
            f"{judged * DEGREES:.2g}°: identify the cable again (bowden identify NEW.csv)"
        )
    if not known:
        warnings.append("the motion is too short or too small for a gain: only the offset was fitted again")
    others = {name: parameters for name, parameters in models.items() if name != given.best}
    joints = None if given.covered is None else [gain * one + offset for one in given.covered[2:]]
    covered = None if joints is None or given.covered is None else Covered(*given.covered[:2], *joints)
    known_before = [] if cable.trust is None else [cable.trust]
    renewed = [Trust("no", ("the cable has changed since its model was identified",))] if changed else []
    trust = least([*known_before, *renewed, *log.doubts]) if known_before or renewed or log.doubts else None
    best = CableModel(given.best, models[given.best], others, covered, trust, given.encoders)
    return Recalibration(
        best=best,
        gain=gain,
        gain_error=error,
        offset=offset,
        before_rms=rmse(before),
        after_rms=after,
        judged_rms=judged,
        changed=changed,
        beyond=beyond,
        warnings=(*log.warnings, *warnings),
        samples=len(log.time),
        cycles=whole_cycles(path),
        log=log,
        predicted=predicted,
        units=cable.units,
    )


def recalibrated(parameters: Mapping[str, float], gain: float, offset: float) -> dict[str, float]:
    """The parameters of a model whose joint is gain·joint + offset of the old one's."""
    found = {name: gain * value if _SCALED.fullmatch(name) else value for name, value in parameters.items()}
    return {name: value + offset if _SHIFTED.fullmatch(name) else value for name, value in found.items()}


def _check_units(cable: IdentifiedCable, units: Mapping[str, str]) -> None:
    for name, unit in units.items():
        own = cable.units.get(name, "")
        if unit and own and unit != own:
            raise ParameterError(
                f"the {name} is in {unit}, {cable.file or 'the model'} has it in {own}",
                expected="one unit",
                do=f"give {name} its value in {own}",
            )


def _outside_stroke(log: Log, cable: IdentifiedCable) -> float:
    """How far the motor leaves the range that a model of the cable says it was fitted to; 0 where none does [rad]."""
    ends = [found for one in cable.models.values() if (found := fitted_range(one)) is not None]
    if not ends:
        return 0.0
    low, high = min(one[0] for one in ends), max(one[1] for one in ends)
    beyond = float(max(low - log.motor.min(), log.motor.max() - high))
    return beyond if beyond > _BEYOND * (high - low) else 0.0


def _placed(cable: IdentifiedCable, values: Mapping[str, float]) -> tuple[IdentifiedCable, list[str]]:
    """The cable at the log's load and bend, and what is to be said of them."""
    known = [name for name in VARIABLES if f"{name}_low" in cable.model().parameters and cable.best == SCHEDULED]
    for name in values:
        if name not in known:
            raise ParameterError(
                f"a {name} is given, and {cable.file or 'the model'} is scheduled by {', '.join(known) or 'nothing'}",
                expected="values of what schedules the model",
                do=f"leave out {name}",
            )
    missing = [name for name in known if name not in values]
    if missing:
        raise ParameterError(
            f"{cable.file or 'the model'} is scheduled by the {missing[0]}, and the log's is not known",
            expected="its value, or the column that has it",
            do=f"give {missing[0]} its value or its column",
        )
    return cable.with_parameters(values) if values else cable, outside(cable.model().parameters, values)


def outside(parameters: Mapping[str, float], values: Mapping[str, float]) -> list[str]:
    """A warning for each variable whose value lies beyond those that were identified by a tenth of their range."""
    found = []
    for name, value in values.items():
        if f"{name}_low" not in parameters:
            continue
        low, high = parameters[f"{name}_low"], parameters[f"{name}_high"]
        if max(low - value, value - high) > 0.1 * (high - low):
            found.append(
                f"the {name} {shown_value(name, value)} lies outside those of the logs that the model was identified "
                f"from ({shown_value(name, low)} to {shown_value(name, high)}): the model goes on straight, at most as "
                "far as that range is wide"
            )
    return found


def _fit(path: Path, model: CableModel) -> tuple[float, float, float, Array, bool]:
    """Gain, offset [rad], standard error of the gain, the old model's joint at each node (n,) [rad], and whether the
    motion says a gain; where it does not it is 1."""
    rested = {name: 0.0 if name in _BEGUN else value for name, value in model.parameters.items()}
    start, best = CableModel(model.name, rested), None
    for lag in _CAME_FROM * path.span:
        arrival = np.linspace(path.motor[0] + lag, path.motor[0], _ARRIVAL)
        drawn = start.joint_angle(np.concatenate([arrival, path.motor]))[_ARRIVAL:]
        cost = _solved(drawn, path.joint, path.weight)[2]
        if best is None or cost < best[0] - 1e-12:
            best = (cost, drawn)
        if not any(name in model.parameters for name in (*_BEGUN, "knot_first")):
            break
    drawn = np.asarray(best[1] if best else np.empty(0))
    blocks = _blocks(path)
    kept = [np.where(blocks == one, 0.0, path.weight) for one in np.unique(blocks)]
    gains = np.array([_solved(drawn, path.joint, weight)[0] for weight in kept])
    count = len(gains)
    error = float(np.sqrt((count - 1) / count * np.sum((gains - gains.mean()) ** 2)))
    gain, offset, _ = _solved(drawn, path.joint, path.weight)
    known = error <= _VAGUE * abs(gain)
    if not known:
        gain, offset = 1.0, float(np.average(path.joint - drawn, weights=path.weight))
    return gain, offset, error, drawn, known


def _solved(drawn: Array, joint: Array, weight: Array) -> tuple[float, float, float]:
    """a, b [rad] and the weighted sum of squares that they leave [rad²]."""
    share = weight / weight.sum()
    centre, height = float(share @ drawn), float(share @ joint)
    power = float(share @ (drawn - centre) ** 2)
    gain = float(share @ ((drawn - centre) * (joint - height))) / max(power, 1e-300)
    rest = joint - height - gain * (drawn - centre)
    return gain, height - gain * centre, float(weight @ rest**2)


def _blocks(path: Path) -> NDArray[np.int64]:
    """Which block each node is in: its stroke, or its stretch of time where there are fewer strokes than blocks."""
    if path.strokes >= _BLOCKS:
        return path.stroke
    place = np.cumsum(path.weight) / max(float(path.weight.sum()), 1e-300)
    return np.minimum((_BLOCKS * place).astype(np.int64), _BLOCKS - 1)


def _block_means(log: Log, path: Path, squares: Array) -> Array:
    """Mean square of each block at the log's full rate [rad²]."""
    blocks = _blocks(path)
    edges = [int(np.searchsorted(log.time, path.time[blocks >= one].min())) for one in np.unique(blocks)]
    bounds = [0, *edges[1:], len(log.time)]
    return np.array([float(squares[a:b].mean()) for a, b in pairwise(bounds) if b > a])
