"""The compensators of the literature: what each promises, alone, on cables known exactly, and on the bench."""

import math
import sys
from functools import cache
from typing import Any

import numpy as np
import pytest

from bowden.control import LAWS
from bowden.control.knowledge import Knowledge, informed
from bowden.control.law import Law
from bowden.control.law_parts import LEAD, LEAD_SQUARE, compensate_lag
from bowden.control.laws.active_disturbance_rejection import observer_gains, prediction
from bowden.control.laws.backlash_inverse import Means, average
from bowden.control.reference import PeriodicMinimumJerk
from bowden.control.stability import StateSpace, margins, servo_model
from bowden.core.nested import flat, leaves, name_of, unflatten
from bowden.core.signals import Reference, Sample
from bowden.core.units import RADIANS
from bowden.models.cable.backlash import Play, joint_angle, push
from bowden.models.cable.bouc_wen import saturation
from bowden.models.drive.servo import Servo
from bowden.plants.presets.bench import default_bench
from support import bench_runs

DT = 1e-3
REST = Reference(0.0, 0.0, 0.0)
NAMES = ("offset_inverse", "hysteresis_model", "cascaded_pid", "backlash_inverse", "active_disturbance_rejection")
INVERSES = ("offset_inverse", "hysteresis_model", "backlash_inverse")
SLOPES = (0.7, 0.8, 0.9, 1.0, 1.05)
BENCH = default_bench()


def on_play(law: Law, play: Play, duration: float, wait: float, *, reference: Any = None) -> tuple[float, Any]:
    """RMSE [rad] after `wait` on a motor that follows at once and pushes a play; and the law's last state."""
    reference = reference or PeriodicMinimumJerk(0.0, 70.0 * RADIANS, 5.0)
    rows = reference.sample(np.arange(0.0, duration, DT)).tolist()
    motor, z = 0.0, 0.0
    joint = joint_angle(z, play)
    state, errors = law.start(Sample(float(joint), motor)), []
    for row in rows:
        state, command = law.step(state, Sample(float(joint), motor), Reference(*row), DT)
        motor = float(command)
        z = float(push(z, motor, play.half_width))
        joint = joint_angle(z, play)
        errors.append(float(joint) - row[0])
    return float(np.sqrt(np.mean(np.square(errors[round(wait / DT) :])))), state


def open_loop(name: str, play: Play, **changes: float) -> Law:
    """An inverse without servo, delay or feedback: exactly the cable's inverse."""
    law = LAWS[name].with_gains(lead=0.0, lead_square=0.0, switching_time=0.0, velocity_band=1e-6, slope=play.slope)
    feedback = [
        gain
        for gain in ("error_share", "error_rate", "proportional_gain", "integral_gain")
        if gain in law.gains._fields
    ]
    return law.with_gains(**dict.fromkeys(feedback, 0.0), **changes)


@pytest.mark.parametrize("play", [Play(0.938, 0.05), Play(0.7, 0.12), Play(-0.9, 0.03)], ids=str)
def test_the_known_inverses_take_play_away(play: Play) -> None:
    uncompensated, _ = on_play(LAWS["uncompensated"].with_gains(slope=play.slope), play, 10.0, 5.0)
    assert uncompensated > 0.8 * abs(play.slope) * play.half_width
    offset = open_loop("offset_inverse", play, half_width=play.half_width)
    model = open_loop("hysteresis_model", play, half_width=play.half_width, friction_stretch=0.0)
    for law in (offset, model):
        assert on_play(law, play, 10.0, 5.0)[0] < 0.01 * uncompensated


@pytest.mark.parametrize("play", [Play(0.938, 0.05), Play(0.7, 0.1, 0.1), Play(1.2, 0.02, -0.05)], ids=str)
def test_the_adaptive_inverse_recovers_slope_and_width_of_play(play: Play) -> None:
    """From a slope of one and no backlash; the offset shows in where the two crossings lie."""
    law = open_loop("backlash_inverse", play).with_gains(slope=1.0)
    uncompensated, _ = on_play(LAWS["uncompensated"], play, 10.0, 5.0)
    rmse, state = on_play(law, play, 30.0, 20.0)
    slope, right, left = state.estimates
    assert slope == pytest.approx(play.slope, rel=0.05)
    assert (right - left) / (2.0 * slope) == pytest.approx(play.half_width, rel=0.05)
    assert -(right + left) / 2.0 == pytest.approx(play.offset, abs=0.005)
    assert rmse < 0.05 * uncompensated


