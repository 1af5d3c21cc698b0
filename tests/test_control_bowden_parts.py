"""Parts of our law, each against its equation: observer, jump, slope, and the table of the oscillation monitor."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bowden.control.our_law import deadzone, observer, oscillation
from bowden.control.our_law.deadzone import DeadzoneInput, DeadzonePhase, DeadzoneState, update_deadzone
from bowden.control.our_law.gains import BowdenGains
from bowden.control.our_law.observer import DerivedRates, Observer, PropagatedCorrection
from bowden.control.our_law.oscillation import OscillationMonitor, no_oscillation, update_oscillation_monitor

DT = 1e-3
number, small = st.floats(-1.0, 1.0), st.floats(-0.3, 0.3)
observers = st.builds(Observer, *[number] * 7)


@given(observers, number, st.floats(0.0, 0.1), st.floats(0.0, 20.0), st.floats(1.0, 200.0))
def test_the_correction_is_its_three_equations_by_backward_euler(
    before: Observer, disturbance: float, least: float, most: float, kappa: float
) -> None:
    quick, arrived = 300.0, PropagatedCorrection(0.1, 0.2)
    after, acceleration = observer.correct(
        before, disturbance, 0.7, arrived, kappa, DerivedRates(9.0, quick, 9.0), least, most, DT
    )
    x = after.innovation
    news = disturbance + before.requested - x
    assert x - before.innovation == pytest.approx(2.0 * quick * DT * news, abs=1e-12)
    step = x * (1.0 - math.exp(-kappa * DT)) * x**2 / (x**2 + least**2 + 1e-30)
    assert before.requested - after.requested == pytest.approx(max(-most * DT, min(most * DT, step)), abs=1e-12)
    pull = quick**2 * (after.requested - after.sent) - 1.7 * quick * after.sent_rate
    assert acceleration == pytest.approx(pull, rel=1e-9, abs=1e-6)
    assert after.sent_rate == pytest.approx(before.sent_rate + DT * acceleration)
    assert after.sent == pytest.approx(before.sent + DT * after.sent_rate)
    assert after[4:] == (0.1, 0.2, 0.7)


@given(observers, number, st.floats(0.0, 0.1), st.floats(0.0, 0.2), st.floats(0.0, 0.2), st.floats(0.1, 9.0))
def test_the_correction_reaches_the_joint_behind_delay_lag_and_load_no_faster_than_it_may(
    before: Observer, shortfall: float, delay: float, lag: float, time: float, most: float
) -> None:
    """T²·ÿ + (lag + 2·0.25·T)·ẏ + y = F − τ·F' + u, by backward Euler."""
    y, rate = observer.propagate_correction(before, shortfall, delay, lag, time, most, DT)
    assert y == pytest.approx(before.at_joint + DT * rate)
    left = time**2 * (rate - before.at_joint_rate) / DT + (lag + 0.5 * time) * rate + y
    left -= before.sent - delay * before.sent_rate + shortfall
    assert abs(rate) <= most
    assert left == pytest.approx(0.0, abs=1e-9) if abs(rate) < most else left * rate <= 1e-12


@given(observers, number, number)
def test_of_a_jump_the_observer_sees_nothing(before: Observer, requested: float, shift: float) -> None:
    """All that is a correction goes by it, what is left of the disturbance the other way, and no rate changes."""
    after = observer.apply_shift(before, requested, shift)
    went = np.subtract(after, before._replace(requested=requested))
    assert went == pytest.approx((shift, 0.0, shift, 0.0, shift, 0.0, -shift), abs=1e-12)


def test_the_rates_follow_from_servo_delay_and_noise() -> None:
    gains = BowdenGains()._replace(servo_frequency=50.0, servo_damping=0.7, delay=2e-3, bandwidth=0.8)
    rates = observer.derived_rates(gains._replace(noise=0.0), 1.2, DT)
    assert rates.kappa * (1.0 / 50.0 + 1.5 * 2e-3) == pytest.approx(0.8)
    assert rates.quick == 12.0 * 50.0
    assert (rates.stopping - 1.0) * (1.4 / 50.0 + 2e-3) == pytest.approx(0.05)
    noisy = observer.derived_rates(gains._replace(noise=0.01), 1.2, DT)
    through = 0.01 * 1.2 * math.sqrt(-math.expm1(-rates.kappa * DT))
    assert through * (noisy.quick / 50.0) ** 2 == pytest.approx(0.0035, rel=1e-4)
    assert [observer.largest_speed(2.0, v, s) for v in (-3.0, math.nan) for s in (False, True)] == [5.0, 7.0, 2.0, 4.0]


phases = st.sampled_from(list(DeadzonePhase))
cables = st.builds(
    DeadzoneState, phases, *[number] * 4, st.floats(0.0, 0.6), st.floats(0.0, 0.6), small, number,
    st.floats(0.8, 1.3), st.floats(1e-4, 0.03), number, small,
)  # fmt: skip
inputs = st.builds(
    DeadzoneInput, *[number] * 5, st.just(1.1), st.floats(0.0, 1e-3), st.just(50.0), st.just(2e-3),
    st.floats(0.0, 0.1), st.floats(0.0, 0.2), number,
)  # fmt: skip


