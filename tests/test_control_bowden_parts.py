"""Parts of our law, each against its equation: observer, motor, width, and the table of the oscillation monitor."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bowden.control import LAWS
from bowden.control.our_law import deadzone, law, oscillation
from bowden.control.our_law.deadzone import DeadzoneState, update_deadzone
from bowden.control.our_law.gains import BowdenGains
from bowden.control.our_law.law import ExpectedMotor, Observer
from bowden.control.our_law.oscillation import OscillationMonitor
from bowden.core.signals import Reference, Sample

DT = 1e-3
QUIET = LAWS["bowden"].start(Sample(0.0, 0.0)).oscillation
number, small = st.floats(-1.0, 1.0), st.floats(-0.3, 0.3)
observers = st.builds(Observer, *[number] * 7)


@given(observers, number, st.floats(0.0, 0.1), st.floats(0.0, 20.0), st.floats(1.0, 200.0))
def test_the_correction_is_its_three_equations_by_backward_euler(
    before: Observer, disturbance: float, least: float, most: float, kappa: float
) -> None:
    quick = 300.0
    requested, x = law.request(before, disturbance, kappa, quick, least, most, DT)
    assert x - before.innovation == pytest.approx(quick * DT * (disturbance + before.requested - x), abs=1e-12)
    step = x * (1.0 - math.exp(-kappa * DT)) * x**2 / (x**2 + least**2 + 1e-30)
    assert before.requested - requested == pytest.approx(max(-most * DT, min(most * DT, step)), rel=1e-4, abs=1e-12)
    sent, rate, acceleration = law.send(before, requested, quick, DT)
    pull = quick**2 * (requested - sent) - 2.0 * quick * rate
    assert acceleration == pytest.approx(pull, rel=1e-9, abs=1e-6)
    assert rate == pytest.approx(before.sent_rate + DT * acceleration)
    assert sent == pytest.approx(before.sent + DT * rate)


@given(observers, number, st.floats(0.0, 0.1), st.floats(0.0, 0.2), st.floats(0.0, 0.2), st.floats(0.1, 9.0))
def test_the_correction_reaches_the_joint_behind_delay_lag_and_load_no_faster_than_it_may(
    before: Observer, shortfall: float, delay: float, lag: float, time: float, most: float
) -> None:
    """T²·ÿ + (lag + 2·0.25·T)·ẏ + y = F − τ·F' + u, by backward Euler; without a load 0.35/ω more of lag."""
    gains = BowdenGains(servo_frequency=50.0, delay=delay, lag=lag)
    y, rate = law.propagate_correction(gains, before, shortfall, time, most, DT)
    assert y == pytest.approx(before.at_joint + DT * rate)
    left = time**2 * (rate - before.at_joint_rate) / DT + (lag + (0.5 * time if time else 0.007)) * rate + y
    left -= before.sent - delay * before.sent_rate + shortfall
    assert abs(rate) <= most
    assert left == pytest.approx(0.0, abs=1e-9) if abs(rate) < most else left * rate <= 1e-12


def test_the_rates_follow_from_servo_delay_and_noise() -> None:
    gains = BowdenGains(servo_frequency=50.0, servo_damping=0.7, delay=2e-3, bandwidth=0.8, slope=-0.8)
    assert law.servo_time(gains) == pytest.approx(1.4 / 50.0 + 2e-3)
    kappa = law.observer_rate(gains)
    assert kappa * (1.0 / 50.0 + 1.5 * 2e-3) == pytest.approx(0.8)
    assert law.filter_rate(gains._replace(noise=0.0), DT) == 1.0 / DT
    through = 0.01 / 0.8 * math.sqrt(-math.expm1(-kappa * DT))
    noisy = law.filter_rate(gains._replace(noise=0.01), DT)
    assert through * (noisy / 50.0) ** 2 == pytest.approx(0.007, rel=1e-4)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_what_it_took_to_turn_a_motor_is_added_at_the_next_turn_to_that_side(side: float) -> None:
    """It stands until 0.5 rad more are added; the next time these come within some of the servo's times."""
    gains, drive, motor = BowdenGains(), ExpectedMotor(*[0.0] * 5, -side, False, *[0.0] * 4), 0.0
    seen = []
    for k in range(4000):
        asked = side if k < 2000 or k >= 3000 else -side
        if k in (0, 2000, 3000):
            stood, begun, motor = 0, drive.fed_forward, 0.0
        if asked * (drive.fed_forward - begun) > 0.5:
            motor = 0.02 * asked
        stood += motor == 0.0
        short = -0.1 * asked if motor == 0.0 else 0.0
        drive = law.update_drive(gains, drive, 0.0, short, motor, asked, DT)
        seen.append(stood)
    assert (drive.stick if side > 0.0 else drive.stick_back) == pytest.approx(0.5, abs=0.1)
    assert seen[3999] < 0.6 * seen[1999]


