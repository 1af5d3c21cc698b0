"""Figures of merit of a run, as pure functions of arrays; angles in radians, times in seconds."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bowden.core.units import DEGREES

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Metrics:
    """The figures of one run; None where a figure does not exist (an unstable run, a motion too short)."""

    rmse_deg: float | None
    """√(Σe²/N) from rest [deg]."""
    rmse_after_10s_deg: float | None
    """The same without the first ten seconds [deg]."""
    peak_deg: float | None
    """Largest |e| [deg]."""
    delay_s: float | None
    """See `delay` [s]."""
    hysteresis_width_deg: float | None
    """See `hysteresis_width`, of the joint over the reference [deg]."""
    mechanical_energy_j: float | None
    """∫Pm dt, Eq. 18 [J]."""
    electrical_energy_j: float | None
    """∫Pe dt, Eq. 18 [J]."""


def summarise(columns: Mapping[str, Array], resistance: float | None, gear_torque_constant: float | None) -> Metrics:
    """All figures of a run.

    Args:
        columns: at least ``time``, ``reference``, ``joint``; energies need ``current`` and ``motor_velocity`` too.
        resistance: the motor's terminal resistance R [Ω].
        gear_torque_constant: torque at the spool per ampere, gear × kτ [N·m/A].
    """
    time, reference, joint = columns["time"], columns["reference"], columns["joint"]
    if not np.isfinite(joint).all():
        return Metrics(None, None, None, None, None, None, None)
    error = joint - reference
    late = time >= time[0] + 10.0
    mechanical = electrical = None
    if resistance is not None and gear_torque_constant is not None and "current" in columns:
        power = columns["motor_velocity"] * gear_torque_constant * columns["current"]
        mechanical = energy(time, power)
        electrical = energy(time, power + resistance * columns["current"] ** 2)
    return Metrics(
        rmse_deg=rmse(error) * DEGREES,
        rmse_after_10s_deg=rmse(error[late]) * DEGREES if late.any() else None,
        peak_deg=float(np.max(np.abs(error))) * DEGREES,
        delay_s=delay(time, reference, joint),
        hysteresis_width_deg=_degrees(hysteresis_width(reference, joint)),
        mechanical_energy_j=mechanical,
        electrical_energy_j=electrical,
    )


def _degrees(angle: float | None) -> float | None:
    return None if angle is None else angle * DEGREES


def rmse(error: Array) -> float:
    """√(Σe²/N): Eq. 16 with the mean under the root (whether it is printed so cannot be told; erratum 11).

    >>> rmse(np.array([3.0, -4.0]))
    3.5355339059327378
    """
    return float(np.sqrt(np.mean(np.square(error))))


def energy(time: Array, power: Array) -> float:
    """∫power dt by the trapezoidal rule [J]."""
    return float(np.trapezoid(power, time))


def delay(time: Array, reference: Array, joint: Array, longest: float = 5.0) -> float | None:
    """The shift τ ≥ 0 that makes joint(t) and reference(t − τ) agree best, in the mean square, over one common window.

    Found on the samples and refined by a parabola. The window leaves out the first `longest` seconds (at most a third
    of the run), so that every shift is judged on the same stretch. None where the reference does not move.
    """
    n, dt = len(time), float(time[1] - time[0])
    most = int(min(longest / dt, n / 3))
    if most < 3 or np.ptp(reference[most:]) < 1e-9:
        return None
    tail = joint[most:]

    def badness(shift: int) -> float:
        return float(np.mean((tail - reference[most - shift : n - shift]) ** 2))

    stride = max(1, most // 100)
    best = min(range(0, most + 1, stride), key=badness)
    while stride > 1:
        stride = max(1, stride // 4)
        around = range(max(0, best - 5 * stride), min(most, best + 5 * stride) + 1, stride)
        best = min(around, key=badness)
    if not 0 < best < most:
        return best * dt
    left, middle, right = badness(best - 1), badness(best), badness(best + 1)
    curvature = left - 2.0 * middle + right
    return (best + (0.5 * (left - right) / curvature if curvature > 0 else 0.0)) * dt


def hysteresis_width(x: Array, y: Array) -> float | None:
    """Height of the loop of y over x at mid-stroke: the mean of y where x falls through the middle of its range, minus
    the mean where it rises through it, as a size [unit of y]. None where x does not pass its middle both ways.
    """
    middle = 0.5 * (float(np.max(x)) + float(np.min(x)))
    above = x >= middle
    rising = np.flatnonzero(~above[:-1] & above[1:])
    falling = np.flatnonzero(above[:-1] & ~above[1:])
    if not len(rising) or not len(falling):
        return None

    def mean_at(index: NDArray[np.intp]) -> float:
        fraction = (middle - x[index]) / (x[index + 1] - x[index])
        return float(np.mean(y[index] + fraction * (y[index + 1] - y[index])))

    return abs(mean_at(falling) - mean_at(rising))


def convergence_time(time: Array, estimate: Array, band: float = 0.05, period: float = 0.0) -> float | None:
    """When an estimate enters, for good, the band of ± `band` around where it ends.

    Args:
        time: (n,) [s].
        estimate: (n,).
        band: half-width of the band, relative to the final value.
        period: the run's period; a moving mean over it is judged, so that the ripple of each cycle does not count [s].

    Returns:
        The time from the first sample [s]; None where the estimate is still outside the band in the last tenth.
    """
    values = estimate
    if period > 0.0:
        window = max(1, round(period / float(time[1] - time[0])))
        total = np.concatenate([[0.0], np.cumsum(estimate)])
        first = np.maximum(np.arange(len(estimate)) - window + 1, 0)
        last = np.arange(len(estimate)) + 1
        values = (total[last] - total[first]) / (last - first)
    final = float(np.mean(values[-max(1, len(values) // 10) :]))
    outside = np.flatnonzero(np.abs(values - final) > band * abs(final))
    if not len(outside):
        return 0.0
    if outside[-1] >= 0.9 * len(values):
        return None
    return float(time[outside[-1] + 1] - time[0])


def frequency_response(
    time: Array, source: Array, response: Array, frequencies: Array, half_width: float
) -> NDArray[np.complex128]:
    """G(f) from `source` to `response` by cross-spectra of the whole record, averaged over ± `half_width` [Hz].

    Args:
        time: evenly spaced (n,) [s].
        source: e.g. a chirp (n,).
        response: (n,).
        frequencies: where G is wanted (m,) [Hz].
        half_width: half-width of the average [Hz].
    """
    dt = float(time[1] - time[0])
    grid = np.fft.rfftfreq(len(time), dt)
    x, y = np.fft.rfft(source), np.fft.rfft(response)
    cross, power = np.cumsum(y * np.conj(x)), np.cumsum(np.abs(x) ** 2)
    low = np.clip(np.searchsorted(grid, frequencies - half_width) - 1, 0, None)
    high = np.clip(np.searchsorted(grid, frequencies + half_width), 1, len(grid)) - 1
    return np.asarray((cross[high] - cross[low]) / (power[high] - power[low]))


def bandwidth(frequencies: Array, gain: Array) -> float | None:
    """The first frequency at which the gain falls below 1/√2 of one (−3 dB) [rad/s]; None where it never does."""
    below = np.flatnonzero(gain < math.sqrt(0.5))
    if not len(below) or below[0] == 0:
        return None
    i = below[0]
    fraction = (gain[i - 1] - math.sqrt(0.5)) / (gain[i - 1] - gain[i])
    return float(2.0 * math.pi * (frequencies[i - 1] + fraction * (frequencies[i] - frequencies[i - 1])))
