"""The wearer: forearm and hand from anthropometric tables, what the elbow does by itself, and the wearer's own torque.

About the elbow, flexion positive, angle 0 the straight arm,

    I·d²φ/dt² = −m·g·c·sin(φ + φu) − K·(φ − φn) − B·dφ/dt + wearer's torque + suit's torque

with the upper arm raised forwards by φu from hanging straight down.

Segment of forearm and hand, from a body of mass M and height H (Winter, *Biomechanics and Motor Control of Human
Movement*, 4th ed. 2009, Fig. 4.1 and Table 4.1, after Dempster and after Drillis and Contini; row "forearm and hand",
whose length runs from the elbow's axis to the ulnar styloid):

    length L = 0.146·H,   m = 0.022·M,   c = 0.682·L,   I = m·(0.827·L)²

Passive elbow: Wiegner and Watts (*J Neurol Neurosurg Psychiatry* 49, 1986, 1171) measured 0.40–1.8 N·m/rad in 19
relaxed subjects, growing with the arm's volume, about a neutral angle of 107° between upper arm and forearm, which is
73° of flexion. 0.01 N·m/rad for each kilogram of body mass keeps 45–120 kg inside that range: a stated choice. So is
the damping, a ratio of 0.2 of the hanging forearm: a relaxed arm that is let go swings a few times.
"""

import math
from typing import NamedTuple

from bowden.core.errors import ParameterError
from bowden.core.kernel import cos, kernel, sin
from bowden.core.units import RADIANS

GRAVITY = 9.81
"""g [m/s²]."""

LENGTH, MASS, CENTRE, GYRATION = 0.146, 0.022, 0.682, 0.827
"""Winter's row: length over height, mass over body mass, centre of mass and radius of gyration from the elbow over
length [–]."""

NEUTRAL = 73.0 * RADIANS
"""φn, where the relaxed elbow has no torque of its own: 180° − 107° [rad]."""

_STIFFNESS, _RATIO = 0.01, 0.2
_RANGES = {"mass": (20.0, 250.0, "kg"), "height": (1.0, 2.3, "m"), "load": (0.0, 20.0, "kg")}


class Arm(NamedTuple):
    """Forearm and hand about the elbow; `arm_of` makes them. The defaults are those of 75 kg and 1.75 m."""

    mass: float = 1.65
    """m, of forearm and hand [kg]."""
    centre: float = 0.174251
    """c, from the elbow to their centre of mass [m]."""
    inertia: float = 0.07366764256871249
    """I, about the elbow [kg·m²]."""
    stiffness: float = 0.75
    """K, of the relaxed elbow [N·m/rad]."""
    damping: float = 0.18233183082531648
    """B, of the relaxed elbow [N·m·s/rad]."""
    neutral: float = NEUTRAL
    """φn, where K has no torque [rad]."""
    elevation: float = 0.0
    """φu, of the upper arm, forwards from hanging [rad]."""


class Wearer(NamedTuple):
    """Torque of the wearer's muscles as a sum of parts; the defaults give none."""

    share: float = 0.0
    """Of the torque that holds forearm and hand against gravity; 0.3 is a weak arm, 1 one that needs no suit [–]."""
    tremor: float = 0.0
    """Amplitude of a tremor [N·m]."""
    tremor_frequency: float = 5.0
    """4 to 6 Hz [Hz]."""
    stiffness: float = 0.0
    """Of a wearer who resists: towards `centre` [N·m/rad]."""
    damping: float = 0.0
    """Of a wearer who resists: against the motion [N·m·s/rad]."""
    centre: float = 0.0
    """Where the resisting wearer wants the elbow [rad]."""
    constant: float = 0.0
    """A torque that does not change, flexing positive [N·m]."""
    swing: float = 0.0
    """Amplitude of a motion about `centre` that the wearer makes, as the stiffness behind it lets them [rad]."""
    swing_frequency: float = 0.5
    """Of that motion [Hz]."""


