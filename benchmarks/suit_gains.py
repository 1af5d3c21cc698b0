"""How λ, κ and ε of the adaptive law are chosen for the suit: the bench's rule, on the suit's linear loop.

The rule of `bowden.paper.gain_choice`, on other plants: 12 dB and 60° for β̂ from 0 to 1.1 and D̂m from 0 to the error
without compensation, 30° (Fig. 17), over `suit_linear.corners`: wearers of 45, 75 and 120 kg, the elbow
at 0, 45 and 90°, the extensor taut and slack. Of the gains that have both margins take the largest κ; with it the
smallest ε, which is nearest to the printed one; with both the λ of the largest phase margin.

ε is chosen too because near s = 0 the law's tanh is a further gain β̂·D̂m/ε, which with the printed ε = 0.01 is 50 times
D̂m: on a servo alone that can be borne, on a forearm that hangs in springs it cannot. No simulation enters, and neither
friction nor play.
"""

from dataclasses import dataclass

from bowden.control.laws.adaptive import AdaptiveGains
from bowden.core.units import RADIANS
from bowden.plants.suit_parts import Suit
from suit_linear import corners, worst_margins

ERROR_GAINS = tuple(round(0.01 * i, 3) for i in range(1, 11))
"""Grid of λ [s]."""
FEEDBACK_GAINS = tuple(0.5 * i for i in range(1, 17))
"""Grid of κ; nothing above 4 1/s has the margins on any suit tried [1/s]."""
SMOOTHINGS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5)
"""Grid of ε [rad·s]."""
ESTIMATES = tuple((beta, bound) for beta in (0.0, 0.5, 1.1) for bound in (0.0, 30.0 * RADIANS))
"""(β̂, D̂m) at which the margins must hold."""


@dataclass(frozen=True)
class SuitChoice:
    """The chosen gains and their worst margins."""

    gains: AdaptiveGains
    gain_margin_db: float
    phase_margin_deg: float


def choose_suit_gains(suit: Suit, gain_margin_db: float = 12.0, phase_margin_deg: float = 60.0) -> SuitChoice:
    """Apply the rule; it takes a minute or two.

    Raises:
        ValueError: no gains on the grid have the margins.
    """
    at, least = corners(suit), (gain_margin_db, phase_margin_deg)
    for feedback in reversed(FEEDBACK_GAINS):
        for smoothing in SMOOTHINGS:
            best: SuitChoice | None = None
            for error in ERROR_GAINS:
                gains = AdaptiveGains(error_gain=error, feedback_gain=feedback, smoothing=smoothing)
                found = worst_margins(at, gains, suit.sample_time, ESTIMATES, least)
                if found is not None and (best is None or found[1] > best.phase_margin_deg):
                    best = SuitChoice(gains, *found)
            if best is not None:
                return best
    raise ValueError("no λ, κ and ε on the grid have the margins asked for")


if __name__ == "__main__":
    from bowden.plants.presets.suit import suit

    print(choose_suit_gains(suit()))
