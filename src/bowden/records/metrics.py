"""Figures of merit of a run, as pure functions of arrays; angles in radians, times in seconds."""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import LogError
from bowden.core.units import DEGREES
from bowden.records.run_figures import NO_FIGURES, Metrics

Array = NDArray[np.float64]


LATE = 10.0
"""From when on the second RMSE counts [s]."""
SMALLEST_STROKE = math.radians(5.0)
"""What counts as the stroke of a reference that moves less [rad]."""


def is_stable(reference: Array, joint: Array) -> bool:
    """True if a run reached its end with its joint never further from the reference than that's whole stroke.

    The stroke is 5° at least. A run that ran away is NaN at its end.

    Args:
        reference: (n,) [rad].
        joint: (n,) [rad].
    """
    error = np.abs(joint - reference)
    return bool(np.max(error) <= max(float(np.ptp(reference)), SMALLEST_STROKE))


def summarise(columns: Mapping[str, Array], resistance: float | None, gear_torque_constant: float | None) -> Metrics:
    """All figures of a run.

    Args:
        columns: at least ``time``, ``reference``, ``joint``; energies need ``current`` and ``motor_velocity`` too.
        resistance: the motor's terminal resistance R [Ω].
        gear_torque_constant: torque at the spool per ampere, gear × kτ [N·m/A].

    Raises:
        LogError: one of the three columns is missing, or time is not even.
    """
    missing = [name for name in ("time", "reference", "joint") if name not in columns]
    if missing:
        raise LogError(
            f"a trace without {', '.join(missing)} (it has {', '.join(columns) or 'nothing'})",
            expected="the columns time, reference and joint",
        )
    time, reference, joint = columns["time"], columns["reference"], columns["joint"]
    increasing(time)
    error = joint - reference
    if not np.isfinite(error).all():
        return NO_FIGURES
    late = time >= time[0] + LATE
    mechanical = electrical = None
    if resistance is not None and gear_torque_constant is not None and {"current", "motor_velocity"} <= set(columns):
        powers = power(columns["motor_velocity"], columns["current"], resistance, gear_torque_constant)
        if np.isfinite(powers).all():
            mechanical, electrical = energy(time, powers[0]), energy(time, powers[1])
    return Metrics(
        rmse_deg=rmse(error) * DEGREES,
        rmse_after_10s_deg=rmse(error[late]) * DEGREES if late.any() else None,
        peak_deg=float(np.max(np.abs(error))) * DEGREES,
        delay_s=delay(time, reference, joint) if is_even(time) else None,
        hysteresis_width_deg=_degrees(hysteresis_width(reference, joint)),
        mechanical_energy_j=mechanical,
        electrical_energy_j=electrical,
    )


def increasing(time: Array) -> None:
    """Refuse a clock that does not go on.

    Raises:
        LogError: fewer than two samples, or time that stands still or goes back.
    """
    if len(time) < 2:
        raise LogError(f"time has {len(time)} samples", expected="two or more")
    steps = np.diff(time)
    worst = int(np.argmin(steps))
    if not steps[worst] > 0.0:
        raise LogError(
            f"time is uneven: a step of {float(steps[worst]):g} s after sample {worst}",
            expected="increasing time",
            do="leave out such samples",
        )


def is_even(time: Array) -> bool:
    """True if all steps of a clock are within 1 % of their mean, as a delay or a frequency needs them."""
    steps = np.diff(time)
    return bool(np.all(np.abs(steps - np.mean(steps)) <= 0.01 * np.mean(steps)))


