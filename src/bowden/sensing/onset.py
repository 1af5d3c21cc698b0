"""Onset and end of a muscle's contraction in surface EMG."""

import math
from typing import NamedTuple

import numpy as np

from bowden.core.kernel import exp, kernel, log, sel
from bowden.sensing.biquad import EMPTY, PASS, Biquad, Memory, biquad, butterworth, critical_high_pass
from bowden.sensing.detector import Detector
from bowden.sensing.onset_settings import DEFAULTS, QUICKEST, SAFE, SLOWEST, OnsetSettings, of_wearer

MAINS = (50.0, 60.0)
"""[Hz]; both are looked for."""


class Onset(NamedTuple):
    band: Biquad
    top: Biquad
    wide: Biquad
    swing: Biquad
    delay: tuple[int, int]
    between: tuple[float, float]
    dt: float
    short: float
    long: float
    power: float
    stay: float
    swung: float
    size: float
    fade: float
    enough: float
    """h, of the evidence for an onset [nats]."""
    rested: float
    cap: float
    even: float
    """gain of power in evidence, nats a second"""
    settings: OnsetSettings


class OnsetState(NamedTuple):
    origin: float
    raw: float
    inner: Memory
    outer: Memory
    top: Memory
    wide: Memory
    slow: Memory
    past: tuple[float, ...]
    power: float
    swing: float
    both: float
    new: float
    covered: float
    hum: float
    leap: float
    stuck: float
    flat: float
    short: tuple[float, float, float]
    mean: tuple[float, float, float]
    long: tuple[float, float, float]
    level: float
    spread: float
    seen: float
    null: float
    size: float
    onset: tuple[float, float, float]
    weak: tuple[float, float, float]
    evidence: float
    end: float
    active: float
    held: float
    rest: float


def _cubic(part):
    f = part
    return (-f * (f - 1.0) * (f - 2.0) / 6.0, (f + 1.0) * (f - 1.0) * (f - 2.0) / 2.0, -(f + 1.0) * f * (f - 2.0) / 2.0, (f + 1.0) * f * (f - 1.0) / 6.0)


def prepare_onset(rate: float, settings: OnsetSettings = DEFAULTS) -> Onset:
    assert SLOWEST <= rate <= QUICKEST
    dt, periods = 1.0 / rate, [rate / mains for mains in MAINS]
    whole = [math.floor(period) for period in periods]
    by = settings
    enough = math.log(by.hours * 3600.0 * 10.0)
    ratio = by.ratio**2
    cap = (enough / (by.bandwidth * by.brief) + math.log(ratio)) / (1.0 - 1.0 / ratio)
    return Onset(
        critical_high_pass(by.band_hz, rate),
        butterworth(by.top_hz, "low", rate) if by.top_hz < 0.4 * rate else PASS,
        butterworth(by.wide_hz, "high", rate),
        butterworth(by.swing_hz, "high", rate),
        (whole[0], whole[1]),
        (_cubic(periods[0] - whole[0]), _cubic(periods[1] - whole[1])),
        dt,
        1.0 - math.exp(-dt / 0.005),
        1.0 - math.exp(-dt / 0.1),
        1.0 - math.exp(-dt / 0.015),
        1.0 - math.exp(-dt / by.stays),
        math.exp(-dt / 0.1),
        math.exp(-dt / 2.0),
        math.exp(-dt / 0.2),
        enough,
        by.quiet * by.bandwidth * math.log(by.ratio),
        cap,
        math.log(ratio) / (1.0 - 1.0 / ratio),
        settings,
    )


def onset_start(onset: Onset, first: float) -> OnsetState:
    """Before the `first` sample, which may be NaN."""
    memories = (EMPTY,) * 5
    none = (0.0, 0.0, 0.0)
    s = onset.settings.spread**2
    return OnsetState(
        first, math.nan, *memories, (0.0,) * (max(onset.delay) + 2),
        0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, none, none, none, 2.0 * math.log(onset.settings.least), s, -0.05, 0.0, 0.0, none, none, 0.0, 0.0, 0.0, 0.0, 0.0,
    )