@given(cables, number, st.floats(1.0, 300.0))
def test_a_jump_fades_with_three_equal_poles(cable: DeadzoneState, begun: float, pace: float) -> None:
    """J''' = −p³·J − 3p²·J' − 3p·J'' by backward Euler, from J less the jump."""
    lack, rate, bend = deadzone.fade_jump(cable, begun, pace, DT)
    assert lack == pytest.approx(cable.jump - begun + DT * rate, abs=1e-9)
    assert rate == pytest.approx(cable.jump_rate + DT * bend, abs=1e-9)
    terms = (-(pace**3) * lack, -3.0 * pace**2 * rate, -3.0 * pace * bend)
    assert (bend - cable.jump_acceleration) / DT == pytest.approx(sum(terms), abs=1e-9 * sum(map(abs, terms)) + 1e-6)


def mirrored(cable: DeadzoneState) -> DeadzoneState:
    """The same cable with both angles and the reference counted the other way round."""
    turned = DeadzoneState(*(-one for one in cable))._replace(phase=DeadzonePhase(-cable.phase))
    return turned._replace(
        width=cable.width_back, width_back=cable.width, inverse=cable.inverse, variance=cable.variance
    )


@given(cables, inputs, small, small)
def test_the_dead_zone_knows_no_side(cable: DeadzoneState, now: DeadzoneInput, before: float, requested: float) -> None:
    cable = cable if cable.phase else cable._replace(width_back=cable.width)  # as one is given
    other = now._replace(**{name: -getattr(now, name) for name in (*DeadzoneInput._fields[:5], "rate")})
    there = update_deadzone(cable, now, before, requested, DT)
    back = update_deadzone(mirrored(cable), other, -before, -requested, DT)
    assert back.state == pytest.approx(mirrored(there.state), abs=1e-9)
    assert (back.requested, back.shift) == pytest.approx((-there.requested, -there.shift), abs=1e-9)


@given(cables, inputs, small)
def test_a_stretch_is_one_kalman_step_of_the_slope(cable: DeadzoneState, now: DeadzoneInput, contact: float) -> None:
    """What was known and what the stretch says add up by their information; what is strange is doubted instead."""
    after, way = deadzone.learn_slope(cable, now, contact), now.joint - cable.extreme
    most, wander = (0.15 * now.inverse) ** 2, (0.02 * now.inverse) ** 2
    if abs(way) <= deadzone.STRETCH:
        assert after == (cable.inverse, cable.variance)
        return
    said, doubt = (contact - cable.contact) / way, (0.035 / way) ** 2
    if said**2 > 9.0 * (cable.variance + doubt):
        assert after == (cable.inverse, min(most, 2.0 * cable.variance))
        return
    variance = 1.0 / (1.0 / cable.variance + 1.0 / doubt)
    mean = variance * (cable.inverse / cable.variance + (cable.inverse + said) / doubt)
    assert after.inverse == pytest.approx(max(0.6 * now.inverse, min(1.7 * now.inverse, mean)), rel=1e-5)
    assert after.variance == pytest.approx(min(most, variance + wander), rel=1e-4)


@given(inputs, st.floats(0.0, 0.6), st.floats(0.0, 0.6), st.floats(-0.1, 1.0), st.sampled_from((1.0, -1.0)))
def test_a_narrower_width_is_believed_at_once_and_a_wider_one_by_a_share(
    now: DeadzoneInput, this: float, other: float, gone: float, side: float
) -> None:
    """Less what the motor went while the joint was late; the other way grows by (1 + ω·lag)² less."""
    after = deadzone.learn_width(deadzone.LearnedWidths(this, other), now, gone, side)
    wider = max(0.0, gone - now.lag * max(0.0, side * now.rate) - this)
    assert after.this_way == pytest.approx(min(0.6, max(0.0, gone) if gone < this else this + 0.4 * wider))
    grown = max(0.0, after.this_way - this) / (1.0 + 50.0 * now.lag) ** 2
    assert after.other_way == pytest.approx(min(0.6, other + grown))


Swing = tuple[float, int]
"""Size of a half-wave [rad] and its cycles."""


def watched(
    swings: list[Swing], begun: OscillationMonitor | None = None, noise: float = 0.0, kappa: float = 100.0
) -> list[OscillationMonitor]:
    """The monitor along half-waves, every second one below zero."""
    found = [begun or no_oscillation()]
    for k, (size, cycles) in enumerate(swings):
        for i in range(cycles):
            fast = (-1.0) ** k * size * math.sin(math.pi * (i + 0.5) / cycles)
            found.append(update_oscillation_monitor(found[-1], fast, noise, kappa, DT))
    return found[1:]


def tried_in(swings: list[Swing], **more: float) -> int | None:
    """The half-wave in which a trial begins, counted from 0."""
    begun = [k for k, one in enumerate(watched(swings, **more)) if one.half_waves < 0.0]
    return sum(begun[0] >= end for end in np.cumsum([cycles for _, cycles in swings])) if begun else None