def arm_of(mass: float = 75.0, height: float = 1.75, *, elevation: float = 0.0, load: float = 0.0) -> Arm:
    """Forearm and hand of a body.

    Args:
        mass: of the body [kg].
        height: of the body [m].
        elevation: of the upper arm, forwards from hanging [rad].
        load: held in the hand, as a point half of Winter's length of the hand, 0.108·H, beyond the wrist [kg].

    Raises:
        ParameterError: a body that cannot be.

    >>> arm = arm_of(75.0, 1.75)
    >>> f"{arm.mass:.2f} kg, {arm.centre:.3f} m, {arm.inertia:.4f} kg·m²"
    '1.65 kg, 0.174 m, 0.0737 kg·m²'
    """
    for name, value in (("mass", mass), ("height", height), ("load", load)):
        low, high, unit = _RANGES[name]
        if not low <= value <= high:
            raise ParameterError(f"wearer: {name} is {value:g} {unit}", expected=f"{low:g} to {high:g} {unit}")
    if not abs(elevation) <= math.pi:
        raise ParameterError(f"wearer: elevation of the upper arm is {elevation:g} rad", expected="−π to π")
    index = mass / height**2
    if not 10.0 <= index <= 80.0:
        raise ParameterError(
            f"wearer: {mass:g} kg at {height:g} m is a body mass index of {index:.3g} kg/m²", expected="10 to 80 kg/m²"
        )
    length, forearm = LENGTH * height, MASS * mass
    hand = length + 0.5 * 0.108 * height
    moment = forearm * CENTRE * length + load * hand
    own = forearm * (GYRATION * length) ** 2  # what is held makes no elbow stiffer
    return Arm(
        mass=forearm + load,
        centre=moment / (forearm + load),
        inertia=own + load * hand**2,
        stiffness=_STIFFNESS * mass,
        damping=2.0 * _RATIO * math.sqrt(own * forearm * GRAVITY * CENTRE * length),
        elevation=elevation,
    )


def check_wearer(wearer: Wearer) -> Wearer:
    """The wearer, if their torque can be.

    Raises:
        ParameterError: a number that is missing or out of its range.
    """
    ranges = {
        "share": (0.0, 2.0),
        "tremor": (0.0, 20.0),
        "tremor_frequency": (0.1, 20.0),
        "stiffness": (0.0, 500.0),
        "damping": (0.0, 50.0),
        "centre": (-math.pi, math.pi),
        "constant": (-50.0, 50.0),
        "swing": (0.0, math.pi),
        "swing_frequency": (0.01, 10.0),
    }
    for name, (low, high) in ranges.items():
        value = getattr(wearer, name)
        if not low <= value <= high:
            raise ParameterError(f"wearer: {name} is {value:g}", expected=f"{low:g} to {high:g}")
    return wearer


@kernel
def gravity_torque(arm: Arm, angle: float) -> float:
    """−m·g·c·sin(φ + φu), flexing positive [N·m].

    >>> round(float(gravity_torque(Arm(), 0.5 * math.pi)), 2)
    -2.82
    """
    return -GRAVITY * arm.mass * arm.centre * sin(angle + arm.elevation)


@kernel
def passive_torque(arm: Arm, angle: float, velocity: float) -> float:
    """−K·(φ − φn) − B·dφ/dt of the relaxed elbow, flexing positive [N·m]."""
    return -arm.stiffness * (angle - arm.neutral) - arm.damping * velocity


@kernel
def wearer_torque(wearer: Wearer, arm: Arm, angle: float, velocity: float, time: float) -> float:
    """Torque of the wearer's muscles at a time [s], flexing positive [N·m].

    Who swings knows their own forearm: they add what its inertia and relaxed elbow ask for along φw = centre +
    swing·sin(2πft), so that an arm without a suit, whose weight they carry, follows φw with any stiffness.
    """
    tremor = wearer.tremor * sin(2.0 * math.pi * wearer.tremor_frequency * time)
    omega = 2.0 * math.pi * wearer.swing_frequency
    sine, cosine = wearer.swing * sin(omega * time), wearer.swing * omega * cos(omega * time)
    wanted = wearer.centre + sine
    resisting = wearer.stiffness * (wanted - angle) + wearer.damping * (cosine - velocity)
    moving = 0.0
    if wearer.swing > 0.0:
        moving = -arm.inertia * omega * omega * sine - passive_torque(arm, wanted, cosine)
    return -wearer.share * gravity_torque(arm, angle) + tremor + resisting + moving + wearer.constant
