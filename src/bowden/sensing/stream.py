"""Envelope and onsets of a signal that comes in pieces, or whole; any cut into pieces gives the same numbers."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bowden.core.kernel import compiled, kernel
from bowden.sensing import envelope, onset_settings
from bowden.sensing.envelope import (
    Envelope,
    EnvelopeSettings,
    EnvelopeState,
    envelope_start,
    envelope_step,
    prepare_envelope,
)
from bowden.sensing.onset import Onset, OnsetState, onset_start, onset_step, prepare_onset
from bowden.sensing.onset_settings import OnsetSettings

Array = NDArray[np.float64]


class Enveloped(NamedTuple):
    """One piece of a signal, cleaned; in its own unit, (n,)."""

    signal: Array
    """Without offset and mains."""
    envelope: Array


class Detected(NamedTuple):
    """What the detector says of one piece, (n,)."""

    active: Array
    """1 in a contraction."""
    trouble: Array
    """0 nothing, 1 flat or missing, 2 movement or mains."""
    rest: Array
    """σ, the size of the signal at rest, in its own unit."""


class EnvelopeFilter:
    """The envelope of a signal of `rate` samples a second [Hz].

    >>> filter = EnvelopeFilter(1000.0)
    >>> filter.feed([0.0, 0.1, -0.1]).envelope.shape
    (3,)
    """

    def __init__(self, rate: float, settings: EnvelopeSettings = envelope.DEFAULTS) -> None:
        self._chain = prepare_envelope(rate, settings)
        self._state: EnvelopeState | None = None

    def feed(self, values: ArrayLike) -> Enveloped:
        """The next samples, finite; (n,)."""
        piece = np.ascontiguousarray(values, dtype=np.float64)
        out = np.empty((2, len(piece)))
        if len(piece):
            state = envelope_start(float(piece[0])) if self._state is None else self._state
            self._state = compiled(_envelope)(self._chain, state, piece, out)
        return Enveloped(*out)


class OnsetDetector:
    """Contractions in a signal of `rate` samples a second, 400 to 5000 Hz; NaN stands for a sample that is missing."""

    def __init__(self, rate: float, settings: OnsetSettings = onset_settings.DEFAULTS) -> None:
        self._onset = prepare_onset(rate, settings)
        self._state: OnsetState | None = None

    def feed(self, values: ArrayLike) -> Detected:
        """The next samples, (n,)."""
        piece = np.ascontiguousarray(values, dtype=np.float64)
        out = np.empty((3, len(piece)))
        if len(piece):
            first = float(piece[0])
            state = onset_start(self._onset, first) if self._state is None else self._state
            self._state = compiled(_onset)(self._onset, state, piece, out)
        return Detected(*out)


@kernel
def _envelope(chain: Envelope, state: EnvelopeState, values: Array, out: Array) -> EnvelopeState:
    for k in range(len(values)):
        state, out[0, k], out[1, k] = envelope_step(chain, state, values[k])
    return state


@kernel
def _onset(onset: Onset, state: OnsetState, values: Array, out: Array) -> OnsetState:
    for k in range(len(values)):
        state, out[0, k], out[1, k] = onset_step(onset, state, values[k])
        out[2, k] = state.rest
    return state
