"""The loop that a model draws along its log, and how well the log shows it.

Single parameters of a flexible model trade with one another: wider plays and a steeper mean draw the same loop. What a
log does show is the loop. In the middle half of the stroke, clear of the reversals by a fifth of it, it is a line with
a step,

    joint ≈ slope·motor + offset ∓ height/2    (− on the way on which the motor rises, for a slope above zero)

and at each of 20 places along the stroke it has a joint angle on the way up and one on the way down, all on average
over the log's strokes, small ones too. Each of these is a weighted sum Σ cᵢ·fittedᵢ over the log's nodes, whatever the
family. Its error has two parts: what the log's own errors make of it, and what the model misses. The former is read
from how Σ cᵢ·rᵢ of the residual r differs from cycle to cycle (stroke to stroke where there are fewer than three
cycles, and at a place), times Student's factor for few of them. The latter is at most the whole sum M = Σ cᵢ·rᵢ, and
nothing says how much of it is the log's own: anything within ±M is as likely, whose standard deviation is M/√3. What is
stated is the root of the sum of both squares.

Source: *Guide to the Expression of Uncertainty in Measurement*, JCGM 100:2008, 4.3.7, for a bound; Carlstein, Annals of
Statistics 14(3), 1986, for sums over blocks.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from bowden.identify.cable.hysteresis_loop import HysteresisLoop
from bowden.identify.cable.path import Path
from bowden.identify.cable.projection import inverse_of
from bowden.identify.cable.uncertainty import effective, few, summed

Array = NDArray[np.float64]

_PLACES = 20
_MIDDLE = (0.25, 0.75)
"""Of the stroke."""
_CLEAR = 0.2
"""Of the stroke, behind a reversal. Long strokes are farther from theirs when they come to the middle half; short ones,
which turn within it, are still on their way from one side of the loop to the other."""
_FEWEST_CYCLES, _FEWEST_STROKES = 3, 3
"""Cycles from which on they are compared, and strokes below which nothing says how they differ."""


def loop_of(path: Path, fitted: Array) -> HysteresisLoop | None:
    """The loop of a model with these joint angles at the nodes of a path (n,) [rad].

    None where the motor has not gone both ways through the middle of its stroke.
    """
    counted = path.weight > 0.0
    low, high = float(path.motor[counted].min()), float(path.motor[counted].max())
    share = (path.motor - low) / max(high - low, 1e-300)
    rises = np.where(np.diff(path.turning)[path.stroke] > 0.0, 1.0, -1.0)
    middle = counted & (share > _MIDDLE[0]) & (share < _MIDDLE[1])
    clear = middle & (np.abs(path.motor - path.turning[path.stroke]) > _CLEAR * (high - low))
    if _different(rises[clear] > 0.0) == 2:
        middle = clear
    if _different(rises[middle] > 0.0) < 2:
        return None
    residual = np.where(counted, path.joint - fitted, 0.0)
    design = np.column_stack([path.motor, np.ones_like(share), rises])
    weighted = np.where(middle, path.weight, 0.0)[:, None] * design
    sums = inverse_of(design.T @ weighted) @ weighted.T
    slope, offset, step = (float(row @ fitted) for row in sums)
    cycles = path.stroke // 2
    owner = cycles if _different(cycles[middle]) >= _FEWEST_CYCLES else path.stroke
    enough = _different(path.stroke[middle]) >= _FEWEST_STROKES
    errors = [_deviation(row, residual, owner) if enough else np.inf for row in sums]
    at = np.clip((_PLACES * share).astype(np.int64), 0, _PLACES - 1)
    up_place, up, up_error = _along(path, fitted, residual, np.where(counted & (rises > 0.0), at, -1))
    down_place, down, down_error = _along(path, fitted, residual, np.where(counted & (rises < 0.0), at, -1))
    both = np.concatenate([up_error, down_error])
    known = both[np.isfinite(both)]
    once = few(2.0) * float(np.sqrt(np.mean(known**2))) if len(known) else np.inf
    up_error, down_error = (np.where(np.isinf(one), once, one) for one in (up_error, down_error))
    height = -2.0 * step * (1.0 if slope >= 0.0 else -1.0)
    curve: list[Any] = [tuple(one.tolist()) for one in (up_place, up, up_error, down_place, down, down_error)]
    passed = np.concatenate([up_error, down_error])
    curve.append(float(np.sqrt(np.mean(passed[~np.isnan(passed)] ** 2))))
    return HysteresisLoop(slope, errors[0], offset, errors[1], height, 2.0 * errors[2], *curve)


def _along(path: Path, fitted: Array, residual: Array, at: NDArray[np.int64]) -> tuple[Array, Array, Array]:
    """Motor angle, joint angle and its deviation at every place (20,), over the nodes `at` it (n,), −1 being none.

    The deviation is NaN where no stroke passed, and infinite where only one did.
    """
    motor, joint, error = np.full((3, _PLACES), np.nan)
    for place in np.flatnonzero(np.bincount(at + 1, minlength=_PLACES + 1)[1:]):
        there = at == place
        shares = np.where(there, path.weight, 0.0) / path.weight[there].sum()
        motor[place], joint[place] = shares @ path.motor, shares @ fitted
        several = _different(path.stroke[there]) > 1
        error[place] = _deviation(shares, residual, path.stroke) if several else np.inf
    return motor, joint, error


def _deviation(shares: Array, residual: Array, owner: NDArray[np.int64]) -> float:
    """Of Σ shares·fitted, from the residual of the groups with the same `owner` (n,)."""
    sizes = summed(owner, np.abs(shares))
    sums = summed(owner, shares * residual)[sizes > 0.0]
    count, missed = len(sums), float(sums.sum())
    spread = float(np.sum((sums - missed / count) ** 2)) * count / (count - 1)
    return float(np.sqrt(few(effective(sizes[sizes > 0.0])) ** 2 * spread + missed**2 / 3.0))


def _different(numbers: NDArray[np.int64] | NDArray[np.bool_]) -> int:
    """How many different ones there are, none below zero."""
    return int(np.count_nonzero(np.bincount(numbers)))
