"""Thinned signals look like the whole ones; colours tell runs apart."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from bowden.drawing.style import COLOURS, CYCLE, colours_for, thin


@settings(max_examples=100)
@given(n=st.integers(1, 3000), most=st.integers(5, 400), seed=st.integers(0, 99), broken=st.booleans())
def test_thinning_keeps_ends_extremes_order_and_gaps(n: int, most: int, seed: int, broken: bool) -> None:
    random = np.random.default_rng(seed)
    x, y = np.arange(float(n)), random.standard_normal(n)
    if broken:
        y[random.random(n) < 0.01] = np.nan
    kept_x, kept_y = thin(x, y, most)
    assert len(kept_x) == len(kept_y) <= most
    assert kept_x[0] == x[0]
    assert kept_x[-1] == x[-1]
    assert (np.diff(kept_x) > 0).all()
    assert np.array_equal(kept_y, y[kept_x.astype(int)], equal_nan=True)
    if np.isfinite(y).any():
        assert np.nanmax(kept_y) == np.nanmax(y)
        assert np.nanmin(kept_y) == np.nanmin(y)


def test_a_thinned_line_is_never_far_from_the_whole_one() -> None:
    time = np.arange(60_000) * 1e-3
    joint = 35.0 * (1.0 - np.cos(2.0 * np.pi * time / 10.0))
    kept_time, kept = thin(time, joint)
    assert np.abs(np.interp(time, kept_time, kept) - joint).max() < 0.01


def test_each_run_has_its_own_colour() -> None:
    names = ["adaptive", "mine", "observer", "adaptive (paper)", "uncompensated"]
    chosen = colours_for(names)
    assert list(chosen) == names
    assert len(set(chosen.values())) == len(names)
    assert chosen["adaptive"] == COLOURS["adaptive"]
    many = colours_for([f"law {i}" for i in range(30)])
    assert set(many.values()) <= set(CYCLE)
