"""`MinimumJerk`: where the joint should be, moved as smoothly as a person moves."""

from collections.abc import Iterable, Sequence
from functools import partial
from typing import Any

from bowden.control.reference import PeriodicMinimumJerk, PointToPoint
from bowden.core import arguments
from bowden.core.errors import ParameterError
from bowden.core.guesses import public


class MinimumJerk:
    """Minimum-jerk motions for a rig's reference: `periodic` or `point_to_point`. The class itself is not a motion.

    >>> MinimumJerk.periodic(0.0, 1.2, period=4.0)
    PeriodicMinimumJerk(low=0.0, high=1.2, period=4.0)
    >>> MinimumJerk.point_to_point([0.0, 1.0, 3.0], [0.0, 0.8, 0.8])
    PointToPoint(times=(0.0, 1.0, 3.0), positions=(0.0, 0.8, 0.8))
    """

    def __new__(cls, *given: Any, **named: Any) -> "MinimumJerk":
        """Refuse to make one.

        Raises:
            ParameterError: always; with what to call.
        """
        values = ", ".join(
            [*map(arguments.format_value, given), *(f"{name}={value!r}" for name, value in named.items())]
        )
        raise ParameterError(
            f"MinimumJerk({values}) is not a motion",
            expected="a motion that is periodic, or goes from point to point",
            do="call MinimumJerk.periodic(low, high, period) or MinimumJerk.point_to_point(times, positions)",
        )

    @staticmethod
    @partial(public, guesses={})
    def periodic(low: float, high: float, period: float) -> PeriodicMinimumJerk:
        """From one angle to another in the first half of each period, and back in the second half.

        Args:
            low: joint angle at the start [rad].
            high: joint angle after half a period [rad].
            period: there and back [s].

        Raises:
            ParameterError: angles that are not finite or look like degrees, or a period that is not above zero.
        """
        what = "MinimumJerk.periodic: "
        return PeriodicMinimumJerk(
            arguments.angle(low, what + "low"),
            arguments.angle(high, what + "high"),
            arguments.number(period, what + "period", "seconds, above 0"),
        )

    @staticmethod
    @partial(public, guesses={})
    def point_to_point(times: Sequence[float], positions: Sequence[float]) -> PointToPoint:
        """Through way points, with a stop at each; two equal points in a row make a pause.

        Args:
            times: when each is reached, increasing (k,) [s].
            positions: joint angle at each (k,) [rad].

        Raises:
            ParameterError: other than one angle for each time, times that do not increase, angles like degrees.
        """
        what = "MinimumJerk.point_to_point: "
        at = [
            arguments.number(one, f"{what}times[{i}]", "seconds") for i, one in enumerate(_row(times, what + "times"))
        ]
        where = _row(positions, what + "positions")
        angles = [arguments.angle(one, f"{what}positions[{i}]") for i, one in enumerate(where)]
        return PointToPoint(tuple(at), tuple(angles))


def _row(values: Any, what: str) -> list[Any]:
    if isinstance(values, str | bytes) or not isinstance(values, Iterable):
        raise ParameterError(
            f"{what} is {arguments.format_value(values)}", expected="a list of numbers", do="for example [0.0, 1.0]"
        )
    return list(values)
