"""How well a log shows what was fitted to it: standard errors of parameters, and the loop that a model draws.

**Parameters.** The covariance of a weighted least-squares fit is the sandwich H⁻¹·M·H⁻¹ with H = JᵀWJ and M the
covariance of the score JᵀW·r. A cable's residual is correlated from sample to sample, and a cable strays: each stroke
lies a little beside the one before. M has a part for each:

    M = Σ_b s_b·s_bᵀ + t²·τ²·Σ_k S_k·S_kᵀ,    s_b = Σ_{i in b} wᵢ·rᵢ·Jᵢ,    S_k = Σ_{i in k} wᵢ·Jᵢ

b are long blocks of the log. τ² is the variance of the mean residual of a stroke k, set free of what the fit took up of
it and of its samples' noise; so a parameter that one stroke alone shows, as the lag at the start, gets its share of it
too. The same is done with cycles (two strokes) for k, in which what strays slowly counts more, and the larger variance
is taken. t makes up for few strokes: Student's quantile over the normal one.

**The loop.** Single parameters of a flexible model trade with one another: wider plays and a steeper mean draw the same
loop. What a log does show is the loop. In the middle half of the stroke, clear of the reversals by a fifth of it, it is
a line with a step,

    joint ≈ slope·motor + offset ∓ height/2    (− on the way on which the motor rises, for a slope above zero)

and at each of 20 places along the stroke it has a joint angle on the way up and one on the way down, all on average
over the log's strokes, small ones too. Each of these is a weighted sum Σ cᵢ·fittedᵢ over the log's nodes, whatever the
family. Its error has two parts: what the log's own errors make of it, and what the model misses. The former is read
from how Σ cᵢ·rᵢ of the residual r differs from cycle to cycle (stroke to stroke where there are fewer than three
cycles, and at a place), times Student's factor for few of them. The latter is at most the whole sum M = Σ cᵢ·rᵢ, and
nothing says how much of it is the log's own: anything within ±M is as likely, whose standard deviation is M/√3. What is
stated is the root of the sum of both squares.

Source: White, Econometrica 48(4), 1980; Carlstein, Annals of Statistics 14(3), 1986, for blocks; Laird and Ware,
Biometrics 38(4), 1982, for what strays from group to group; *Guide to the Expression of Uncertainty in Measurement*,
JCGM 100:2008, 4.3.7, for a bound.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from bowden.identify.cable.hysteresis_loop import HysteresisLoop
from bowden.identify.cable.path import Path
from bowden.identify.cable.projection import Array, Estimate, inverse_of, products
from bowden.plants.predicted import PREDICTED

_BLOCKS = 24
_LEAST_LEFT = 0.1
"""Least share of a stroke's straying that a fit is taken to leave in the residual."""
_INVERSE_FREEDOM = (0.0, 0.1, 0.2, 1.0 / 3.0, 0.5, 1.0)
_QUANTILES = (1.960, 2.228, 2.571, 3.182, 4.303, 12.706)
"""Of Student's distribution, 97.5 %, at these inverse degrees of freedom."""


