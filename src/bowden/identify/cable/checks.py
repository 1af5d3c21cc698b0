"""What a log must be before anything is fitted to it; every refusal says what, where and what to do."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import LogError
from bowden.core.units import DEGREES
from bowden.identify.cable.cycles import ENOUGH
from bowden.identify.cable.turns import Index, motor_noise

Array = NDArray[np.float64]

_LEADS = 0.005
"""Of the loop that `swapped` looks at: a quarter of the least that a recorded cable shows [–]."""

_STOPPED = 0.01
"""Share of the motor's range in which a joint that stands still makes the model's end a wrong one [–]. Within a cable's
play it stands as the motor goes back, not on."""

FEWEST_SAMPLES = 50
"""Below this a loop cannot be distinguished from noise."""

_LIKE_DEGREES = (0.8 * DEGREES, 1.15 * DEGREES)
"""Ratios of two motions that are rather a mistaken unit than a cable's slope: those of cables are 0.8 to 1.15."""


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
                expected="both in the same unit",
                do="convert one of them; with a gear between them give each unit (--unit deg,deg, unit='deg,deg')",
            )


def look_swapped(motor: Array, joint: Array, turns: Index) -> bool:
    """True if motor and joint look swapped: a cable's far end lags, and so its loop is gone round one way.

    What is looked at is ½∮(m·dj − j·dm), over the motor's travel and the joint's range: 0.019 to 0.052 on 24 recordings
    of cables, and nothing on one without play.

    Args:
        motor: (n,) [rad].
        joint: (n,) [rad].
        turns: samples at which the motor turns.
    """
    if len(turns) < 3:  # nothing is gone round: the chord of an open path has an area too
        return False
    round_ = slice(turns[0], turns[2 * ((len(turns) - 1) // 2)])
    motor, joint = motor[round_], joint[round_]
    m, j = motor - motor.mean(), joint - joint.mean()
    area = 0.5 * float(np.sum(m[:-1] * np.diff(j) - j[:-1] * np.diff(m)) * np.sign(np.sum(m * j)))
    return area < -_LEADS * float(np.abs(np.diff(m)).sum() * np.ptp(j))


def stopped_at(motor: Array, joint: Array, turns: Index) -> tuple[float, float] | None:
    """The joint's angle at which it stands while the motor goes on, and how far that goes on [rad]; None where none is.

    A sensor at the end of its range reads so, and a joint at a stop.

    Args:
        motor: (n,) [rad].
        joint: (n,) [rad].
        turns: samples at which the motor turns.
    """
    near = 3.0 * motor_noise(joint)
    direction = float(np.sign(np.sum((motor - motor.mean()) * (joint - joint.mean()))))
    slope = float(np.ptp(joint) / np.ptp(motor))
    for side in (1.0, -1.0):
        out, along = side * joint, side * direction * motor
        there, beyond = out >= out.max() - near, []
        for begin, end in pairwise([0, *turns]):
            if along[end] > along[begin] and there[end] and not there[begin]:
                beyond.append(float(along[end] - along[begin + int(there[begin : end + 1].argmax())]))
        on = sorted(beyond)[-2] if len(beyond) > 1 else 0.0  # once is no stop; and not every stroke goes as far
        if on > _STOPPED * float(np.ptp(motor)) + 2.0 * near / slope:
            return side * float(out.max()), on
    return None


def check_length(samples: int, where: str) -> None:
    """Refuse a log that is too short.

    Raises:
        LogError: fewer than fifty samples.
    """
    if samples < FEWEST_SAMPLES:
        raise LogError(
            f"{where}: {samples} samples are too short a log",
            expected=f"at least {FEWEST_SAMPLES}, over several cycles",
            do=f"record at least {ENOUGH} whole cycles",
        )
