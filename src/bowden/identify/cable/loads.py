"""Several logs of one cable fitted together, and their model scheduled by the load, the bend, or both.

The model is `bowden.models.cable.scheduled`: one loop of free shape, whose ordinates are polynomials of the scheduling
variables. Everything in it is linear but the plays' half-widths, which lie on a fixed grid:

1. shares of the plays: non-negative least squares of all logs, each with a static curve of its own;
2. ordinates of f and g for all logs at once: least squares with a small penalty on their roughness, which fills what no
   log passed through and gives way to the data anywhere else. Where a branch of the loop would run against the cable's
   direction the penalty is raised until none does.

Every log counts the same, however long it is. Its first long stroke is simulated and not fitted: what the cable had
been through before is not known, and forgotten after it.

A log's load is one number, its mean. (The torque of each instant was tried in its place and predicts unseen loads
worse, since it holds the joint's own friction.)

What is judged: second halves by what was fitted to first halves; each log by the others where another has its load; and
each load by the others, where two differ from it. With load and bend it is each pair of them that is left out: logs of
the same load at another bend stay in the fit. The model itself is fitted to all.
"""

import itertools
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import LogError, ParameterError
from bowden.core.units import DEGREES
from bowden.identify.cable.bouc_wen import fit_terms, search
from bowden.identify.cable.cycles import ENOUGH
from bowden.identify.cable.fit import Fit
from bowden.identify.cable.fitted import FittedLog, ModelFit, described
from bowden.identify.cable.path import Path, build_path
from bowden.identify.cable.projection import Progress, products, weights_of_one_sign, without
from bowden.identify.cable.turns import find_turns
from bowden.identify.cable.uncertainty import loop_of
from bowden.identify.log.read import Log
from bowden.identify.log.variables import Scheduled
from bowden.models.cable.prandtl_ishlinskii import plays
from bowden.models.cable.scheduled import ScheduledCable, hats, joint_angle, parameters_of, powers
from bowden.plants.cable_parameters import shown_value
from bowden.plants.counting import covered_by
from bowden.plants.identified import CableModel
from bowden.plants.predicted import SCHEDULED
from bowden.records.metrics import rmse

Array = NDArray[np.float64]

_NODES, _SEARCHED = 1500, 150
"""Nodes of a log's path: where it is fitted, and where the plain Bouc–Wen cable is searched for."""
_KNOTS = 20
"""Ordinates of f and of g. With 14 or 30 the figures of docs/decisions/0014 change by 0.006° at most."""
_GRID = np.geomspace(2e-3, 0.3, 14)
"""Half-widths offered, over the motor's range [–]; those of the stack that a log of one amplitude can show."""
_EDGE = 0.005
"""Share of the samples beyond the first knot, and beyond the last: a jerk of the motor shall not stretch the knots."""
_STATIC_DEGREE = 8
"""Of each log's own static curve."""
_ROUGH = 1e-3
"""Penalty on the squared second differences of f and first differences of g, over the mean squared error [–]; between
1e-4 and 1e-2 nothing changes but what no log passed through."""
_SCHEDULE_ROUGH = 10.0
"""The same of what the variables change, over that of the base: a shape changes less than it is [–]."""
_ALIKE = 0.05
"""Loads that differ by less than this share of all loads' range are one level [–]."""
_LEAST_RANGE = 0.02
"""Loads whose range is smaller than this share of the largest are all equal [–]."""
_TOGETHER = 0.95
"""Correlation of load and bend over the logs above which they are refused."""
_BESIDE = 0.005
"""A log whose mean error is above that share of the motor's range and half its scatter lies beside the others [–]."""
_HIGHEST = 2
"""Highest power of a variable. f bends with the load as a cable's stiffness rises with its tension."""


class _Moved(NamedTuple):
    """One log, ready to be fitted."""

    log: Log
    path: Path
    """Its weights are 1 in all, and zero on the first long stroke."""
    begin: int
    """Sample at the end of the first long stroke."""


class _Frame(NamedTuple):
    """What all logs share."""

    first: float
    step: float
    half_widths: Array

    def lags(self, path: Path) -> Array:
        """motor − zᵢ (n, k) [rad]."""
        return np.asarray(path.motor[:, None] - plays(path.motor, self.half_widths))


