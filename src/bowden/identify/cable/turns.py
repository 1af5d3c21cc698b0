"""Where the motor turns, and how well a noisy, counting encoder lets that be known.

A reversal's angle matters: it is where the cable's hysteresis starts again, and an error of it shifts the whole branch
that follows. The extreme reading itself lies too far out by a few times the noise.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from bowden.core.kernel import compiled, kernel

Array = NDArray[np.float64]
Index = NDArray[np.intp]

_SPAN = 5.0
"""Motion, in standard deviations of the noise, over which samples are averaged to find an extreme; of 5, 10 and 20 the
one that is right within 0.2 of a deviation for sines, minimum-jerk motions and sharp triangles alike."""


_ENOUGH = 200_000
"""Samples that show an encoder's counts, noise and speed: of twice as many and more, every so many is looked at."""


@dataclass(frozen=True)
class Turns:
    """The reversals of a recorded motion."""

    at: Index
    """Sample of each reversal (strokes − 1,)."""
    angle: Array
    """Motor angle at the start, at each reversal, and at the end (strokes + 1,) [rad]."""
    start_error: float
    """Standard error of the motor angle at the start [rad]."""
    common_error: float
    """Standard error that all reversals of one side may have in common [rad]."""


def find_turns(motor: Array, noise: float | None = None) -> Turns:
    """The reversals of a motion (n,) [rad] whose reading has that `noise` [rad]; see `motor_noise`."""
    noise = motor_noise(motor) if noise is None else noise
    at = reversals(motor, least_swing(motor, noise))
    sums = np.concatenate([[0.0], np.cumsum(motor)])
    (start, start_error), (end, _) = _first_value(motor, noise), _first_value(motor[::-1], noise)
    tops = [_extreme(motor, sums, k, noise) for k in at.tolist()]
    return Turns(at, np.array([start, *tops, end]), start_error, _common_error(motor))


def least_swing(motor: Array, noise: float | None = None) -> float:
    """The least swing of a motion that is no noise [rad]."""
    noise = motor_noise(motor) if noise is None else noise
    return max(8.0 * noise, 2e-3 * float(np.ptp(motor)), 1e-9)