def sample_time(time: Array) -> float:
    """The step of an evenly sampled clock [s].

    Raises:
        LogError: fewer than two samples, or steps that differ by more than 1 % of their mean.
    """
    if len(time) < 2:
        raise LogError(f"time has {len(time)} samples", expected="two or more")
    steps = np.diff(time)
    mean = float(time[-1] - time[0]) / (len(time) - 1)
    worst = int(np.argmax(np.where(np.isfinite(steps), np.abs(steps - mean), np.inf)))
    if not (mean > 0.0 and abs(float(steps[worst]) - mean) <= 0.01 * mean):
        raise LogError(
            f"time is uneven: a step of {float(steps[worst]):g} s after sample {worst}, {mean:g} s in the mean",
            expected="increasing time with even steps",
            do="resample the run first",
        )
    return mean


def _degrees(angle: float | None) -> float | None:
    return None if angle is None else angle * DEGREES


def finite(value: float) -> float | None:
    """The figure, or None where it does not exist, as documents have it."""
    return value if math.isfinite(value) else None


def rmse(error: Array) -> float:
    """√(Σe²/N): Eq. 16 with the mean under the root (whether it is printed so is not known; reading 11).

    >>> rmse(np.array([3.0, -4.0]))
    3.5355339059327378
    """
    return float(np.sqrt(np.mean(np.square(error))))


def power(motor_velocity: Array, current: Array, resistance: float, gear_torque_constant: float) -> tuple[Array, Array]:
    """Mechanical power Pm = ω·kτ·I and electrical power Pe = Pm + R·I² of the motor (Eq. 18) [W].

    Negative Pm is work that the load does on the motor. Eq. 18 prints |ω|: with the current counted along the motion
    that is the same product.

    Args:
        motor_velocity: at the spool, with its sign (n,) [rad/s].
        current: positive where its torque is (n,) [A].
        resistance: R, of the motor's terminals [Ω].
        gear_torque_constant: gear × kτ [N·m/A].
    """
    mechanical = motor_velocity * gear_torque_constant * current
    return mechanical, mechanical + resistance * current**2


def energy(time: Array, power: Array) -> float:
    """∫power dt by the trapezoidal rule [J]."""
    return float(np.trapezoid(power, time))


def delay(time: Array, reference: Array, joint: Array, longest: float = 5.0) -> float | None:
    """The shift τ ≥ 0 that makes joint(t) and reference(t − τ) agree best, in the mean square, over one common window.

    Found on the samples and refined by a parabola. The window leaves out the first `longest` seconds (at most a third
    of the run), so that every shift is judged on the same stretch. Where several shifts agree almost equally well (the
    motion repeats within the window), the shortest counts. None where the reference does not move.

    Raises:
        LogError: time is not even.
    """
    n, dt = len(time), sample_time(time)
    most = int(min(longest / dt, n / 3))
    if most < 3 or np.ptp(reference[most:]) < 1e-9:
        return None
    tail = joint[most : n - 1]  # the last sample is left out so that a shift of −1 can be judged too
    size = len(tail)

    def badness(shift: int) -> float:
        return float(np.mean((tail - reference[most - shift : most - shift + size]) ** 2))

    # All shifts at once: |a − b|² = |a|² − 2·a·b + |b|², with a·b as a correlation by FFT.
    middle = float(np.mean(reference))
    a, b = tail - middle, reference - middle
    length = 1 << (n + size).bit_length()
    correlation = np.fft.irfft(np.conj(np.fft.rfft(a, length)) * np.fft.rfft(b, length), length)[: most + 1]
    squares = np.concatenate([[0.0], np.cumsum(b**2)])
    energies = squares[size : size + most + 1] - squares[: most + 1]
    all_badness = (np.sum(a**2) - 2.0 * correlation + energies)[::-1] / size  # by shift, 0 … most
    good = all_badness <= all_badness.min() + _AS_GOOD * np.ptp(all_badness)
    first = int(np.argmax(good))
    end = first + int(np.argmin(good[first:])) if not good[first:].all() else most + 1
    best = first + int(np.argmin(all_badness[first:end]))
    if best == most:
        return best * dt
    left, centre, right = badness(best - 1), badness(best), badness(best + 1)
    curvature = left - 2.0 * centre + right
    return max(0.0, best + (0.5 * (left - right) / curvature if curvature > 0 else 0.0)) * dt


