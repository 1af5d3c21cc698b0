"""Two recordings of one motion, each with a clock of its own: the motor's and the joint's, brought to one clock.

The clocks' offset and drift come from the motion itself. Where the cross-correlation of both rates is largest they are
nearly right; there a stack of plays round a bent line is fitted at each of several lags, and the one that leaves least
is taken: a cable's play delays the joint after each reversal, which the correlation takes for a lag and the stack does
not; round a straight line it would take a bend for one. The drift is the slope of the lags of both halves. Its error,
and that of the offset, is how far the lags of quarters of the log stand beside that line.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import LogError
from bowden.identify.cable.generalised import bent_stack
from bowden.identify.cable.path import build_path
from bowden.identify.cable.plays import LAGS
from bowden.identify.cable.turns import find_turns

Array = NDArray[np.float64]

_LEAST = 0.6
"""Correlation of both rates below which they are not of one motion."""
_REACH = 0.25
"""How far beside the correlation's largest the lag is looked for, over the time of a stroke."""
_SHARED = 0.5
"""Share of the shorter recording that both must have in common."""
_NODES = 400
_PARTS = 4


class Aligned(NamedTuple):
    """Both on the clock of the slower one."""

    time: Array
    """(n,) [s]"""
    motor: Array
    """(n,), in its unit."""
    joint: Array
    """(n,), in its unit."""
    said: str
    """How the clocks stood to one another, for the user."""
    uncertain: bool
    """True if the offset is known to no better than a step of the slower one."""


def aligned(motor: tuple[Array, Array], joint: tuple[Array, Array]) -> Aligned:
    """The motor's and the joint's even times [s] and angles, as one recording.

    Raises:
        LogError: they are not of one motion.
    """
    (at_motor, angle), (at_joint, answer) = motor, joint
    step = max(float(at_motor[1] - at_motor[0]), float(at_joint[1] - at_joint[0]))
    first, second = at_motor - at_motor[0], at_joint - at_joint[0]
    late, correlation = _correlated(first, angle, second, answer, step)
    if correlation < _LEAST:
        raise LogError(
            f"the motor's and the joint's file are not of one motion (correlation {correlation:.2f} at best)",
            expected="two recordings of one run",
            do="give the files of one run, or each log by itself",
        )
    shared = (max(0.0, late), min(first[-1], second[-1] + late))
    if shared[1] - shared[0] < _SHARED * min(first[-1], second[-1]):
        raise LogError(
            f"the motor's and the joint's file have {max(0.0, shared[1] - shared[0]):.3g} s in common",
            expected=f"{100 * _SHARED:g} % of the shorter one at least",
            do="record both from begin to end of the motion",
        )
    time = np.arange(*shared, step)
    on_clock = np.interp(time, first, angle)
    turns = np.count_nonzero(np.diff(np.sign(np.gradient(np.convolve(on_clock, np.ones(9) / 9.0, "same")))))
    reach = max(4.0 * step, _REACH * (shared[1] - shared[0]) / max(turns, 1))
    edges = np.linspace(time[0], time[-1], _PARTS + 1)
    lags = [
        _refined(time[one], on_clock[one], second, answer, late, reach)
        for one in ((time >= low) & (time <= high) for low, high in pairwise(edges))
    ]
    middles = 0.5 * (edges[1:] + edges[:-1])
    drift, offset = (float(one) for one in np.polyfit(middles - middles.mean(), lags, 1))
    rest = np.array(lags) - offset - drift * (middles - middles.mean())
    scatter = float(np.sqrt(np.sum(rest**2) / (_PARTS - 2)))
    drift_error = scatter / float(np.sqrt(np.sum((middles - middles.mean()) ** 2)))
    if abs(drift) < 2.0 * drift_error:
        drift = 0.0
    offset = _refined(time, on_clock, second / (1.0 - drift), answer, offset - drift * middles.mean(), reach)
    moved = second / (1.0 - drift) + offset  # the joint's times on the motor's clock
    kept = (time >= moved[0]) & (time <= moved[-1])
    between = float(at_motor[0] - at_joint[0]) + offset
    said = (
        f"the joint's clock stands {between:.4f} ± {scatter / np.sqrt(_PARTS):.1g} s before the motor's at the start"
        f" and runs {1e6 * drift:.0f} ± {1e6 * drift_error:.0f} ppm slower: both were aligned by the motion, at "
        f"{1.0 / step:.4g} Hz"
    )
    return Aligned(time[kept], on_clock[kept], np.interp(time[kept], moved, answer), said, scatter > 2.0 * step)


def _correlated(first: Array, angle: Array, second: Array, answer: Array, step: float) -> tuple[float, float]:
    """How much later the second's clock began [s], and the correlation of both rates there, whatever its sign."""
    from scipy.signal import correlate

    rates = []
    for time, values in ((first, angle), (second, answer)):
        even = np.interp(np.arange(0.0, time[-1], step), time, values)
        rate = np.gradient(np.convolve(even, np.ones(5) / 5.0, "same"))
        rate[:5] = rate[-5:] = 0.0
        rates.append(rate / max(float(np.sqrt(rate @ rate)), 1e-300))
    found = correlate(rates[0], rates[1], method="fft")
    best = int(np.argmax(np.abs(found)))
    shift = best - len(rates[1]) + 1
    overlap = (max(0, shift), min(len(rates[0]), len(rates[1]) + shift))
    share = np.linalg.norm(rates[0][slice(*overlap)]) * np.linalg.norm(
        rates[1][overlap[0] - shift : overlap[1] - shift]
    )
    return shift * step, float(abs(found[best]) / max(share, 1e-300))


def _refined(time: Array, motor: Array, second: Array, answer: Array, late: float, reach: float) -> float:
    """The lag near `late` at which a stack of plays round a bent line leaves least of the joint [s]."""
    from scipy.optimize import minimize_scalar

    turns = find_turns(motor)

    def left(lag: float) -> float:
        path = build_path(time, motor, np.interp(time, second + lag, answer), turns, _NODES)
        return bent_stack(path, LAGS * path.span).left

    tried = late + reach * np.linspace(-1.0, 1.0, 17)
    near = float(tried[int(np.argmin([left(one) for one in tried]))])
    width = reach / 8.0
    return float(
        minimize_scalar(left, bounds=(near - width, near + width), method="bounded", options={"xatol": 1e-4}).x
    )