def standard_errors(path: Path, estimate: Estimate, family: str) -> dict[str, float]:
    """One standard deviation of every parameter; infinite where the data do not show it, NaN where none is stated.

    None is stated of a setting, nor where smoothing draws the coordinates: they trade with what is not in J.
    `loop_of` states the loop's then.
    """
    if estimate.prior is not None:
        return dict.fromkeys(estimate.parameters, np.nan)
    errors = dict.fromkeys(estimate.parameters, np.nan) | dict.fromkeys(estimate.slopes, np.inf)
    seen, blind = _shown(path, estimate)
    kept = _jacobian(estimate)[:, seen]
    residual, inverse = path.joint - estimate.fitted, inverse_of(products(kept, path.weight))
    scores = _score_covariance(path, kept, residual)
    variance = np.max(
        [
            np.diag(inverse @ (scores + _straying(path, kept, residual, inverse, owner)) @ inverse)
            for owner in (path.stroke, path.stroke // 2)
        ],
        axis=0,
    )
    variance = variance + sum(
        (inverse @ np.einsum("np,n->p", kept, path.weight * change)) ** 2
        for change in _reversal_changes(path, estimate, family)
    )
    for name, value, hidden in zip(np.array(list(estimate.slopes))[seen], variance, blind, strict=True):
        if not hidden:
            errors[str(name)] = float(np.sqrt(max(value, 0.0) + estimate.variance.get(str(name), 0.0)))
    return errors


def all_shown(path: Path, estimate: Estimate) -> bool:
    """True if the data show every parameter for which a deviation is stated: none would be infinite."""
    if estimate.prior is not None:
        return True
    seen, blind = _shown(path, estimate)
    return bool(seen.all()) and not blind.any() and np.inf not in estimate.variance.values()


def few(effective: float) -> float:
    """Student's quantile over the normal one, for a variance taken from so many independent sums [–].

    >>> round(few(2.0), 2), round(few(6.0), 2)
    (6.48, 1.31)
    """
    return float(np.interp(1.0 / max(effective - 1.0, 1.0), _INVERSE_FREEDOM, _QUANTILES)) / _QUANTILES[0]


def _jacobian(estimate: Estimate) -> Array:
    return np.stack(list(estimate.slopes.values()), axis=1)


def _shown(path: Path, estimate: Estimate) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which fitted parameters move the joint at all (p,), and which of these only together with others."""
    jacobian = _jacobian(estimate)
    size = np.sqrt(np.einsum("n,np->p", path.weight, jacobian**2))
    largest = np.abs([estimate.parameters[name] for name in estimate.slopes])
    seen = size * np.maximum(largest, 1e-6) > 1e-9 * np.sqrt(path.weight @ estimate.fitted**2)
    values, vectors = np.linalg.eigh(products(jacobian[:, seen] / size[seen], path.weight))
    return seen, (np.abs(vectors[:, values < 1e-11 * values[-1]]) > 1e-2).any(axis=1)


def _straying(path: Path, jacobian: Array, residual: Array, inverse: Array, owner: NDArray[np.int64]) -> Array:
    """t²·τ²·Σ S_k·S_kᵀ (p, p), the nodes of a k having the same `owner` (n,)."""
    weights, means = (summed(owner, path.weight * one) for one in (np.ones_like(residual), residual))
    kept, means = weights > 0.0, means / np.maximum(weights, 1e-300)
    free = max(int(np.count_nonzero(path.weight)) - int(np.count_nonzero(kept)), 1)
    noise = float(path.weight @ (residual - means[owner]) ** 2) / free  # of a sample: it moves the means as well
    sums = np.stack([summed(owner, path.weight * column) for column in jacobian.T], axis=1)[kept]
    means, weights = means[kept], weights[kept]
    left = np.eye(len(weights)) - sums / weights[:, None] @ inverse @ sums.T
    share = max(float(weights @ np.einsum("kl,kl->k", left, left)) / float(weights.sum()), _LEAST_LEFT)
    strays = max(float(weights @ means**2) / share - noise * len(weights), 0.0) / float(weights.sum())
    return np.asarray(few(effective(weights)) ** 2 * strays * (sums.T @ sums))


def summed(owner: NDArray[np.int64], values: Array) -> Array:
    """The sum of the values (n,) that have the same `owner` (n,), by owner."""
    return np.bincount(owner, values).astype(np.float64)


def effective(weights: Array) -> float:
    """How many of even weight say as much."""
    return float(weights.sum() ** 2 / (weights @ weights))


def _score_covariance(path: Path, jacobian: Array, residual: Array) -> Array:
    count = jacobian.shape[1]
    blocks = max(_BLOCKS, 2 * count)
    scores = jacobian * (path.weight * residual)[:, None]
    edges = np.linspace(0, len(scores), blocks + 1).astype(int)[:-1]
    sums = np.add.reduceat(scores, edges, axis=0)
    return np.asarray(sums.T @ sums * blocks / (blocks - count))  # count directions of the sums vanish at the minimum


def _reversal_changes(path: Path, estimate: Estimate, family: str) -> list[Array]:
    """How the joint changes (n,) when the reversals of one side lie further out by their common error."""
    turns = np.flatnonzero(np.diff(path.stroke) > 0) + 1
    outward = np.sign(path.motor[turns] - path.motor[turns - 1])
    if not len(turns) or path.reversal_error == 0.0:
        return []
    found, base = [], PREDICTED[family](estimate.parameters, path.motor)
    for side in (1.0, -1.0):
        if not (outward == side).any():
            continue
        error = path.reversal_error  # what the tops of a motion have in common, several amplitudes do not mend
        motor = path.motor.copy()
        motor[turns[outward == side]] += side * error
        found.append(PREDICTED[family](estimate.parameters, motor) - base)
    return found


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