def test_the_adaptive_inverse_learns_nothing_from_motion_inside_the_slot() -> None:
    law = LAWS["backlash_inverse"]
    small = PeriodicMinimumJerk(0.0, 0.03, 2.0)
    _, state = on_play(law, Play(0.8, 0.05), 10.0, 1.0, reference=small)
    assert state.estimates == (1.0, 0.0, 0.0)


@pytest.mark.parametrize("name", NAMES)
def test_estimates_and_sums_stay_in_their_box_whatever_comes(name: str) -> None:
    law = LAWS[name]
    random = np.random.default_rng(7)
    wild = [math.nan, math.inf, -math.inf, 1e300, -1e300, 1e16, 0.0, -0.0]
    state = law.start(Sample(0.0, 0.0))
    with np.errstate(all="ignore"):
        for k in range(3000):
            values = random.normal(0.0, 3.0, 5).tolist()
            if k % 3 == 0:
                values[k // 3 % 2] = wild[k % len(wild)]
            state, command = law.step(state, Sample(*values[:2]), Reference(*values[2:]), DT)
            boxed = {
                "correction": getattr(law.gains, "correction_limit", 0.0),
                "integral": getattr(law.gains, "integral_limit", getattr(law.gains, "correction_limit", 0.0)),
                "direction": 1.0,
                "friction": 1.0,
                "estimates.right": getattr(law.gains, "largest_crossing", 0.0),
                "estimates.left": getattr(law.gains, "largest_crossing", 0.0),
            }
            now = {name_of(path): value for path, value in leaves(state)}
            for field in boxed.keys() & now.keys():
                assert abs(now[field]) <= boxed[field], (field, k)
            if name == "backlash_inverse":
                assert law.gains.lowest_slope <= state.estimates.slope <= law.gains.highest_slope
                assert all(map(math.isfinite, flat(state)))
                assert math.isfinite(command)


def linear(law: Law, slope: float, **estimates: float) -> StateSpace:
    """The law near rest from the motor's angle to minus the command, the joint moving by `slope` per motor motion.

    By central differences; the laws are linear there. States that the motor does not reach, or that do not reach the
    command, are left out.
    """
    rest = law.start(Sample(0.0, 0.0))._replace(**estimates)

    def at(change: np.ndarray, motor: float) -> np.ndarray:
        before = unflatten(rest, np.array(flat(rest)) + change)
        after, command = law.step(before, Sample(slope * motor, motor), REST, DT)
        return np.array([*flat(after), -command], dtype=float)

    n, small = len(flat(rest)), 1e-6
    columns = [(at(small * row, 0.0) - at(-small * row, 0.0)) / (2.0 * small) for row in np.eye(n)]
    matrix = np.array(columns).T
    into = (at(np.zeros(n), small) - at(np.zeros(n), -small)) / (2.0 * small)
    a, c, b, d = matrix[:n], matrix[n:], into[:n, None], float(into[n])
    reached, seen = b[:, 0] != 0.0, c[0] != 0.0
    for _ in range(n):
        reached |= (a != 0.0) @ reached
        seen |= (a != 0.0).T @ seen
    kept = reached & seen
    return StateSpace(a[np.ix_(kept, kept)], b[kept], c[:, kept], d)


def worst_margins(law: Law) -> tuple[float, float, float]:
    """Smallest gain, phase and delay margin over the slopes; the loop must be stable at each."""
    found = []
    for factor in SLOPES:
        model = linear(law, factor * BENCH.cable.slope)
        found.append(margins(servo_model(BENCH.servo, DT, BENCH.delay, 1.0), model, DT))
        assert found[-1].stable
    return (
        min(m.gain_margin_db for m in found if m.gain_margin_db is not None),
        min(m.phase_margin_deg for m in found if m.phase_margin_deg is not None),
        min(m.delay_margin_s for m in found if m.delay_margin_s is not None),
    )


@pytest.mark.parametrize("name", NAMES)
def test_margins_are_kept_over_the_sheath_s_slopes(name: str) -> None:
    """12 dB and 60°, as the tuning rule asks; the issue's bound is 6 dB and 45°."""
    gain_margin, phase_margin, delay_margin = worst_margins(LAWS[name])
    assert gain_margin >= 12.0
    assert phase_margin >= 60.0
    assert delay_margin > 5e-3


def rig(omega: float, delay: int, sample_time: float, noise: float = 2e-4) -> Knowledge:
    """What is known of a rig, by its servo's ω [rad/s], cycles of delay, Ts [s] and the joint's noise [rad]."""
    return Knowledge(omega, 1.0, (delay + 0.5) * sample_time, sample_time, joint_noise=noise, joint_step=0.0)


def test_the_observer_s_bandwidth_follows_servo_delay_and_noise() -> None:
    law, bench = LAWS["active_disturbance_rejection"], rig(53.58, 1, DT)
    assert informed(law, bench).gains.observer_bandwidth == pytest.approx(law.gains.observer_bandwidth, rel=1e-12)
    assert informed(law, rig(15.0, 1, DT)).gains.observer_bandwidth == pytest.approx(15.0 / 53.58 * 190.0)
    late, loud = informed(law, rig(53.58, 8, DT)).gains, informed(law, rig(53.58, 1, DT, 2e-3)).gains
    assert late.observer_bandwidth == pytest.approx(1.0 / 8.5e-3)
    assert loud.observer_bandwidth == pytest.approx((0.1 * RADIANS / 2e-3 * 53.58**2 / DT**0.5) ** 0.4)
    unknown = informed(law, Knowledge(servo_frequency=30.0)).gains
    assert (unknown.observer_bandwidth, unknown.arrival) == (law.gains.observer_bandwidth, 1.0)


@pytest.mark.parametrize("omega", [15.0, 50.0, 120.0])
@pytest.mark.parametrize(("delay", "sample_time"), [(0, 1e-3), (1, 4e-3), (3, 5e-4), (8, 1e-3), (8, 4e-3)])
def test_disturbance_rejection_holds_on_rigs_that_it_is_not_tuned_for(
    monkeypatch: pytest.MonkeyPatch, omega: float, delay: int, sample_time: float
) -> None:
    """6 dB and 45° from 0.7 to 1.05 of the slope, as the check asks."""
    monkeypatch.setattr(sys.modules[__name__], "DT", sample_time)
    law = informed(LAWS["active_disturbance_rejection"], rig(omega, delay, sample_time))
    plant = servo_model(Servo(omega, 1.0), sample_time, delay, 1.0)
    for factor in (SLOPES[0], SLOPES[-1]):
        found = margins(plant, linear(law, factor * law.gains.slope), sample_time)
        assert found.stable
        assert (found.gain_margin_db or math.inf) >= 6.0
        assert (found.phase_margin_deg or math.inf) >= 45.0


def test_of_what_the_backlash_inverse_began_with_a_hundredth_is_left_when_it_has_settled() -> None:
    """Its means forget while the cable is pushed: half of the time at least."""
    law, means = LAWS["backlash_inverse"], Means(*[1.0] * 8)
    for _ in range(round(0.5 * law.settling(law.gains) / DT)):
        means = average(means, 0.0, 0.0, True, DT / law.gains.forgetting_time)
    assert means.product == pytest.approx(math.exp(-5.0), rel=0.01)


def test_disturbance_rejection_steers_by_two_poles_at_its_bandwidth() -> None:
    law, rest = LAWS["active_disturbance_rejection"].with_gains(control_bandwidth=30.0), Sample(0.0, 0.0)
    gains, state = law.gains, law.start(rest)
    omega, wanted = gains.natural_frequency, gains.control_bandwidth
    alone, off, rate = (law.step(state, rest, Reference(p, v, 0.0), DT)[1] for p, v in ((0, 0), (0.1, 0), (0, 0.1)))
    assert (off - alone) * gains.slope == pytest.approx(0.1 * wanted**2 / omega**2)
    damped = 2.0 * (wanted - gains.damping * omega) / omega**2
    assert (rate - alone) * gains.slope == pytest.approx(0.1 * (gains.lead + damped))


def test_what_is_on_its_way_is_no_disturbance() -> None:
    """The observer is given the command that acts: beyond a cycle of delay its two lags have the delay's mean."""
    law = informed(LAWS["active_disturbance_rejection"], rig(40.0, 8, DT))
    state, seen = law.start(Sample(0.0, 0.0)), []
    for _ in range(100):
        state = state._replace(command=1.0)
        state, _ = law.step(state, Sample(0.0, 0.0), REST, DT)
        seen.append(1.0 - state.command_before)
    assert sum(seen) == pytest.approx(7.0, abs=0.01)  # cycles until the ninth, of which the loop itself has one
    assert seen == sorted(seen, reverse=True)


@pytest.mark.parametrize(("omega", "damping", "bandwidth"), [(53.58, 1.0, 190.0), (20.0, 0.5, 60.0), (0.0, 1.0, 100.0)])
def test_the_observer_s_poles_are_where_they_should_be(omega: float, damping: float, bandwidth: float) -> None:
    known, beta = prediction(omega, damping, DT), math.exp(-bandwidth * DT)
    correction = np.array([observer_gains(known, beta)]).T
    phi = np.array([[known.xx, known.xv, known.xf], [known.vx, known.vv, known.vf], [0.0, 0.0, 1.0]])
    error = (np.eye(3) - correction @ [[1.0, 0.0, 0.0]]) @ phi
    np.testing.assert_allclose(np.poly(error), np.poly([beta] * 3), rtol=1e-9)
    if omega == 0.0:  # Miklosovic, Radke, Gao: the current observer of a double integrator
        expected = [1 - beta**3, 1.5 * (1 - beta) ** 2 * (1 + beta) / DT, (1 - beta) ** 3 / DT**2]
        np.testing.assert_allclose(correction[:, 0], expected, rtol=1e-9)


def test_the_observer_s_prediction_is_the_servo_s() -> None:
    exact = servo_model(BENCH.servo, DT, 0, 1.0).a
    known = prediction(BENCH.servo.natural_frequency, BENCH.servo.damping, DT)
    np.testing.assert_allclose([[known.xx, known.xv], [known.vx, known.vv]], exact, rtol=2e-3, atol=1e-6)


def measured(law: Law, moved: bool) -> tuple[float, float, float]:
    """RMSE from rest and after 10 s [deg], and the command's total variation over the reference's."""
    trace = bench_runs.run(law, moved=moved)
    found = trace.metrics()
    assert trace.stable
    assert found.rmse_deg is not None
    assert found.rmse_after_10s_deg is not None
    variation = np.abs(np.diff(trace["command"])).sum() / np.abs(np.diff(trace["reference"])).sum()
    return found.rmse_deg, found.rmse_after_10s_deg, float(variation)


@cache
def figures(name: str, moved: bool) -> tuple[float, float, float]:
    return measured(LAWS[name], moved)


@pytest.mark.parametrize("moved", [False, True], ids=["constant", "moved"])
@pytest.mark.parametrize("name", NAMES)
def test_no_law_is_a_straw_man(name: str, moved: bool) -> None:
    """Half of the uncompensated error is the least; none here needs more than the paper's adaptive law has."""
    found = figures(name, moved)
    assert found[0] < 0.5 * figures("uncompensated", moved)[0]
    assert found[0] < figures("adaptive", moved)[0]
    assert found[2] < 2.2
    if not moved:
        assert found[2] <= 2.0  # the tuning rule's


def test_the_widths_are_those_of_the_bench_s_cable() -> None:
    cable = BENCH.cable
    width = abs(cable.hysteresis_gain) * BENCH.sheath.gap * float(saturation(cable)) / cable.slope
    assert LAWS["offset_inverse"].gains.half_width == pytest.approx(width, rel=2e-3)
    model = LAWS["hysteresis_model"].gains
    assert model.half_width + model.friction_stretch == pytest.approx(width, rel=2e-3)


def test_the_lead_is_the_bench_s_servo_and_delay() -> None:
    servo, tau = BENCH.servo, (BENCH.delay + 0.5) * BENCH.sample_time
    lag = 2.0 * servo.damping / servo.natural_frequency
    assert pytest.approx(lag + tau, rel=2e-3) == LEAD
    assert pytest.approx(servo.natural_frequency**-2 + lag * tau + tau**2 / 2.0, rel=2e-3) == LEAD_SQUARE
    plant = servo_model(servo, DT, BENCH.delay, 1.0)
    x, errors = np.zeros((len(plant.a), 1)), []
    rows = PeriodicMinimumJerk(0.0, 1.0, 10.0).sample(np.arange(0.0, 10.0, DT))
    for row in rows:
        errors.append(float((plant.c @ x)[0, 0] - row[0]))
        x = plant.a @ x + plant.b * compensate_lag(Reference(*row.tolist()), LEAD, LEAD_SQUARE)
    assert np.max(np.abs(errors)) < 2e-4 * np.ptp(rows[:, 0])


@pytest.mark.parametrize("name", INVERSES)
def test_feedback_stands_still_while_the_dead_zone_is_crossed(name: str) -> None:
    law = LAWS[name]
    state = law.start(Sample(0.0, 0.0))
    for _ in range(200):
        state, _ = law.step(state, Sample(0.0, 0.0), Reference(0.0, 1.0, 0.0), DT)
    sums = []
    for _ in range(200):  # the joint is off by 0.1 rad all the time
        state, _ = law.step(state, Sample(-0.1, 0.0), Reference(0.0, -1.0, 0.0), DT)
        sums.append(float(state[-1]))  # the sum is the last field of each
    still = np.flatnonzero(np.diff(sums) == 0.0)
    assert len(still) > 1e3 * law.gains.hold
    assert sums[-1] > sums[0] == 0.0


def test_the_cascade_s_integral_stops_at_the_limit_and_comes_back_at_once() -> None:
    law = LAWS["cascaded_pid"].with_gains(correction_limit=0.1)
    state = law.start(Sample(0.0, 0.0))
    for _ in range(2000):
        state, _ = law.step(state, Sample(-0.2, 0.0), REST, DT)
    assert 0.0 < state.integral <= 0.1 - law.gains.proportional_gain * 0.2 + 1e-9
    before = state.integral
    for _ in range(100):
        state, _ = law.step(state, Sample(0.01, 0.0), REST, DT)
    assert state.integral < before


def test_the_cascade_s_inner_loop_is_the_faster_servo_that_is_claimed() -> None:
    """ka and kv with an ideal derivative, in continuous time: the frequency rises by √(1 + ka), the damping stays."""
    gains, servo = LAWS["cascaded_pid"].gains, BENCH.servo
    frequency = servo.natural_frequency * math.sqrt(1.0 + gains.motor_gain)
    friction = 2.0 * servo.damping * servo.natural_frequency + gains.motor_rate_gain * servo.natural_frequency**2
    assert friction / (2.0 * frequency) == pytest.approx(servo.damping, rel=0.01)


def test_disturbance_rejection_carries_a_constant_offset_without_error() -> None:
    """A joint that hangs 0.1 rad below the motor's: f settles at −ω²·0.1 and the command makes up for it."""
    law = LAWS["active_disturbance_rejection"]
    plant = servo_model(BENCH.servo, DT, 1, 0.938)
    x = np.zeros((len(plant.a), 1))
    state = law.start(Sample(0.0, 0.0))
    for _ in range(2000):
        joint = float((plant.c @ x)[0, 0]) - 0.1
        state, command = law.step(state, Sample(joint, joint / 0.938), REST, DT)
        x = plant.a @ x + plant.b * float(command)
    assert joint == pytest.approx(0.0, abs=1e-6)
    assert state.disturbance == pytest.approx(-0.1 * law.gains.natural_frequency**2, rel=1e-3)
    assert command == pytest.approx(0.1 / 0.938, rel=1e-3)
