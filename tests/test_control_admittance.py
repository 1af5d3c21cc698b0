"""The virtual elbow against the exact solution of its equation, and its bounds against what they promise."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from bowden.control.admittance.virtual_elbow import (
    Admittance,
    AdmittanceState,
    admittance_start,
    admittance_step,
    beyond_band,
    check_admittance,
)
from bowden.core.errors import ParameterError

WIDE = Admittance(
    inertia=0.1, damping=0.3, stiffness=2.0, rest=0.5, dead_band=0.0, low=-50.0, high=50.0, speed_limit=1e3,
    acceleration_limit=1e6,
)  # fmt: skip


def driven(given_: Admittance, torques: np.ndarray, dt: float, begin: float = 0.0) -> np.ndarray:
    """Position, velocity and acceleration of each cycle (n, 3)."""
    state, rows = admittance_start(given_, begin), []
    for torque in torques:
        state, reference = admittance_step(given_, state, float(torque), dt)
        assert state == reference
        rows.append(reference)
    return np.array(rows)


def exact(given_: Admittance, dt: float, cycles: int) -> np.ndarray:
    """The solution under 0.7·sin(5t) N·m by an integrator of high order, at the cycles' ends."""

    def rates(t: float, x: np.ndarray) -> list[float]:
        push = 0.7 * np.sin(5.0 * t) - given_.damping * x[1] - given_.stiffness * (x[0] - given_.rest)
        return [x[1], push / given_.inertia]

    ends = dt * np.arange(1, cycles + 1)
    return solve_ivp(rates, (0.0, ends[-1]), [0.0, 0.0], t_eval=ends, rtol=1e-10, atol=1e-12).y[0]


def test_it_converges_to_the_equation_with_the_first_order_of_its_step() -> None:
    errors = []
    for dt in (4e-3, 2e-3, 1e-3):
        cycles = round(4.0 / dt)
        torques = 0.7 * np.sin(5.0 * dt * np.arange(1, cycles + 1))
        errors.append(np.max(np.abs(driven(WIDE, torques, dt)[:, 0] - exact(WIDE, dt, cycles))))
    assert errors[2] < 0.005
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.15)
    assert errors[1] / errors[2] == pytest.approx(2.0, rel=0.1)


@given(
    inertia=st.floats(1e-6, 10.0),
    damping=st.floats(0.0, 100.0),
    stiffness=st.floats(0.0, 1e4),
    velocity=st.floats(-50.0, 50.0),
    dt=st.floats(1e-4, 0.1),
)
@settings(deadline=None, max_examples=150)
def test_left_alone_it_never_gains_energy(
    inertia: float, damping: float, stiffness: float, velocity: float, dt: float
) -> None:
    free = WIDE._replace(
        inertia=inertia, damping=damping, stiffness=stiffness, low=-1e9, high=1e9, acceleration_limit=1e12
    )
    state = AdmittanceState(0.2, velocity, 0.0)

    def energy(s: AdmittanceState) -> float:
        return 0.5 * inertia * s.velocity**2 + 0.5 * stiffness * (s.position - free.rest) ** 2

    for _ in range(50):
        before = energy(state)
        state, _ = admittance_step(free, state, 0.0, dt)
        assert energy(state) <= before * (1.0 + 1e-9) + 1e-12


@given(torques=st.lists(st.sampled_from([-40.0, -3.0, -0.1, 0.0, 0.2, 5.0, 60.0, np.nan, np.inf]), max_size=60))
@settings(deadline=None, max_examples=100)
def test_range_speed_and_acceleration_hold_under_any_torque(torques: list[float]) -> None:
    bounded = Admittance(inertia=0.01, damping=0.05, low=0.1, high=1.5)
    dt, before = 1e-3, 0.0
    held = np.repeat(torques, 25)
    for position, velocity, acceleration in driven(bounded, held, dt, begin=0.8):
        assert bounded.low - 1e-12 <= position <= bounded.high + 1e-12
        assert abs(velocity) <= bounded.speed_limit
        assert abs(velocity - before) <= bounded.acceleration_limit * dt * (1.0 + 1e-9)
        assert acceleration == pytest.approx((velocity - before) / dt)
        before = velocity


def test_nothing_winds_up_behind_an_end() -> None:
    bounded = Admittance(inertia=0.02, damping=0.2, dead_band=0.0, low=0.0, high=1.0)
    pushed = driven(bounded, np.full(5000, 10.0), 1e-3, begin=0.5)
    assert pushed[-1, 0] == pytest.approx(1.0, abs=1e-6)
    state = AdmittanceState(*pushed[-1])
    state, reference = admittance_step(bounded, state, -1.0, 1e-3)
    assert reference.velocity < 0.0  # at once
    free = -1.0 * 1e-3 / (0.02 + 1e-3 * 0.2)
    assert reference.velocity == pytest.approx(free, rel=1e-3)


def test_the_dead_band_is_odd_smooth_and_no_amplifier() -> None:
    torques = np.linspace(-3.0, 3.0, 6001)
    heard = np.array([beyond_band(float(t), 0.4) for t in torques])
    slope = np.diff(heard) / np.diff(torques)
    assert np.max(np.abs(heard + heard[::-1])) < 1e-14
    assert slope.min() >= 0.0
    assert slope.max() < 1.0
    assert np.max(np.abs(np.diff(slope))) < 0.01  # no kink
    assert heard[-1] == pytest.approx(3.0 - 0.4, abs=1e-5)
    assert abs(beyond_band(0.04, 0.4)) < 0.0002


def test_without_a_torque_it_comes_to_rest_where_it_is() -> None:
    sprung = WIDE._replace(decay=0.05, rest=5.0)
    moving = driven(sprung, np.full(300, 1.0), 1e-3)
    lost = [AdmittanceState(*moving[-1])]
    for _ in range(1000):
        lost.append(admittance_step(sprung, lost[-1], float("nan"), 1e-3)[0])
    speeds = np.array([state.velocity for state in lost])
    assert np.all(np.diff(speeds) <= 0.0)
    assert speeds[50] == pytest.approx(speeds[0] * np.exp(-1.0), rel=0.02)
    assert speeds[-1] < 1e-6
    assert lost[-1].position - lost[0].position == pytest.approx(speeds[0] * 0.05, rel=0.03)


def test_whatever_the_torque_its_state_is_a_number() -> None:
    state = admittance_start(Admittance(), 0.7)
    for torque in [np.nan, np.inf, -np.inf, 1e300, -1e300, 5.0, 0.0]:
        state, _ = admittance_step(Admittance(), state, float(torque), 1e-3)
        assert np.isfinite(state).all()


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"inertia": -0.1}, "inertia is -0.1"),
        ({"damping": float("nan")}, "damping is nan"),
        ({"inertia": 0.0, "damping": 0.0}, "both 0"),
        ({"decay": 0.0}, "decay is 0"),
        ({"low": 1.0, "high": 0.5}, "range is 1 to 0.5"),
        ({"rest": float("inf")}, "rest angle"),
    ],
)
def test_what_cannot_be_is_refused(changes: dict[str, float], said: str) -> None:
    with pytest.raises(ParameterError, match=said):
        check_admittance(Admittance()._replace(**changes))
