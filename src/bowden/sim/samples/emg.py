"""Recordings of a simulated muscle: rest, a maximum contraction, and contractions of known times.

Skin and amplifier, contractions as noise of the muscle's band, and mains with harmonics; see `bowden.sim.emg`.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bowden.sim.emg import NOISE, background, contractions, hum
from bowden.sim.samples.files import SampleFile, csv_text

Array = NDArray[np.float64]
Spans = Sequence[tuple[float, float, float]]

RATE = 1000.0
"""Samples a second [Hz]."""
MAINS, MAINS_RMS = 50.0, 0.003
"""[Hz] and [mV]."""
MAXIMUM = 0.5
"""Standard deviation of the strongest contraction [mV]."""
MVC: Spans = ((8.0, 13.0, MAXIMUM),)
"""Onset [s], end [s] and standard deviation [mV] of the contraction of ``mvc.csv``: as a wearer would who is calibrated
from a stream, which is counted for a moment, 1 s to make ready, 5 s of rest, 1 s, 5 s of contraction."""
_LENGTHS = (1.5, 0.8, 2.5, 1.0, 0.4, 3.0, 1.2, 2.0)
_STRENGTHS = (0.4, 0.1, 0.6, 0.2, 0.8, 0.3, 0.06, 0.5)
"""Of ``biceps.csv``, shares of `MAXIMUM`."""
_FIRST, _PAUSE = 4.0, 2.5
SUIT: Spans = tuple((4.0 + 5.0 * k, 5.2 + 5.0 * k, 0.4 * MAXIMUM) for k in range(4))
"""Of a suit's recording: each begins the next motion, which takes two seconds."""
SUIT_SECONDS = 24.0


def muscle(spans: Spans, duration: float, seed: int) -> Array:
    """EMG of one muscle (n,) [mV].

    Args:
        spans: onset [s], end [s] and standard deviation [mV] of each contraction.
        duration: [s].
        seed: of everything.
    """
    count, random = round(duration * RATE), np.random.default_rng(seed)
    values = background(RATE, count, random) + MAINS_RMS * hum(RATE, count, MAINS, 0.2, random)
    return values + contractions(RATE, spans, count, seed + 1) if spans else values


def spread(seed: int) -> Spans:
    """The contractions of ``biceps.csv``, at times that are a little uneven."""
    random, at, spans = np.random.default_rng([seed, 1]), _FIRST, []
    for length, strength in zip(_LENGTHS, _STRENGTHS, strict=True):
        onset = round(at + random.uniform(0.0, 0.5), 3)
        spans.append((onset, round(onset + length, 3), strength * MAXIMUM))
        at = onset + length + _PAUSE
    return tuple(spans)


def emg_files(seed: int) -> dict[str, SampleFile]:
    """Name → file of the sample; the last one is the truth.

    Args:
        seed: of everything.
    """
    spans = spread(seed)
    duration = float(np.ceil(spans[-1][1] + 2.0))
    return {
        "rest.csv": SampleFile(_recording((), 8.0, 3 * seed), "a muscle at rest, 8 s"),
        "mvc.csv": SampleFile(_recording(MVC, 15.0, 3 * seed + 1), "rest, and one contraction as strong as can be"),
        "biceps.csv": SampleFile(
            _recording(spans, duration, 3 * seed + 2), f"{len(spans)} contractions, strong and weak, {duration:g} s"
        ),
        "biceps.labels.csv": SampleFile(_labels(spans), "when they begin and end"),
        "emg.truth.toml": SampleFile(_truth("emg", seed, spans, MVC), "how strong each is"),
    }


def suit_files(seed: int) -> dict[str, SampleFile]:
    """Name → file of the recording that moves a suit, without the suit's rig; the last one is the truth.

    Args:
        seed: of everything.
    """
    about = f"EMG of {len(SUIT)} contractions, {SUIT_SECONDS:g} s: flex, extend, flex, extend"
    return {
        "biceps.csv": SampleFile(_recording(SUIT, SUIT_SECONDS, seed), about),
        "biceps.labels.csv": SampleFile(_labels(SUIT), "when they begin and end"),
        "suit.truth.toml": SampleFile(_truth("suit", seed, SUIT), "how strong each is"),
    }


def _recording(spans: Spans, duration: float, seed: int) -> str:
    values = muscle(spans, duration, seed)
    return csv_text({"time_s": (np.arange(len(values)) / RATE, 3), "biceps_mV": (values, 5)})


def _labels(spans: Spans) -> str:
    return csv_text(
        {"onset_s": (np.array([one[0] for one in spans]), 3), "offset_s": (np.array([one[1] for one in spans]), 3)}
    )


def _truth(kind: str, seed: int, biceps: Spans, mvc: Spans = ()) -> str:
    def listed(spans: Spans, column: int) -> str:
        return "[" + ", ".join(f"{one[column]:.3f}" for one in spans) + "]"

    lines = [
        f"# What is behind the simulated EMG of bowden sample {kind} --seed {seed}.",
        "",
        f"rest_mv = {NOISE:g}  # standard deviation at rest, without mains",
        f"mains_mv = {MAINS_RMS:g}  # standard deviation, at {MAINS:g} Hz",
    ]
    for name, spans in (("mvc", mvc), ("biceps", biceps)):
        if spans:
            lines += ["", f"[{name}]  # {name}.csv", f"onset_s = {listed(spans, 0)}", f"offset_s = {listed(spans, 1)}"]
            lines += [f"contraction_mv = {listed(spans, 2)}  # standard deviation of each"]
    return "\n".join(lines) + "\n"
