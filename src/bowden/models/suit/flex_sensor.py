"""The flex sensor in the sleeve: a resistive strip, which is off by a little in five ways.

    reading = round( play(φ) · (1 + gain) + offset + drift + noise ),    d(drift) = −drift/τ·dt + random

The paper's sensor (Spectra Symbol, Section 2.3) is given as accurate to ±1°. The parts below add up to that: gain and
offset are constant for a wearer, the play is the strip's hysteresis in its pocket, drift wanders with warmth and sweat,
noise and steps are the converter's. The random numbers are handed in, so that a run can be repeated.
"""

from typing import NamedTuple

from bowden.core.kernel import exp, floor, kernel, sqrt
from bowden.core.units import RADIANS
from bowden.models.cable.backlash import push


class FlexSensor(NamedTuple):
    """How far a flex sensor is off; the defaults are ideal, `PAPER_FLEX` is the paper's."""

    gain: float = 0.0
    """Error of its scale [–]."""
    offset: float = 0.0
    """Error of its zero [rad]."""
    hysteresis: float = 0.0
    """Whole width of its loop [rad]."""
    drift: float = 0.0
    """Standard deviation of the drift [rad]."""
    drift_time: float = 60.0
    """τ, in which the drift forgets [s]."""
    noise: float = 0.0
    """Standard deviation of one reading [rad]."""
    resolution: float = 0.0
    """One step of the converter; 0 for none [rad]."""


PAPER_FLEX = FlexSensor(hysteresis=0.5 * RADIANS, drift=0.2 * RADIANS, noise=0.05 * RADIANS, resolution=0.05 * RADIANS)
"""±1° of accuracy: a loop of 0.5° (± 0.25°), a drift of 0.2°, and up to ± 0.4° of zero and scale, which each wearer has
of their own (``benchmarks/wearers.py``); a stated division, the paper gives the sum."""


class FlexState(NamedTuple):
    """State of the sensor."""

    slot: float
    """Of the play [rad]."""
    drift: float
    """[rad]"""


@kernel
def flex_start(angle: float) -> FlexState:
    """At a joint angle [rad], in the middle of its loop and without drift."""
    return FlexState(angle, 0.0)


@kernel
def flex_step(
    sensor: FlexSensor, state: FlexState, angle: float, normal: float, wander: float, dt: float
) -> tuple[FlexState, float]:
    """The next reading [rad].

    Args:
        sensor: its errors.
        state: before.
        angle: of the joint [rad].
        normal: a standard normal number, of the noise.
        wander: another one, of the drift.
        dt: since the reading before [s].
    """
    slot = push(state.slot, angle, 0.5 * sensor.hysteresis)
    kept = exp(-dt / sensor.drift_time)
    drift = kept * state.drift + sensor.drift * sqrt(1.0 - kept * kept) * wander
    value = slot * (1.0 + sensor.gain) + sensor.offset + drift + sensor.noise * normal
    if sensor.resolution > 0.0:
        value = sensor.resolution * floor(value / sensor.resolution + 0.5)
    return FlexState(slot, drift), value
