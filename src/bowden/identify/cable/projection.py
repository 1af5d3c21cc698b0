"""What every family of models is fitted with: what is linear is solved exactly inside, only the rest is searched.

For a model joint = Φ(θ)·c the best coefficients for given θ are c(θ) = (ΦᵀWΦ)⁻¹ΦᵀW·joint. The search over θ minimises
the residual r(θ) = Φ(θ)·c(θ) − joint, whose exact derivative needs that of c too:

    ∂r/∂θ = ∂Φ·c + Φ·∂c,    ∂c = −(ΦᵀWΦ)⁻¹·(∂ΦᵀW·r + ΦᵀW·∂Φ·c)

Least squares needs of r and J = ∂r/∂θ only the products JᵀWJ, JᵀWr and rᵀWr. They follow from a few weighted sums over
the nodes, so that nothing as long as the log is handed to the search.

Source, of variable projection: Golub and Pereyra, SIAM Journal on Numerical Analysis 10(2), 1973.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from bowden.core.kernel import compiled, kernel

Array = NDArray[np.float64]
Basis = Callable[[Array], tuple[Array, Array]]
"""θ (k,) → Φ (n, p), and ∂/∂θ of its last m columns (k, n, m); the others do not depend on θ."""
Progress = Callable[[str, float], None]
"""What is being done now, and the share of the work that is behind."""


@dataclass(frozen=True)
class Estimate:
    """A family fitted to a path."""

    parameters: dict[str, float]
    """Every parameter by name, in the order in which it is reported; SI and radians."""
    slopes: dict[str, Array]
    """∂joint/∂parameter at each node (n,), for the parameters that were fitted; the others are settings.
    Where there is a `prior`, ∂joint/∂coordinate by the coordinate's name."""
    fitted: Array
    """Joint angle of the model at each node (n,) [rad]."""
    theta: Array
    """Where the search ended, in the family's own coordinates (k,)."""
    variance: dict[str, float] = field(default_factory=dict)
    """What a parameter's variance gets from the path itself being known with noise only, by name."""
    prior: Array | None = None
    """What the fitted coordinates cost, beside the squared error, as a quadratic form (k, k); none of most families."""


@kernel
def weighted_products(columns: Array, weight: Array, found: Array) -> None:
    """ΦᵀWΦ of `columns` Φ (n, p) and `weight` (n,), added to `found` (p, p)."""
    n, p = columns.shape
    for i in range(n):
        for a in range(p):
            scaled = weight[i] * columns[i, a]
            for b in range(a + 1):
                found[a, b] += scaled * columns[i, b]
    for a in range(p):
        for b in range(a):
            found[b, a] = found[a, b]


def products(columns: Array, weight: Array) -> Array:
    """`weighted_products`, compiled: faster for a few columns than a threaded matrix product, and the same on any
    number of processors."""
    found = np.zeros((columns.shape[1],) * 2)
    compiled(weighted_products)(np.ascontiguousarray(columns), weight, found)
    return found


def inverse_of(gram: Array) -> Array:
    """The inverse of ΦᵀWΦ (p, p), without the directions that the data do not show (pseudo-inverse)."""
    scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    values, vectors = np.linalg.eigh(gram / np.outer(scale, scale))
    kept = values > 1e-13 * values[-1]
    half = vectors[:, kept] / np.sqrt(values[kept]) / scale[:, None]
    return np.asarray(half @ half.T)


def without(sums: Array, free: int) -> Array:
    """`products` (p, p) of what is left of the later columns once the first `free` ones are fitted to each."""
    inverse = np.linalg.pinv(sums[:free, :free], rcond=1e-12, hermitian=True)
    return np.asarray(sums[free:, free:] - sums[free:, :free] @ inverse @ sums[:free, free:])


