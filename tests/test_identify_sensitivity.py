"""The sensitivities of Bouc–Wen's h: against differences of the exact integration, and their own laws."""

import numpy as np
import pytest
from numpy.typing import NDArray

from bowden.core.kernel import compiled
from bowden.identify.cable.bouc_wen import cable_at
from bowden.identify.cable.projection import minimise, reduced_problem
from bowden.models.cable.bouc_wen import BoucWen, saturation
from bowden.models.cable.bouc_wen_sensitivity import (
    Sensitive,
    fill_sensitivities,
    hysteresis,
    sensitivities,
    sensitivity_slope,
)

Array = NDArray[np.float64]

MOTION = 0.4 * np.sin(np.linspace(0.0, 20.0, 4001)) + 0.15 * np.sin(np.linspace(0.0, 63.0, 4001))
CABLES = {
    "paper": BoucWen(),
    "fractional": BoucWen(rate=30.0, shape=2.0, exponent=1.3),
    "lets go faster": BoucWen(rate=20.0, shape=0.7, exponent=2.5),
    "sharp": BoucWen(rate=15.0, shape=4.0, exponent=12.0),
}


def follow(motor: Array, initial: float, cable: BoucWen) -> Array:
    return hysteresis(motor, initial, cable)


@pytest.mark.parametrize("cable", CABLES.values(), ids=CABLES)
def test_the_value_is_the_one_of_the_exact_integration(cable: BoucWen) -> None:
    found = sensitivities(MOTION, 0.05, cable)
    assert found[:, 0] == pytest.approx(follow(MOTION, 0.05, cable), abs=5e-6)


@pytest.mark.parametrize("cable", CABLES.values(), ids=CABLES)
@pytest.mark.parametrize(("column", "name"), [(1, "rate"), (2, "shape"), (3, "exponent")])
def test_sensitivities_are_what_differences_approach(cable: BoucWen, column: int, name: str) -> None:
    value = getattr(cable, name)
    step = 1e-4 * value
    up, down = cable._replace(**{name: value + step}), cable._replace(**{name: value - step})
    difference = (follow(MOTION, 0.05, up) - follow(MOTION, 0.05, down)) / (2.0 * step)
    found = sensitivities(MOTION, 0.05, cable)[:, column]
    assert found == pytest.approx(difference, abs=2e-3 * np.max(np.abs(difference)))


@pytest.mark.parametrize("cable", CABLES.values(), ids=CABLES)
def test_the_start_is_forgotten_as_differences_say(cable: BoucWen) -> None:
    difference = (follow(MOTION, 0.05 + 1e-5, cable) - follow(MOTION, 0.05 - 1e-5, cable)) / 2e-5
    found = sensitivities(MOTION, 0.05, cable)[:, 4]
    assert found[0] == 1.0
    assert found == pytest.approx(difference, abs=1e-4)
    assert abs(found[-1]) < 1e-6


def test_at_rest_on_the_bound_the_derivatives_are_the_bounds() -> None:
    cable = BoucWen()
    ramp = np.linspace(0.0, 3.0, 50)
    h, by_rate, by_shape, by_exponent, by_initial = sensitivities(ramp, 0.0, cable)[-1]
    assert h == pytest.approx(saturation(cable), rel=1e-8)
    assert (by_rate, by_initial) == (0.0, 0.0)
    for name, found in (("shape", by_shape), ("exponent", by_exponent)):
        value = getattr(cable, name)
        up, down = cable._replace(**{name: value + 1e-6}), cable._replace(**{name: value - 1e-6})
        assert found == pytest.approx((saturation(up) - saturation(down)) / 2e-6, rel=1e-6)


