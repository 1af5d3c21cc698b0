"""What our law is told: its gains, their limits, and those for the suit."""

from typing import NamedTuple

from bowden.core.units import RADIANS


class BowdenGains(NamedTuple):
    """What the law is told; the defaults are for the paper's bench, of whose cable it knows nothing."""

    servo_frequency: float = 53.6
    """ω, natural frequency of the servo, to about ± 20 % [rad/s]."""
    servo_damping: float = 1.0
    """ζ of the servo [–]."""
    delay: float = 0.0015
    """From a sample to the middle of the time for which its command is held [s]."""
    slope: float = 1.0
    """First guess of the slope, to about ± 40 %; negative where the cable runs the other way [rad/rad]."""
    width: float = 0.0
    """First guess of the dead zone in motor angle; 0 where nothing is known [rad]."""
    doubt: float = 1.0
    """Doubt about the first guesses: 1 where nothing is known, 0.1 where they come from an identified model [–]."""
    lag: float = 0.0
    """First guess of the joint's lag behind the cable [s]."""
    feedback: float = 1.1
    """Largest gain of the feedback over ω [–]."""
    most: float = 60.0
    """Largest gain of the feedback [1/s]."""
    budget: float = 0.6
    """Largest gain of the feedback times filter, delay and learned lag [–]."""
    lead: float = 1.0
    """Time of the feedback's lead, times ω [–]."""
    smoothing: float = 0.45
    """Time constant of the error's filter, times ω [–]."""
    quiet: float = 2.2
    """Changes of the feedback that are left alone, in standard deviations of the measured noise [–]."""
    crossing: float = 1.9
    """Time of a jump through the dead zone, times ω [–]."""
    early: float = 0.4
    """Share of that time by which a jump begins before the reference turns [–]."""
    reach: float = 0.95
    """Share of the dead zone that is jumped [–]."""
    worth: float = 0.0008
    """Motion of the reference that is worth a reversal [rad]."""
    tolerance: float = 0.007
    """Error that is worth crossing the dead zone for, if it does not pass by itself [rad]."""
    patience: float = 0.5
    """Time given to an error to pass by itself [s]."""
    slow: float = 0.01
    """Speed of the reference below which a harmless dead zone is left to the feedback, not jumped blindly [rad/s]."""
    caution: float = 2.0
    """What is left out of a jump at that speed, in standard deviations of the dead zone [–]."""
    haste: float = 2.0
    """Factor on the feedback's gain inside a harmless dead zone [–]."""
    foresight: float = 0.0
    """Time for which the reference is seen ahead to tell the side (`foreseen_side`); 0 for `wanted_side` [s]."""
    rest: float = 0.0
    """Way of a braking reference below which its stroke counts as ended, and the dead zone is crossed ahead of the
    next; with `foresight` only [rad]."""
    search: float = 0.0
    """Speed at which a crossing goes on after its jump until the joint is seen to move; 0 for none [rad/s]."""
    sway: float = 0.0
    """Share of the error's swing, of tremor above all, that counts as noise where a touch is looked for [–]."""
    stray: float = 0.0
    """What moves the joint beside the motor while a slope is learned, such as an arm that swings [rad]."""
    stop: float = 0.0
    """Time within which a braking reference has to stand for its stroke to count as ended; with `rest` only, 0 for any
    time [s]."""
    late: float = 0.0
    """What a joint that has not moved with the motor may be behind until a crossing that seemed to have ended goes on,
    and two thirds of what any may; with `search` only, 0 for never [rad]."""
    rush: float = 0.0
    """Speed added to a search for each way of the reference foreseen beyond 1.5°; with `search` only [1/s]."""
    sight: float = 0.0
    """Time for which a slow reference that comes back to a joint that has not arrived is seen ahead, and the joint is
    pulled no further; with `foresight` only, 0 for none [s]."""
    chase: float = 0.0
    """Speed of a search in a slow stroke over what the joint will be behind, once most of the believed dead zone is
    crossed; with `search` only [1/s]."""


SUIT = BowdenGains(
    width=0.15,
    lag=0.09,
    most=3.0,
    lead=4.0,
    smoothing=0.3,
    crossing=9.0,
    reach=0.3,
    worth=0.6 * RADIANS,
    tolerance=3.0 * RADIANS,
    patience=0.35,
    haste=1.0,
    foresight=0.4,
    rest=0.35 * RADIANS,
    search=9.0 * RADIANS,
    sway=0.33,
    stray=0.1,
    stop=0.1,
    late=0.04,
    rush=30.0,
    sight=1.0,
    chase=5.0,
)
"""For the suit (docs/suit.md): a feedback with 12 dB and 60° of margin on a forearm that hangs in springs, with a lead
for it; crossings ahead of the next stroke, jumped in part and sought in the rest; slopes that a swinging arm does not
mislead; and no care for what a flex sensor of ± 1° cannot tell."""

LIMITS: dict[str, tuple[float, float]] = {
    "servo_frequency": (1.0, 1e4),
    "servo_damping": (0.1, 10.0),
    "delay": (0.0, 0.1),
    "width": (0.0, 0.5),
    "doubt": (0.0, 10.0),
    "lag": (0.0, 0.1),
    "feedback": (0.0, 5.0),
    "most": (0.0, 1e3),
    "budget": (0.0, 5.0),
    "lead": (0.0, 10.0),
    "smoothing": (0.01, 10.0),
    "quiet": (0.0, 100.0),
    "crossing": (0.5, 100.0),
    "early": (0.0, 1.0),
    "reach": (0.0, 1.0),
    "worth": (0.0, 1.0),
    "tolerance": (1e-6, 1.0),
    "patience": (0.01, 100.0),
    "slow": (0.0, 10.0),
    "caution": (0.0, 10.0),
    "haste": (1.0, 5.0),
    "foresight": (0.0, 10.0),
    "rest": (0.0, 0.1),
    "search": (0.0, 10.0),
    "sway": (0.0, 10.0),
    "stray": (0.0, 1.0),
    "stop": (0.0, 10.0),
    "late": (0.0, 1.0),
    "rush": (0.0, 1e3),
    "sight": (0.0, 10.0),
    "chase": (0.0, 100.0),
}
"""Smallest and largest value of each gain that has a limit."""