cables = st.builds(
    DeadzoneState, st.sampled_from((-1.0, 1.0)), st.booleans(), *[number] * 4, st.floats(0.0, 0.6), st.floats(0.0, 0.6),
    small, number, st.floats(0.8, 1.3), number, small,
)  # fmt: skip
GAINS = BowdenGains(servo_frequency=50.0, delay=2e-3, slope=1.0 / 1.1, noise=5e-4)


def mirrored(cable: DeadzoneState) -> DeadzoneState:
    """The same cable with both angles and the reference counted the other way round."""
    turned = DeadzoneState(*(-one for one in cable))._replace(crossing=cable.crossing, inverse=cable.inverse)
    return turned._replace(width=cable.width_back, width_back=cable.width)


@given(cables, st.tuples(*[number] * 5), st.floats(0.0, 0.1), st.floats(0.0, 0.2), number, small, small)
def test_the_dead_zone_knows_no_side(
    cable: DeadzoneState, now: tuple[float, ...], lag: float, answer: float, rate: float, last: float, wanted: float
) -> None:
    joint, motor, *reference = now

    def updated(cable: DeadzoneState, sign: float) -> tuple[DeadzoneState, float, float]:
        asked = Reference(*(sign * one for one in reference))
        angles = (sign * joint, True, sign * motor, asked)
        return update_deadzone(GAINS, cable, *angles, lag, answer, sign * rate, sign * last, sign * wanted, DT)

    there, back = updated(cable, 1.0), updated(mirrored(cable), -1.0)
    assert back[0] == pytest.approx(mirrored(there[0]), abs=1e-9)
    assert back[1:] == pytest.approx((-there[1], -there[2]), abs=1e-9)


@given(cables, number, small)
def test_a_stretch_says_half_of_the_slope_where_it_is_long_and_little_where_it_is_short(
    cable: DeadzoneState, joint: float, contact: float
) -> None:
    way = joint - cable.extreme
    said = 0.5 * (contact - cable.contact) * way / (way**2 + 0.3**2)
    expected = max(1.1 / 1.7, min(1.1 * 1.7, cable.inverse + said))
    assert deadzone.learn_slope(GAINS, cable, joint, contact) == pytest.approx(expected)


@given(st.floats(0.0, 0.6), st.floats(-0.1, 1.0), st.floats(0.0, 0.1))
def test_a_narrower_width_is_believed_at_once_and_a_wider_one_by_a_share(
    known: float, gone: float, late: float
) -> None:
    """Less what the motor went while the joint was late."""
    wider = max(0.0, gone - late - known)
    expected = min(0.6, max(0.0, gone) if gone < known else known + 0.4 * wider)
    assert deadzone.learn_width(known, gone, late) == pytest.approx(expected)


@given(cables, number, number, number)
def test_a_reference_turns_where_it_will_be_behind_its_furthest_and_does_not_go_on(
    cable: DeadzoneState, position: float, velocity: float, acceleration: float
) -> None:
    """Seen ahead by the delay and 2.2/(3ω); behind by more than 1 mrad and four standard deviations."""
    now, ahead, far = Reference(position, velocity, acceleration), 2e-3 + 2.2 / (3.0 * 50.0), 1e-3 + 4.0 * GAINS.noise
    there = position + ahead * velocity + 0.5 * ahead**2 * acceleration
    side, furthest = deadzone.reference_turn(GAINS, cable, now)
    behind, onward = cable.side * (cable.furthest - there), cable.side * (velocity + ahead * acceleration)
    turns = behind > far and onward <= 0.0
    assert side == (-cable.side if turns else cable.side)
    assert furthest == pytest.approx(there if turns or behind < 0.0 else cable.furthest)
    begun = deadzone.reference_turn(GAINS, cable._replace(side=0.0), now)
    assert begun[0] == (math.copysign(1.0, there - cable.furthest) if abs(behind) > far else 0.0)
    assert deadzone.reference_turn(GAINS, cable._replace(side=0.0, furthest=deadzone.FURTHEST), now)[0] == (
        math.copysign(1.0, there - position) if abs(there - position) > far else 0.0
    )


Swing = tuple[float, int]
"""Size of a half-wave [rad] and its cycles."""


def watched(
    swings: list[Swing], begun: OscillationMonitor = QUIET, least: float = 0.002, kappa: float = 100.0
) -> list[OscillationMonitor]:
    """The monitor along half-waves, every second one below zero."""
    found = [begun]
    for k, (size, cycles) in enumerate(swings):
        for i in range(cycles):
            fast = (-1.0) ** k * size * math.sin(math.pi * (i + 0.5) / cycles)
            found.append(oscillation.watch(found[-1], fast, least, kappa, DT))
    return found[1:]


