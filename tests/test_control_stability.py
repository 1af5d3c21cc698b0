"""Margins of the sampled loop against python-control, and the law's linear model against the law."""

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bowden.control import LAWS
from bowden.control.laws.adaptive import AdaptiveGains, ultimate_bounds
from bowden.control.stability import (
    StateSpace,
    adaptive_model,
    closed_loop_poles,
    frequencies,
    margins,
    margins_of,
    response,
    servo_model,
)
from bowden.core.signals import Reference, Sample
from bowden.models.drive.servo import Servo
from bowden.plants.presets.bench import bench

DT = 1e-3


def as_control(model: StateSpace) -> control.StateSpace:
    return control.ss(model.a, model.b, model.c, [[model.d]], DT)


CASES = [
    (Servo(54.4, 1.0), 1, 0.938, AdaptiveGains(), 1.0, 0.05),
    (Servo(54.4, 1.0), 0, 0.7, AdaptiveGains(error_gain=0.1, feedback_gain=20.0), 0.5, 0.0),
    (Servo(20.0, 0.6), 3, 1.1, AdaptiveGains(error_gain=0.05, feedback_gain=5.0), 1.0, 0.1),
    (Servo(100.0, 0.7), 2, 0.938, AdaptiveGains(error_gain=0.02, feedback_gain=30.0), 1.1, 0.0),
    (Servo(54.4, 1.3), 1, 0.938, AdaptiveGains(derivative_time=0.0), 1.0, 0.0),
]


@pytest.mark.parametrize(("servo", "delay", "slope", "gains", "slope_inverse", "bound"), CASES)
def test_margins_equal_python_controls(
    servo: Servo, delay: int, slope: float, gains: AdaptiveGains, slope_inverse: float, bound: float
) -> None:
    plant, law = servo_model(servo, DT, delay, slope), adaptive_model(gains, DT, slope_inverse, bound)
    loop = as_control(law) * as_control(plant)
    omega = np.geomspace(1e-2, np.pi / DT * 0.999, 5000)
    gain, phase, _, _, crossover, _ = control.stability_margins(control.frd(loop, omega), returnall=True)
    ours = margins(plant, law, DT)
    assert ours.stable
    assert ours.gain_margin_db == pytest.approx(20.0 * np.log10(min(g for g in gain if g > 1.0)), rel=0.01)
    assert ours.phase_margin_deg == pytest.approx(min(phase, key=abs), rel=0.01)
    assert ours.delay_margin_s == pytest.approx(min(np.radians(phase) / crossover), rel=0.01)
    poles = np.sort(np.abs(np.linalg.eigvals(loop.A - loop.B @ loop.C)))  # the plant has no way straight through
    np.testing.assert_allclose(np.sort(np.abs(closed_loop_poles(plant, law))), poles, atol=1e-5)


def test_only_where_the_loop_is_real_and_negative_it_may_come_to_minus_one() -> None:
    """A loop that is 0.01 at −180° and 0.9 at −360° may be a hundred times as large."""
    phase = np.linspace(0.0, -2.5 * np.pi, len(frequencies(DT)))
    gain = np.exp(np.interp(-phase / np.pi, [0.0, 1.0, 2.0, 2.5], np.log([0.01, 0.01, 0.9, 0.9])))
    found = margins_of(gain * np.exp(1j * phase), np.array([0.5 + 0.0j]), DT)
    assert found.gain_margin_db == pytest.approx(40.0, abs=0.1)
    assert found.phase_margin_deg is None


def test_response_equals_python_controls() -> None:
    plant = servo_model(Servo(), DT, 1, 0.938)
    omega = np.geomspace(0.1, 3000.0, 50)
    np.testing.assert_allclose(response(plant, omega, DT), as_control(plant)(np.exp(1j * omega * DT)), rtol=1e-6)


@pytest.mark.parametrize("derivative_time", [0.0, 0.005])
def test_linear_model_is_the_law_near_rest(derivative_time: float) -> None:
    slope_inverse, bound, size = 0.9, 0.04, 1e-7
    gains = AdaptiveGains(slope_adaptation=0.0, bound_adaptation=0.0, derivative_time=derivative_time)
    law = LAWS["adaptive"].with_gains(**gains._asdict())
    state = law.start(Sample(0.0, 0.0))._replace(slope_inverse=slope_inverse, bound=bound)
    model = adaptive_model(gains, DT, slope_inverse, bound)
    joints = size * np.random.default_rng(3).standard_normal(50)
    x = np.zeros((3, 1))
    for joint in joints:
        state, command = law.step(state, Sample(joint, 0.0), Reference(0.0, 0.0, 0.0), DT)
        output = (model.c @ x)[0, 0] + model.d * joint
        x = model.a @ x + model.b * joint
        assert -command == pytest.approx(output, abs=1e-6 * size, rel=1e-6)


def test_a_loop_beyond_its_gain_margin_is_unstable() -> None:
    servo, gains = Servo(), AdaptiveGains()
    law = adaptive_model(gains, DT, 1.0, 0.0)
    found = margins(servo_model(servo, DT, 1, 0.938), law, DT)
    assert found.gain_margin_db is not None
    edge = 0.938 * 10.0 ** (found.gain_margin_db / 20.0)
    assert margins(servo_model(servo, DT, 1, 0.98 * edge), law, DT).stable
    beyond = margins(servo_model(servo, DT, 1, 1.02 * edge), law, DT)
    assert not beyond.stable
    assert beyond.gain_margin_db is None
    assert beyond.largest_pole > 1.0


@given(st.lists(st.floats(0.01, 10.0), min_size=10, max_size=10))
def test_lyapunov_bounds_are_where_the_papers_function_stops_falling(numbers: list[float]) -> None:
    """β·s²/2 = f/ϱ and |e| = 2·s/λ."""
    *eight, slope, height = numbers
    gains, beta = AdaptiveGains(*eight), 1.0 / slope
    found = ultimate_bounds(gains, slope, height)
    f = 0.5 * (gains.slope_leakage * beta**2 + gains.bound_leakage * height**2) + 0.2785 * gains.smoothing
    products = gains.slope_leakage * gains.slope_adaptation, gains.bound_leakage * gains.bound_adaptation
    rate = min(2.0 * gains.feedback_gain * slope, *products)
    assert 0.5 * beta * found.filtered_error**2 == pytest.approx(f / rate)
    assert found.error * gains.error_gain == pytest.approx(2.0 * found.filtered_error)


def test_lyapunov_bounds_shrink_with_error_gain_and_are_vacuous_with_the_printed_gains() -> None:
    slope = bench().cable.slope
    printed = ultimate_bounds(LAWS["adaptive"].presets["paper"], slope, 0.05)
    assert np.degrees(printed.error) == pytest.approx(59.0, abs=0.5)
    assert printed.error == pytest.approx(2.0 * printed.filtered_error / 2.0)
    assert np.degrees(ultimate_bounds(AdaptiveGains(error_gain=0.05), slope, 0.05).error) > 1000.0


def test_a_long_system_answers_as_its_chain_of_delays_does() -> None:
    servo, omega = Servo(), np.geomspace(0.1, 3000.0, 300)
    long, short = servo_model(servo, DT, 30, 0.938), servo_model(servo, DT, 1, 0.938)
    assert len(long.a) > 8 >= len(short.a)
    late = np.exp(-29j * omega * DT)
    np.testing.assert_allclose(response(long, omega, DT), late * response(short, omega, DT), rtol=1e-6)
