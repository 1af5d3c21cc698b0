"""Envelope and contractions of a signal that comes in pieces, or whole; any cut into pieces gives the same numbers."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bowden.core.kernel import compiled, kernel, specialise
from bowden.sensing import envelope
from bowden.sensing.detector import Detector, detector_rest, detector_step
from bowden.sensing.detectors import DEFAULT
from bowden.sensing.envelope import (
    Envelope,
    EnvelopeSettings,
    EnvelopeState,
    envelope_start,
    envelope_step,
    prepare_envelope,
)

Array = NDArray[np.float64]


class Enveloped(NamedTuple):
    """One piece of a signal, cleaned; in its own unit, (n,)."""

    signal: Array
    """Without offset and mains."""
    envelope: Array


class Detected(NamedTuple):
    """Output of the detector for one piece, (n,)."""

    active: Array
    """1 in a contraction."""
    trouble: Array
    """Number of a `Trouble`."""
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
    """Contractions in a signal of `rate` samples a second; NaN stands for a sample that is missing.

    Args:
        rate: that the detector takes [Hz].
        settings: of the detector; its own by default.
        detector: which.

    Raises:
        ParameterError: a rate that the detector does not take.
    """

    def __init__(self, rate: float, settings: Any = None, detector: Detector = DEFAULT) -> None:
        self._detector, self._prepared = detector, detector.prepared(rate, settings)
        self._run = specialise(_detect, detector.name, detector_step=detector.step, detector_rest=detector.rest)
        self._state: Any = None

    def feed(self, values: ArrayLike) -> Detected:
        """The next samples, (n,)."""
        piece = np.ascontiguousarray(values, dtype=np.float64)
        out = np.empty((3, len(piece)))
        if len(piece):
            first = float(piece[0])
            state = self._detector.start(self._prepared, first) if self._state is None else self._state
            self._state = self._run(self._prepared, state, piece, out)
        return Detected(*out)


@kernel
def _envelope(chain: Envelope, state: EnvelopeState, values: Array, out: Array) -> EnvelopeState:
    for k in range(len(values)):
        state, out[0, k], out[1, k] = envelope_step(chain, state, values[k])
    return state


@kernel
def _detect(prepared: Any, state: Any, values: Array, out: Array) -> Any:
    for k in range(len(values)):
        state, contracts, trouble = detector_step(prepared, state, values[k])
        out[0, k], out[1, k] = contracts, trouble.value
        out[2, k] = detector_rest(state)
    return state
