"""Onset and end of a muscle's contraction in surface EMG: a causal likelihood ratio, in any unit at any sample rate.

The band from 40 to 400 Hz is looked at in three ways: as it is, and less itself one mains period ago, of 50 and of
60 Hz. Hum is missing in one of the latter, a muscle's noise in none; so all three must say what follows.

**What can be there without a contraction** is one power, the null:

    v₀ = exp(m + z·√(s² + u)) + λ₁·P + λ₂·B + λ₃·W² + min(λ₄·L, λ₅·S²) + (λ₆·A)²

m and s are level and spread of the log of power at rest, averaged over 0.1 s, and u is the variance of what is not
known of it: large at first, less after a contraction, which leaves another rest than it found, and e^(−t/T) of it after
t seconds of rest. P and B, powers above 20 Hz and in the band, and W, the recent peak of what is faster than 5 Hz, leak
a known share into what is new in the band, be they movement or mains. L is the power from 20 to 30 Hz and S the recent
peak from 5 to 15 Hz: a swing's spectrum falls steeply from below 20 Hz, so that L bounds what of it is in the band, and
a muscle alone has no S. A is the size of the contraction that lasts or has just ended, which leaves a tail.

**OnsetEvidence.** Noise of bandwidth B whose power r = x²/v₀ rises by ρ² gains log likelihood against rest,

    Λ ← max(0, Λ + B·dt·((1 − 1/ρ²)·min(r, K) − log ρ²))

which is Page's cumulative sum (1954) with a ratio bounded as Huber's (1965): no click weighs more than its time.
An onset is Λ ≥ h. h follows from how rarely rest may pass for a contraction, and K from the least time that one takes:
B·((1 − 1/ρ²)·K − log ρ²)·brief = h. There are two such sums, of r averaged over 5 ms, for strong contractions, and over
0.1 s, for weak ones, whose spikes are far apart. The end is the same sum with signs turned and half of log ρ².

**Rest** is learned as a mean with forgetting, anew after each contraction, of what is below v₀·ρ²·log ρ²/(ρ² − 1) while
there is little evidence, in steps of at most z standard deviations upward; more than that only at a share of the speed,
and in a contraction too, so that a step of rest is got over. What is quieter is learned at once: it cannot be a
contraction. Nothing is learned from a signal that leaks explain, or that is dead. Where an electrode was off, or mains
are gone that covered the signal, it starts again.

A signal is dead that repeats one value for 20 ms, and one on its rails hardly moves for most of the time between its
largest steps, as hum does that is clipped.
"""

import math
from enum import IntEnum
from typing import NamedTuple

from bowden.core.kernel import exp, kernel, log, sqrt
from bowden.sensing.biquad import EMPTY, PASS, Biquad, Memory, biquad, butterworth, critical_high_pass
from bowden.sensing.detector import Detector, Trouble
from bowden.sensing.onset_constants import (
    BAND_HZ,
    BANDWIDTH,
    BROAD,
    CHANGED,
    DOUBT,
    FALLS,
    FAMILIAR,
    FLAT,
    FORGET,
    GONE,
    LEARNT,
    LIFTED,
    MAINS_LEVEL,
    MEMORY,
    MOVED,
    MUTED,
    REPEATS,
    SILENT,
    SLOW,
    SLOW_HZ,
    SPREAD,
    STAYS,
    STEEP,
    STEEP_HZ,
    STEPS,
    STILL,
    STUCK,
    SURE,
    SWING_HZ,
    TAIL_SHARE,
    TOP_HZ,
    UNKNOWN,
    WEIGHT,
    WIDE_HZ,
)
from bowden.sensing.onset_settings import DEFAULTS, LARGEST, QUICKEST, SAFE, SLOWEST, OnsetSettings, of_wearer