def test_interpreted_and_compiled_are_equal() -> None:
    at = Sensitive(0.1, 0.01, -0.02, 0.03, 0.5)
    for direction in (1.0, -1.0):
        assert tuple(sensitivity_slope(at, direction, BoucWen())) == pytest.approx(
            tuple(compiled(sensitivity_slope)(at, direction, BoucWen())), rel=1e-14
        )
    short = MOTION[:40]
    interpreted = np.empty((len(short), 5))
    fill_sensitivities(short, 0.05, BoucWen(), interpreted)
    assert interpreted == pytest.approx(sensitivities(short, 0.05, BoucWen()), abs=1e-12)


def test_the_search_coordinates_and_their_derivative() -> None:
    theta = np.array([3.0, -1.5, 0.7, 0.3])
    cable, initial, change = cable_at(theta)
    assert cable.rate / saturation(cable) == pytest.approx(np.exp(3.0))
    assert initial / saturation(cable) == pytest.approx(0.3)

    def values(at: Array) -> Array:
        cable, initial, _ = cable_at(at)
        return np.array([cable.rate, cable.shape, cable.exponent, initial])

    for i in range(4):
        step = 1e-6 * np.eye(4)[i]
        assert change[:, i] == pytest.approx((values(theta + step) - values(theta - step)) / 2e-6, rel=1e-7, abs=1e-9)


def test_variable_projection_is_the_derivative_of_the_projected_residual() -> None:
    """Gradient and curvature of ½·rᵀr, with the linear coefficients solved anew at every θ."""
    random = np.random.default_rng(0)
    motor, weight = MOTION[::8].copy(), random.uniform(0.0, 3.0, len(MOTION[::8]))
    joint = 0.9 * motor - 0.1 * np.tanh(9.0 * motor) + 0.02 * random.standard_normal(len(motor))

    def basis(theta: Array) -> tuple[Array, Array]:
        cable, initial, change = cable_at(theta)
        found = sensitivities(motor, initial, cable)
        columns = np.stack([np.ones_like(motor), motor, found[:, 0]], axis=1)
        return columns, (found[:, 1:] @ change).T[:, :, None]

    def residual(theta: Array) -> Array:
        columns = basis(theta)[0] * np.sqrt(weight)[:, None]
        linear = np.linalg.lstsq(columns, np.sqrt(weight) * joint)[0]
        return columns @ linear - np.sqrt(weight) * joint

    theta = np.array([3.0, -1.0, 0.5, 0.2])
    r, jacobian, linear = reduced_problem(basis, theta, joint, weight)
    full = residual(theta)
    steps = 1e-5 * np.eye(4)
    differences = np.stack([(residual(theta + step) - residual(theta - step)) / 2e-5 for step in steps], axis=1)
    assert r @ r == pytest.approx(full @ full, rel=1e-10)
    assert jacobian.T @ r == pytest.approx(differences.T @ full, rel=1e-3, abs=1e-7)
    assert jacobian.T @ jacobian == pytest.approx(differences.T @ differences, rel=1e-3, abs=1e-7)
    assert linear == pytest.approx(
        np.linalg.lstsq(basis(theta)[0] * np.sqrt(weight)[:, None], np.sqrt(weight) * joint)[0]
    )


def test_what_the_data_do_not_show_stays_where_it_is() -> None:
    """An unknown without any influence keeps its start, to the bit, though rounding gives it a slope."""
    points = np.linspace(-1.0, 1.0, 50)
    joint = np.tanh(3.0 * points) + 0.5

    def basis(theta: Array) -> tuple[Array, Array]:
        bent = np.tanh(theta[0] * points)
        slopes = np.stack([points * (1.0 - bent**2), 1e-20 * np.cos(9.0 * points)])
        return np.stack([np.ones(50), bent], axis=1), slopes[:, :, None]

    low, high = np.array([0.1, -1.0]), np.array([9.0, 1.0])
    theta, _ = minimise(basis, joint, np.ones(50), np.array([1.0, 0.123]), low, high)
    assert theta[0] == pytest.approx(3.0, rel=1e-6)
    assert theta[1] == 0.123
