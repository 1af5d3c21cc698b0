"""Standard errors that hold when the residual is not white.

The covariance of a weighted least-squares fit is the sandwich H⁻¹·M·H⁻¹ with H = JᵀWJ and M the covariance of the score
JᵀW·r. A cable's residual is correlated from sample to sample (what the model does not explain comes back at the same
place of each stroke; a reversal known with an error shifts the whole branch after it), so M is taken from the scores
summed over long blocks, which need not be independent inside.

Source: White, Econometrica 48(4), 1980; Carlstein, Annals of Statistics 14(3), 1986, for blocks.
"""

import numpy as np

from bowden.identify.cable.family import Array, Estimate, Family
from bowden.identify.cable.path import Path
from bowden.identify.cable.projection import inverse_of, products

_BLOCKS = 24


def standard_errors(path: Path, estimate: Estimate, family: Family) -> dict[str, float]:
    """One standard deviation of every parameter; infinite where the data do not show it, NaN where none is stated.

    None is stated of a setting, nor where smoothing draws the coordinates: its bias is no part of the sandwich.
    """
    if estimate.prior is not None:
        return dict.fromkeys(estimate.parameters, np.nan)
    names = list(estimate.slopes)
    jacobian = np.stack([estimate.slopes[name] for name in names], axis=1)
    size = np.sqrt(np.einsum("n,np->p", path.weight, jacobian**2))
    largest = np.abs([estimate.parameters[name] for name in names])
    seen = size * np.maximum(largest, 1e-6) > 1e-9 * np.sqrt(path.weight @ estimate.fitted**2)
    errors = dict.fromkeys(estimate.parameters, np.nan) | dict.fromkeys(names, np.inf)
    kept = jacobian[:, seen]
    scaled = kept / size[seen]
    values, vectors = np.linalg.eigh(products(scaled, path.weight))
    blind = (np.abs(vectors[:, values < 1e-11 * values[-1]]) > 1e-2).any(axis=1)
    inverse = inverse_of(products(kept, path.weight))
    variance = np.diag(inverse @ _score_covariance(path, kept, path.joint - estimate.fitted) @ inverse)
    variance = variance + sum(
        (inverse @ np.einsum("np,n->p", kept, path.weight * change)) ** 2
        for change in _reversal_changes(path, estimate, family)
    )
    for name, value, hidden in zip(np.array(names)[seen], variance, blind, strict=True):
        if not hidden:
            errors[str(name)] = float(np.sqrt(max(value, 0.0) + estimate.variance.get(str(name), 0.0)))
    return errors


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
    found = []
    for side in (1.0, -1.0):
        if not (outward == side).any() or path.reversal_error == 0.0:
            continue
        error = path.reversal_error  # what the tops of a motion have in common, several amplitudes do not mend
        motor = path.motor.copy()
        motor[turns[outward == side]] += side * error
        base = family.predict(estimate.parameters, path.motor)
        found.append(family.predict(estimate.parameters, motor) - base)
    return found