MAINS = (50.0, 60.0)
"""[Hz]; both are looked for."""
_SHORT, _LONG, _POWER = 0.005, 0.1, 0.015
"""Time constants of the averages for strong and for weak contractions, and of powers [s]."""
_STEP, _SWING = 0.03, 0.1
"""In which the largest step, and movement's peak, fade [s]."""
_SIZE, _TAIL = 2.0, 0.2
"""In which a contraction's size fades while it lasts, and when it has ended [s]."""
_SETTLES = 0.05
"""Filters and the memory of a period fill in this time [s]."""
_LOOKS = 10.0
"""So often in a second rest has a chance to pass for a contraction: once in `_LONG` [Hz]."""
_LEFT = UNKNOWN * UNKNOWN * math.exp(-MEMORY / LEARNT)
"""u is never less, since rest is remembered for so long only [–]."""
_SPIKY = 3.0
"""Single samples count up to this many times K in the average over 5 ms: noise has them [–]."""


class Ways(NamedTuple):
    """A number for each way in which the band is looked at."""

    plain: float
    fifty: float
    sixty: float


NONE = Ways(0.0, 0.0, 0.0)


class Onset(NamedTuple):
    """The detector at one rate; `prepare_onset` makes it. Times are in samples or per sample."""

    band: Biquad
    top: Biquad
    wide: Biquad
    swing: Biquad
    steep: Biquad
    slow: Biquad
    delay: tuple[int, int]
    """Whole samples of one mains period, for each of `MAINS`."""
    between: tuple[tuple[float, float, float, float], ...]
    """Weights of the samples from one before that to two after."""
    dt: float
    short: float
    long: float
    power: float
    stay: float
    step: float
    swung: float
    size: float
    tail: float
    enough: float
    """h [–]."""
    rested: float
    """OnsetEvidence of rest that ends a contraction [–]."""
    most: float
    """K [–]."""
    gain: float
    """OnsetEvidence of one sample, for each unit of r [–]."""
    drift: float
    """OnsetEvidence that one sample takes away [–]."""
    even: float
    """r that leaves the evidence as it is [–]."""
    gain_of_end: float
    drift_of_end: float
    floor: float
    """m is never less while little of rest has been seen."""
    weakest: float
    """Rest of a wearer is taken to reach this at least: what is larger by ρ² is a contraction."""
    settings: OnsetSettings


class Phase(IntEnum):
    """State of the muscle, reported or not."""

    REST = 0
    CONTRACTION = 1


class InputState(NamedTuple):
    """The raw signal."""

    origin: float
    """Its first value, so that an offset makes no step."""
    value: float
    """The last one; NaN before the first."""
    largest_step: float
    """Recent largest step from one sample to the next."""
    still_share: float
    """Share of recent samples without a step."""
    flat_time: float
    """How long the value has been the same [s]."""


class Sections(NamedTuple):
    """States of the filters."""

    band_first: Memory
    band_second: Memory
    top: Memory
    wide: Memory
    swing: Memory
    steep: Memory
    slow: Memory


class Bands(NamedTuple):
    """One sample in each of the bands."""

    muscle: float
    wide: float
    swing: float
    low: float
    slow: float


class Powers(NamedTuple):
    """Powers and squares of peaks, in the signal's unit squared."""

    wide: float
    """Above 20 Hz."""
    band: float
    """In the band."""
    new: float
    """Least power of the three ways."""
    swing: float
    """Square of the movement's recent peak."""
    low: float
    """From 20 to 30 Hz."""
    slow: float
    """Square of the recent peak from 5 to 15 Hz."""


class Mains(NamedTuple):
    """Mains that cover rest."""

    share: float
    """Of recent rest that they covered."""
    power: float
    """Averaged alike."""


class RestEstimate(NamedTuple):
    """Estimate of the signal at rest."""

    level: float
    """m."""
    spread: float
    """s²."""
    seen: float
    """Rest of which m is the mean; below 0 while filters fill [s]."""
    uncertainty: float
    """u."""


class OnsetEvidence(NamedTuple):
    """Sums of log likelihood."""

    strong: Ways
    """Λ of the short average."""
    weak: Ways
    """Λ of the long one."""
    onset: float
    """Λ on which all three ways agree, the larger of strong and weak."""
    end: float
    """Of rest."""


class Observation(NamedTuple):
    """Evidence of one sample about rest."""

    power: float
    """Of the band over 0.1 s, at least that of a signal that is none."""
    excess: float
    """Log of it over rest, less what hum and movement explain [–]."""
    limit: float
    """Most that counts of the excess, z·√(s² + u) [–]."""
    hidden: bool
    """Hum and movement explain all of it."""
    muted: bool
    """As of an amplifier that is muted."""
    bounded: bool
    """Little is known of rest, and a wearer's file bounds it."""
    speed: float
    """Rest is learned this fast, 0 to 1 [–]."""


