"""Hard cases of surface EMG: a recording whose contractions are known exactly, drawn from its number.

Each part of a case belongs to a family of `FAMILIES`; the parts are drawn independently, so that a judging set has
combinations that nobody thought of. Sizes are of the band of surface EMG (20 to 450 Hz): a contraction's ratio is the
RMS of all that is there during it, rest included, over the RMS of rest without mains, heart and movement.

There are two kinds of draws. In the first, rest is the same before and after a contraction. In the second, `changing`,
it is another after each contraction, and a calm floor with bursts, as it is in people; a contraction's ratio is over
the rest before it.
"""

import gzip
import math
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import signal
from scipy.fft import next_fast_len
from scipy.interpolate import CubicSpline

from bowden.sim.emg import NOISE, background, hum
from emg_sources import Artefact, disturb, heart, interference, modulated, motor_units, one

Array = NDArray[np.float64]

SETS = {"development": 1, "validation": 2, "judging": 3}
"""Set → its key, which goes into every draw: no two sets share a seed."""
_CASES, _RESTS, _CALIBRATIONS, _CHANGING, _BURSTS = 18_001, 18_002, 18_003, 18_004, 18_005
"""What a number is drawn for."""
RATES = (500.0, 512.0, 1000.0, 1024.0, 1925.9, 2000.0, 2048.0, 4000.0)
"""Samples a second of the rigs that are drawn [Hz]; few, since loops are compiled for each."""
RATIOS = ((1.5, 1000.0), (1.5, 10.0))
"""Log-uniform; half of the draws are from each, since it is the weak ones that are hard [–]."""
SEEN = 3.0
"""A ramp counts from where it passes so many times rest, or nine tenths of its plateau where that is less [–]."""
QUICK = 0.1
"""A rise that takes less counts from its beginning [s]."""

FAMILIES: dict[str, dict[str, float]] = {
    "rest": {"skin": 3, "white": 1, "flicker": 1, "wandering": 1, "few units": 1, "recorded": 3},
    "contraction": {"dense": 3, "wandering": 2, "few units": 2, "recorded": 3},
    "rise": {"step": 3, "quick": 3, "ramp": 3},
    "plateau": {"even": 2, "uneven": 2, "fatigue": 1},
    "sizes": {"alike": 2, "mixed": 1},
    "start": {"rest": 6, "short rest": 1, "contraction": 1},
    "mains": {"none": 6, "steady": 2, "on and off": 1},
    "baseline": {"still": 5, "drift": 1},
    "heart": {"none": 7, "beats": 1},
    "movement": {"none": 7, "in pauses": 2, "anywhere": 1},
    "electrode": {"on": 9, "lifts": 1},
    "converter": {"fine": 6, "coarse": 1, "clipped": 1},
}
"""Part → family → weight."""
CHANGING: dict[str, dict[str, float]] = FAMILIES | {
    "pauses": {"each its own": 1, "walking": 1},
    "bursts": {"none": 1, "some": 2},
}
"""The same of draws whose rest changes: each pause has a level of its own, or that of the one before and a change."""
JUMPS = (0.1, 1.3)
"""RMS of the change in the log of rest's power from one pause to the next, log-uniform by case: 0.11 and 0.13 in
BioSPPy's recordings, 0.65, 0.77 and 1.3 in those of biosignalsnotebooks [–]."""
BURSTS_A_SECOND, BURST_SECONDS, BURST_RISE = (0.05, 3.0), (0.08, 0.5), (0.4, 1.6)
"""How often a burst begins at rest, log-uniform by case [Hz]; how long one lasts, log-uniform [s]; how far it is above
the floor, in the log of power, uniform: at most 2.2 times its size, since from 2.5 times on it would be a contraction
[–]."""
UNITS = {"V": 1e-3, "mV": 1.0, "µV": 1e3, "counts": 0.0}
"""Unit of the recording → factor from mV; counts are the converter's own."""


@dataclass(frozen=True)
class Contraction:
    """One contraction as it truly is; times from the first sample [s]."""

    onset: float
    end: float
    ratio: float
    """RMS over rest's, over the plateau [–]."""
    rise: float
    """From the onset to the plateau [s]."""
    seen: float
    """From when latency counts: the onset of a quick one; of a ramp, see `SEEN` [s]."""
    gone: float
    """From when the latency of its end counts [s]."""
    judged: bool
    """False of one that is there before there was rest."""

    @property
    def length(self) -> float:
        """[s]."""
        return self.end - self.onset