_AS_GOOD = 0.02
"""Shifts whose mean square is within this share of its whole range over the least count as equally good in `delay`."""


def hysteresis_width(x: Array, y: Array) -> float | None:
    """Height of the loop of y over x at mid-stroke: the mean of y where x falls through the middle of its range, minus
    the mean where it rises through it, as a size [unit of y]. None where x does not pass its middle both ways.

    A stroke counts when x passes the middle tenth of its range; where noise makes x cross the middle several times in
    one stroke, the mean over these crossings is that stroke's y.
    """
    low, high = float(np.min(x)), float(np.max(x))
    middle, margin = 0.5 * (low + high), 0.05 * (high - low)
    side = np.where(x > middle + margin, 1, np.where(x < middle - margin, -1, 0))
    outside = np.flatnonzero(side)
    turns = np.flatnonzero(np.diff(side[outside]))  # the last sample on one side and the first on the other
    means: dict[int, list[float]] = {-1: [], 1: []}
    for start, end in zip(outside[turns], outside[turns + 1], strict=True):
        above = x[start : end + 1] >= middle
        crossing = start + np.flatnonzero(above[:-1] != above[1:])
        fraction = (middle - x[crossing]) / (x[crossing + 1] - x[crossing])
        stroke = y[crossing] + fraction * (y[crossing + 1] - y[crossing])
        means[int(side[end])].append(float(np.mean(stroke)))
    if not means[1] or not means[-1]:
        return None
    return abs(float(np.mean(means[-1])) - float(np.mean(means[1])))


def convergence_time(time: Array, estimate: Array, band: float = 0.05, period: float = 0.0) -> float | None:
    """When an estimate enters, for good, the band of ± `band` around where it ends.

    Args:
        time: (n,) [s].
        estimate: (n,).
        band: half-width of the band, relative to the final value.
        period: the run's period; a moving mean over it is judged, so that the ripple of each cycle does not count [s].

    Returns:
        The time from the first sample [s]; None where the estimate is still outside the band in the last tenth, or
        is not a number somewhere (an unstable run).

    Raises:
        LogError: time is not even.
    """
    step = sample_time(time)
    if not np.isfinite(estimate).all():
        return None
    values = estimate
    if period > 0.0:
        window = max(1, round(period / step))
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

    Raises:
        LogError: time is not even, or the record is too short or too slow for these frequencies.
    """
    grid = np.fft.rfftfreq(len(time), sample_time(time))
    if half_width < grid[1] or np.max(frequencies) > grid[-1]:
        raise LogError(
            f"a record that resolves {grid[1]:g} Hz and reaches {grid[-1]:g} Hz, asked for "
            f"{np.max(frequencies):g} Hz ± {half_width:g} Hz",
            expected="a longer record, a wider average or lower frequencies",
        )
    x, y = np.fft.rfft(source), np.fft.rfft(response)
    cross, power = np.cumsum(y * np.conj(x)), np.cumsum(np.abs(x) ** 2)
    low = np.clip(np.searchsorted(grid, frequencies - half_width) - 1, 0, None)
    high = np.clip(np.searchsorted(grid, frequencies + half_width), 1, len(grid)) - 1
    return np.asarray((cross[high] - cross[low]) / (power[high] - power[low]))


def bandwidth(frequencies: Array, gain: Array) -> float | None:
    """The first frequency at which the gain falls below 1/√2 of one (−3 dB) [rad/s]; None where it
    never does, or is below from the start.
    """
    below = np.flatnonzero(gain < math.sqrt(0.5))
    if not len(below) or below[0] == 0:
        return None
    i = below[0]
    fraction = (gain[i - 1] - math.sqrt(0.5)) / (gain[i - 1] - gain[i])
    return float(2.0 * math.pi * (frequencies[i - 1] + fraction * (frequencies[i] - frequencies[i - 1])))