def peak_speed(time: Array, angle: Array) -> float:
    """The speed that a signal hardly ever exceeds [rad/s]; nine samples outweigh its noise."""
    moved = (angle[9:] - angle[:-9])[:: max(1, len(angle) // _ENOUGH)]
    return float(np.quantile(np.abs(moved), 0.95)) / (9.0 * float(np.median(np.diff(time))))


def motor_noise(motor: Array) -> float:
    """Standard deviation of a recorded angle's reading, from its second differences and from its resolution [rad].

    The encoder's count is taken to be the smallest step, if the log consists of so few different steps that they must
    be counts.
    """
    second = np.diff(motor, 2)[:: max(1, len(motor) // _ENOUGH)]
    white = float(np.median(np.abs(second))) / (0.6745 * np.sqrt(6.0))
    return max(white, resolution(motor) / np.sqrt(12.0))


def _common_error(motor: Array) -> float:
    """What averaging cannot mend in the angle of a reversal that comes back at the same place [rad].

    Without noise to move it about, an encoder shows the same count at every visit: its error, 0.225 counts (the mean
    square of its first harmonic), shrinks by exp(−2π²·(noise/count)²). The estimate of an extreme has a bias of its own
    of up to 0.07 of the noise at the flat tops of a minimum-jerk motion; what it and the nodes beside it do to a play's
    half-width is some 0.12 of it (0.05 to 0.17 on four simulated logs).

    Source: Widrow and Kollár, *Quantization Noise*, 2008, Chapter 6, for the first harmonic.
    """
    count = resolution(motor)
    spread = float(np.mean(np.diff(motor, 2) ** 2)) / 6.0 if count > 0.0 else motor_noise(motor) ** 2
    white = np.sqrt(max(0.0, spread - count**2 / 12.0))
    quantised = 0.225 * count * np.exp(-2.0 * np.pi**2 * (white / count) ** 2) if count > 0.0 else 0.0
    return float(np.hypot(quantised, 0.12 * white))


def resolution(angle: Array) -> float:
    """One count of the encoder behind a recorded angle [rad]; zero where none can be determined.

    >>> float(round(resolution(np.round(np.linspace(0.0, 1.0, 999) ** 2 / 0.01) * 0.01), 9))
    0.01
    """
    angle = angle[:: max(1, len(angle) // _ENOUGH)]
    levels = np.unique(angle)
    if len(levels) > 0.5 * len(angle) or len(levels) < 2:
        return 0.0
    steps = np.diff(levels)
    return float(np.median(steps[steps > 1e-3 * np.median(steps)]))


def reversals(motor: Array, threshold: float) -> Index:
    """Samples at which the motor turns, ignoring swings smaller than `threshold` [rad]."""
    found = np.empty(len(motor), np.int64)
    count = compiled(zigzag)(np.ascontiguousarray(motor), threshold, found)
    return found[:count].astype(np.intp)


@kernel
def zigzag(motor: Array, threshold: float, found: NDArray[np.int64]) -> int:
    """Fill `found` with the indices of the extremes between swings of at least `threshold`, and count them."""
    count, direction, low, high = 0, 0, 0, 0
    for k in range(motor.size):
        if motor[k] > motor[high]:
            high = k
        if motor[k] < motor[low]:
            low = k
        if direction >= 0 and motor[high] - motor[k] >= threshold:
            found[count] = high
            count += direction  # the first swing only shows where the motor sets out to
            direction, high, low = -1, k, k
        elif direction <= 0 and motor[k] - motor[low] >= threshold:
            found[count] = low
            count -= direction
            direction, high, low = 1, k, k
    return count


def _extreme(motor: Array, sums: Array, at: int, noise: float) -> float:
    """The motor's true extreme near the sample `at` [rad]: the top of a quartic through the samples around it.

    The quartic spans the stretch within which the motor moves by a few times its noise, so that the noise is averaged
    as far as the motion allows. `sums` are the motor's running sums (n + 1,).
    """
    half = 1
    while True:
        wider = max(half + 1, int(1.25 * half))
        if at - wider < 0 or at + wider >= motor.size:
            break
        edge = max(1, wider // 4)
        middle = (sums[at + edge + 1] - sums[at - edge]) / (2 * edge + 1)
        left = (sums[at - wider + edge] - sums[at - wider]) / edge
        right = (sums[at + wider + 1] - sums[at + wider - edge + 1]) / edge
        if max(abs(middle - left), abs(middle - right)) > _SPAN * noise:
            break
        half = wider
    if half < 4:
        return float(motor[at])
    near = motor[at - half : at + half + 1]
    first = half // 4
    smooth = _smoothed(near, 4)[first : near.size - first]
    return float(smooth.max() if motor[at] > 0.5 * (near[0] + near[-1]) else smooth.min())


def _first_value(motor: Array, noise: float) -> tuple[float, float]:
    """The motor's true angle at the first sample and its standard error [rad].

    From a parabola through the samples within which the motor moves a few times its noise.
    """
    far = np.flatnonzero(np.abs(motor - motor[0]) > _SPAN * noise)
    near = motor[: far[0]] if len(far) else motor
    if len(near) < 12:
        return float(motor[0]), noise
    return float(_smoothed(near, 2)[0]), 3.0 * noise / float(np.sqrt(len(near)))


def _smoothed(values: Array, degree: int) -> Array:
    """Evenly spaced values (n,) smoothed by the polynomial of a degree that fits them best."""
    basis = _polynomials(len(values), degree)
    return np.asarray(basis @ (basis.T @ values))


@lru_cache(256)
def _polynomials(count: int, degree: int) -> Array:
    """Orthonormal ones at evenly spaced places (count, degree + 1)."""
    return np.linalg.qr(np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, count), degree))[0]
