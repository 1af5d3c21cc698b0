"""Our own hyperbolic tangent against one of fifty digits."""

import math
from decimal import Decimal, localcontext

import numpy as np
import pytest

from bowden.core.kernel import compiled, kernel, tanh
from bowden.core.primitives import TANH, half_to

PIECE = math.log(2.0) / 2.0


def exact(x: float) -> Decimal:
    """By the exponential; of a small number, whose digits would cancel, by the series."""
    with localcontext(prec=50):
        given = Decimal(x)
        if abs(x) < 1e-8:
            return given - given**3 / 3 + 2 * given**5 / 15
        grown = (2 * given).exp()
        return (grown - 1) / (grown + 1)


def off(x: float) -> float:
    """Error in units in the last place of the result."""
    right = exact(x)
    return float(abs(Decimal(tanh(x)) - right) / Decimal(math.ulp(float(right))))


def numbers() -> list[float]:
    """All sizes; where one piece ends and the next begins; where tanh comes up to one."""
    random = np.random.default_rng(1)
    evenly = random.uniform(0.0, 1.5, 6000).tolist() + random.uniform(0.0, 25.0, 1500).tolist()
    sizes = (10.0 ** random.uniform(-323.0, 2.0, 1500)).tolist()
    edges = [(k + 0.5) * PIECE + by * 1e-9 for k in range(58) for by in (-1.0, 0.0, 1.0)]
    return [*evenly, *sizes, *edges]


def test_within_two_units_in_the_last_place_over_the_whole_range() -> None:
    errors = [off(x) for x in numbers()]
    assert max(errors) < 2.0
    assert np.mean(errors) < 0.5


def test_odd_bounded_and_never_falling() -> None:
    for x in numbers():
        assert tanh(-x) == -tanh(x)
        assert tanh(x) <= 1.0
        assert tanh(x * (1.0 + 1e-14)) >= tanh(x) * (1.0 - 4e-16)


def test_what_is_special() -> None:
    for small in (5e-324, 3e-310, 2.3e-308, 1e-100, 1e-9):
        assert tanh(small) == small
    assert math.copysign(1.0, tanh(-0.0)) == -1.0
    assert math.copysign(1.0, tanh(0.0)) == 1.0
    assert [tanh(x) for x in (19.1, 25.0, 1e308, math.inf, -math.inf)] == [1.0, 1.0, 1.0, 1.0, -1.0]
    assert tanh(18.0) < 1.0
    assert math.isnan(tanh(math.nan))
    assert type(tanh(np.float64(0.5))) is type(tanh(1)) is float


def test_compiled_it_has_the_same_bits() -> None:
    twin = compiled(_tanh)
    for x in [*numbers(), math.inf, 5e-324, 0.0, 1e308]:
        for signed in (x, -x):
            assert float(twin(signed)).hex() == tanh(signed).hex()
    assert math.isnan(twin(math.nan))


def test_the_constants_are_ln_2() -> None:
    """Together to twice the digits of a double; the first with room for the products with whole numbers."""
    with localcontext(prec=50):
        rest = Decimal(2).ln() / 2 - Decimal(TANH["high"]) - Decimal(TANH["low"])
    assert abs(rest) < Decimal(2) ** -86
    assert TANH["high"] * 2.0**33 == round(TANH["high"] * 2.0**33)


@pytest.mark.parametrize("k", [-1023.0, -58.0, -1.0, 0.0, 1.0, 1022.0])
def test_powers_of_two_are_exact(k: float) -> None:
    assert half_to(k) == compiled(_half_to)(k) == math.ldexp(1.0, -int(k))


@kernel
def _tanh(x: float) -> float:
    return tanh(x)


@kernel
def _half_to(k: float) -> float:
    return half_to(k)