@kernel
def onset_step(onset: Onset, state: OnsetState, value: float) -> tuple[OnsetState, float, float]:
    by, dt = onset.settings, onset.dt
    here = np.abs(value) < np.inf
    raw = sel(here, value, state.raw)
    origin = sel(np.abs(state.origin) < np.inf, state.origin, raw)
    x = sel(np.abs(raw) < np.inf, raw - origin, 0.0)
    inner, half = biquad(onset.band, state.inner, x)
    outer, above = biquad(onset.band, state.outer, half)
    top, band = biquad(onset.top, state.top, above)
    wide, all_of_it = biquad(onset.wide, state.wide, x)
    slow, movement = biquad(onset.swing, state.slow, x)

    past = state.past
    i0, i1 = onset.delay[0], onset.delay[1]
    c0, c1 = onset.between[0], onset.between[1]
    d0 = band - c0[0] * past[i0 - 2] - c0[1] * past[i0 - 1] - c0[2] * past[i0] - c0[3] * past[i0 + 1]
    d1 = band - c1[0] * past[i1 - 2] - c1[1] * past[i1 - 1] - c1[2] * past[i1] - c1[3] * past[i1 + 1]
    q0, q1, q2 = band * band, 0.5 * d0 * d0, 0.5 * d1 * d1
    least = np.fmin(q0, np.fmin(q1, q2))

    power = state.power + onset.power * (all_of_it * all_of_it - state.power)
    swing = np.fmax(movement * movement, state.swing * onset.swung)
    both = state.both + onset.power * (band * band - state.both)
    new = state.new + onset.power * (least - state.new)

    started = state.seen > 0.0
    lim = sel(started, onset.cap * state.null, np.inf)
    b0 = state.long[0] + onset.long * (np.fmin(q0, lim) - state.long[0])
    b1 = state.long[1] + onset.long * (np.fmin(q1, lim) - state.long[1])
    b2 = state.long[2] + onset.long * (np.fmin(q2, lim) - state.long[2])

    # what is wrong
    step = sel(np.abs(state.raw) < np.inf, np.abs(raw - state.raw), 0.0)
    leap = np.fmax(step, state.leap * 1.0)
    leap = np.fmax(step, state.leap * exp(-dt / 0.03))
    stuck = state.stuck + onset.power * (sel(step <= by.still * leap, 1.0, 0.0) - state.stuck)
    flat = sel(here * (raw != state.raw) > 0.0, 0.0, state.flat + dt)
    railed = (stuck > by.stuck) * (power > by.steps * leap * leap)
    sigma2 = exp(state.level)
    narrow = (new < by.broad * power) + (new < by.moved * swing) + railed > 0.0
    odd = narrow * (power > 9.0 * sigma2) > 0.0
    dead = flat > by.flat
    trouble = sel(dead, 1.0, sel(odd, 2.0, 0.0))

    # rest
    idle = state.active < 0.5
    sd = np.sqrt(state.spread + by.between * by.between / (1.0 + np.fmax(state.seen, 0.0) / by.same))
    u = log(np.fmax(np.fmin(b0, np.fmin(b1, b2)), by.least * by.least))
    beside = by.periodic * both + by.broad * power + by.moved * swing + by.share * by.share * state.size
    e = u - state.level
    e = sel(e > 0.0, np.fmax(0.0, e - log(1.0 + beside / sigma2)), e)
    lid = by.clip * sd
    hidden = beside > exp(u)
    learns = idle * (1.0 - dead)
    calm = learns * sel(exp(u) < onset.even * state.null, sel(state.evidence < 0.25 * onset.enough, 1.0, 0.0), by.doubt)
    n = np.fmax(state.seen, 0.0) + 0.1
    up = sel(idle, calm * (1.0 - hidden) * np.fmin(e, lid), by.doubt * (1.0 - dead) * e) / n
    level = state.level + dt * sel(e < -lid, (1.0 - dead) * e / np.fmin(n, by.down), sel(e < 0.0, learns * e / n, up))
    level = sel(started, level, sel(dead, state.level, u))
    squares = np.fmin(e * e, lid * lid)
    spread = state.spread + sel(state.seen > 1.0, calm * (1.0 - hidden), 0.0) * dt / (n + by.prior) * (squares - state.spread)
    seen = sel(idle, np.fmin(state.seen + calm * dt, by.memory), state.seen * (1.0 - dt / by.forget))
    slow_rate = sel(idle * (1.0 - dead) > 0.0, onset.stay, 0.0)
    covered = state.covered + slow_rate * (sel(hidden, 1.0, 0.0) - state.covered)
    hum = state.hum + slow_rate * (sel(hidden, power, 0.0) - state.hum)
    gone = idle * (covered > 0.5) * (power < by.gone * hum) > 0.0
    covered, hum = sel(gone, 0.0, covered), sel(gone, 0.0, hum)
    seen = sel(gone, -0.05, seen)
    seen = sel(flat > by.off, -0.05, seen)
    level = np.fmax(level, 2.0 * log(by.least))

    # null
    rest2 = exp(level + by.sure * sd)
    null = rest2 + beside
    r0, r1, r2 = q0 / null, q1 / null, q2 / null
    m0, m1, m2 = np.fmin(r0, 3.0 * onset.cap), np.fmin(r1, 3.0 * onset.cap), np.fmin(r2, 3.0 * onset.cap)
    a0 = state.short[0] + onset.short * (m0 - state.short[0])
    a1 = state.short[1] + onset.short * (m1 - state.short[1])
    a2 = state.short[2] + onset.short * (m2 - state.short[2])
    m0, m1, m2 = np.fmin(r0, onset.cap), np.fmin(r1, onset.cap), np.fmin(r2, onset.cap)
    l0 = state.mean[0] + onset.long * (m0 - state.mean[0])
    l1 = state.mean[1] + onset.long * (m1 - state.mean[1])
    l2 = state.mean[2] + onset.long * (m2 - state.mean[2])
    ratio = by.ratio * by.ratio
    share, drift = by.bandwidth * dt * (1.0 - 1.0 / ratio), by.bandwidth * dt * log(ratio)
    kcap = onset.cap
    most = 2.0 * onset.enough
    open_ = sel((state.leap > 0.0) * (1.0 - dead) * (1.0 - railed) > 0.0, most, 0.0)
    f0 = np.fmin(open_, np.fmax(0.0, state.onset[0] + share * np.fmin(a0, kcap) - drift))
    f1 = np.fmin(open_, np.fmax(0.0, state.onset[1] + share * np.fmin(a1, kcap) - drift))
    f2 = np.fmin(open_, np.fmax(0.0, state.onset[2] + share * np.fmin(a2, kcap) - drift))
    w0 = np.fmin(open_, np.fmax(0.0, state.weak[0] + share * np.fmin(l0, kcap) - drift))
    w1 = np.fmin(open_, np.fmax(0.0, state.weak[1] + share * np.fmin(l1, kcap) - drift))
    w2 = np.fmin(open_, np.fmax(0.0, state.weak[2] + share * np.fmin(l2, kcap) - drift))
    on, weak = np.fmin(f0, np.fmin(f1, f2)), np.fmin(w0, np.fmin(w1, w2))
    p = np.fmin(a0, np.fmin(a1, a2))
    f = by.bandwidth * dt * (log(by.ratio) - (1.0 - 1.0 / by.ratio) * np.fmin(p, onset.cap))
    end = np.fmax(0.0, state.end + f)

    begins = idle * ((on >= onset.enough) + (weak >= onset.enough) > 0.0) > 0.0
    ends = (1.0 - idle) * ((end > onset.rested) + dead > 0.0) > 0.0
    active = sel(begins, 1.0, sel(ends, 0.0, state.active))
    keep = 1.0 - ends
    wipe = sel(ends + dead + railed > 0.0, 1.0, np.inf)
    a0, a1, a2 = np.fmin(a0, wipe), np.fmin(a1, wipe), np.fmin(a2, wipe)
    l0, l1, l2 = np.fmin(l0, wipe), np.fmin(l1, wipe), np.fmin(l2, wipe)
    b0, b1, b2 = np.fmin(b0, wipe * null), np.fmin(b1, wipe * null), np.fmin(b2, wipe * null)
    seen = sel(ends, np.fmin(seen, by.after), seen)
    end = sel(begins, 0.0, end)
    size = sel(active > 0.5, np.fmax(new, state.size * onset.size), state.size * onset.fade)
    held = sel(active > 0.5, state.held + dt, 0.0)
    reported = sel((active > 0.5) * (held > by.shortest) > 0.0, 1.0, 0.0)
    after = OnsetState(
        origin, raw, inner, outer, top, wide, slow,
        (band,) + past[:-1],  # noqa: RUF005 - Numba takes no star in a tuple
        power, swing, both, new, covered, hum, leap, stuck, flat, (a0, a1, a2), (l0, l1, l2), (b0, b1, b2), level, spread, seen, null, size, (keep * f0, keep * f1, keep * f2), (keep * w0, keep * w1, keep * w2), keep * np.fmax(on, weak), end, active, held, exp(0.5 * level),
    )
    return after, reported, trouble


@kernel
def onset_rest(state: OnsetState) -> float:
    """σ, in the signal's unit."""
    return state.rest


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
    source="this project",
)
