"""EMG: the chain is SciPy's for any cut into pieces, and the detector tells contractions from all else."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal

from bowden.core.nested import flat, names
from bowden.identify.emg.log import read_emg, read_labels
from bowden.identify.emg.score import Findings, find, score, spans
from bowden.sensing.biquad import PASS, notch
from bowden.sensing.envelope import EnvelopeSettings, envelope_start, envelope_step, prepare_envelope
from bowden.sensing.onset import onset_rest, onset_start, onset_step, prepare_onset
from bowden.sensing.onset_settings import DEFAULTS, OnsetSettings, of_wearer
from bowden.sensing.stream import EnvelopeFilter, OnsetDetector
from bowden.sim.emg import NOISE, background, contractions
from emg_sources import rest

LONG = pytest.mark.long
"""Each further rate is compiled for."""
RECORDINGS = {"biceps_bursts": 9, "biceps_fatigue": 30, "adductor_pollicis_twitches": 12}


def noise(count: int, seed: int = 1) -> np.ndarray:
    return 0.3 + np.random.default_rng(seed).normal(0.0, 0.1, count)


@pytest.mark.parametrize("rate", [500.0, 1000.0, 2148.1, 4000.0])
@pytest.mark.parametrize("mains", [50.0, 60.0, 0.0])
def test_signal_and_envelope_are_scipys(rate: float, mains: float) -> None:
    x = noise(5000)
    got = EnvelopeFilter(rate, EnvelopeSettings(offset_hz=20.0, mains_hz=mains)).feed(x)
    y = signal.lfilter(*signal.butter(2, 20.0, "high", fs=rate), x - x[0])
    for k in (1, 2, 3):
        if 0.0 < k * mains < 0.45 * rate:
            y = signal.lfilter(*signal.iirnotch(k * mains, k * mains / 2.0, fs=rate), y)
    np.testing.assert_allclose(got.signal, y, rtol=0.0, atol=1e-12)
    envelope = signal.lfilter(*signal.butter(2, 8.0, fs=rate), np.abs(y))
    np.testing.assert_allclose(got.envelope, envelope, rtol=0.0, atol=1e-12)


def test_a_notch_beyond_the_rate_is_none() -> None:
    assert notch(240.0, 2.0, 500.0) == PASS


@settings(max_examples=20)
@given(st.lists(st.integers(0, 700), max_size=8))
def test_any_cut_into_pieces_gives_the_same_numbers(cuts: list[int]) -> None:
    x = noise(700) + contractions(1000.0, [(0.55, 0.7, 1.0)], 700)
    pieces = np.split(x, sorted(cuts))
    for make in (lambda: EnvelopeFilter(1000.0), lambda: OnsetDetector(1000.0)):
        whole, chain = make().feed(x), make()
        parts: list[Any] = [chain.feed(piece) for piece in pieces]
        for i, column in enumerate(whole):
            np.testing.assert_array_equal(column, np.concatenate([part[i] for part in parts]))


def test_interpreted_and_compiled_agree_bit_for_bit() -> None:
    x = noise(1200) + contractions(1000.0, [(0.6, 1.0, 1.0)], 1200)
    x[:10] = x[900:905] = np.nan
    x[1100:1150] = 0.25
    fast, detector, state = OnsetDetector(1000.0).feed(x), prepare_onset(1000.0), None
    for k, value in enumerate(x.tolist()):
        state = onset_start(detector, value) if state is None else state
        state, active, trouble = onset_step(detector, state, value)
        assert (active, trouble, onset_rest(state)) == (fast.active[k], fast.trouble[k], fast.rest[k]), k
    assert fast.active.max() == 1.0
    assert set(fast.trouble) >= {0.0, 1.0}
    x = noise(300)
    quick, chain, memory = EnvelopeFilter(1000.0).feed(x), prepare_envelope(1000.0), envelope_start(float(x[0]))
    for k, value in enumerate(x.tolist()):
        memory, _, envelope = envelope_step(chain, memory, value)
        assert envelope == quick.envelope[k]


@pytest.mark.parametrize("rate", [901.3, 1111.1, 1925.9])
def test_between_two_samples_a_cubic_is_read_where_it_is(rate: float) -> None:
    places = np.array([-1.0, 0.0, 1.0, 2.0])
    for weights in prepare_onset(rate).between:
        part = float(np.dot(weights, places))
        assert 0.0 < part < 1.0
        assert [np.dot(weights, places**power) for power in range(4)] == pytest.approx([1.0, part, part**2, part**3])


SIZES = ("input.origin", "input.value", "input.largest_step", "sections", "past", "sigma")
POWERS = ("powers", "mains.power", "squares", "null", "size", "strength")


def test_in_another_unit_sizes_and_powers_are_others_and_all_else_is_the_same() -> None:
    """Through rest, a contraction in a swing of the cable, hum from rail to rail, and an electrode that falls off."""
    time, unit = np.arange(1600) / 1000.0, 2.0**10
    x = background(1000.0, 1600, np.random.default_rng(3)) + contractions(1000.0, [(0.4, 0.9, 0.1)], 1600)
    x += 0.2 * np.sin(12.0 * np.pi * time) * (np.abs(time - 0.6) < 0.1) + np.sign(np.sin(100.0 * np.pi * time)) * (
        (time > 1.2) & (time < 1.3)
    )
    x[1500:] = 0.3
    one, other = (prepare_onset(1000.0, of_wearer(0.8 * NOISE * scale)) for scale in (1.0, unit))
    small, large = onset_start(one, float(x[0])), onset_start(other, unit * float(x[0]))
    parts = names(small)
    scales = [unit if one.startswith(SIZES) else unit**2 if one.startswith(POWERS) else 1.0 for one in parts]
    scale = np.array(scales)
    shift = np.where(np.array(parts) == "rest.level", 2.0 * np.log(unit), 0.0)
    found = set()
    for value in x.tolist():
        small, active, trouble = onset_step(one, small, value)
        large, *same = onset_step(other, large, unit * value)
        assert same == [active, trouble]
        found.add((active, int(trouble)))
        np.testing.assert_allclose(flat(large), scale * flat(small) + shift, rtol=1e-9, atol=1e-12)
    assert len(found) >= 4


def found_in(name: str, folder: Path, by: OnsetSettings = DEFAULTS) -> Findings:
    log, labels = read_emg(folder / "emg" / f"{name}.csv.gz"), read_labels(folder / "emg" / f"{name}.labels.csv")
    return find(log.values, log.rate, labels, settings=by)


@pytest.mark.parametrize("name", RECORDINGS)
def test_recorded_contractions_are_found_each_once(name: str, shared_data: Path) -> None:
    found = found_in(name, shared_data).score
    assert (found.detections, found.misses, found.false_activations) == (RECORDINGS[name], 0, 0)
    assert found.latency_median_s is not None
    assert found.latency_median_s <= 0.150


@pytest.mark.parametrize("shortest", [0.1, 1.0])
@pytest.mark.parametrize("name", ["biceps_bursts", "biceps_fatigue", "adductor_pollicis_twitches"])
def test_a_contraction_that_is_told_after_its_end_is_right_and_one_that_is_too_short_is_no_miss(
    name: str, shortest: float, shared_data: Path
) -> None:
    found = found_in(name, shared_data, DEFAULTS._replace(shortest=shortest)).score
    assert (found.misses, found.false_activations) == (0, 0)
    assert found.rejected == (12 if name == "adductor_pollicis_twitches" and shortest == 1.0 else 0)


def test_what_is_shorter_than_chosen_is_not_told_and_the_rest_is_told_so_much_later(shared_data: Path) -> None:
    waits = DEFAULTS._replace(shortest=0.1)
    prompt, late = (found_in("biceps_fatigue", shared_data, by).score for by in (DEFAULTS, waits))
    assert late.detections == prompt.detections
    assert late.latency_median_s == pytest.approx(prompt.latency_median_s + 0.1, abs=2e-3)
    assert found_in("adductor_pollicis_twitches", shared_data, DEFAULTS._replace(shortest=1.0)).score.detections == 0


@pytest.mark.parametrize(
    ("rate", "mains", "seed"),
    [
        (1000.0, 60.0, 1),
        (2000.0, 50.0, 1),
        pytest.param(1000.0, 50.0, 1, marks=LONG),
        pytest.param(2000.0, 60.0, 2, marks=LONG),
    ],
)
def test_half_an_hour_of_rest_with_hum_moving_and_lost_electrodes_is_no_contraction(
    rate: float, mains: float, seed: int
) -> None:
    values, happened = rest(rate, 1800.0, seed=seed, mains=mains)
    detected = OnsetDetector(rate).feed(values)
    assert len(happened) > 590
    assert spans(detected.active, rate) == []


@pytest.mark.parametrize(
    "rate", [400.0, 1111.1, *(pytest.param(r, marks=LONG) for r in (900.0, 1000.0, 2000.0, 5000.0))]
)
@pytest.mark.parametrize("scale", [1.0, 1e-3, 1e3])
def test_contractions_are_found_at_any_rate_and_in_any_unit(rate: float, scale: float) -> None:
    want = [(3.0 + 2.0 * i, 3.9 + 2.0 * i, NOISE * size) for i, size in enumerate((8.0, 15.0, 40.0, 8.0, 100.0))]
    count = round(14.0 * rate)
    values = background(rate, count, np.random.default_rng(5)) + contractions(rate, want, count, 5)
    got = find(scale * (values + 0.4), rate, [(on, off) for on, off, _ in want]).score
    assert (got.misses, got.false_activations) == (0, 0)
    assert got.latency_max_s is not None
    assert got.latency_max_s < 0.12


@pytest.mark.parametrize("rate", [1000.0, 2000.0, 5000.0])
def test_contractions_that_saturate_the_amplifier_are_found(rate: float) -> None:
    """At 0.7 of their standard deviation: half of the samples are at a rail."""
    want = [(3.0 + 3.0 * i, 4.5 + 3.0 * i, 40.0 * NOISE) for i in range(10)]
    count = round(34.0 * rate)
    values = background(rate, count, np.random.default_rng(31)) + contractions(rate, want, count, 31)
    rail = 0.7 * 40.0 * NOISE
    got = find(np.clip(values, -rail, rail), rate, [(on, off) for on, off, _ in want]).score
    assert (got.misses, got.false_activations) == (0, 0)


def swung(times: float) -> list[tuple[float, float]]:
    """What is found in a contraction that comes `times` its size deep in a swing of the cable at 6 Hz."""
    count, size = 6000, 40.0 * NOISE
    time = np.arange(count) / 1000.0
    values = background(1000.0, count, np.random.default_rng(8))
    values += contractions(1000.0, [(3.0, 4.0, size)], count, 8)
    values += times * size * np.sin(2.0 * np.pi * 6.0 * time) * (np.abs(time - 3.0) < 1.5)
    return spans(OnsetDetector(1000.0).feed(values).active, 1000.0)


def test_a_contraction_is_found_in_a_swing_of_its_own_size_and_not_in_one_that_buries_it() -> None:
    for times in (0.0, 1.0, 5.0):
        ((on, _),) = swung(times)
        assert 3.0 < on < 3.12
    assert not [on for on, _ in swung(60.0) if on < 4.0]


def test_a_contraction_ends_when_the_electrode_falls_off() -> None:
    count = 6000
    values = background(1000.0, count, np.random.default_rng(2)) + contractions(1000.0, [(2.0, 5.0, 0.2)], count)
    values[3000:] = 0.1
    detected = OnsetDetector(1000.0).feed(values)
    ((on, off),) = spans(detected.active, 1000.0)
    assert 2.0 < on < 2.12
    assert 3.0 < off < 3.03
    assert np.all(detected.trouble[3100:] == 1.0)
    values[3000:] = np.nan
    ((first, last),) = spans(OnsetDetector(1000.0).feed(values).active, 1000.0)
    assert (first, last) == pytest.approx((on, off), abs=2e-3)


DEAD = ("zero", "offset", "missing", "hum", "clipped")


def killed(values: np.ndarray, rate: float, kind: str, begin: float, lasts: float) -> np.ndarray:
    """The signal with nothing of the muscle in it for a while, from `begin` on [s]."""
    dead = slice(round(begin * rate), round((begin + lasts) * rate))
    time = np.arange(len(values))[dead] / rate
    hum = 1.5 * np.sin(2.0 * np.pi * 60.1 * time + 1.0)
    out = values.copy()
    out[dead] = {"zero": 0.0, "offset": 0.3, "missing": np.nan, "hum": hum, "clipped": np.clip(20.0 * hum, -1.5, 1.5)}[
        kind
    ]
    return out


@pytest.mark.parametrize("kind", DEAD)
@pytest.mark.parametrize("rate", [1000.0, 2000.0])
def test_an_input_that_is_dead_at_first_begins_at_rest(kind: str, rate: float) -> None:
    count = round(20.0 * rate)
    calm = 0.4 + background(rate, count, np.random.default_rng(21))
    for lasts in (0.05, 0.3, 1.0, 5.0):
        values = killed(calm, rate, kind, 0.0, lasts)
        assert spans(OnsetDetector(rate).feed(values).active, rate) == []
        values += contractions(rate, [(9.0, 10.0, 8.0 * NOISE)], count, 21)
        ((on, _),) = spans(OnsetDetector(rate).feed(values).active, rate)
        assert 9.0 < on < 9.15


@pytest.mark.parametrize("kind", DEAD)
@pytest.mark.parametrize("louder", [1.0, 4.0])
def test_an_electrode_that_dies_and_comes_back_another_is_at_rest(kind: str, louder: float) -> None:
    values = background(1000.0, 30_000, np.random.default_rng(22))
    values[8000:] *= louder
    for lasts in (1.0, 4.0):
        found = OnsetDetector(1000.0).feed(0.4 + killed(values, 1000.0, kind, 8.0 - lasts, lasts))
        assert spans(found.active, 1000.0) == []


@pytest.mark.parametrize("share", [0.3, 0.1, 0.01])
def test_a_start_too_quiet_is_got_over_and_harmless_where_the_wearer_is_known(share: float) -> None:
    for seed in range(4):
        values = background(1000.0, 60_000, np.random.default_rng(seed))
        values[:1000] *= share
        ((on, off),) = spans(OnsetDetector(1000.0).feed(values).active, 1000.0)
        assert off - on < 30.0
        known = of_wearer(0.8 * NOISE)
        assert spans(OnsetDetector(1000.0, known).feed(values).active, 1000.0) == []
        values[1000:1800] *= share  # the file bounds rest until two seconds of it have been seen
        assert spans(OnsetDetector(1000.0, known).feed(values).active, 1000.0) == []
        if share < 0.05:  # an amplifier that is muted shows no rest
            values[1800:6000] *= share
            assert spans(OnsetDetector(1000.0, known).feed(values).active, 1000.0) == []


@pytest.mark.parametrize("quiet", [1.0, 0.1])
def test_a_wearer_who_is_known_has_no_contraction_below_a_twentieth_of_the_largest(quiet: float) -> None:
    want = [(20.0 + 3.0 * i, 21.5 + 3.0 * i, share * NOISE) for i, share in enumerate((100.0, 300.0, 1000.0))]
    bumps = [(5.0 + 3.0 * i, 6.0 + 3.0 * i, 30.0 * NOISE) for i in range(4)]
    values = quiet * background(1000.0, 30_000, np.random.default_rng(8))
    values += contractions(1000.0, bumps + want, 30_000, 8)
    assert len(spans(OnsetDetector(1000.0).feed(values).active, 1000.0)) == 7
    found = spans(OnsetDetector(1000.0, of_wearer(NOISE, 1000.0 * NOISE)).feed(values).active, 1000.0)
    assert [on for on, _ in found] == pytest.approx([on for on, _, _ in want], abs=0.2)


def test_flexions_over_a_raised_tone_are_no_rest(shared_data: Path) -> None:
    log = read_emg(shared_data / "cases" / "emg_three_flexions.csv.gz")
    assert len(spans(OnsetDetector(log.rate).feed(log.values).active, log.rate)) in (3, 4)


@pytest.mark.parametrize("rate", [1000.0, 1111.1, *(pytest.param(r, marks=LONG) for r in (900.0, 1925.9))])
@pytest.mark.parametrize("mains", [50.0, 60.0])
@pytest.mark.parametrize("noisy", [0.0, NOISE])
def test_hum_from_rail_to_rail_is_no_contraction_at_any_rate(rate: float, mains: float, noisy: float) -> None:
    random, count = np.random.default_rng(23), round(60.0 * rate)
    values = background(rate, count, random)
    for begin in np.arange(3.0, 57.0, 3.0):
        at = slice(round(begin * rate), round((begin + random.uniform(0.3, 1.5)) * rate))
        hum = np.sin(2.0 * np.pi * (mains + random.uniform(-0.2, 0.2)) * np.arange(count)[at] / rate)
        rails = np.sign(hum) if random.random() < 0.5 else np.clip(random.uniform(3.0, 20.0) * hum, -1.0, 1.0)
        values[at] = random.uniform(0.5, 5.0) * rails + noisy * random.normal(size=len(hum))
    assert spans(OnsetDetector(rate).feed(values).active, rate) == []


@pytest.mark.parametrize("rate", [1000.0, 2000.0])
@pytest.mark.parametrize("mains", [50.0, 60.0])
@pytest.mark.parametrize("size", [0.0, 0.5, 1.0, 2.0])
def test_contractions_are_found_in_hum_of_up_to_twice_their_size(rate: float, mains: float, size: float) -> None:
    """It begins with the signal; what is learned of rest does not grow from one contraction to the next."""
    want = [(3.0 + 3.0 * i, 4.5 + 3.0 * i, 8.0 * NOISE) for i in range(20)]
    count = round(64.0 * rate)
    values = background(rate, count, np.random.default_rng(24)) + contractions(rate, want, count, 24)
    values += size * 8.0 * NOISE * np.sqrt(2.0) * np.sin(2.0 * np.pi * mains * np.arange(count) / rate)
    got = find(values, rate, [(on, off) for on, off, _ in want]).score
    assert (got.misses, got.false_activations) == (0, 0)
    assert got.latency_median_s is not None
    assert got.latency_median_s < (0.15 if size < 2.0 else 0.2)


def test_rest_that_is_louder_than_before_becomes_rest() -> None:
    count = 240_000
    noise_then = background(1000.0, count, np.random.default_rng(3))
    noise_then[20_000:] *= 8.0
    detected = OnsetDetector(1000.0).feed(noise_then)
    assert detected.active[21_000] == 1.0
    assert detected.active[-20_000:].max() == 0.0


@pytest.mark.parametrize("huge", [1e13, 1e100, 1e160, -1e308])
def test_a_sample_that_no_converter_gives_is_a_missing_one(huge: float) -> None:
    values = background(1000.0, 12_000, np.random.default_rng(1))
    values += contractions(1000.0, [(8.0, 9.0, 0.08)], len(values), 1)
    values[4000] = huge
    detected = OnsetDetector(1000.0).feed(values)
    ((on, off),) = spans(detected.active, 1000.0)
    assert 8.0 < on < 8.15
    assert 9.0 < off < 9.4


@pytest.mark.parametrize("ratio", [6.0, 30.0])
def test_a_contraction_of_two_minutes_lasts_as_long(ratio: float) -> None:
    values = background(1000.0, 140_000, np.random.default_rng(4))
    values += contractions(1000.0, [(15.0, 135.0, ratio * NOISE)], len(values), 4)
    ((on, off),) = spans(OnsetDetector(1000.0).feed(values).active, 1000.0)
    assert 15.0 < on < 15.15
    assert 134.5 < off < 135.5


def test_scores_of_detections_that_are_early_late_twice_or_nowhere() -> None:
    labels = [(1.0, 2.0), (4.0, 5.0), (8.0, 9.0)]
    found = [(0.9, 1.2), (1.5, 1.9), (3.0, 4.5), (8.2, 9.5)]
    got = score(found, labels, 60.0)
    assert (got.detections, got.misses, got.false_activations, got.false_per_minute) == (4, 1, 2, 2.0)
    assert got.latency_median_s == pytest.approx(0.05)
    assert got.latency_max_s == pytest.approx(0.2)
    late = score([(3.6, 4.0)], [(3.0, 3.2), (5.0, 5.2), (7.0, 8.0)], 60.0, 0.5)
    assert (late.misses, late.rejected, late.false_activations) == (1, 1, 0), "told 0.4 s after the end"
    assert late.latency_max_s == pytest.approx(0.6)
    assert score([], labels, 60.0).latency_max_s is None
    assert score(found, None, 60.0).misses is None
    assert score(found, [], 60.0).false_activations == 4


@pytest.mark.parametrize("swing", [1.0, 3.0, 10.0])
def test_a_movement_just_before_a_contraction_does_not_hide_it(swing: float) -> None:
    """A wearer who has just moved contracts: slow swings of a second are no rest, and what follows them is none."""
    count, want = 20000, [(5.0, 6.0, 8.0 * NOISE), (9.0, 10.0, 8.0 * NOISE), (14.0, 15.0, 8.0 * NOISE)]
    for seed, frequency in ((31, 4.0), (32, 6.0), (33, 8.0)):
        values = background(1000.0, count, np.random.default_rng(seed)) + contractions(1000.0, want, count, seed)
        time = np.arange(count) / 1000.0
        for begin, end in ((3.7, 4.85), (12.7, 13.6)):
            moved = (time > begin) & (time < end)
            values[moved] += swing * 8.0 * NOISE * np.sin(2.0 * np.pi * frequency * (time[moved] - begin))
        got = find(values, 1000.0, [(on, off) for on, off, _ in want]).score
        assert (got.misses, got.false_activations) == (0, 0)


def test_only_what_is_contracted_while_rest_is_measured_anew_is_lost() -> None:
    """Hum of thirty times rest goes just before the first, and the electrode comes back in the second."""
    time = np.arange(16000) / 1000.0
    want = [(4.2, 5.4, 8.0 * NOISE), (6.6, 7.8, 8.0 * NOISE), (9.5, 10.5, 8.0 * NOISE), (12.5, 13.5, 8.0 * NOISE)]
    values = background(1000.0, 16000, np.random.default_rng(41)) + contractions(1000.0, want, 16000, 41)
    values += np.where(time < 4.0, 30.0 * NOISE * np.sin(2.0 * np.pi * 50.0 * time), 0.0)
    values[(time > 9.7) & (time < 10.3)] = np.nan
    found = [on for on, _ in spans(OnsetDetector(1000.0).feed(values).active, 1000.0)]
    for on, _, _ in want[1:]:
        assert any(on < told < on + 0.15 for told in found)


@pytest.mark.parametrize("counts", [0.5, 0.4])
def test_a_converter_whose_count_is_larger_than_rest_will_do(counts: float) -> None:
    want = [(4.0, 5.5, 8.0 * NOISE), (7.0, 8.3, 8.0 * NOISE)]
    for seed in (51, 52):
        values = background(1000.0, 10000, np.random.default_rng(seed)) + contractions(1000.0, want, 10000, seed)
        got = find(np.round(values / NOISE * counts + 500.2), 1000.0, [(on, off) for on, off, _ in want]).score
        assert (got.misses, got.false_activations) == (0, 0)


def test_a_wearer_whose_rest_was_louder_when_measured_loses_no_contraction() -> None:
    want = [(6.0, 7.0, 4.0 * NOISE), (10.0, 11.0, 4.0 * NOISE), (14.0, 15.0, 4.0 * NOISE)]
    values = background(1000.0, 17_000, np.random.default_rng(6)) + contractions(1000.0, want, 17_000, 6)
    found = spans(OnsetDetector(1000.0, of_wearer(5.0 * NOISE)).feed(values).active, 1000.0)
    without = spans(OnsetDetector(1000.0).feed(values).active, 1000.0)
    assert [round(on) for on, _ in found] == [6, 10, 14]
    assert [on for on, _ in found] == pytest.approx([on for on, _ in without], abs=0.05)


def test_a_wearer_whose_rest_was_louder_when_measured_loses_nothing_of_a_long_contraction_soon_after_another() -> None:
    """What is known of rest is forgotten in it; the file must not bound rest again meanwhile."""
    want = [(5.0, 6.5, 8.0 * NOISE), (7.2, 24.2, 8.0 * NOISE)]
    values = background(1000.0, 28_000, np.random.default_rng(7)) + contractions(1000.0, want, 28_000, 7)
    found = spans(OnsetDetector(1000.0, of_wearer(5.0 * NOISE)).feed(values).active, 1000.0)
    without = spans(OnsetDetector(1000.0).feed(values).active, 1000.0)
    assert np.ravel(found)[:3] == pytest.approx(np.ravel(without)[:3], abs=0.1)
    assert found[1][1] == pytest.approx(without[1][1], abs=1.0)


def test_a_contraction_soon_after_another_lasts_half_a_minute_and_a_rest_that_is_louder_after_one_is_rest() -> None:
    want = [(10.0, 14.0, 30.0 * NOISE), (14.8, 44.8, 30.0 * NOISE)]
    values = background(1000.0, 60_000, np.random.default_rng(4))
    values[44_800:] *= 2.0
    values += contractions(1000.0, want, 60_000, 4)
    (_, (on, off)) = spans(OnsetDetector(1000.0).feed(values).active, 1000.0)
    assert 14.8 < on < 14.95
    assert 44.5 < off < 46.0
