"""The motion of the motor from which cable and servo are identified: slow ramps, sines of several sizes, a chirp."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bowden.control.reference import Chirp, PointToPoint
from bowden.core.errors import ParameterError
from bowden.safety.limits import Limits

Array = NDArray[np.float64]

_SHARE = 0.9
"""Of the way to the nearest limit that is used."""
_RAMP = 4.0
"""Time of one slow stroke over the whole range [s]."""
_SINES = ((1.0, 0.2, 3), (0.5, 0.3, 4), (0.25, 0.4, 4))
"""Share of the range, frequency [Hz] and cycles of each sine."""
_REST = 0.5
"""Between two parts [s]."""
_CHIRP = (0.06, 0.3, 12.0, 20.0)
"""Amplitude [rad], first and last frequency [Hz], length [s]."""


@dataclass(frozen=True)
class Excitation:
    """A motion of the motor."""

    motor: Array
    """Target in each cycle (n,) [rad]."""
    servo_from: int
    """The cycle at which the chirp begins; what is before it shows the cable."""


def excitation(limits: Limits, period: float) -> Excitation:
    """Ramps over the whole range, sines of all of it, a half and a quarter about its middle, and a chirp there.

    The range goes from 0, where the cable is slack or just taut, to 0.9 of what motor and joint may do, the joint taken
    to follow with the steepest slope that the limits know.

    Args:
        limits: the supervisor's.
        period: of a cycle [s].

    Raises:
        ParameterError: no room to move.
    """
    pull = -limits.slack_sign
    motor = limits.motor_high if pull > 0.0 else -limits.motor_low
    joint = limits.joint_high if pull > 0.0 else -limits.joint_low
    top = _SHARE * min(motor, joint / limits.slope_high)
    if not (top > 2.0 * _CHIRP[0] and limits.motor_low <= 0.0 <= limits.motor_high):
        raise ParameterError(
            f"the limits leave the motor {np.degrees(max(top, 0.0)):.3g}° to move from 0",
            expected=f"more than {np.degrees(2.0 * _CHIRP[0]):.3g}°, and 0 between motor_low_deg and motor_high_deg",
            do="correct [limits], or the homes in [drive]",
        )
    middle = 0.5 * top
    knots = [0.0, *(top if i % 2 else 0.0 for i in range(1, 5)), middle]
    slow = PointToPoint(tuple(_RAMP * i for i in range(len(knots))), tuple(knots))
    parts = [slow.sample(_cycles(_RAMP * (len(knots) - 1), period))[:, 0]]
    rest = np.full(round(_REST / period), middle)
    for share, frequency, cycles in _SINES:
        time = _cycles(cycles / frequency, period)
        grown = np.minimum(1.0, np.minimum(time, time[-1] - time) * frequency)  # over the first and the last cycle
        parts += [rest, middle + share * middle * grown * np.sin(2.0 * np.pi * frequency * time)]
    parts.append(rest)
    amplitude, first, last, length = _CHIRP
    time = _cycles(length, period)
    sweep = Chirp(amplitude, first, last, length).sample(time)[:, 0]
    fade = np.minimum(1.0, np.minimum(time, time[-1] - time) / 0.5)
    begin = sum(map(len, parts))
    return Excitation(pull * np.concatenate([*parts, middle + fade * sweep, rest]), begin)


def _cycles(duration: float, period: float) -> Array:
    return np.arange(round(duration / period), dtype=np.float64) * period