def fit_logs(logs: Sequence[Log], by: Sequence[Scheduled], seed: int, tell: Progress) -> Fit:
    """Fit one model to several logs of a cable.

    Args:
        logs: two or more, read and checked.
        by: load, bend or both, of each log.
        seed: of the plain Bouc–Wen cable's search.
        tell: called with what is being done and the share of the work that is behind.

    Raises:
        LogError: logs that do not go together.
        ParameterError: load and bend that change together.
    """
    tell("following the motors", 0.1)
    paths = [_path(log, _NODES) for log in logs]
    frame = _frame(paths)
    moved = [_prepared(log, path) for log, path in zip(logs, paths, strict=True)]
    _check_alike(moved)
    differing, warnings = _scheduling(by)
    values = np.array([one.values for one in differing]).T if differing else np.empty((len(logs), 0))
    names = [one.name for one in differing]
    tell("fitting all logs", 0.3)
    cable = _fitted(moved, values, frame)
    tell("judging", 0.5)
    judged = _judged(moved, values, names, frame, cable)
    warnings += _beside(moved, values, cable)
    middle = [0.5 * float(low + high) for low, high in zip(cable.low, cable.high, strict=True)]
    tell("bouc_wen", 0.8)
    near = int(np.argmin(np.abs(values - middle).sum(axis=1))) if len(names) else 0
    plain = fit_terms(paths[near], search(_path(logs[near], _SEARCHED).first(30), seed), 1, 0).parameters
    best = CableModel(
        SCHEDULED,
        parameters_of(cable, names, middle),
        others={"bouc_wen": plain},
        covered=covered_by([log.covered for log in logs]),
        encoders=logs[0].encoders,
    )
    errors = [_over_logs([getattr(one, name) for one in judged]) for name in ("train_rms", "test_rms")]
    count = cable.middle.size + cable.height.size + len(cable.half_widths)
    left_out = (_over_logs([getattr(one, name) for one in judged]) for name in ("unseen_offset_rms", "same_offset_rms"))
    tell("done", 1.0)
    return Fit(
        {
            SCHEDULED: ModelFit(best, {}, None, count, *errors),
            "bouc_wen": ModelFit(CableModel("bouc_wen", plain)),
        },
        best,
        tuple(judged),
        judged_rms=next((one for one in left_out if np.isfinite(one)), errors[1]),
        warnings=(
            *(f"{log.name}: {said}" for log in logs for said in log.warnings),
            *warnings,
            *(one.said for one in by if one.said),
        ),
        units={one.name: one.unit for one in differing},
    )


def _over_logs(errors: Sequence[float]) -> float:
    """Root mean square over the logs for which there is one."""
    known = np.array([error for error in errors if np.isfinite(error)])
    return float(np.sqrt(np.mean(known**2))) if len(known) else math.nan


def _path(log: Log, nodes: int) -> Path:
    return build_path(log.time, log.motor, log.joint, find_turns(log.motor), nodes)


def _frame(paths: Sequence[Path]) -> _Frame:
    """Knots over the range in which the motors nearly always are."""
    low, high = (
        float(pick([np.quantile(np.repeat(path.motor, path.weight.astype(np.intp)), edge) for path in paths]))
        for pick, edge in ((np.min, _EDGE), (np.max, 1.0 - _EDGE))
    )
    return _Frame(low, (high - low) / (_KNOTS - 1), _GRID * (high - low))


def _prepared(log: Log, path: Path) -> _Moved:
    lengths = np.abs(np.diff(path.turning))
    begun = int(np.argmax(lengths >= 0.5 * path.span)) + 1
    weight = np.where(path.stroke < begun, 0.0, path.weight) if begun < path.strokes else path.weight
    whole = float(weight.sum())
    if path.strokes < 2 or whole == 0.0:
        raise LogError(
            f"{log.name}: the motor does not turn back",
            expected="a log in which it goes back and forth",
            do=f"record {ENOUGH} whole cycles, or leave this log out",
        )
    begin = int(np.searchsorted(log.time, path.time[np.flatnonzero(weight)[0]]))
    return _Moved(log, path.with_weight(weight / whole), begin)


def _check_alike(moved: Sequence[_Moved]) -> None:
    """Refuse logs whose joints move in opposite directions: they are of two cables, or of two ways of counting."""
    slopes = [np.polyfit(one.path.motor, one.path.joint, 1, w=np.sqrt(one.path.weight))[0] for one in moved]
    for one, slope in zip(moved, slopes, strict=True):
        if slope * slopes[0] <= 0.0:
            raise LogError(
                f"{one.log.name}: the joint moves {slope:+.3g} times as far as the motor, in {moved[0].log.name} "
                f"{slopes[0]:+.3g} times",
                expected="one sign in all logs of a cable",
                do="check the columns, or turn the sign of one",
            )


