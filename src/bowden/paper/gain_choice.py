"""How λ and κ of the adaptive law are chosen: for margin on the constant bench, before Table 1 is computed.

The rule, stated beforehand: on a grid of λ and κ, keep the pairs whose sampled loop has a gain margin of at least 12 dB
and a phase margin of at least 60° for β̂ from 0 (where it starts) to a tenth above 1/αφ, D̂m from 0 to 0.4 rad (where it
drifts to in minutes) and the cable's slope within ± 10 %; of these take the largest κ, which is the integral gain and
so sets the tracking error, and with it the λ of the largest phase margin. No simulation enters, and no moved sheath.
"""

import itertools
from dataclasses import dataclass

from bowden.control.laws.adaptive import AdaptiveGains
from bowden.control.stability import Margins, adaptive_model, margins, servo_model
from bowden.plants.bench import Bench

ERROR_GAINS = tuple(round(0.01 + 0.005 * i, 3) for i in range(19))
"""Grid of λ, 0.01–0.1 [s]."""
FEEDBACK_GAINS = tuple(5.0 * i for i in range(1, 21))
"""Grid of κ, 5–100 [1/s]."""


@dataclass(frozen=True)
class Choice:
    """The chosen gains and their worst margins."""

    gains: AdaptiveGains
    gain_margin_db: float
    phase_margin_deg: float


def corners(bench: Bench) -> list[tuple[float, float, float]]:
    """(slope, β̂, D̂m) at which the margins must hold."""
    slope = bench.cable.slope
    return list(itertools.product((0.9 * slope, 1.1 * slope), (0.0, 0.5 / slope, 1.1 / slope), (0.0, 0.4)))


def worst_margins(bench: Bench, gains: AdaptiveGains) -> Margins | None:
    """The smallest gain and phase margin over the corners; None where one of them is unstable."""
    found: list[Margins] = []
    for slope, slope_inverse, bound in corners(bench):
        plant = servo_model(bench.servo, bench.sample_time, bench.delay, slope)
        law = adaptive_model(gains, bench.sample_time, slope_inverse, bound)
        found.append(margins(plant, law, bench.sample_time))
        if not found[-1].stable:
            return None
    return Margins(
        stable=True,
        gain_margin_db=min((m.gain_margin_db for m in found if m.gain_margin_db is not None), default=None),
        phase_margin_deg=min((m.phase_margin_deg for m in found if m.phase_margin_deg is not None), default=None),
        delay_margin_s=min((m.delay_margin_s for m in found if m.delay_margin_s is not None), default=None),
        largest_pole=max(m.largest_pole for m in found),
    )


def choose_gains(bench: Bench, gain_margin_db: float = 12.0, phase_margin_deg: float = 60.0) -> Choice:
    """Apply the rule.

    Raises:
        ValueError: no pair on the grid has the margins.
    """
    for feedback in reversed(FEEDBACK_GAINS):
        best: Choice | None = None
        for error in ERROR_GAINS:
            gains = AdaptiveGains(error_gain=error, feedback_gain=feedback)
            worst = worst_margins(bench, gains)
            if worst is None or worst.gain_margin_db is None or worst.phase_margin_deg is None:
                continue
            if worst.gain_margin_db < gain_margin_db or worst.phase_margin_deg < phase_margin_deg:
                continue
            if best is None or worst.phase_margin_deg > best.phase_margin_deg:
                best = Choice(gains, worst.gain_margin_db, worst.phase_margin_deg)
        if best is not None:
            return best
    raise ValueError("no λ and κ on the grid have the margins asked for")
