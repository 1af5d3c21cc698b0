"""Gains of our law: nine numbers, their values for the suit, and the limits within which they make sense."""

from typing import Annotated, NamedTuple

from bowden.core.quantity import Quantity


class BowdenGains(NamedTuple):
    """Gains of the law; the defaults are for the paper's bench, of whose cable it knows nothing."""

    servo_frequency: float = 53.6
    """ω, natural frequency of the servo, to about ± 25 % [rad/s]."""
    servo_damping: float = 1.0
    """ζ of the servo [–]."""
    servo_integral: float = 0.0
    """k, integral of the drive's position loop; 0 of a PD loop, or where nothing is known [1/s]."""
    delay: float = 0.0015
    """τ, from a sample to the middle of the time for which its command is held [s]."""
    slope: float = 1.0
    """a₀, joint motion per motor motion, to about ± 40 %; negative where the cable runs the other way [rad/rad]."""
    width: float = 0.0
    """A dead zone that there is at least, in motor angle; 0 where nothing is known [rad]."""
    noise: float = 0.0002
    """σ, standard deviation of the joint's reading, counting included [rad]."""
    lag: float = 0.0
    """Time by which the joint follows the cable late, such as an arm in its springs; how it swings is learned [s]."""
    bandwidth: Annotated[float, Quantity("c, of the observer: its rate κ is c/(1/ω + 1.5·τ)", live=True)] = 4.3


SUIT = BowdenGains(noise=0.0009, lag=0.09)
"""For the suit (docs/day_one_suit.md): a flex sensor that counts by 0.05°, and a forearm that hangs in the springs of
cables and fabric and follows some 90 ms late."""

LIMITS: dict[str, tuple[float, float]] = {
    "servo_frequency": (1.0, 1e4),
    "servo_damping": (0.1, 10.0),
    "servo_integral": (0.0, 1e3),
    "delay": (0.0, 0.1),
    "width": (0.0, 0.5),
    "noise": (0.0, 0.1),
    "lag": (0.0, 0.2),
    "bandwidth": (0.1, 20.0),
}
"""Smallest and largest value of each gain that makes sense."""
