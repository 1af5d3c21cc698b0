"""The path of a log: the motor's travel from reversal to reversal, freed of encoder noise, with the joint along it.

All models here are rate-independent: only the order of the motor's positions matters, not when they were reached. A
log is therefore thinned along its travel. Between two reversals, following samples are averaged into nodes that do not
step back; each reversal is a node of its own, with a weight of zero and the motor's extreme estimated from the samples
around it. Without this, every flicker of an encoder would count as a reversal, and the travel lost at the rounded tops
would shift each branch of the loop.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bowden.core.kernel import compiled, kernel

Array = NDArray[np.float64]
Index = NDArray[np.intp]

_SPAN = 5.0
"""Motion, in standard deviations of the noise, over which samples are averaged to find an extreme; of 5, 10 and 20 the
one that is right within 0.2 of a deviation for sines, minimum-jerk motions and sharp triangles alike."""


@dataclass(frozen=True)
class Path:
    """Nodes in the order in which the motor passed them."""

    motor: Array
    """Motor angle (n,) [rad]."""
    joint: Array
    """Mean joint angle (n,) [rad]; zero where the weight is."""
    weight: Array
    """Samples averaged in the node (n,) [–]; zero at the start and the reversals."""
    time: Array
    """Mean time (n,) [s]."""
    stroke: NDArray[np.int64]
    """Which stroke the node belongs to, from 0 (n,)."""
    turning: Array
    """Motor angle at the start, at each reversal, and at the end (strokes + 1,) [rad]."""
    start_error: float
    """Standard error of the motor angle at the start [rad]."""
    reversal_error: float
    """Standard error that all reversals of one side may have in common [rad]."""

    @property
    def strokes(self) -> int:
        """Monotone strokes of the motor."""
        return len(self.turning) - 1

    @property
    def span(self) -> float:
        """Range of the motor [rad]."""
        return float(np.ptp(self.turning))

    def with_weight(self, weight: Array) -> "Path":
        """The same path, its nodes weighted otherwise (n,)."""
        return replace(self, weight=weight)


def build_path(time: Array, motor: Array, joint: Array, noise: float, nodes: int) -> Path:
    """The path of a log.

    Args:
        time: (n,) [s].
        motor: (n,) [rad].
        joint: (n,) [rad].
        noise: standard deviation of the motor's reading, `motor_noise` [rad].
        nodes: about how many nodes are wanted; reversals that are close together add some.
    """
    threshold = max(8.0 * noise, 2e-3 * float(np.ptp(motor)))
    at = reversals(motor, threshold)
    (start, start_error), (end, _) = _first_value(motor, noise), _first_value(motor[::-1], noise)
    turning = np.array([start, *(_extreme(motor, k, noise) for k in at), end])
    travel = float(np.sum(np.abs(np.diff(turning))))
    fast = float(np.quantile(np.abs(motor[9:] - motor[:-9]), 0.9)) / 9.0  # per sample; nine outweigh the noise
    together = max(1, int(travel / nodes / max(fast, 1e-12)), len(motor) // (4 * nodes))
    together = min(together, max(1, len(motor) // nodes))
    parts = compiled(gather)(time, motor, joint, np.array([0, *at, len(motor)]), turning, together)
    return Path(parts[0], parts[1], parts[2], parts[3], parts[4], turning, start_error, common_error(motor))


def motor_noise(motor: Array) -> float:
    """Standard deviation of a recorded angle's reading, from its second differences and from its resolution [rad].

    The encoder's count is taken to be the smallest step, if the log consists of so few different steps that they must
    be counts.
    """
    second = np.diff(motor, 2)
    white = float(np.median(np.abs(second))) / (0.6745 * np.sqrt(6.0))
    return max(white, resolution(motor) / np.sqrt(12.0))


def common_error(motor: Array) -> float:
    """What averaging cannot mend in the angle of a reversal that comes back at the same place [rad].

    Without noise to move it about, an encoder shows the same count at every visit: its error, 0.225 counts (the mean
    square of its first harmonic), shrinks by exp(−2π²·(noise/count)²). The estimate of an extreme has a bias of its own
    of up to 0.07 of the noise, at the flat tops of a minimum-jerk motion.

    Source: Widrow and Kollár, *Quantization Noise*, 2008, Chapter 6, for the first harmonic.
    """
    count = resolution(motor)
    spread = float(np.mean(np.diff(motor, 2) ** 2)) / 6.0 if count > 0.0 else motor_noise(motor) ** 2
    white = np.sqrt(max(0.0, spread - count**2 / 12.0))
    quantised = 0.225 * count * np.exp(-2.0 * np.pi**2 * (white / count) ** 2) if count > 0.0 else 0.0
    return float(np.hypot(quantised, 0.07 * white))


def resolution(angle: Array) -> float:
    """One count of the encoder behind a recorded angle [rad]; zero where none can be told.

    >>> float(round(resolution(np.round(np.linspace(0.0, 1.0, 999) ** 2 / 0.01) * 0.01), 9))
    0.01
    """
    levels = np.unique(angle)
    if len(levels) > 0.5 * len(angle) or len(levels) < 2:
        return 0.0
    steps = np.diff(levels)
    return float(np.median(steps[steps > 1e-3 * np.median(steps)]))


def reversals(motor: Array, threshold: float) -> Index:
    """Samples at which the motor turns, ignoring swings smaller than `threshold` [rad]."""
    return np.asarray(compiled(zigzag)(motor, threshold), dtype=np.intp)


@kernel
def zigzag(motor: Array, threshold: float) -> NDArray[np.int64]:
    """Indices of the extremes between swings of at least `threshold`."""
    found = np.empty(motor.size, np.int64)
    count, direction, low, high = 0, 0, 0, 0
    for k in range(motor.size):
        if motor[k] > motor[high]:
            high = k
        if motor[k] < motor[low]:
            low = k
        if direction >= 0 and motor[high] - motor[k] >= threshold:
            found[count] = high
            count += direction  # the first swing only tells where the motor sets out to
            direction, high, low = -1, k, k
        elif direction <= 0 and motor[k] - motor[low] >= threshold:
            found[count] = low
            count -= direction
            direction, high, low = 1, k, k
    return found[:count]


def _extreme(motor: Array, at: int, noise: float) -> float:
    """The motor's true extreme near the sample `at` [rad]: the top of a quartic through the samples around it.

    The quartic spans the stretch within which the motor moves by a few times its noise, so that the noise is averaged
    as far as the motion allows; the extreme reading itself is biased outwards.
    """
    half = 1
    while True:
        wider = max(half + 1, int(1.25 * half))
        if at - wider < 0 or at + wider >= len(motor):
            break
        edge = max(1, wider // 4)
        middle = np.mean(motor[at - edge : at + edge + 1])
        left = np.mean(motor[at - wider : at - wider + edge])
        right = np.mean(motor[at + wider - edge + 1 : at + wider + 1])
        if max(abs(middle - left), abs(middle - right)) > _SPAN * noise:
            break
        half = wider
    if half < 4:
        return float(motor[at])
    near = motor[at - half : at + half + 1]
    smooth = _polynomial(near, 4)[half // 4 : -(half // 4)]
    return float(np.max(smooth) if motor[at] > 0.5 * (near[0] + near[-1]) else np.min(smooth))


def _first_value(motor: Array, noise: float) -> tuple[float, float]:
    """The motor's true angle at the first sample and its standard error [rad].

    From a parabola through the samples within which the motor moves a few times its noise.
    """
    far = np.flatnonzero(np.abs(motor - motor[0]) > _SPAN * noise)
    near = motor[: far[0]] if len(far) else motor
    if len(near) < 12:
        return float(motor[0]), noise
    return float(_polynomial(near, 2)[0]), 3.0 * noise / float(np.sqrt(len(near)))


def _polynomial(values: Array, degree: int) -> Array:
    x = np.linspace(-1.0, 1.0, len(values))
    return np.asarray(np.polynomial.chebyshev.chebval(x, np.polynomial.chebyshev.chebfit(x, values, degree)))


@kernel
def gather(
    time: Array, motor: Array, joint: Array, bounds: NDArray[np.int64], turning: Array, together: int
) -> tuple[Array, Array, Array, Array, NDArray[np.int64]]:
    """Average every `together` samples of a stroke into a node; then merge nodes that would step back.

    The samples are grouped by time, not by travel: a group that ended where a reading is large would be biased. The
    merging (pooled adjacent violators) gives the monotone motion closest to the readings; a rest becomes one node. It
    leaves the last node of a stroke a little too far out, so no node may lie beyond the reversals.

    Returns:
        Motor, joint, weight, time and stroke of each node.
    """
    size = motor.size // together + 2 * bounds.size
    m, j, w, t = np.zeros(size), np.zeros(size), np.zeros(size), np.zeros(size)
    owner = np.zeros(size, np.int64)
    n = 0
    for stroke in range(bounds.size - 1):
        sign = 1.0 if turning[stroke + 1] >= turning[stroke] else -1.0
        m[n], j[n], w[n] = turning[stroke], 0.0, 0.0
        t[n], owner[n] = time[bounds[stroke]], stroke
        n += 1
        first = n
        for begin in range(bounds[stroke], bounds[stroke + 1], together):
            stop = min(begin + together, bounds[stroke + 1])
            m[n], j[n] = np.mean(motor[begin:stop]), np.mean(joint[begin:stop])
            t[n], w[n], owner[n] = np.mean(time[begin:stop]), stop - begin, stroke
            n += 1
            while n - 1 > first and sign * (m[n - 1] - m[n - 2]) <= 0.0:
                share = w[n - 1] / (w[n - 2] + w[n - 1])
                m[n - 2] += (m[n - 1] - m[n - 2]) * share
                j[n - 2] += (j[n - 1] - j[n - 2]) * share
                t[n - 2] += (t[n - 1] - t[n - 2]) * share
                w[n - 2] += w[n - 1]
                n -= 1
        for k in range(first, n):
            m[k] = sign * min(max(sign * m[k], sign * turning[stroke]), sign * turning[stroke + 1])
    return m[:n], j[:n], w[:n], t[:n], owner[:n]