@dataclass(frozen=True)
class Case:
    """One recording."""

    number: int
    families: dict[str, str]
    values: Array
    """In the unit of the rig (n,)."""
    rate: float
    contractions: tuple[Contraction, ...]
    rest: float
    """RMS at rest in the band, in the same unit."""
    facts: dict[str, float] = field(default_factory=dict)
    """What else was drawn, for reading."""


@dataclass(frozen=True)
class _Recorded:
    """Stretches of a recording, at 1 kHz."""

    rest: tuple[Array, ...]
    contractions: tuple[Array, ...]


RECORDINGS = {
    "emg/biceps_bursts": (),
    "emg/biceps_fatigue": (),
    "emg/adductor_pollicis_twitches": (),
    "emg_more/bmc_three": ((0.9, 1.0),),
    "emg_more/biosppy_weak": ((11.0, 13.0), (43.0, 49.0)),
    "emg_more/biosppy_four": ((16.95, 22.5), (23.0, 24.0), (35.9, 41.2)),
}
"""Recording in ``../shared/data`` → stretches that nobody can tell [s]."""
SHARED = Path(__file__).parents[2] / "shared" / "data"


def random_of(set_name: str, number: int, kind: int = _CASES) -> np.random.Generator:
    """The random numbers of one case."""
    return np.random.default_rng([kind, SETS[set_name], number])


def there() -> tuple[str, ...]:
    """The recordings that are there."""
    return tuple(name for name in RECORDINGS if (SHARED / f"{name}.csv.gz").is_file())


@cache
def recording(name: str) -> tuple[Array, tuple[tuple[float, float], ...]]:
    """Values of a recording at 1 kHz, and its labels [s]."""
    with gzip.open(SHARED / f"{name}.csv.gz", "rt", encoding="utf-8") as file:
        values = np.loadtxt(file, delimiter=",", skiprows=1)[:, 1]
    labels = np.loadtxt(SHARED / f"{name}.labels.csv", delimiter=",", skiprows=1, ndmin=2)
    return values, tuple((float(on), float(off)) for on, off in labels)


@cache
def _stretches(name: str) -> _Recorded:
    """Half a second clear of labels and of what nobody can tell; contractions without their ends.

    A stretch of rest is left out if some 50 ms of it are four times the median: nobody has looked whether that is rest.
    """
    values, labels = recording(name)
    values = signal.sosfiltfilt(signal.butter(2, 8.0, "high", fs=1000.0, output="sos"), values)
    duration = len(values) / 1000.0
    busy = sorted([*labels, *RECORDINGS[name]])
    edges = [-0.5, *(t for span in busy for t in span), duration + 0.5]
    rests = [(edges[i] + 0.5, edges[i + 1] - 0.5) for i in range(0, len(edges), 2)]
    inside = [(on + 0.15, off - 0.1) for on, off in labels]
    parts = [
        tuple(values[round(1e3 * on) : round(1e3 * off)] for on, off in spans if off - on >= least)
        for spans, least in ((rests, 0.8), (inside, 0.3))
    ]
    return _Recorded(tuple(part for part in parts[0] if _is_even(part)), parts[1])


