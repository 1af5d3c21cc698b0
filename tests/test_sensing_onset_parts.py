"""Parts of the onset detector, each against its equation in the module's text."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bowden.sensing import onset as parts
from bowden.sensing import onset_constants as of
from bowden.sensing.detector import Trouble
from bowden.sensing.onset import (
    Bands,
    InputState,
    Mains,
    Observation,
    OnsetEvidence,
    OnsetState,
    Phase,
    Powers,
    RestEstimate,
    Ways,
    onset_start,
    prepare_onset,
)
from bowden.sensing.onset_settings import DEFAULTS

ONSET, DT = prepare_onset(1000.0), 1e-3
DRIFT = 2.0 * math.log(DEFAULTS.ratio)
SHARE = 1.0 - DEFAULTS.ratio**-2
some, log_power = st.floats(0.01, 9.0), st.floats(-3.0, 3.0)
ways, all_powers = st.builds(Ways, some, some, some), st.builds(Powers, *[some] * 6)
rests = st.builds(RestEstimate, log_power, some, st.floats(-0.05, 20.0), some)
seen = st.builds(
    Observation, some, log_power, some, st.booleans(), st.booleans(), st.booleans(), st.sampled_from((0.0, 0.1, 1.0))
)


def state(**changes: object) -> OnsetState:
    return onset_start(ONSET, 0.0)._replace(**changes)


@given(all_powers, some)
def test_what_is_there_without_rest_and_contraction_is_what_leaks_and_a_tail(powers: Powers, size: float) -> None:
    leaks = (of.REPEATS * powers.band, of.BROAD * powers.wide, of.MOVED * powers.swing)
    steep = min(of.STEEP * powers.low, of.SLOW * powers.slow)
    assert parts.power_beside_rest(powers, size) == pytest.approx(sum(leaks) + steep + of.TAIL_SHARE**2 * size)


@given(all_powers, st.builds(Bands, *[log_power] * 5), ways)
def test_a_power_is_an_average_over_15_ms_and_a_peak_fades_in_100(powers: Powers, bands: Bands, squares: Ways) -> None:
    after, keeps, fades = parts.update_powers(ONSET, powers, bands, squares), math.exp(-DT / 0.015), math.exp(-DT / 0.1)
    taken = {"wide": bands.wide**2, "band": squares.plain, "new": min(squares), "low": bands.low**2}
    for name, value in taken.items():
        assert getattr(after, name) == pytest.approx(value + keeps * (getattr(powers, name) - value))
    assert after.swing == pytest.approx(max(bands.swing**2, fades * powers.swing))
    assert after.slow == pytest.approx(max(bands.slow**2, fades * powers.slow))


@given(st.booleans(), st.booleans(), all_powers, st.floats(0.1, 1.0), st.sampled_from((0.99, 1.01)), st.booleans())
def test_a_signal_that_is_dead_or_that_leaks_explain_is_told_so(
    dead: bool, railed: bool, powers: Powers, usual: float, share: float, swings: bool
) -> None:
    """What is new is less than one leak puts there, and the signal three times its usual size."""
    swing = powers.swing if swings else 0.0
    now = powers._replace(swing=swing, new=share * max(of.BROAD * powers.wide, of.MOVED * swing))
    explained = (share < 1.0 or railed) and powers.wide > 9.0 * usual
    expected = Trouble.DEAD if dead else Trouble.MOVEMENT_OR_MAINS if explained else Trouble.NONE
    assert parts.trouble_of(dead, railed, now, usual) == expected


@given(st.builds(OnsetEvidence, ways, ways, some, some), ways, ways, st.floats(1.0, 60.0))
def test_evidence_is_pages_sum_of_a_bounded_ratio_in_which_all_ways_agree(
    before: OnsetEvidence, short: Ways, long: Ways, most: float
) -> None:
    short, gain = Ways(*(20.0 * one for one in short)), of.BANDWIDTH * DT
    after = parts.sum_evidence(ONSET, before, short, long, most)
    for now, then, ratio in ((after.strong, before.strong, short), (after.weak, before.weak, long)):
        sums = np.array(then) + gain * (SHARE * np.minimum(ratio, ONSET.most) - DRIFT)
        assert now == pytest.approx(tuple(np.clip(sums, 0.0, most)))
    assert after.onset == max(min(after.strong), min(after.weak))
    quiet = gain * (0.5 * DRIFT - (1.0 - 1.0 / DEFAULTS.ratio) * min(*short, ONSET.most))
    assert after.end == pytest.approx(max(0.0, before.end + quiet))


def test_the_bounds_are_those_of_false_alarms_of_a_click_and_of_rest_that_ends_one() -> None:
    """h of so many chances an hour, K by which the least time makes h, and an end after `quiet` of rest at nothing."""
    assert math.exp(ONSET.enough) == pytest.approx(DEFAULTS.hours * 36_000.0)
    assert of.BANDWIDTH * DEFAULTS.brief * (SHARE * ONSET.most - DRIFT) == pytest.approx(ONSET.enough)
    assert ONSET.rested == pytest.approx(DEFAULTS.quiet / DT * ONSET.drift_of_end)
    assert ONSET.gain * ONSET.even == pytest.approx(ONSET.drift)
    assert ONSET.weakest * DEFAULTS.ratio**2 == pytest.approx(DEFAULTS.weakest**2)
    assert math.exp(ONSET.floor) == pytest.approx(DEFAULTS.least**2)


@given(st.sampled_from(list(Phase)), rests, seen)
def test_rest_is_a_mean_with_forgetting_of_what_can_be_rest(phase: Phase, rest: RestEstimate, now: Observation) -> None:
    """What cannot be a contraction counts whole; in one, and where leaks explain it, nothing that is above does."""
    level, count = parts.learn_level(phase, rest, now, DT), rest.seen + 0.1
    contracts = phase == Phase.CONTRACTION
    if rest.seen <= 0.0:
        assert level == math.log(now.power)
    elif now.excess < -now.limit:
        assert level == pytest.approx(rest.level + DT * now.excess / min(count, of.FALLS))
    elif now.excess < 0.0:
        assert level == pytest.approx(rest.level + (0.0 if contracts else DT * now.excess / count))
    else:
        share = of.DOUBT * now.excess if contracts else now.speed * min(now.excess, now.limit) * (not now.hidden)
        assert level == pytest.approx(rest.level + DT * share / count)


@given(st.sampled_from(list(Phase)), rests, seen, st.booleans())
def test_what_is_not_known_of_rest_goes_with_rest_and_grows_in_a_contraction(
    phase: Phase, rest: RestEstimate, now: Observation, dead: bool
) -> None:
    after = parts.learn_rest(ONSET, phase, rest, now, dead)
    level = rest.level if dead else parts.learn_level(phase, rest, now, DT)
    if phase == Phase.CONTRACTION:
        doubt = min(of.UNKNOWN**2, rest.uncertainty * (1.0 + DT * of.FORGET / of.LEARNT))
        assert after == pytest.approx((level, rest.spread, max(0.0, rest.seen - DT * of.FORGET), doubt))
        return
    assert after.level == (max(level, ONSET.floor) if now.bounded else level)
    learns = now.speed * DT / (rest.seen + 0.1 + of.WEIGHT) if rest.seen > 1.0 and not now.hidden else 0.0
    square = min(now.excess**2, now.limit**2)
    assert after.spread == pytest.approx(rest.spread + learns * (square - rest.spread))
    known = now.speed * DT / of.LEARNT if rest.seen > 0.0 and not now.muted else 0.0
    least = of.UNKNOWN**2 * math.exp(-of.MEMORY / of.LEARNT)
    assert after.uncertainty == pytest.approx(max(least, rest.uncertainty * (1.0 - known)))
    assert after.seen == pytest.approx(min(rest.seen + now.speed * DT, of.MEMORY))


@given(rests, some, st.floats(0.0, 3.0), st.sampled_from(list(Phase)), st.booleans())
def test_what_is_above_rest_counts_less_what_leaks_explain(
    rest: RestEstimate, power: float, beside: float, phase: Phase, dead: bool
) -> None:
    before = state(rest=rest, phase=phase, sigma=math.exp(0.5 * rest.level))
    found = parts.observe_rest(ONSET, before, power, beside, dead)
    assert found.bounded == (phase == Phase.REST and rest.uncertainty > of.FAMILIAR)
    assert found.power == max(power, (DEFAULTS.least if found.bounded else of.SILENT) ** 2)
    above = math.log(found.power) - rest.level
    explained = math.log1p(beside / math.exp(rest.level))
    assert found.excess == pytest.approx(max(0.0, above - explained) if above > 0.0 else above, abs=1e-9)
    assert found.limit == pytest.approx(of.SURE * math.sqrt(rest.spread + rest.uncertainty))
    assert found.hidden == (beside > found.power)
    assert found.muted == (power < (of.MUTED * DEFAULTS.least) ** 2)
    assert found.speed == parts.learning_speed(ONSET, before, found.power, dead)


@given(rests, some, st.floats(0.0, 20.0), some, st.sampled_from(list(Phase)), st.booleans())
def test_rest_is_learned_below_what_leaves_the_evidence_as_it_is_and_while_there_is_little(
    rest: RestEstimate, power: float, evidence: float, null: float, phase: Phase, dead: bool
) -> None:
    strength = 0.7 * null
    before = state(rest=rest, phase=phase, null=null, strength=strength)
    before = before._replace(evidence=before.evidence._replace(onset=evidence))
    bound = strength / DEFAULTS.ratio**2
    assert parts.bound_of_rest(ONSET, strength) == pytest.approx(bound)
    assert parts.bound_of_rest(ONSET, 0.0) == math.inf
    bound = bound if bound > math.exp(rest.level) else math.inf
    speed = parts.learning_speed(ONSET, before, power, dead)
    if phase == Phase.CONTRACTION or dead:
        assert speed == 0.0
    elif power >= min(DRIFT / SHARE * null, bound):
        assert speed == of.DOUBT
    else:
        assert speed == float(evidence < 0.25 * ONSET.enough)


@given(rests, some, st.floats(0.0, 9.0) | st.just(math.inf))
def test_the_largest_rest_is_its_level_and_doubt_as_far_as_a_contraction_bounds_it(
    rest: RestEstimate, limit: float, bound: float
) -> None:
    sure = math.exp(rest.level + of.SURE * math.sqrt(rest.spread))
    below = max(sure, bound) if bound > math.exp(rest.level) else math.inf
    most = min(math.exp(rest.level + limit), below)
    assert parts.largest_rest(ONSET, rest, limit, bound) == pytest.approx(max(most, ONSET.weakest))


@given(st.builds(Mains, st.floats(0.0, 1.0), some), all_powers, st.booleans())
def test_mains_cover_rest_where_they_hide_it_and_are_quicker_than_a_swing(
    mains: Mains, powers: Powers, hidden: bool
) -> None:
    after, keeps = parts.update_mains(ONSET, mains, powers, hidden), math.exp(-DT / of.STAYS)
    covers = float(hidden and powers.wide > of.MAINS_LEVEL * powers.swing)
    assert after.share == pytest.approx(covers + keeps * (mains.share - covers))
    assert after.power == pytest.approx(hidden * powers.wide + keeps * (mains.power - hidden * powers.wide))


@given(some, some, st.floats(0.0, 1.0), st.sampled_from((0.0, 1.0)))
def test_the_strength_of_a_contraction_is_the_mean_of_what_does_not_speak_for_its_end(
    power: float, strength: float, held: float, end: float
) -> None:
    before = state(phase=Phase.CONTRACTION, strength=strength, held=held)
    before = before._replace(evidence=before.evidence._replace(end=end))
    mean = (held * strength + DT * power) / (held + DT)
    assert parts.mean_strength(ONSET, before, power) == pytest.approx(strength if end else mean)
    assert parts.mean_strength(ONSET, before._replace(phase=Phase.REST), power) == power


@given(st.floats(-1.0, 1.0) | st.just(math.nan), st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_a_sample_that_repeats_the_last_one_or_is_missing_is_flat(value: float, largest: float, still: float) -> None:
    begun = InputState(0.1, 0.3, largest, still, 0.02)
    after = parts.take_sample(ONSET, begun, value)
    raw = 0.3 if math.isnan(value) else value
    step, fades, keeps = abs(raw - 0.3), math.exp(-DT / 0.03), math.exp(-DT / 0.015)
    assert after[:2] == (0.1, raw)
    assert after.largest_step == pytest.approx(max(step, fades * largest))
    rests = float(step <= of.STILL * after.largest_step)
    assert after.still_share == pytest.approx(rests + keeps * (still - rests))
    assert after.flat_time == pytest.approx(0.0 if step else 0.021)
    for powers in (Powers(wide, 0.0, 0.0, 0.0, 0.0, 0.0) for wide in (0.5, 2.0)):
        loud = powers.wide > of.STEPS * after.largest_step**2
        assert parts.is_railed(after, powers) == (after.still_share > of.STUCK and loud)
