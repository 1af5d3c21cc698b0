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
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import LogError, ParameterError
from bowden.core.units import DEGREES
from bowden.identify.cable.fit import Fit
from bowden.identify.cable.fitted import ModelFit, Recalibration, described
from bowden.identify.cable.path import Path, build_path
from bowden.identify.cable.projection import solve_linear
from bowden.identify.cable.turns import find_turns
from bowden.identify.log.read import Log
from bowden.identify.log.variables import Scheduled
from bowden.models.cable.scheduled import VARIABLES
from bowden.plants.cable_parameters import outside
from bowden.plants.counting import Covered
from bowden.plants.identified import CableModel, IdentifiedCable
from bowden.plants.predicted import DISTRIBUTED, SCHEDULED
from bowden.plants.recounted import fitted_range, recalibrated
from bowden.records.metrics import rmse

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


def fit_gain(log: Log, cable: IdentifiedCable, by: Sequence[Scheduled] = ()) -> Fit:
    """Fit gain and offset of a known cable's recommended model to a log; all its models get them.

    Args:
        log: seconds of motion with a reversal at least, read and checked.
        cable: as it was identified.
        by: load or bend of the log, of a scheduled model.

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
    path = build_path(log.time, log.motor, log.joint, find_turns(log.motor), _NODES)
    if path.strokes < 2:
        raise LogError(
            f"{log.name}: the motor does not turn back, so that offset and half the loop cannot be separated",
            expected="at least one stroke back and forth",
            do="record some seconds more",
        )
    given, warnings = _placed(cable, by)
    gain, offset, error, drawn, sure = _fit(path, given.model())
    if not gain > 0.0:
        raise LogError(
            f"{log.name}: the joint moves {gain:+.3g} times as far as the model {cable.file or given.best} says",
            expected="a gain near 1",
            do="check the columns and which cable it is, or identify this log",
        )
    predicted = path.at(log.time, gain * drawn + offset)
    before, left, judged = path.at(log.time, drawn) - log.joint, predicted - log.joint, cable.judged
    after, beyond = rmse(left), _outside_stroke(log, given)
    far = sure and max(gain, 1.0 / gain) * (1.0 - 2.0 * error / gain) > _GAIN
    changed = None if beyond else far or _has_changed(_block_means(log, path, left**2), judged, log.resolutions[1])
    values = tuple(one.values[0] for one in by)
    fitted = described(log, path, len(log.time) // 2, predicted, train_rms=after, values=values)
    says = (
        (
            beyond > 0.0,
            f"the motor goes {beyond * DEGREES:.3g}° outside the identified stroke, where the model was fitted to "
            "nothing: gain and offset are those of both together; record a motion within it, or identify this log",
        ),
        (
            changed and far,
            f"the gain is {gain:.3g}, further from 1 than a bend or stretch of the cable explains "
            f"({1.0 / _GAIN:.2g} to {_GAIN:g}): check the units and the gear, or identify the "
            "cable again (bowden identify NEW.csv)",
        ),
        (
            changed and not far,
            f"with gain and offset fitted again {after * DEGREES:.2g}° are left, the model was judged to leave "
            f"{judged * DEGREES:.2g}°: identify the cable again (bowden identify NEW.csv)",
        ),
        (not sure, "the motion is too short or too small for a gain: only the offset was fitted again"),
        (
            fitted.cycles.more > 0,
            f"to identify the cable from this log, {fitted.cycles.to_record}: it has {fitted.cycles.counted}",
        ),
    )
    warnings += [words for holds, words in says if holds]
    models = {
        name: CableModel(name, recalibrated(parameters, gain, offset))
        for name, parameters in given.models.items()
        if name not in DISTRIBUTED
    }
    others = {name: one.parameters for name, one in models.items() if name != given.best}
    joints = None if given.covered is None else [gain * one + offset for one in given.covered[2:]]
    covered = None if joints is None or given.covered is None else Covered(*given.covered[:2], *joints)
    best = replace(models[given.best], others=others, covered=covered, encoders=given.encoders)
    return Fit(
        {name: ModelFit(one) for name, one in models.items()}
        | {given.best: ModelFit(models[given.best], fitted_count=1 + sure, train_rms=after)},
        best,
        (fitted,),
        judged_rms=judged,
        warnings=(*log.warnings, *warnings),
        units={one.name: one.unit or cable.units.get(one.name, "") for one in by},
        recalibration=Recalibration(
            cable.file or given.best, gain, error, offset, rmse(before), after, judged, changed, beyond
        ),
    )


def _has_changed(squares: Array, judged: float, count: float) -> bool | None:
    """True if clearly more is left in the blocks (n,) [rad²] than was judged [rad], with that joint's count [rad]."""
    if not math.isfinite(judged):
        return None
    scatter = float(np.std(squares, ddof=1)) / math.sqrt(len(squares))
    most = max((_WORSE * judged) ** 2 + count**2 / 12.0, _LEAST**2)
    return bool(squares.mean() - 2.0 * scatter > most)


def _outside_stroke(log: Log, cable: IdentifiedCable) -> float:
    """How far the motor leaves the range that a model of the cable says it was fitted to; 0 where none does [rad]."""
    ends = [found for one in cable.models.values() if (found := fitted_range(one)) is not None]
    if not ends:
        return 0.0
    low, high = min(one[0] for one in ends), max(one[1] for one in ends)
    beyond = float(max(low - log.motor.min(), log.motor.max() - high))
    return beyond if beyond > _BEYOND * (high - low) else 0.0


def _placed(cable: IdentifiedCable, by: Sequence[Scheduled]) -> tuple[IdentifiedCable, list[str]]:
    """The cable at the log's load and bend, and what is to be said of them."""
    for one in by:
        own = cable.units.get(one.name, "")
        if one.unit and own and one.unit != own:
            raise ParameterError(
                f"the {one.name} is in {one.unit}, {cable.file or 'the model'} has it in {own}",
                expected="one unit",
                do=f"give {one.name} its value in {own}",
            )
    values = {one.name: one.values[0] for one in by}
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
    basis = np.stack([drawn, np.ones_like(drawn)], axis=1)
    (gain, offset), _ = solve_linear(basis, joint, weight)
    return float(gain), float(offset), float(weight @ (joint - gain * drawn - offset) ** 2)


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
