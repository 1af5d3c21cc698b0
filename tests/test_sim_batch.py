"""Many loops are the single runs, to the last bit."""

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
from bowden.sim.run import Case, simulate
from support.sensors import PAPER_ENCODER
from unseen_cells import case_of, draw

STROKE = PeriodicMinimumJerk(0.0, 70.0 * RADIANS, 5.0)
STILL = constant_bend(np.pi)
NOISY = Bench(joint_encoder=PAPER_ENCODER, motor_encoder=PAPER_ENCODER)
ADAPTIVE, PLAIN = LAWS["adaptive"], LAWS["uncompensated"]


def case(seed: int = 0, law: Law = ADAPTIVE, bench: Bench = NOISY, **changes: Any) -> Case:
    return Case(bench, (law,), STROKE, STILL, seed, 0.0)._replace(**changes)


def alone(one: Case, law: Law, duration: float) -> tuple[float | None, ...]:
    """The figures of a single run by the ordinary way, in the order of `together`."""
    trace = simulate(
        one.plant,
        law,
        one.reference,
        duration=duration,
        bend=one.bend,
        seed=one.seed,
        initial_motor=one.initial_motor,
        fault=one.fault,
    )
    found = trace.metrics()
    if not trace.ended:
        return (float(np.isfinite(trace["joint"]).sum()), 0.0, 0.0, *[None] * 7)
    commands = trace["command"]
    return (
        float(len(trace)),
        1.0,
        float(trace.stable),
        found.rmse_deg,
        found.rmse_after_10s_deg,
        found.peak_deg,
        found.mechanical_energy_j,
        found.electrical_energy_j,
        float(np.abs(np.diff(commands, prepend=one.initial_motor)).sum()),
        float(np.abs(commands).max()),
    )


def together(outcome: Outcome) -> tuple[float | None, ...]:
    values = (
        outcome.cycles,
        outcome.ended,
        outcome.stable,
        outcome.rmse * DEGREES,
        outcome.rmse_after_10s * DEGREES,
        outcome.peak * DEGREES,
        outcome.mechanical_energy,
        outcome.electrical_energy,
        outcome.command_travel,
        outcome.largest_command,
    )
    return tuple(None if np.isnan(value) else value for value in values)


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
    found = [together(outcome) for (outcome,) in simulate_many(cases, 12.0)]
    assert found == [alone(one, one.laws[0], 12.0) for one in cases]
    assert [row[1] for row in found] == [1.0, 1.0, 0.0, 1.0, 1.0, 1.0]


def test_the_neighbours_do_not_matter() -> None:
    other = NOISY._replace(sample_time=2e-3)
    cases = [case(seed, bench=bench) for seed in range(4) for bench in (NOISY, other)]
    found = [together(one) for (one,) in simulate_many(cases, 2.0)]
    assert [together(one) for (one,) in simulate_many(reversed(cases), 2.0)] == found[::-1]
    assert len(set(found)) == len(found)


def test_laws_of_one_case_share_its_noise() -> None:
    both = next(simulate_many([case(1)._replace(laws=(ADAPTIVE, ADAPTIVE.with_gains(feedback_gain=20.0)))], 3.0))
    for found, law in zip(both, (ADAPTIVE, ADAPTIVE.with_gains(feedback_gain=20.0)), strict=True):
        assert together(found) == alone(case(1), law, 3.0)


def test_plants_round_a_cable_are_their_single_runs() -> None:
    cases = [case_of(draw("development", number), (PLAIN,)) for number in range(6)]
    for one, (outcome,) in zip(cases, simulate_many(cases, 12.0), strict=True):
        assert together(outcome) == alone(one, PLAIN, 12.0)


def test_the_lag_is_the_delay_of_a_joint_that_is_only_late() -> None:
    """A straight cable behind a quick servo of known lag 2ζ/ω and four cycles of delay."""
    bench = Bench(cable=BoucWen(slope=1.0, hysteresis_gain=0.0), servo=Servo(200.0, 1.0), delay=4)
    ((found,),) = simulate_many([case(law=PLAIN, bench=bench)], 10.0)
    assert found.lag == pytest.approx(2.0 / 200.0 + 0.004 + 0.0005, rel=0.05)


def test_a_sensor_that_fails() -> None:
    kinds = (Injected.NOTHING, Injected.JOINT_FROZEN, Injected.MOTOR_FROZEN, Injected.JOINT_NAN)
    cases = [case(1, fault=SensorFault(kind, 3000, 4000)) for kind in kinds]
    none, joint, motor, lost = (outcome for (outcome,) in simulate_many(cases, 6.0))
    assert together(none) == together(motor) == alone(case(1), ADAPTIVE, 6.0)  # the law does not look at the motor
    assert together(joint) == alone(cases[1], ADAPTIVE, 6.0)
    assert joint.peak > 2.0 * none.peak
    assert joint.cycles == 6000.0
    assert (lost.cycles, lost.ended, lost.stable) == (3000.0, 0.0, 0.0)
    assert np.isnan(lost.rmse)


def test_settings_that_cannot_be_are_refused() -> None:
    with pytest.raises(ParameterError, match="duration is 0"):
        next(simulate_many([case()], 0.0))
