"""The envelope of an EMG signal, causal, sample by sample: the paper's chain, with offset and mains taken out.

    raw → high-pass (offset, movement) → notches (mains) → |·| → low-pass (second-order Butterworth, 8 Hz)

The paper (§ on the clinical experiment) compares it with a fifth of that of a maximum voluntary contraction, MVC;
`bowden.sensing.onset` is what we trust instead.
"""

from typing import NamedTuple

from bowden.core.kernel import kernel
from bowden.sensing.biquad import EMPTY, PASS, Biquad, Memory, biquad, butterworth, notch

PLAIN_THRESHOLD = 0.2
"""Share of the MVC's envelope above which the paper sees intent [–]."""


class EnvelopeSettings(NamedTuple):
    """Frequencies that the chain removes and passes."""

    offset_hz: float = 20.0
    """Corner of the high-pass, below which there is movement of electrode and cable (SENIAM: 10 to 20 Hz)."""
    mains_hz: float = 50.0
    """50 or 60, which is taken out with its second and third harmonic; 0 for none."""
    mains_width_hz: float = 2.0
    """Of each notch."""
    low_pass_hz: float = 8.0
    """Of the envelope."""


DEFAULTS = EnvelopeSettings()


class Envelope(NamedTuple):
    """The chain's sections at one rate; `prepare_envelope` makes them."""

    high: Biquad
    mains: Biquad
    second: Biquad
    third: Biquad
    low: Biquad


class EnvelopeState(NamedTuple):
    """State of the chain."""

    origin: float
    """The first sample, so that an offset makes no step."""
    high: Memory
    mains: Memory
    second: Memory
    third: Memory
    low: Memory


def prepare_envelope(rate: float, settings: EnvelopeSettings = DEFAULTS) -> Envelope:
    """The sections for a signal of `rate` samples a second [Hz]."""
    mains, width = settings.mains_hz, settings.mains_width_hz
    first, second, third = (notch(k * mains, width, rate) if mains > 0.0 else PASS for k in (1, 2, 3))
    high, low = butterworth(settings.offset_hz, "high", rate), butterworth(settings.low_pass_hz, "low", rate)
    return Envelope(high, first, second, third, low)


@kernel
def envelope_start(first: float) -> EnvelopeState:
    """Before the `first` sample."""
    return EnvelopeState(first, EMPTY, EMPTY, EMPTY, EMPTY, EMPTY)


@kernel
def envelope_step(chain: Envelope, state: EnvelopeState, value: float) -> tuple[EnvelopeState, float, float]:
    """One sample; the signal without offset and mains, and its envelope, in the signal's own unit."""
    high, out = biquad(chain.high, state.high, value - state.origin)
    mains, out = biquad(chain.mains, state.mains, out)
    second, out = biquad(chain.second, state.second, out)
    third, out = biquad(chain.third, state.third, out)
    low, envelope = biquad(chain.low, state.low, abs(out))
    return EnvelopeState(state.origin, high, mains, second, third, low), out, envelope
