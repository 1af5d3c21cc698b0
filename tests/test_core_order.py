"""Sorted values are NumPy's, to the bit."""

import numpy as np
import pytest

from bowden.core.order import distinct, median, quantile


@pytest.mark.parametrize("count", [1, 2, 3, 10, 11, 500])
def test_they_are_numpys(count: int) -> None:
    random = np.random.default_rng(count)
    for values in (random.normal(size=count), np.round(random.normal(size=count), 1)):
        assert distinct(values).tolist() == np.unique(values).tolist()
        assert median(values) == np.median(values)
        for share in (0.0, 0.3, 0.5, 0.95, 1.0, random.uniform()):
            assert quantile(values, share) == np.quantile(values, share)


def test_of_nothing_nothing_is_distinct() -> None:
    assert distinct(np.empty(0)).tolist() == []