def tried_in(swings: list[Swing], **more: float) -> int | None:
    """The half-wave in which a trial begins, counted from 0."""
    begun = [k for k, one in enumerate(watched(swings, **more)) if one.half_waves < 0.0]
    return sum(begun[0] >= end for end in np.cumsum([cycles for _, cycles in swings])) if begun else None


@pytest.mark.parametrize(
    ("ratio", "half_wave"), [(0.6, None), (0.65, 4), (1.0, 4), (1.25, 4), (1.28, 2), (1.6, 2), (0.5, None)]
)
def test_a_trial_begins_after_four_alike_half_waves_or_within_the_third_that_grows(
    ratio: float, half_wave: int | None
) -> None:
    assert tried_in([(0.02 * ratio**k, 80) for k in range(5)]) == half_wave


@pytest.mark.parametrize(
    ("swings", "found"),
    [
        ([(0.0021, 80)], True),
        ([(0.0019, 80)], False),  # below the least size
        ([(0.02, 80), (0.02, 120)], True),
        ([(0.02, 80), (0.02, 136)], False),  # not alike in time
        ([(0.02, 245)], True),
        ([(0.02, 255)], False),  # too slow for a load
    ],
)
def test_what_is_small_uneven_or_slow_swings_nothing(swings: list[Swing], found: bool) -> None:
    begun = QUIET._replace(last_half_wave_time=0.25)
    seen = watched(swings * 12, begun)
    assert any(one.half_waves < 0.0 for one in seen) == found


@pytest.mark.parametrize("kappa", [5.0, 40.0, 200.0, 2000.0])
def test_in_a_trial_kappa_is_slower_than_the_swing(kappa: float) -> None:
    """At most a quarter of the swing's angular frequency."""
    begun = next(one for one in watched([(0.02, 80)] * 6, kappa=kappa) if one.half_waves < 0.0)
    swing = math.pi / begun.last_half_wave_time
    assert swing == pytest.approx(math.pi / 0.08, rel=0.02)
    assert kappa * begun.bandwidth_share == pytest.approx(min(0.25 * swing, kappa))
    assert oscillation.time_of_load(begun) == pytest.approx(1.0 / swing)
    assert begun.wearer_amplitude == pytest.approx(0.02, rel=0.01)


@pytest.mark.parametrize(("late", "own"), [(0.011, True), (0.013, False)])
def test_a_swing_that_has_decayed_at_the_end_of_a_trial_is_the_loop_s_own(late: float, own: bool) -> None:
    """To 0.6 of it in the last three of eight half-waves; a wearer's is known at once, and κ is whole again."""
    seen = watched([(0.02, 80)] * 8 + [(late, 80)] * 8)
    begin = next(k for k, one in enumerate(seen) if one.half_waves < 0.0)
    end = next(k for k, one in enumerate(seen) if one.half_waves >= 0.0 and k > begin)
    after, lasted = seen[end], (end - begin) * DT / 0.08
    assert lasted == pytest.approx(8.0, abs=0.2) if own else 5.0 < lasted < 6.0
    assert after.load_time == (pytest.approx(0.08 / math.pi, rel=0.02) if own else 0.0)
    assert (after.wearer_amplitude == 0.0) == own
    for one, then in pairwise(seen[end : end + 50]):
        assert then.bandwidth_share == pytest.approx(min(1.0, one.bandwidth_share * (1.0 + DT / 2.0)))
        assert then.wearer_amplitude == pytest.approx(one.wearer_amplitude * (1.0 - DT / 30.0))
    assert (after.bandwidth_share == 1.0) == (not own)


def test_only_a_larger_swing_than_the_wearer_s_is_suspect() -> None:
    known = QUIET._replace(wearer_amplitude=0.02)
    for factor, suspect in ((1.55, False), (1.65, True)):
        assert any(one.half_waves < 0.0 for one in watched([(factor * 0.02, 80)] * 6, known)) == suspect


@pytest.mark.parametrize(("ratio", "known"), [(1.0, True), (1.55, True), (1 / 1.55, True), (1.65, False), (0.6, False)])
def test_a_swing_at_the_frequency_of_a_known_load_is_never_the_wearer_s(ratio: float, known: bool) -> None:
    """The load stays, and κ is not taken below what swings no load, however often it is tried."""
    load = ratio * 0.08 / math.pi
    seen = watched([(0.02, 80)] * 40, QUIET._replace(load_time=load))
    assert seen[-1].load_time == load
    assert any(one.wearer_amplitude > 0.0 for one in seen[-400:]) or known
    trials = sum(a.half_waves >= 0.0 > b.half_waves for a, b in pairwise(seen))
    assert (trials > 1) == known
    assert min(one.bandwidth_share for one in seen) > 0.099 * math.pi / 0.08 / 100.0
