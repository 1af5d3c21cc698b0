"""What a log must be before anything is fitted to it; every refusal says what, where and what to do."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import LogError
from bowden.core.order import median, quantile
from bowden.core.units import CABLE_LOG_LIMIT, DEGREES

Array = NDArray[np.float64]

FEWEST_SAMPLES = 50
"""Below this a loop cannot be told from noise."""

_JITTER = 0.1
"""Largest scatter of the time steps (root mean square of their departure from the median, over it) that is mended by
resampling. One step may be further off, as a scheduler's hiccup is, if it is no gap."""

_LIKE_DEGREES = (0.8 * DEGREES, 1.15 * DEGREES)
"""Ratios of two motions that are rather a mistaken unit than a cable's slope: those of cables are 0.8 to 1.15."""

_GAP = 1.5
"""A step longer than this many medians is a gap, where the others do not scatter as much: a sample may be missing."""


def check_finite(name: str, values: Array, where: Callable[[int], str]) -> None:
    """Refuse values that are not numbers.

    Raises:
        LogError: naming the first place and how many there are.
    """
    bad = np.flatnonzero(~np.isfinite(values))
    if len(bad):
        more = f" and {len(bad) - 1} more" if len(bad) > 1 else ""
        raise LogError(
            f"{where(int(bad[0]))}: {name} is {values[bad[0]]}{more}",
            expected="a number in every row",
            do="remove those rows or fill them by interpolation",
        )


def check_angles(name: str, values: Array, unit: str, unit_known: bool, where: Callable[[int], str]) -> None:
    """Refuse angles that no cable's log holds, and a signal that does not move.

    Args:
        name: of the signal.
        values: (n,) as the log has them.
        unit: ``deg`` or ``rad``, in which they are taken.
        unit_known: whether the log or the user named that unit.
        where: sample → place, for messages.

    Raises:
        LogError: an angle beyond ±20 rad, or no motion.
    """
    worst = int(np.argmax(np.abs(values)))
    limit = CABLE_LOG_LIMIT * (DEGREES if unit == "deg" else 1.0)
    if abs(values[worst]) > limit and unit == "deg":
        raise LogError(
            f"{where(worst)}: {name} is {values[worst]:.6g}°",
            expected=f"an angle within ±{limit:.0f}°",
            do="check the column and its unit, or remove the outlier",
        )
    if abs(values[worst]) > limit:
        said = "declared as radians" if unit_known else "without a unit in its name"
        raise LogError(
            f"{where(worst)}: {name} is {values[worst]:.6g}, {said}; angles beyond ±{CABLE_LOG_LIMIT:g} rad "
            "look like degrees",
            do="give the unit deg (--unit deg, unit='deg'), or end the column's name in _deg",
        )
    if not np.ptp(values) > 1e-9 * (DEGREES if unit == "deg" else 1.0):
        raise LogError(
            f"{where(0)}: {name} is {values[0]:.6g} {unit} in every sample",
            expected="a motor that moves back and forth, and a joint that follows",
            do="check the columns and the cable",
        )


def check_same_unit(motor: Array, joint: Array, where: str) -> None:
    """Refuse a joint that moves some 57.3 times as far as the motor, or a motor as the joint: degrees beside radians.

    Args:
        motor: (n,) [rad].
        joint: (n,) [rad].
        where: the log, for messages.

    Raises:
        LogError: it does.
    """
    ratio = float(np.ptp(joint) / np.ptp(motor))
    for factor, large, small in ((ratio, "joint", "motor"), (1.0 / ratio, "motor", "joint")):
        if _LIKE_DEGREES[0] < factor < _LIKE_DEGREES[1]:
            raise LogError(
                f"{where}: the {large} moves {factor:.3g} times as far as the {small}, which looks like degrees beside "
                "radians",
                expected="both in one unit",
                do="convert one of them; where the motor is counted before a gear, divide it by the gear's ratio",
            )


def check_length(samples: int, where: str) -> None:
    """Refuse a log that is too short.

    Raises:
        LogError: fewer than fifty samples.
    """
    if samples < FEWEST_SAMPLES:
        raise LogError(
            f"{where}: {samples} samples are too short a log",
            expected=f"at least {FEWEST_SAMPLES}, over several cycles",
            do="record at least six cycles",
        )


def even_time(time: Array, where: Callable[[int], str]) -> tuple[Array, list[str]]:
    """The even clock that is closest to a log's time stamps, and what is to be said about them.

    Args:
        time: (n,) finite [s].
        where: sample → place, for messages.

    Returns:
        Even times (n,), the given ones where they are even already, and warnings.

    Raises:
        LogError: time that goes back, stands still, has a gap, or scatters by more than a tenth of its step.
    """
    steps = np.diff(time)
    middle = median(steps)
    back = np.flatnonzero(steps <= 0.0)
    if len(back):
        k = int(back[0])
        kind = "repeats" if steps[k] == 0.0 else "goes back"
        raise LogError(
            f"{where(k + 1)}: time {kind} ({time[k]:.9g} s, then {time[k + 1]:.9g} s)",
            expected="time stamps that increase",
            do="sort the rows and remove repeated ones",
        )
    away = np.abs(steps / middle - 1.0)
    scatter = float(np.sqrt(np.mean(away**2)))
    worst = int(np.argmax(away))
    seen = f"a step of {steps[worst]:.4g} s where {middle:.4g} s is usual"
    if 1.4826 * median(away) > _JITTER or (scatter > _JITTER and steps[worst] <= _GAP * middle):
        raise LogError(
            f"{where(worst + 1)}: the time steps scatter by {100 * scatter:.0f} % RMS ({seen})",
            expected=f"even time stamps, within {100 * _JITTER:.0f} % RMS",
            do="resample the log on an even clock",
        )
    if steps[worst] > _GAP * middle:
        raise LogError(
            f"{where(worst + 1)}: time has a gap ({seen})",
            expected=f"no step longer than {_GAP:g} times the usual one",
            do="cut the log at the gap, or fill it by interpolation",
        )
    if float(np.max(away)) < 1e-3:
        return time, []
    even = np.linspace(time[0], time[-1], len(time))
    return even, [
        f"the time steps scatter by {100 * scatter:.2g} % RMS, {100 * away[worst]:.2g} % at worst; the log was "
        f"resampled on an even clock (accepted up to {100 * _JITTER:.0f} % RMS and {_GAP:g} times the usual step)"
    ]


def odd_time(time: Array, motor: Array) -> list[str]:
    """A warning where time looks like milliseconds that were declared as seconds."""
    step = median(np.diff(time))
    speed = quantile(np.abs(np.diff(motor)), 0.95) / step * DEGREES
    if step >= 0.5 and len(time) > 500:
        return [
            f"a time step of {step:g} s and a log of {time[-1] - time[0]:.0f} s look like milliseconds; the models do "
            "not depend on time, but the figures' time axes do (name the column time_ms)"
        ]
    if speed > 1e5:
        return [f"the motor moves at {speed:.2g} °/s: the unit of time or of the motor is probably wrong"]
    return []