def _scheduling(by: Sequence[Scheduled]) -> tuple[list[Scheduled], list[str]]:
    """The variables that differ among the logs, and what is to be said of them."""
    found, warnings = [], []
    for one in by:
        values = np.array(one.values)
        if not np.ptp(values) > _LEAST_RANGE * float(np.abs(values).max()):
            warnings.append(
                f"the {one.name} is {shown_value(one.name, values.mean(), one.unit)} in all logs, so that it schedules "
                "nothing: one model was fitted to all; record logs at three values of it or more"
            )
            continue
        if _levels(values).max() == 1:
            warnings.append(
                f"the {one.name} has two values only: the model goes straight between them, and nothing can judge it "
                "at a third; record one more"
            )
        found.append(one)
    if len(found) == 2 and abs(float(np.corrcoef([one.values for one in found])[0, 1])) > _TOGETHER:
        raise ParameterError(
            "load and bend change together from log to log, so that their effects cannot be separated",
            expected="logs in which one changes and the other does not",
            do="record such a log, or schedule by one of them (none for the other)",
        )
    if not found and not warnings:
        warnings.append("the logs do not differ in load or bend: one model was fitted to all of them")
    return found, warnings


def _levels(values: Array) -> NDArray[np.int64]:
    """Which level each value is on (n,), the least on 0; none is further from its level's first than that."""
    order = np.argsort(values, kind="stable")
    widest, first, found = _ALIKE * float(np.ptp(values)), values[order[0]], np.zeros(len(values), np.int64)
    for before, i in itertools.pairwise(order):
        above = values[i] - first > widest
        first, found[i] = values[i] if above else first, found[before] + above
    return found


def _fitted(moved: Sequence[_Moved], values: Array, frame: _Frame) -> ScheduledCable:
    """The scheduled cable of some logs at `values` (logs, V)."""
    degree = np.array([min(_HIGHEST, _levels(column).max()) for column in values.T], dtype=np.int64)
    rows = 1 + int(degree.sum())
    shares = _shares(moved, frame)
    kept = shares > 0.0
    empty = np.zeros((rows, _KNOTS))
    cable = ScheduledCable(
        frame.first,
        frame.step,
        empty,
        empty,
        frame.half_widths[kept],
        shares[kept],
        values.min(axis=0, initial=np.inf) if len(degree) else np.empty(0),
        values.max(axis=0, initial=-np.inf) if len(degree) else np.empty(0),
        degree,
    )
    count = 2 * rows * _KNOTS
    gram, moments = np.zeros((count, count)), np.zeros(count)
    for one, at in zip(moved, values, strict=True):
        path = one.path
        middle, height = (hats(path.motor, frame.first, frame.step, _KNOTS, outward) for outward in (1.0, 0.0))
        basis = np.column_stack([middle, height * (frame.lags(path) @ shares)[:, None], path.joint])
        sums = products(basis, path.weight)
        factors = powers(at.tolist(), cable)
        turned = np.kron(np.outer(factors, factors), sums[:-1, :-1].reshape(2 * _KNOTS, 2 * _KNOTS))
        gram += turned
        moments += np.kron(factors, sums[:-1, -1])
    roughness = _roughness(rows) * len(moved)
    for stiffer in 10.0 ** np.arange(7):  # at most to where f is a straight line and g a constant
        found = np.linalg.solve(gram + stiffer * roughness, moments).reshape(rows, 2, _KNOTS)
        cable = cable._replace(middle=found[:, 0].copy(), height=found[:, 1].copy())
        if _runs_one_way(cable, moved[0].path.direction):
            break
    return cable


def _shares(moved: Sequence[_Moved], frame: _Frame) -> Array:
    """ηᵢ (k,) [1/rad], by non-negative least squares; each log has a static curve of its own beside the plays."""
    whole = np.zeros((len(frame.half_widths) + 1,) * 2)
    last = frame.first + frame.step * (_KNOTS - 1)
    for path in (one.path for one in moved):
        place = np.clip((2.0 * path.motor - frame.first - last) / (last - frame.first), -1.0, 1.0)
        static = np.polynomial.chebyshev.chebvander(place, _STATIC_DEGREE).astype(np.float64)
        columns = np.column_stack([static, -path.direction * frame.lags(path), path.joint])
        whole += without(products(columns, path.weight), static.shape[1])
    found, _ = weights_of_one_sign(whole, 1.0)
    if not found.any():  # a cable without a loop: any memory will do, and g says that there is none
        found[0] = 1.0
    return np.asarray(found / (found @ frame.half_widths))