def _is_even(part: Array) -> bool:
    size = np.sqrt(np.mean(part[: len(part) // 50 * 50].reshape(-1, 50) ** 2, axis=1))
    return bool(size.max() < 4.0 * np.median(size))


def _joined(parts: tuple[Array, ...], count: int, rate: float, random: np.random.Generator) -> Array:
    """Pieces of half to two seconds of recorded stretches, faded into one another, at another rate, (count,)."""
    needed, fade = math.ceil(1000.0 * count / rate) + 1, 40
    out, at = np.zeros(needed + 4000), 0
    up = np.sin(0.5 * np.pi * (np.arange(fade) + 0.5) / fade)
    while at < needed + fade:
        part = parts[random.choice(len(parts), p=_shares(parts))]
        length = min(len(part), int(random.uniform(500.0, 2000.0)))
        first = int(random.integers(0, len(part) - length + 1))
        piece = part[first : first + length].copy()
        piece[:fade] *= up
        piece[-fade:] *= up[::-1]
        out[at : at + length] += piece
        at += length - fade
    taken = out[fade : fade + math.ceil(1000.0 * count / rate)]
    made = one(taken if rate == 1000.0 else signal.resample(taken, count), rate)
    return made + 0.03 * random.normal(size=count)  # an amplifier's own, above what was recorded


def _shares(parts: tuple[Array, ...]) -> Array:
    lengths = np.array([len(part) for part in parts], dtype=np.float64)
    return lengths / lengths.sum()


def _log(random: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(random.uniform(math.log(low), math.log(high))))


def _resting(kind: str, count: int, rate: float, random: np.random.Generator) -> Array:
    if kind == "skin":
        return one(background(rate, count, random), rate)
    if kind == "white":
        return one(random.normal(size=count), rate)
    if kind == "flicker":
        frequency = np.fft.rfftfreq(count, 1.0 / rate)
        density = 1.0 / np.sqrt(np.maximum(frequency, 0.5)) + 0.03
        return one(np.fft.irfft(np.fft.rfft(random.normal(size=count)) * density, count), rate)
    if kind == "wandering":
        even = one(background(rate, count, random), rate)
        return modulated(even, rate, random.uniform(0.05, 0.15), _log(random, 0.05, 2.0), random)
    if kind == "few units":
        share = random.uniform(0.2, 0.6)
        skin, units = _resting("skin", count, rate, random), motor_units(rate, count, 3, random)
        return one(math.sqrt(1.0 - share) * skin + math.sqrt(share) * units, rate)
    parts = _stretches(_pick(random, rests())).rest
    one_part = parts[random.choice(len(parts), p=_shares(parts))]  # two pauses of a recording may differ sevenfold
    return _joined((one_part,), count, rate, random)


@cache
def rests() -> tuple[str, ...]:
    """Recordings with stretches of rest."""
    return tuple(name for name in there() if _stretches(name).rest)


def _contracting(kind: str, count: int, rate: float, random: np.random.Generator) -> Array:
    if kind == "few units":
        return motor_units(rate, count, int(random.integers(8, 40)), random)
    if kind == "recorded":
        names = tuple(name for name in there() if _stretches(name).contractions and name != "emg_more/biosppy_weak")
        return _joined(_stretches(_pick(random, names)).contractions, count, rate, random)
    carrier = interference(rate, count, random.uniform(30.0, 80.0), random.uniform(60.0, 150.0), random)
    if kind == "dense":
        return carrier
    return modulated(carrier, rate, random.uniform(0.2, 0.5), _log(random, 0.02, 0.2), random)


def _pick(random: np.random.Generator, names: tuple[str, ...]) -> str:
    return names[int(random.integers(len(names)))]


def _families(random: np.random.Generator, families: dict[str, dict[str, float]] = FAMILIES) -> dict[str, str]:
    chosen = {}
    for part, weights in families.items():
        shares = np.array(list(weights.values()))
        chosen[part] = str(random.choice(list(weights), p=shares / shares.sum()))
    if not there():
        for part, else_one in (("rest", "skin"), ("contraction", "dense")):
            chosen[part] = else_one if chosen[part] == "recorded" else chosen[part]
    return chosen


def _plan(chosen: dict[str, str], random: np.random.Generator) -> tuple[list[tuple[float, ...]], float]:
    """Onset, end, ratio, rise, fall and whether it counts, of each contraction; and the duration [s]."""
    at = {"rest": random.uniform(2.0, 5.0), "short rest": random.uniform(0.7, 1.2), "contraction": -0.5}[
        chosen["start"]
    ]
    between = RATIOS[int(random.integers(2))]
    ratio, plan = _log(random, *between), []
    for k in range(int(random.integers(3, 7))):
        if chosen["sizes"] == "mixed" or (k == 0 and at < 0.0):
            ratio = _log(random, *between)
        length = _log(random, 0.15, 10.0)
        rise = {
            "step": 0.002,
            "quick": random.uniform(0.01, QUICK),
            "ramp": _log(random, 0.2, 4.0),
        }[chosen["rise"]]
        fall = _log(random, 0.005, 0.5)
        rise, fall = min(rise, 0.5 * length), min(fall, 0.3 * length)
        plan.append((at, at + length, ratio, rise, fall, float(at > 0.0)))
        at += length + _log(random, 1.0 if at < 0.0 else 0.5, 6.0)
    return plan, at + 0.5


def _profile(
    time: Array, one_of: tuple[float, ...], kind: str, random: np.random.Generator
) -> tuple[Array, float, float]:
    """A contraction's size over rest's, and when it passes what is seen, upward and downward [s]."""
    on, off, ratio, rise, fall, _ = one_of
    size = np.interp(time, [on, on + rise, off - fall, off], [0.0, 1.0, 1.0, 0.0])
    inside = (time >= on) & (time <= off)
    if kind == "uneven":
        knots = np.linspace(on, off, 3 + int(2.0 * (off - on)))
        size *= np.interp(time, knots, np.exp(random.normal(0.0, 0.2, len(knots))))
    elif kind == "fatigue":
        size *= np.interp(time, [on, off], [1.0, random.uniform(0.5, 0.8)])
    flat = (time >= on + rise) & (time <= off - fall)
    if flat.any():
        size /= math.sqrt(float(np.mean(size[flat] ** 2)))
    size *= math.sqrt(ratio**2 - 1.0)
    level = math.sqrt(min(SEEN, 1.0 + 0.9 * (ratio - 1.0)) ** 2 - 1.0)
    above = np.flatnonzero(inside & (size >= min(level, 0.99 * float(size.max(initial=0.0)))))
    first, last = (float(time[above[0]]), float(time[above[-1]])) if len(above) else (on, off)
    return size, on if rise <= QUICK else first, last


def _levels(kind: str, pauses: int, random: np.random.Generator) -> Array:
    """Log of the power of rest in each pause, over that of the first one (pauses,)."""
    jump = _log(random, *JUMPS)
    if kind == "walking":
        return np.concatenate([[0.0], np.cumsum(random.normal(0.0, jump, pauses - 1))])
    own = random.normal(0.0, jump / math.sqrt(2.0), pauses)
    return own - own[0]


def _bursts(count: int, rate: float, random: np.random.Generator) -> Array:
    """Size of rest that is a calm floor with bursts, of RMS 1 (count,)."""
    power, duration = np.zeros(count), count / rate
    for begin in random.uniform(0.0, duration, random.poisson(duration * _log(random, *BURSTS_A_SECOND))):
        first, length = round(begin * rate), round(_log(random, *BURST_SECONDS) * rate)
        part = power[first : first + length]  # a view
        shape = np.hanning(length)[: len(part)]
        np.maximum(part, random.uniform(*BURST_RISE) * np.minimum(1.0, 2.0 * shape), out=part)
    size = np.exp(0.5 * power)
    return size / math.sqrt(float(np.mean(size**2)))


def _changed(
    time: Array, plan: list[tuple[float, ...]], chosen: dict[str, str], rate: float, random: np.random.Generator
) -> tuple[Array, Array]:
    """Size of rest over that of the first pause (n,), and that before each contraction (contractions,).

    The level goes from one pause's to the next one's while the contraction lasts.
    """
    levels = _levels(chosen["pauses"], len(plan) + 1, random)
    at = [edge for entry in plan for edge in entry[:2]]
    size = np.exp(0.5 * np.interp(time, at, np.repeat(levels, 2)[1:-1]))
    if chosen["bursts"] == "some" and chosen["rest"] != "recorded":
        size *= _bursts(len(time), rate, random)
    return size, np.exp(0.5 * levels[:-1])


def draw(set_name: str, number: int, changing: bool = False, rate: float = 0.0) -> Case:
    """The case of a number; with rest that changes across contractions, or not; at a rate that is not its own [Hz]."""
    random = random_of(set_name, number, _CHANGING if changing else _CASES)
    chosen, own = _families(random, CHANGING if changing else FAMILIES), float(random.choice(RATES))
    rate = rate or own
    plan, duration = _plan(chosen, random)
    count = next_fast_len(round(duration * rate), real=True)
    time = np.arange(count) / rate
    calm, over = _changed(time, plan, chosen, rate, random) if changing else (np.ones(count), np.ones(len(plan)))
    size, made = np.zeros(count), []
    for entry, rest in zip(plan, over, strict=True):
        shape, seen, gone = _profile(time, entry, chosen["plateau"], random)
        size += rest * shape
        on, off, ratio, rise, _, judged = entry
        made.append(Contraction(on, off, ratio, rise, seen, gone, judged > 0.5))
    resting = _resting(chosen["rest"], count, rate, random)
    muscle = NOISE * (calm * resting + size * _contracting(chosen["contraction"], count, rate, random))
    facts: dict[str, float] = {}
    most = NOISE * max(1.0, float(size.max(initial=1.0)))
    beside, phase = _around(count, chosen, rate, facts, random)
    values = muscle + beside
    _moved(values, phase, plan, most, chosen, rate, random)
    values, factor = _converted(values, most, float(np.max(np.abs(beside))), chosen, facts, random)
    return Case(number, chosen, values, rate, tuple(made), NOISE * factor, facts)


def draw_calibration(set_name: str, case: Case) -> Case:
    """What a wearer records before, with the same rig: four seconds of rest and three of the largest contraction."""
    random = random_of(set_name, case.number, _CALIBRATIONS)
    chosen = case.families | {"plateau": "even", "movement": "none", "electrode": "on", "converter": "fine"}
    plan = (4.0, 7.0, max(one.ratio for one in case.contractions), 0.1, 0.1, 1.0)
    count = next_fast_len(round(8.0 * case.rate), real=True)
    size, seen, gone = _profile(np.arange(count) / case.rate, plan, "even", random)
    facts: dict[str, float] = {}
    beside, _ = _around(count, chosen, case.rate, facts, random)
    resting = _resting(chosen["rest"], count, case.rate, random)
    if chosen.get("bursts") == "some" and chosen["rest"] != "recorded":
        resting *= _bursts(count, case.rate, random)
    muscle = resting + size * _contracting(chosen["contraction"], count, case.rate, random)
    values = case.rest * (muscle + beside / NOISE)
    only = Contraction(plan[0], plan[1], plan[2], plan[3], seen, gone, True)
    return Case(case.number, chosen, values, case.rate, (only,), case.rest, facts)


def _around(
    count: int, chosen: dict[str, str], rate: float, facts: dict[str, float], random: np.random.Generator
) -> tuple[Array, Array]:
    """Mains, baseline and heart [mV], and the phase of the mains [rad]; (count,) each."""
    values = np.zeros(count)
    duration, mains = count / rate, float(random.choice((50.0, 60.0)))
    if chosen["mains"] != "none":
        size = NOISE * _log(random, 0.3, 10.0)
        there = np.ones(count)
        if chosen["mains"] == "on and off":
            edges = np.sort(random.uniform(0.0, duration, 4))
            there = np.searchsorted(edges, np.arange(count) / rate) % 2.0
        values = values + size * there * hum(rate, count, mains, _log(random, 0.03, 1.0), random)
        facts |= {"mains_hz": mains, "hum_over_rest": size / NOISE}
    if chosen["baseline"] == "drift":
        knots = np.linspace(0.0, duration, 3 + int(duration / random.uniform(1.0, 8.0)))
        wander = CubicSpline(knots, random.normal(size=len(knots)))(np.arange(count) / rate)
        values = values + NOISE * _log(random, 3.0, 300.0) * wander
    if chosen["heart"] == "beats":
        size = _log(random, 2.0, 30.0)
        values = values + NOISE * size * heart(rate, count, random.uniform(0.9, 1.9), random)
        facts["heart_over_rest"] = size
    return values, 2.0 * np.pi * mains * np.arange(count) / rate


_MOVEMENTS = (Artefact.BUMP, Artefact.STEP, Artefact.CLICK, Artefact.CABLE)
_LIFTS = (Artefact.FLAT, Artefact.RAIL, Artefact.OFF)


def _moved(
    values: Array,
    phase: Array,
    plan: list[tuple[float, ...]],
    most: float,
    chosen: dict[str, str],
    rate: float,
    random: np.random.Generator,
) -> None:
    """Put movement and a lifted electrode into the signal, in place.

    What happens in a pause ends half a second before the next contraction, and a lifted electrode is back for a second;
    anywhere, movement is at most as large as the largest contraction.
    """
    duration, rail = len(values) / rate, 4.0 * most
    ends = [0.0, *(entry[1] for entry in plan)]
    begins = [*(entry[0] for entry in plan), duration]
    pauses = [(end + 0.3, begin - 2.0) for end, begin in zip(ends, begins, strict=True) if begin - end > 2.5]
    if chosen["movement"] == "in pauses":
        for first, last in pauses:
            at, kind = random.uniform(first, last), _MOVEMENTS[int(random.integers(len(_MOVEMENTS)))]
            disturb(values, phase, round(at * rate), rate, kind, NOISE * _log(random, 3.0, 1000.0), random, rail)
    elif chosen["movement"] == "anywhere":
        for at in random.uniform(1.0, max(1.5, duration - 2.0), 1 + int(duration / 6.0)):
            kind = _MOVEMENTS[int(random.integers(len(_MOVEMENTS)))]
            disturb(values, phase, round(at * rate), rate, kind, _log(random, NOISE, most), random, rail)
    wide = [(first, last - 1.0) for first, last in pauses if last - 1.0 > first]
    if chosen["electrode"] == "lifts" and wide:
        first, last = wide[int(random.integers(len(wide)))]
        kind = _LIFTS[int(random.integers(len(_LIFTS)))]
        size = NOISE * _log(random, 10.0, 3000.0)
        disturb(values, phase, round(random.uniform(first, last) * rate), rate, kind, size, random, rail)


def _converted(
    values: Array,
    most: float,
    beside: float,
    chosen: dict[str, str],
    facts: dict[str, float],
    random: np.random.Generator,
) -> tuple[Array, float]:
    """The signal as its converter gives it, in the rig's unit, and the factor from mV.

    A converter that clips does so at one to two standard deviations of the largest contraction, beyond all that is
    there `beside` the muscle.
    """
    if chosen["converter"] == "clipped":
        span = 2.0 * (random.uniform(1.0, 2.0) * most + beside)
    else:
        span = max(2.0 * _log(random, 4.0, 12.0) * most, 2.2 * float(np.max(np.abs(values))))
    counts = _log(random, 0.8, 3.0) if chosen["converter"] == "coarse" else _log(random, 3.0, 100.0)  # of rest
    bits = min(24, max(8, math.ceil(math.log2(span * counts / NOISE))))
    step = span / 2.0**bits
    unit = str(random.choice(list(UNITS)))
    taken = np.clip(np.round(values / step), -(2.0 ** (bits - 1)), 2.0 ** (bits - 1) - 1.0)
    facts |= {"bits": float(bits), "counts_of_rest": NOISE / step}
    if unit == "counts":
        return taken + 2.0 ** (bits - 1), 1.0 / step
    return UNITS[unit] * (step * taken + most * random.uniform(-0.5, 0.5)), UNITS[unit]


REST_SECONDS = 600.0
"""Of one stretch of rest [s]."""


def draw_rest(set_name: str, number: int, changing: bool = False, rate: float = 0.0) -> Case:
    """Ten minutes of rest of a number: every third second something that is no contraction; with bursts, or not."""
    random = random_of(set_name, number, _BURSTS if changing else _RESTS)
    chosen, own = _families(random), float(random.choice(RATES))
    rate = rate or own
    count = next_fast_len(round(REST_SECONDS * rate), real=True)
    facts: dict[str, float] = {}
    beside, phase = _around(count, chosen, rate, facts, random)
    resting = _resting(chosen["rest"], count, rate, random)
    if changing and chosen["rest"] != "recorded":
        resting *= _bursts(count, rate, random)
    values = NOISE * resting + beside
    rail = NOISE * _log(random, 30.0, 3000.0)
    for begin in np.arange(3.0, REST_SECONDS - 5.0, 3.0):
        kind = Artefact(random.choice(list(Artefact)))
        at = round((begin + random.uniform(0.0, 1.0)) * rate)
        size = NOISE * (_log(random, 10.0, 3000.0) if kind in _LIFTS else _log(random, 3.0, 1000.0))
        disturb(values, phase, at, rate, kind, size, random, rail)
    values, factor = _converted(values, rail, float(np.max(np.abs(beside))), chosen, facts, random)
    return Case(number, chosen, values, rate, (), NOISE * factor, facts)


def describe(case: Case) -> dict[str, Any]:
    """What was drawn, without the signal."""
    return {"number": case.number, "rate_hz": case.rate, **case.families, **case.facts}