def weights_of_one_sign(sums: Array, sign: float) -> tuple[Array, float]:
    """Coefficients (p,), none against `sign`, of weighted least squares, and the sum of squares that they leave.

    Args:
        sums: `products` of the p columns and, as the last one, of the joint.
        sign: 1 or −1.

    Source: Lawson and Hanson, *Solving Least Squares Problems*, 1974.
    """
    from scipy.optimize import nnls  # half a second, which a simulation need not wait for

    gram, moments = sums[:-1, :-1], sums[:-1, -1]
    size = np.sqrt(np.maximum(np.diag(gram), 1e-300))  # a column that never moves has none
    values, vectors = np.linalg.eigh(gram / np.outer(size, size))
    root = np.sqrt(np.maximum(values, 1e-10 * values[-1]))
    weights = sign * nnls(root[:, None] * vectors.T, sign * (vectors.T @ (moments / size)) / root)[0] / size
    return weights, float(sums[-1, -1] - 2.0 * weights @ moments + weights @ gram @ weights)


def solve_linear(basis: Array, joint: Array, weight: Array) -> tuple[Array, Array]:
    """Weighted least squares: c (p,) and (ΦᵀWΦ)⁻¹, refined once so that the normal equations cost no digits."""
    sums = products(np.column_stack([basis, joint]), weight)
    inverse = inverse_of(sums[:-1, :-1])
    linear = inverse @ sums[:-1, -1]
    rest = joint - np.einsum("np,p->n", basis, linear)
    return linear + inverse @ np.einsum("np,n->p", basis, weight * rest), inverse


def reduced_problem(basis: Basis, theta: Array, joint: Array, weight: Array) -> tuple[Array, Array, Array]:
    """A residual (k + 1,) and its derivative (k + 1, k) with the same rᵀr, Jᵀr and JᵀJ as √W·r and √W·∂r/∂θ; and c."""
    phi, slopes = basis(theta)
    linear, inverse = solve_linear(phi, joint, weight)
    count, moving = phi.shape[1], slopes.shape[2]
    residual = np.einsum("np,p->n", phi, linear) - joint
    moved = np.einsum("knm,m->kn", slopes, linear[-moving:])  # ∂Φ·c
    sums = products(np.column_stack([phi, moved.T, residual]), weight)
    turned = sums[count:-1, :count].copy()  # (∂Φ·c)ᵀW·Φ
    turned[:, -moving:] += np.einsum("knm,n->km", slopes, weight * residual)
    drift = -turned @ inverse  # ∂c (k, p)
    mixed = np.concatenate([np.hstack([drift, np.eye(len(theta)), np.zeros((len(theta), 1))]), np.eye(len(sums))[-1:]])
    gram = mixed @ sums @ mixed.T  # products of the columns of [J, r], J = ∂Φ·c + Φ·∂c
    values, vectors = np.linalg.eigh(gram)
    root = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T
    size = np.diag(gram)[:-1]
    root[:, :-1] *= size > 1e-16 * size.max()  # less comes out of rounding: what the data do not show stays where it is
    return root[:, -1], root[:, :-1], linear


def minimise(
    basis: Basis, joint: Array, weight: Array, start: Array, low: Array, high: Array, rough: bool = False
) -> tuple[Array, Array]:
    """θ (k,) and c (p,) of the minimum nearest to `start` within bounds.

    `rough` ends the search where a step improves the cost by less than 1e-4, as comparing models needs no more.
    """
    from scipy.optimize import least_squares  # half a second, which a simulation need not wait for

    @lru_cache(1)  # residual and derivative come together, and are asked for one after the other
    def problem(theta: bytes) -> tuple[Array, Array, Array]:
        return reduced_problem(basis, np.frombuffer(theta), joint, weight)

    def residual(theta: Array) -> Array:
        return problem(theta.tobytes())[0]

    def slopes(theta: Array) -> Array:
        return problem(theta.tobytes())[1]

    margin = 1e-6 * (high - low)
    found = least_squares(
        residual,
        np.clip(start, low + margin, high - margin),
        jac=slopes,
        bounds=(low, high),
        x_scale=0.1 * np.minimum(high - low, 10.0),
        xtol=1e-9,
        ftol=1e-4 if rough else 1e-7,
        gtol=1e-14,
        max_nfev=15 if rough else 80,
    )
    return found.x, problem(found.x.tobytes())[2]
