"""Standard errors that hold when the residual is not white.

The covariance of a weighted least-squares fit is the sandwich H⁻¹·M·H⁻¹ with H = JᵀWJ and M the covariance of the score
JᵀW·r. A cable's residual is correlated from sample to sample, and a cable strays: each stroke lies a little beside the
one before. M has a part for each:

    M = Σ_b s_b·s_bᵀ + t²·τ²·Σ_k S_k·S_kᵀ,    s_b = Σ_{i in b} wᵢ·rᵢ·Jᵢ,    S_k = Σ_{i in k} wᵢ·Jᵢ

b are long blocks of the log. τ² is the variance of the mean residual of a stroke k, set free of what the fit took up
of it and of its samples' noise; so a parameter that one stroke alone shows, as the lag at the start, gets its share of
it too. The same is done with cycles (two strokes) for k, in which what strays slowly counts more, and the larger
variance is taken. t makes up for few strokes: Student's quantile over the normal one.

Source: White, Econometrica 48(4), 1980; Carlstein, Annals of Statistics 14(3), 1986, for blocks; Laird and Ware,
Biometrics 38(4), 1982, for what strays from group to group.
"""

import numpy as np
from numpy.typing import NDArray

from bowden.identify.cable.family import Array, Estimate, Family
from bowden.identify.cable.path import Path
from bowden.identify.cable.projection import inverse_of, products
from bowden.plants.predicted import PREDICTED

_BLOCKS = 24
_LEAST_LEFT = 0.1
"""Least share of a stroke's straying that a fit is taken to leave in the residual."""
_INVERSE_FREEDOM = (0.0, 0.1, 0.2, 1.0 / 3.0, 0.5, 1.0)
_QUANTILES = (1.960, 2.228, 2.571, 3.182, 4.303, 12.706)
"""Of Student's distribution, 97.5 %, at these inverse degrees of freedom."""


def standard_errors(path: Path, estimate: Estimate, family: Family) -> dict[str, float]:
    """One standard deviation of every parameter; infinite where the data do not show it, NaN where none is stated.

    None is stated of a setting, nor where smoothing draws the coordinates: they trade with what is not in J.
    `bowden.identify.cable.loop` states the loop's then.
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


def _reversal_changes(path: Path, estimate: Estimate, family: Family) -> list[Array]:
    """How the joint changes (n,) when the reversals of one side lie further out by their common error."""
    turns = np.flatnonzero(np.diff(path.stroke) > 0) + 1
    outward = np.sign(path.motor[turns] - path.motor[turns - 1])
    if not len(turns) or path.reversal_error == 0.0:
        return []
    found, base = [], PREDICTED[family.name](estimate.parameters, path.motor)
    for side in (1.0, -1.0):
        if not (outward == side).any():
            continue
        error = path.reversal_error  # what the tops of a motion have in common, several amplitudes do not mend
        motor = path.motor.copy()
        motor[turns[outward == side]] += side * error
        found.append(PREDICTED[family.name](estimate.parameters, motor) - base)
    return found
