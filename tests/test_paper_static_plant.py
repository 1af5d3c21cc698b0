"""The paper's static plant solved together with the adaptive law: on a monotone cable the printed gains hold."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from bowden.control import LAWS
from bowden.control.reference import PeriodicMinimumJerk
from bowden.core.errors import ParameterError
from bowden.core.signals import Reference, Sample
from bowden.core.units import DEGREES, RADIANS
from bowden.models.cable.backlash import Play
from bowden.models.cable.bouc_wen import BoucWen
from bowden.paper.static_plant import StaticRun, static_plant_run

PRINTED = LAWS["adaptive"].presets["paper"]
MOTION = PeriodicMinimumJerk(0.0, 70.0 * RADIANS, 10.0)
MONOTONE = {"play": Play(), "bouc_wen": BoucWen(rate=5.0)}


@pytest.fixture(scope="module", params=MONOTONE)
def minute(request: pytest.FixtureRequest) -> StaticRun:
    return static_plant_run(PRINTED, MONOTONE[request.param], MOTION, 60.0, 1e-3)


def test_printed_gains_hold(minute: StaticRun) -> None:
    """Erratum 7: 0.34° from rest and 0.12° after ten seconds."""
    error = (minute.joint - minute.reference) * DEGREES
    assert np.sqrt(np.mean(error**2)) == pytest.approx(0.34, abs=0.01)
    assert np.sqrt(np.mean(error[10_000:] ** 2)) == pytest.approx(0.12, abs=0.005)


def test_estimates_do_not_settle_at_the_truth(minute: StaticRun) -> None:
    """Erratum 10: β̂ settles well below 1/αφ, D̂m above the true bound."""
    assert 0.75 < minute.slope_inverse[-1] < 0.9  # the truth is 1/0.938 = 1.066
    assert minute.bound[-1] > 0.06


def test_every_sample_solves_law_and_plant(minute: StaticRun) -> None:
    """The interpreted law, fed the solution, commands the motor angle at which the plant already is."""
    law = LAWS["adaptive"].preset("paper")
    state = law.start(Sample(0.0, 0.0))
    references = MOTION.sample(minute.time)
    for k in range(12_000):
        sample = Sample(minute.joint[k], minute.motor[k])
        state, command = law.step(state, sample, Reference(*references[k]), 1e-3)
        assert command == pytest.approx(minute.motor[k], abs=1e-9)


def test_against_a_solver_of_its_own() -> None:
    """Eqs 9–14 and the play written out again, solved by Brent's method."""
    lam, kappa, eps, delta, leak, dt, slope, r = 2.0, 10.0, 0.01, 2.0, 0.005, 1e-3, 0.938, 0.0527
    phi, dphi, _ = MOTION.sample(np.arange(3000) * dt).T

    def parts(m: float, k: int, z: float, joint: float, integral: float, beta: float, bound: float) -> np.ndarray:
        new_z = min(max(z, m - r), m + r)
        new_joint = slope * new_z
        new_integral = integral + (new_joint - phi[k]) * dt
        s = lam * (new_joint - phi[k]) + new_integral
        wanted = phi[k] - lam * ((new_joint - joint) / dt - dphi[k]) - bound * math.tanh(s / eps)
        new_beta = beta - dt * delta * (wanted * s + leak * beta)
        new_bound = bound + dt * delta * (beta * math.tanh(s / eps) * s - leak * bound)
        return np.array([m - (beta * wanted - kappa * s), new_z, new_joint, new_integral, new_beta, new_bound])

    memory, motors = np.zeros(5), [0.0]
    for k in range(len(phi)):
        around = motors[-1] - 1.0, motors[-1] + 1.0
        motors.append(brentq(lambda m, k, *memory: parts(m, k, *memory)[0], *around, (k, *memory), 1e-14, 1e-15))
        memory = parts(motors[-1], k, *memory)[1:]
    np.testing.assert_allclose(static_plant_run(PRINTED, Play(), MOTION, 3.0, dt).motor, motors[1:], atol=1e-9)


def test_printed_cable_makes_the_motor_jump() -> None:
    """On the printed Bouc–Wen cable the problem is ill-posed: the motor jumps at each reversal."""
    printed = static_plant_run(PRINTED, BoucWen(), MOTION, 6.0, 1e-3)
    monotone = static_plant_run(PRINTED, BoucWen(rate=5.0), MOTION, 6.0, 1e-3)
    assert np.abs(np.diff(monotone.motor)).max() < 0.001
    assert np.abs(np.diff(printed.motor)).max() > 0.05


def test_without_a_solution_the_rest_is_nan() -> None:
    runaway = static_plant_run(PRINTED._replace(feedback_gain=-1e6), Play(), MOTION, 1.0, 1e-3)
    assert not np.isfinite(runaway.motor).all()
    assert np.isnan(runaway.motor[-1])


@pytest.mark.parametrize(("duration", "dt"), [(0.0, 1e-3), (1.0, 0.0), (1.0, -1e-3), (math.nan, 1e-3), (1.0, 2.0)])
def test_absurd_times_are_refused(duration: float, dt: float) -> None:
    with pytest.raises(ParameterError, match="expected"):
        static_plant_run(PRINTED, Play(), MOTION, duration, dt)
