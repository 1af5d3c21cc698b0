"""Many runs are the single runs, to the last bit."""

from typing import Any

import numpy as np
import pytest

from bowden.control import LAWS
from bowden.control.law import Law
from bowden.control.reference import PeriodicMinimumJerk
from bowden.core.errors import ParameterError
from bowden.core.units import DEGREES, RADIANS
from bowden.models.cable.bouc_wen import BoucWen
from bowden.models.cable.sheath_path import constant_bend, random_bend
from bowden.models.drive.servo import Servo
from bowden.plants.bench import Bench
from bowden.sim.injected import Injected, SensorFault
from bowden.sim.many import Outcome, simulate_many
from bowden.sim.run import Case
from support.sensors import PAPER_ENCODER

STROKE = PeriodicMinimumJerk(0.0, 70.0 * RADIANS, 5.0)
STILL = constant_bend(np.pi)
NOISY = Bench(joint_encoder=PAPER_ENCODER, motor_encoder=PAPER_ENCODER)
ADAPTIVE, PLAIN = LAWS["adaptive"], LAWS["uncompensated"]


def case(seed: int = 0, law: Law = ADAPTIVE, bench: Bench = NOISY, **changes: Any) -> Case:
    return Case(bench, (law,), STROKE, STILL, seed, 0.0)._replace(**changes)


def assert_same(outcome: Outcome, one: Case, duration: float) -> None:
    """The figures are those of the case's trace; of one that ran away there are none."""
    trace = one.trace(0, duration)
    found, commands = trace.metrics(), trace["command"]
    angles = {"rmse": found.rmse_deg, "rmse_after_10s": found.rmse_after_10s_deg, "peak": found.peak_deg}
    figures = {
        "cycles": float(np.isfinite(trace["joint"]).sum()),
        "ended": float(trace.ended),
        "stable": float(trace.stable),
        **{name: None if value is None else value / DEGREES for name, value in angles.items()},
        "mechanical_energy": found.mechanical_energy_j,
        "electrical_energy": found.electrical_energy_j,
        "command_travel": float(np.abs(np.diff(commands, prepend=trace.settings["initial_motor"])).sum()),
        "largest_command": float(np.abs(commands).max()),
    }
    for name, value in figures.items():
        expected = np.nan if value is None else value
        assert getattr(outcome, name) == pytest.approx(expected, rel=1e-14, nan_ok=True), name


def test_a_batch_is_its_single_runs_to_the_last_bit() -> None:
    """Everything that may differ from run to run differs, and one of them runs away."""
    gains = ADAPTIVE.with_gains(error_gain=0.02, feedback_gain=25.0)
    quick = NOISY._replace(servo=Servo(80.0, 0.7, speed_limit=3.0), delay=3, cable=BoucWen(slope=0.8, exponent=2.3))
    moved = random_bend(2.0, 6.0, 2.0, 12.0, 3)
    wide = PeriodicMinimumJerk(0.1, 1.4, 3.0)
    cases = [
        case(1),
        case(2, bench=quick, initial_motor=0.2),
        case(3, ADAPTIVE.preset("paper")),
        case(4, gains, bend=moved, reference=wide),
        case(5, bend=moved, bench=NOISY._replace(substeps=4)),
        case(6, bench=Bench(delay=0)),
    ]
    found = [outcome for (outcome,) in simulate_many(cases, 12.0)]
    for outcome, one in zip(found, cases, strict=True):
        assert_same(outcome, one, 12.0)
    assert [outcome.ended for outcome in found] == [1.0, 1.0, 0.0, 1.0, 1.0, 1.0]


def test_the_neighbours_do_not_matter() -> None:
    other = NOISY._replace(sample_time=2e-3)
    cases = [case(seed, bench=bench) for seed in range(4) for bench in (NOISY, other)]
    found = [one[:6] for (one,) in simulate_many(cases, 2.0)]
    assert str([one[:6] for (one,) in simulate_many(reversed(cases), 2.0)]) == str(found[::-1])
    assert len(set(found)) == len(found)


def test_laws_of_one_case_share_its_noise() -> None:
    one, other = next(simulate_many([case(1)._replace(laws=(ADAPTIVE, ADAPTIVE))], 3.0))
    assert one.rmse == other.rmse
    assert_same(one, case(1), 3.0)


def test_the_lag_is_the_delay_of_a_joint_that_is_only_late() -> None:
    """A straight cable behind a quick servo of known lag 2ζ/ω and four cycles of delay."""
    bench = Bench(cable=BoucWen(slope=1.0, hysteresis_gain=0.0), servo=Servo(200.0, 1.0), delay=4)
    ((found,),) = simulate_many([case(law=PLAIN, bench=bench)], 10.0)
    assert found.lag == pytest.approx(2.0 / 200.0 + 0.004 + 0.0005, rel=0.05)


def test_a_sensor_that_fails() -> None:
    kinds = (Injected.NOTHING, Injected.JOINT_FROZEN, Injected.MOTOR_FROZEN, Injected.JOINT_NAN)
    cases = [case(1, fault=SensorFault(kind, 3000, 4000)) for kind in kinds]
    none, joint, motor, lost = (outcome for (outcome,) in simulate_many(cases, 6.0))
    assert none.rmse == motor.rmse  # the law does not look at the motor
    assert_same(none, case(1), 6.0)
    assert_same(joint, cases[1], 6.0)
    assert joint.peak > 2.0 * none.peak
    assert joint.cycles == 6000.0
    assert (lost.cycles, lost.ended, lost.stable) == (3000.0, 0.0, 0.0)
    assert np.isnan(lost.rmse)


def test_settings_that_cannot_be_are_refused() -> None:
    with pytest.raises(ParameterError, match="duration is 0"):
        next(simulate_many([case()], 0.0))