class OnsetState(NamedTuple):
    """State of the detector."""

    input: InputState
    sections: Sections
    past: tuple[float, ...]
    """The band's last samples, the newest first, over the longest mains period."""
    powers: Powers
    mains: Mains
    short: Ways
    """r, averaged over 5 ms."""
    long: Ways
    """r, averaged over 0.1 s."""
    squares: Ways
    """x², averaged over 0.1 s."""
    rest: RestEstimate
    null: float
    """v₀."""
    evidence: OnsetEvidence
    phase: Phase
    held: float
    """How long the contraction has lasted [s]."""
    size: float
    """A²."""
    strength: float
    """Mean power on which all three ways agree, of the contraction that lasts or was the last; 0 before the first, and
    where rest starts again."""
    sigma: float
    """σ, the size of rest in the signal's unit."""


def prepare_onset(rate: float, settings: OnsetSettings = DEFAULTS) -> Onset:
    """The detector for `rate` samples a second [Hz], which must be from `SLOWEST` to `QUICKEST`."""
    assert SLOWEST <= rate <= QUICKEST
    by, dt, periods = settings, 1.0 / rate, [rate / mains for mains in MAINS]
    whole = [math.floor(period) for period in periods]
    enough = math.log(by.hours * 3600.0 * _LOOKS)
    share, drift = 1.0 - by.ratio**-2, 2.0 * math.log(by.ratio)
    return Onset(
        band=critical_high_pass(BAND_HZ, rate),
        top=butterworth(TOP_HZ, "low", rate) if 0.4 * rate > TOP_HZ else PASS,
        wide=butterworth(WIDE_HZ, "high", rate),
        swing=butterworth(SWING_HZ, "high", rate),
        steep=butterworth(STEEP_HZ, "low", rate),
        slow=butterworth(SLOW_HZ, "low", rate),
        delay=(whole[0], whole[1]),
        between=(_cubic(periods[0] - whole[0]), _cubic(periods[1] - whole[1])),
        dt=dt,
        short=1.0 - math.exp(-dt / _SHORT),
        long=1.0 - math.exp(-dt / _LONG),
        power=1.0 - math.exp(-dt / _POWER),
        stay=1.0 - math.exp(-dt / STAYS),
        step=math.exp(-dt / _STEP),
        swung=math.exp(-dt / _SWING),
        size=math.exp(-dt / _SIZE),
        tail=math.exp(-dt / _TAIL),
        enough=enough,
        rested=by.quiet * BANDWIDTH * 0.5 * drift,
        most=(enough / (BANDWIDTH * by.brief) + drift) / share,
        gain=BANDWIDTH * dt * share,
        drift=BANDWIDTH * dt * drift,
        even=drift / share,
        gain_of_end=BANDWIDTH * dt * (1.0 - 1.0 / by.ratio),
        drift_of_end=BANDWIDTH * dt * 0.5 * drift,
        floor=2.0 * math.log(by.least),
        weakest=(by.weakest / by.ratio) ** 2,
        settings=by,
    )


def _cubic(part: float) -> tuple[float, float, float, float]:
    """Lagrange's weights of samples at −1, 0, 1 and 2 for the value at `part` between 0 and 1."""
    return (
        -part * (part - 1.0) * (part - 2.0) / 6.0,
        (part + 1.0) * (part - 1.0) * (part - 2.0) / 2.0,
        -(part + 1.0) * part * (part - 2.0) / 2.0,
        (part + 1.0) * part * (part - 1.0) / 6.0,
    )


