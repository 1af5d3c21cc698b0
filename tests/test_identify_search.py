"""The searches of the identification find what SciPy finds."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import Bounds, differential_evolution, least_squares, nnls

from bowden.identify.cable.bounded import ProblemAt, bounded_least_squares
from bowden.identify.cable.evolution import evolve
from bowden.identify.cable.non_negative import non_negative
from bowden.identify.cable.projection import minimise

Array = NDArray[np.float64]


def _bent(points: Array, unknown: Array) -> tuple[Array, Array]:
    """A sum of an exponential and a bent line, and its derivatives by three unknowns."""
    fast = np.exp(-unknown[0] * points)
    values = fast + unknown[1] * points**2 - np.sin(unknown[2] * points)
    return values, np.stack([-points * fast, points**2, -points * np.cos(unknown[2] * points)], axis=1)


@pytest.mark.parametrize("seed", range(20))
def test_bounded_least_squares_comes_to_where_scipy_does(seed: int) -> None:
    """Inside the bounds and at them: the same cost and place. How many steps it takes hangs on the last bit."""
    random = np.random.default_rng(seed)
    points = np.linspace(0.0, 2.0, 40)
    low, high = np.array([0.1, -1.0, 0.2]), np.array([3.0, 1.0, 2.5])
    truth = low + (high - low) * random.uniform(-0.3, 1.3, 3)  # often beyond a bound
    wanted = _bent(points, truth)[0] + 0.05 * random.normal(size=40)
    start = low + (high - low) * random.uniform(0.05, 0.95, 3)

    def problem(theta: Array) -> ProblemAt:
        values, slopes = _bent(points, theta)
        return ProblemAt(values - wanted, slopes, np.empty(0))

    found = bounded_least_squares(
        problem, start, low, high, np.full(3, 0.3), step_tolerance=1e-12, cost_tolerance=1e-14, most=200
    )
    known = least_squares(
        lambda theta: _bent(points, theta)[0] - wanted,
        start,
        jac=lambda theta: _bent(points, theta)[1],
        bounds=(low, high),
        x_scale=np.full(3, 0.3),
        xtol=1e-12,
        ftol=1e-14,
        gtol=1e-14,
        max_nfev=200,
    )
    assert np.all((found.theta > low) & (found.theta < high))
    # Each ends within 1e-14 of the least cost, and a sum of 40 squares is known to 40 roundings.
    settled = 2.0 * (1e-14 + 40.0 * np.finfo(float).eps)
    assert found.cost == pytest.approx(known.cost, rel=settled)
    # A cost c known to e·c leaves a free place open by √(2·e·c/λ), λ the least eigenvalue of JᵀJ there; both leave it.
    free = known.active_mask == 0
    stiffness = np.linalg.eigvalsh(known.jac[:, free].T @ known.jac[:, free])
    within = 2.0 * np.sqrt(settled * known.cost / stiffness[0]) if free.any() else 0.0
    np.testing.assert_allclose(found.theta[free], known.x[free], rtol=0.0, atol=within)
    np.testing.assert_allclose(found.theta[~free], known.x[~free], rtol=0.0, atol=1e-9)


def test_what_the_data_do_not_show_stays_where_it_is() -> None:
    """An unknown without any influence keeps its start, to the bit, though rounding gives it a slope."""
    points = np.linspace(-1.0, 1.0, 50)
    joint = np.tanh(3.0 * points) + 0.5

    def basis(theta: Array) -> tuple[Array, Array]:
        bent = np.tanh(theta[0] * points)
        slopes = np.stack([points * (1.0 - bent**2), 1e-20 * np.cos(9.0 * points)])
        return np.stack([np.ones(50), bent], axis=1), slopes[:, :, None]

    low, high = np.array([0.1, -1.0]), np.array([9.0, 1.0])
    found = minimise(basis, joint, np.ones(50), np.array([1.0, 0.123]), low, high)
    assert found.theta[0] == pytest.approx(3.0, rel=1e-6)
    assert found.theta[1] == 0.123


@pytest.mark.parametrize("seed", range(5))
def test_evolution_draws_and_finds_what_scipy_does(seed: int) -> None:
    """To the bit, with the same seed."""
    low, high = np.array([-2.0, -1.0, 0.0, -3.0]), np.array([2.0, 3.0, 5.0, 3.0])

    def costs(candidates: Array) -> Array:
        x = candidates
        return np.asarray(np.sum(x**2, axis=1) + np.sin(5.0 * x[:, 0]) + np.cos(3.0 * x[:, 1] * x[:, 2]) + 3.0)

    known = differential_evolution(
        lambda x: costs(np.ascontiguousarray(x.T)),
        Bounds(low, high),
        popsize=8,
        maxiter=25,
        tol=1e-3,
        rng=seed,
        polish=False,
        vectorized=True,
        updating="deferred",
    )
    assert evolve(costs, low, high, seed, each=8, generations=25, spread=1e-3).tolist() == known.x.tolist()


@pytest.mark.parametrize("seed", range(20))
def test_non_negative_least_squares_is_scipys(seed: int) -> None:
    """With some unknowns at zero, with all of them, and with none."""
    random = np.random.default_rng(seed)
    matrix = random.normal(size=(12, 8)) + (seed % 3)
    wanted = matrix @ random.normal(size=8) + random.normal(size=12) - 4.0 * (seed == 7)
    found = non_negative(matrix, wanted)
    np.testing.assert_allclose(found, nnls(matrix, wanted)[0], rtol=1e-9, atol=1e-12)
    assert np.all(found >= 0.0)
    assert not non_negative(matrix, -np.abs(matrix).sum(axis=1) * 0.0).any()
