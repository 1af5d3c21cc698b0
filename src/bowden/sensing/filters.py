"""Causal filters for the live loop, in the portable subset."""

import math

from bowden.core.kernel import exp, kernel


@kernel
def low_pass(before: float, value: float, cutoff: float, dt: float) -> float:
    """One cycle of a first-order low-pass, exact for a value that is constant over the cycle.

        y ← y + (1 − exp(−ωc·dt))·(x − y)

    It delays slow motion by 1/ωc, which costs a law ω/ωc of phase margin at its crossover: off unless asked for.

    Args:
        before: y of the cycle before; the first value where it is not finite.
        value: x, finite.
        cutoff: ωc [rad/s]; 0 lets every value through as it is.
        dt: length of the cycle [s].

    >>> low_pass(0.0, 1.0, 0.0, 0.001), round(low_pass(0.0, 1.0, 1000.0, 0.001), 4)
    (1.0, 0.6321)
    """
    if cutoff > 0.0 and math.isfinite(before):
        return before + (1.0 - exp(-cutoff * dt)) * (value - before)
    return value