def onset_start(onset: Onset, first: float) -> OnsetState:
    """Before the `first` sample, which may be NaN."""
    return OnsetState(
        input=InputState(first, math.nan, 0.0, 0.0, 0.0),
        sections=Sections(EMPTY, EMPTY, EMPTY, EMPTY, EMPTY, EMPTY, EMPTY),
        past=(0.0,) * (max(onset.delay) + 2),
        powers=Powers(0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        mains=Mains(0.0, 0.0),
        short=NONE,
        long=NONE,
        squares=NONE,
        rest=RestEstimate(onset.floor, SPREAD * SPREAD, -_SETTLES, UNKNOWN * UNKNOWN),
        null=0.0,
        evidence=OnsetEvidence(NONE, NONE, 0.0, 0.0),
        phase=Phase.REST,
        held=0.0,
        size=0.0,
        strength=0.0,
        sigma=onset.settings.least,
    )


@kernel
def is_sample(value: float) -> bool:
    """A number that a converter can give."""
    return not math.isnan(value) and abs(value) <= LARGEST


@kernel
def take_sample(onset: Onset, state: InputState, value: float) -> InputState:
    """The raw signal with its next `value`; a missing one repeats the last."""
    present = is_sample(value)
    raw = value if present else state.value
    origin = state.origin if is_sample(state.origin) else raw
    step = 0.0 if math.isnan(state.value) else abs(raw - state.value)
    largest_step = max(step, state.largest_step * onset.step)
    still = 1.0 if step <= STILL * largest_step else 0.0
    still_share = state.still_share + onset.power * (still - state.still_share)
    changes = present and raw != state.value
    flat_time = 0.0 if changes else state.flat_time + onset.dt
    return InputState(origin, raw, largest_step, still_share, flat_time)


@kernel
def filter_sample(onset: Onset, state: Sections, x: float) -> tuple[Sections, Bands]:
    """One sample through all filters."""
    band_first, half = biquad(onset.band, state.band_first, x)
    band_second, above = biquad(onset.band, state.band_second, half)
    top, muscle = biquad(onset.top, state.top, above)
    wide, wide_part = biquad(onset.wide, state.wide, x)
    swing, swing_part = biquad(onset.swing, state.swing, x)
    steep, low_part = biquad(onset.steep, state.steep, wide_part)
    slow, slow_part = biquad(onset.slow, state.slow, swing_part)
    after = Sections(band_first, band_second, top, wide, swing, steep, slow)
    return after, Bands(muscle, wide_part, swing_part, low_part, slow_part)


@kernel
def _before(past: tuple[float, ...], whole: int, weights: tuple[float, float, float, float]) -> float:
    """The band one mains period ago, between samples."""
    return (
        weights[0] * past[whole - 2]
        + weights[1] * past[whole - 1]
        + weights[2] * past[whole]
        + weights[3] * past[whole + 1]
    )


@kernel
def squares_of_ways(onset: Onset, past: tuple[float, ...], band: float) -> Ways:
    """x² of the band as it is, and less itself one mains period ago."""
    fifty = band - _before(past, onset.delay[0], onset.between[0])
    sixty = band - _before(past, onset.delay[1], onset.between[1])
    return Ways(band * band, 0.5 * fifty * fifty, 0.5 * sixty * sixty)


@kernel
def _least(values: Ways) -> float:
    return min(values.plain, min(values.fifty, values.sixty))


@kernel
def _bounded(values: Ways, most: float) -> Ways:
    return Ways(min(values.plain, most), min(values.fifty, most), min(values.sixty, most))


@kernel
def _averaged(before: Ways, values: Ways, most: float, share: float) -> Ways:
    """One sample into an average of each way, with values up to `most`."""
    bounded = _bounded(values, most)
    return Ways(
        before.plain + share * (bounded.plain - before.plain),
        before.fifty + share * (bounded.fifty - before.fifty),
        before.sixty + share * (bounded.sixty - before.sixty),
    )


@kernel
def update_powers(onset: Onset, state: Powers, bands: Bands, squares: Ways) -> Powers:
    """Powers and peaks with one sample more."""
    return Powers(
        wide=state.wide + onset.power * (bands.wide * bands.wide - state.wide),
        band=state.band + onset.power * (squares.plain - state.band),
        new=state.new + onset.power * (_least(squares) - state.new),
        swing=max(bands.swing * bands.swing, state.swing * onset.swung),
        low=state.low + onset.power * (bands.low * bands.low - state.low),
        slow=max(bands.slow * bands.slow, state.slow * onset.swung),
    )


@kernel
def is_railed(signal: InputState, powers: Powers) -> bool:
    """Hardly moves between its largest steps, as clipped hum does; rest of half a count has small steps."""
    loud = powers.wide > STEPS * signal.largest_step * signal.largest_step
    return signal.still_share > STUCK and loud


@kernel
def trouble_of(dead: bool, railed: bool, powers: Powers, usual: float) -> Trouble:
    """Trouble with the signal, whose power at rest is `usual`."""
    if dead:
        return Trouble.DEAD
    explained = powers.new < BROAD * powers.wide or powers.new < MOVED * powers.swing or railed
    if explained and powers.wide > 9.0 * usual:
        return Trouble.MOVEMENT_OR_MAINS
    return Trouble.NONE


@kernel
def power_beside_rest(powers: Powers, size: float) -> float:
    """Power that hum, movement and the last contraction's tail put into the band: all of v₀ but rest."""
    swinging = MOVED * powers.swing + min(STEEP * powers.low, SLOW * powers.slow)
    return REPEATS * powers.band + BROAD * powers.wide + swinging + TAIL_SHARE * TAIL_SHARE * size


@kernel
def bound_of_rest(onset: Onset, strength: float) -> float:
    """Below which rest is, since the last contraction was larger by ρ; infinite before the first."""
    strong = onset.settings.strong
    bound = strong * strong if strong > 0.0 else math.inf
    if strength > 0.0:
        bound = min(bound, strength / (onset.settings.ratio * onset.settings.ratio))
    return bound


@kernel
def is_beyond_rest(power: float, bound: float, rest: RestEstimate) -> bool:
    """True if a power is none of rest, which is below the `bound`.

    Where rest's level is above that, it was no contraction, and bounds nothing.
    """
    return power >= bound and bound > exp(rest.level)


@kernel
def learning_speed(onset: Onset, state: OnsetState, power: float, dead: bool) -> float:
    """How fast rest is learned, 0 to 1 [–]."""
    if state.phase == Phase.CONTRACTION or dead:
        return 0.0
    if power >= onset.even * state.null or is_beyond_rest(power, bound_of_rest(onset, state.strength), state.rest):
        return DOUBT
    return 1.0 if state.evidence.onset < 0.25 * onset.enough else 0.0


@kernel
def observe_rest(onset: Onset, state: OnsetState, power: float, beside: float, dead: bool) -> Observation:
    """Evidence about rest in the band's `power` over 0.1 s, of which `beside` is not rest."""
    least, rest = onset.settings.least, state.rest
    # in a contraction rest is forgotten, and a level that rises would end it
    bounded = state.phase == Phase.REST and rest.uncertainty > FAMILIAR
    bound = least if bounded else SILENT
    observed = max(power, bound * bound)
    excess = log(observed) - rest.level
    if excess > 0.0:
        excess = max(0.0, excess - log(1.0 + beside / (state.sigma * state.sigma)))
    limit = SURE * sqrt(rest.spread + rest.uncertainty)
    muted = power < MUTED * MUTED * least * least
    return Observation(
        observed, excess, limit, beside > observed, muted, bounded, learning_speed(onset, state, observed, dead)
    )


@kernel
def learn_level(phase: Phase, rest: RestEstimate, seen: Observation, dt: float) -> float:
    """m with one sample more of a signal that is not dead."""
    if rest.seen <= 0.0:
        return log(seen.power)
    count = rest.seen + _LONG
    if seen.excess < -seen.limit:  # cannot be a contraction
        return rest.level + dt * (seen.excess / min(count, FALLS))
    if phase == Phase.CONTRACTION:
        return rest.level + dt * (DOUBT * max(0.0, seen.excess) / count)
    if seen.excess < 0.0:
        return rest.level + dt * (seen.excess / count)
    if seen.hidden:
        return rest.level
    return rest.level + dt * (seen.speed * min(seen.excess, seen.limit) / count)


@kernel
def learn_rest(onset: Onset, phase: Phase, rest: RestEstimate, seen: Observation, dead: bool) -> RestEstimate:
    """Rest with one sample more; in a contraction it is forgotten."""
    dt, spread, uncertainty = onset.dt, rest.spread, rest.uncertainty
    level = rest.level if dead else learn_level(phase, rest, seen, dt)
    if phase == Phase.CONTRACTION:
        doubted = min(UNKNOWN * UNKNOWN, uncertainty * (1.0 + dt * FORGET / LEARNT))
        return RestEstimate(level, spread, max(0.0, rest.seen - dt * FORGET), doubted)
    if seen.bounded:
        level = max(level, onset.floor)
    if rest.seen > 1.0 and not seen.hidden:
        share = seen.speed * dt / (rest.seen + _LONG + WEIGHT)
        spread = spread + share * (min(seen.excess * seen.excess, seen.limit * seen.limit) - spread)
    if rest.seen > 0.0 and not seen.muted:
        uncertainty = uncertainty * (1.0 - seen.speed * dt / LEARNT)
    return RestEstimate(level, spread, min(rest.seen + seen.speed * dt, MEMORY), max(_LEFT, uncertainty))


@kernel
def rest_at_onset(rest: RestEstimate, familiar: bool) -> RestEstimate:
    """Estimate of rest kept when a contraction begins: a level that is to outlast it."""
    seen = min(rest.seen + LEARNT, MEMORY) if familiar else max(rest.seen, LEARNT)
    return RestEstimate(rest.level, rest.spread, seen, rest.uncertainty)


@kernel
def rest_at_end(rest: RestEstimate) -> RestEstimate:
    """Estimate of rest kept when a contraction ends, which leaves another rest than it found."""
    return RestEstimate(rest.level, rest.spread, min(rest.seen, _LONG), max(rest.uncertainty, CHANGED * CHANGED))


@kernel
def update_mains(onset: Onset, state: Mains, powers: Powers, hidden: bool) -> Mains:
    """Mains that cover rest, with one sample of rest more; what swings slowly is movement."""
    covers = 1.0 if hidden and powers.wide > MAINS_LEVEL * powers.swing else 0.0
    power = powers.wide if hidden else 0.0
    return Mains(state.share + onset.stay * (covers - state.share), state.power + onset.stay * (power - state.power))


@kernel
def _summed(onset: Onset, before: Ways, ratio: Ways, most: float) -> Ways:
    """Λ of each way, up to `most`."""
    bounded = _bounded(ratio, onset.most)
    return Ways(
        min(most, max(0.0, before.plain + onset.gain * bounded.plain - onset.drift)),
        min(most, max(0.0, before.fifty + onset.gain * bounded.fifty - onset.drift)),
        min(most, max(0.0, before.sixty + onset.gain * bounded.sixty - onset.drift)),
    )


@kernel
def sum_evidence(onset: Onset, state: OnsetEvidence, short: Ways, long: Ways, most: float) -> OnsetEvidence:
    """OnsetEvidence for an onset, up to `most`, and for an end, with one sample more."""
    strong = _summed(onset, state.strong, short, most)
    weak = _summed(onset, state.weak, long, most)
    quiet = onset.drift_of_end - onset.gain_of_end * min(_least(short), onset.most)
    return OnsetEvidence(strong, weak, max(_least(strong), _least(weak)), max(0.0, state.end + quiet))


@kernel
def next_phase(onset: Onset, phase: Phase, evidence: OnsetEvidence, dead: bool) -> Phase:
    """Rest becomes a contraction with enough evidence for it, and a contraction rest likewise, or with its signal."""
    if phase == Phase.REST and evidence.onset >= onset.enough:
        return Phase.CONTRACTION
    if phase == Phase.CONTRACTION and (evidence.end > onset.rested or dead):
        return Phase.REST
    return phase


@kernel
def largest_rest(onset: Onset, rest: RestEstimate, limit: float, bound: float) -> float:
    """Upper bound on rest: its level raised by `limit`, whose allowance for the unknown ends at the `bound`."""
    largest = exp(rest.level + limit)
    if is_beyond_rest(largest, bound, rest):
        largest = min(largest, max(exp(rest.level + SURE * sqrt(rest.spread)), bound))
    return max(largest, onset.weakest)


@kernel
def mean_strength(onset: Onset, state: OnsetState, power: float) -> float:
    """Mean power of a contraction, with one sample more; what speaks for its end does not count."""
    if state.phase == Phase.REST:
        return power
    if state.evidence.end > 0.0:
        return state.strength
    return state.strength + onset.dt / (state.held + onset.dt) * (power - state.strength)


@kernel
def onset_step(onset: Onset, state: OnsetState, value: float) -> tuple[OnsetState, bool, Trouble]:
    """One sample, in any unit; NaN, or beyond `LARGEST`, where it is missing.

    Returns:
        The state, whether the muscle contracts, and what is wrong with the signal.
    """
    signal = take_sample(onset, state.input, value)
    x = 0.0 if math.isnan(signal.value) else signal.value - signal.origin
    sections, bands = filter_sample(onset, state.sections, x)
    square = squares_of_ways(onset, state.past, bands.muscle)
    powers = update_powers(onset, state.powers, bands, square)
    most_square = onset.most * state.null if state.rest.seen > 0.0 else math.inf
    squares = _averaged(state.squares, square, most_square, onset.long)

    dead = signal.flat_time > FLAT
    railed = is_railed(signal, powers)
    trouble = trouble_of(dead, railed, powers, state.sigma * state.sigma)

    # rest; it is another one where an electrode was off, or mains are gone that covered it
    beside = power_beside_rest(powers, state.size)
    seen = observe_rest(onset, state, _least(squares), beside, dead)
    rest, mains, gone = learn_rest(onset, state.phase, state.rest, seen, dead), state.mains, False
    if state.phase == Phase.REST:
        mains = mains if dead else update_mains(onset, mains, powers, seen.hidden)
        gone = mains.share > 0.5 and powers.wide < GONE * mains.power
    if gone:
        mains = Mains(0.0, 0.0)
    if gone or signal.flat_time > LIFTED:
        rest = RestEstimate(rest.level, rest.spread, -_SETTLES, UNKNOWN * UNKNOWN)
    strength = 0.0 if rest.seen <= 0.0 else state.strength

    # evidence for an onset, and for an end
    null = largest_rest(onset, rest, seen.limit, bound_of_rest(onset, strength)) + beside
    ratio = Ways(square.plain / null, square.fifty / null, square.sixty / null)
    short = _averaged(state.short, ratio, _SPIKY * onset.most, onset.short)
    long = _averaged(state.long, ratio, onset.most, onset.long)
    silent = dead or railed or signal.largest_step <= 0.0
    evidence = sum_evidence(onset, state.evidence, short, long, 0.0 if silent else 2.0 * onset.enough)

    phase = next_phase(onset, state.phase, evidence, dead)
    ends = state.phase == Phase.CONTRACTION and phase == Phase.REST
    if state.phase == Phase.REST and phase == Phase.CONTRACTION:
        rest = rest_at_onset(rest, state.rest.uncertainty <= FAMILIAR)
        evidence = OnsetEvidence(evidence.strong, evidence.weak, evidence.onset, 0.0)
    if ends:
        rest = rest_at_end(rest)
        evidence = OnsetEvidence(NONE, NONE, 0.0, evidence.end)
    if ends or dead or railed:
        short, long, squares = _bounded(short, 1.0), _bounded(long, 1.0), _bounded(squares, null)
    contracts = phase == Phase.CONTRACTION
    held = state.held + onset.dt if contracts else 0.0
    after = OnsetState(
        signal,
        sections,
        (bands.muscle,) + state.past[:-1],  # noqa: RUF005 - Numba takes no star in a tuple
        powers,
        mains,
        short,
        long,
        squares,
        rest,
        null,
        evidence,
        phase,
        held,
        max(powers.new, state.size * onset.size) if contracts else state.size * onset.tail,
        mean_strength(onset, state, powers.new) if contracts else strength,
        exp(0.5 * rest.level),
    )
    return after, contracts and held > onset.settings.shortest, trouble


@kernel
def onset_rest(state: OnsetState) -> float:
    """σ, in the signal's unit."""
    return state.sigma


ONSET = Detector(
    name="onset",
    settings=DEFAULTS,
    prepare=prepare_onset,
    start=onset_start,
    step=onset_step,
    rest=onset_rest,
    of_wearer=of_wearer,
    slowest=SLOWEST,
    safe=SAFE,
    quickest=QUICKEST,
    source="this project; the cumulative sum of Page (1954) with the bounded ratio of Huber (1965)",
)
