"""Standard errors that hold when the residual is not white.

The covariance of a weighted least-squares fit is the sandwich H⁻¹·M·H⁻¹ with H = JᵀWJ and M the covariance of the score
JᵀW·r. A cable's residual is correlated from sample to sample (what the model does not explain comes back at the same
place of each stroke; a reversal known with an error shifts the whole branch after it), so M is taken from the scores
summed over long blocks, which need not be independent inside.

Source: White, Econometrica 48(4), 1980; Carlstein, Annals of Statistics 14(3), 1986, for blocks.
"""

import numpy as np

from bowden.identify.family import Array, Estimate
from bowden.identify.path import Path
from bowden.identify.projection import inverse_of, products

_BLOCKS = 24


def standard_errors(path: Path, estimate: Estimate) -> dict[str, float]:
    """One standard deviation of every parameter; infinite where the data do not show it, NaN for a setting."""
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
    variance = np.diag(_sandwich(path, kept, path.joint - estimate.fitted))
    for name, value, hidden in zip(np.array(names)[seen], variance, blind, strict=True):
        if not hidden:
            errors[str(name)] = float(np.sqrt(value + estimate.variance.get(str(name), 0.0)))
    return errors


def _sandwich(path: Path, jacobian: Array, residual: Array) -> Array:
    inverse = inverse_of(products(jacobian, path.weight))
    count = jacobian.shape[1]
    blocks = max(_BLOCKS, 2 * count)
    scores = jacobian * (path.weight * residual)[:, None]
    edges = np.linspace(0, len(scores), blocks + 1).astype(int)[:-1]
    sums = np.add.reduceat(scores, edges, axis=0)
    middle = sums.T @ sums * blocks / (blocks - count)  # count directions of the sums are zero at the minimum
    return np.asarray(inverse @ middle @ inverse)