def _roughness(rows: int) -> Array:
    """The penalty's quadratic form, ordered as the unknowns are: row, then f and g, then knot."""
    bends = np.diff(np.eye(_KNOTS), 2, axis=0)
    steps = np.diff(np.eye(_KNOTS), 1, axis=0)
    own = np.zeros((2 * _KNOTS,) * 2)
    own[:_KNOTS, :_KNOTS], own[_KNOTS:, _KNOTS:] = bends.T @ bends, steps.T @ steps
    own += 1e-6 * np.eye(2 * _KNOTS)
    return np.asarray(_ROUGH * np.kron(np.diag([1.0] + [_SCHEDULE_ROUGH] * (rows - 1)), own))


def _runs_one_way(cable: ScheduledCable, sign: float) -> bool:
    """True if both branches of the loop go the cable's way at every corner of the scheduling variables."""
    for corner in itertools.product(*zip(cable.low.tolist(), cable.high.tolist(), strict=True)):
        weights = powers(corner, cable)
        middle, height = np.diff(weights @ cable.middle), np.diff(weights @ cable.height)
        if (sign * middle < np.abs(height)).any():
            return False
    return True


def _predicted(one: _Moved, cable: ScheduledCable, values: Array) -> Array:
    """Joint angle at the log's full rate (m,) [rad]."""
    return one.path.at(one.log.time, joint_angle(one.path.motor, cable, values.tolist()))


def _error(one: _Moved, cable: ScheduledCable, values: Array) -> Array:
    """Error of the joint at the log's full rate, from the end of the first long stroke on [rad]."""
    return (_predicted(one, cable, values) - one.log.joint)[one.begin :]


def _judged(
    moved: Sequence[_Moved], values: Array, names: Sequence[str], frame: _Frame, cable: ScheduledCable
) -> list[FittedLog]:
    first = [np.where(np.cumsum(one.path.weight) <= 0.5, one.path.weight, 0.0) for one in moved]
    part = [one._replace(path=one.path.with_weight(weight)) for one, weight in zip(moved, first, strict=True)]
    halves = _fitted(part, values, frame)
    level = np.array([_levels(column) for column in values.T]).T.reshape(values.shape)
    fits: dict[bytes, ScheduledCable] = {}

    def left_out(i: int, kept: NDArray[np.bool_]) -> tuple[float, float]:
        """Errors on a log of a cable of some; NaN where these do not differ in every variable any more."""
        if not kept.any() or any(_levels(column).max() < 1 for column in values[kept].T):
            return math.nan, math.nan
        if (key := kept.tobytes()) not in fits:
            fits[key] = _fitted([one for one, keep in zip(moved, kept, strict=True) if keep], values[kept], frame)
        error = _error(moved[i], fits[key], values[i])
        half = len(error) // 2
        return rmse(error), rmse(error[half:] - error[:half].mean())

    found, nothing = [], np.zeros(len(moved), bool)
    for i, (one, at) in enumerate(zip(moved, values, strict=True)):
        alike = (level == level[i]).all(axis=1)
        same = left_out(i, np.arange(len(moved)) != i if alike.sum() > 1 else nothing)
        unseen = left_out(i, ~alike if names else nothing)
        log, middle = one.log, (one.begin + len(one.log.time)) // 2
        line = np.polyfit(log.motor[:middle], log.joint[:middle], 1)
        found.append(
            described(
                log,
                one.path,
                middle,
                _predicted(one, halves, at),
                train_rms=rmse(_error(one, cable, at)),
                line_rms=rmse(np.polyval(line, log.motor[middle:]) - log.joint[middle:]),
                loop=loop_of(one.path, joint_angle(one.path.motor, cable, at.tolist())),
                fitted_from=one.begin,
                values=tuple(at.tolist()),
                same_rms=same[0],
                same_offset_rms=same[1],
                unseen_rms=unseen[0],
                unseen_offset_rms=unseen[1],
            )
        )
    return found


def _beside(moved: Sequence[_Moved], values: Array, cable: ScheduledCable) -> list[str]:
    """What is to be said of logs that lie beside the others at their load: an encoder that was zeroed again."""
    found, least = [], _BESIDE * cable.step * (cable.middle.shape[1] - 1)
    for one, at in zip(moved, values, strict=True):
        error = _error(one, cable, at)
        mean = abs(float(error.mean()))
        if mean > max(least, 0.5 * float(error.std())):
            found.append(f"{one.log.name} by {mean * DEGREES:.2g}°")
    if not found:
        return []
    return [
        f"{', '.join(found[:4])}{', …' if len(found) > 4 else ''} beside the model of all logs: their encoders were "
        "zeroed again, or the cable changed; record all with one zero, since it is the offset that a load changes most"
    ]