@pytest.mark.parametrize(
    ("ratio", "half_wave"), [(0.75, None), (0.85, 4), (1.0, 4), (1.25, 4), (1.35, 2), (1.6, 2), (0.5, None)]
)
def test_a_trial_begins_after_four_alike_half_waves_or_within_the_third_that_grows(
    ratio: float, half_wave: int | None
) -> None:
    assert tried_in([(0.02 * ratio**k, 80) for k in range(5)]) == half_wave


@pytest.mark.parametrize(
    ("swings", "noise", "found"),
    [
        ([(0.0021, 80)], 0.0, True),
        ([(0.0019, 80)], 0.0, False),  # below the least size
        ([(0.01, 80)], 0.0016, True),
        ([(0.01, 80)], 0.0017, False),  # within six standard deviations
        ([(0.02, 80), (0.02, 120)], 0.0, True),
        ([(0.02, 80), (0.02, 136)], 0.0, False),  # not alike in time
        ([(0.02, 245)], 0.0, True),
        ([(0.02, 255)], 0.0, False),  # too slow for a load
    ],
)
def test_what_is_small_uneven_or_slow_swings_nothing(swings: list[Swing], noise: float, found: bool) -> None:
    begun = no_oscillation()._replace(last_half_wave_time=0.25)
    seen = watched(swings * 12, begun, noise)
    assert any(one.half_waves < 0.0 for one in seen) == found


@pytest.mark.parametrize("kappa", [5.0, 40.0, 200.0, 2000.0])
def test_in_a_trial_kappa_is_half_of_what_it_was_and_slower_than_the_swing(kappa: float) -> None:
    """At most 0.3 of the swing's angular frequency, and no trial takes it below a tenth of that."""
    begun = next(one for one in watched([(0.02, 80)] * 6, kappa=kappa) if one.half_waves < 0.0)
    swing = math.pi / begun.last_half_wave_time
    assert swing == pytest.approx(math.pi / 0.08, rel=0.02)
    assert kappa * begun.bandwidth_share == pytest.approx(min(0.3 * swing, max(0.1 * swing, 0.5 * kappa)))
    assert oscillation.time_of_load(begun) == pytest.approx(1.15 / swing)
    assert begun.wearer_amplitude == pytest.approx(0.02, rel=0.01)


@pytest.mark.parametrize(("late", "own"), [(0.011, True), (0.013, False)])
def test_a_swing_that_has_decayed_at_the_end_of_a_trial_is_the_loop_s_own(late: float, own: bool) -> None:
    """To 0.6 of it in the last three of seven half-waves; a wearer's is known at once, and κ is whole again."""
    seen = watched([(0.02, 80)] * 8 + [(late, 80)] * 8)
    begin = next(k for k, one in enumerate(seen) if one.half_waves < 0.0)
    end = next(k for k, one in enumerate(seen) if one.half_waves >= 0.0 and k > begin)
    after, lasted = seen[end], (end - begin) * DT / 0.08
    assert lasted == pytest.approx(7.0, abs=0.2) if own else 4.0 < lasted < 5.0
    assert after.load_time == (pytest.approx(oscillation.load_of_half_wave(0.08), rel=0.02) if own else 0.0)
    assert (after.wearer_amplitude == 0.0) == own
    for one, then in pairwise(seen[end : end + 50]):
        assert then.bandwidth_share == pytest.approx(min(1.0, one.bandwidth_share * (1.0 + DT / 1.5)))
        assert then.wearer_amplitude == pytest.approx(one.wearer_amplitude * (1.0 - DT / 30.0))
    assert (after.bandwidth_share == 1.0) == (not own)


def test_only_a_larger_swing_than_the_wearer_s_is_suspect() -> None:
    known = no_oscillation()._replace(wearer_amplitude=0.02)
    for factor, suspect in ((1.55, False), (1.65, True)):
        assert any(one.half_waves < 0.0 for one in watched([(factor * 0.02, 80)] * 6, known)) == suspect


@pytest.mark.parametrize(("ratio", "known"), [(1.0, True), (1.55, True), (1 / 1.55, True), (1.65, False), (0.6, False)])
def test_a_swing_at_the_frequency_of_a_known_load_is_never_the_wearer_s(ratio: float, known: bool) -> None:
    """The load stays, and κ is not taken below what swings no load, however often it is tried."""
    load = ratio * oscillation.load_of_half_wave(0.08)
    seen = watched([(0.02, 80)] * 40, no_oscillation()._replace(load_time=load))
    assert seen[-1].load_time == load
    assert any(one.wearer_amplitude > 0.0 for one in seen[-400:]) or known
    trials = sum(a.half_waves >= 0.0 > b.half_waves for a, b in pairwise(seen))
    assert (trials > 1) == known
    assert min(one.bandwidth_share for one in seen) > 0.099 * math.pi / 0.08 / 100.0


def test_what_is_four_times_as_large_as_the_half_wave_before_comes_from_outside() -> None:
    for ratio, outside in ((3.9, False), (4.1, True)):
        seen = watched([(0.02, 80), (0.02 * ratio, 80)])
        assert any(oscillation.is_step_disturbance(one) for one in seen[81:]) == outside
