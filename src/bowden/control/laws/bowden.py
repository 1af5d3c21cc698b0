"""Our law: it learns while it runs how the cable loses motion, and makes up for it ahead of time.

Its equations are in `bowden.control.our_law`, their derivation in ``docs/our_law.md``.
"""

from bowden.control.law import Law
from bowden.control.our_law.gains import LIMITS, SUIT, BowdenGains
from bowden.control.our_law.law import start, step

_ANGLES = (
    *("plan", "owed", "jump", "reference", "integral", "feedback", "error_before", "error", "slow_error", "joint"),
    *("joint_before", "width", "shortfall", "far_motor", "far_joint", "turn_motor", "turn_joint", "free"),
    *("filtered_motor", "filtered_joint", "from_motor", "from_joint"),
    *("moved_motor", "moved_joint", "origin", "low", "dip", "gone"),
)

LAW = Law(
    name="bowden",
    gains=BowdenGains(),
    start_kernel=start,
    step_kernel=step,
    source="this project, docs/our_law.md",
    presets={"suit": SUIT},
    suit_preset="suit",
    told={name: name for name in ("servo_frequency", "servo_damping", "delay", "slope", "width", "doubt")},
    compensates_lag=True,
    limits=LIMITS,
    state_units={
        **dict.fromkeys(_ANGLES, "rad"),
        **dict.fromkeys(("since", "lag", "elapsed", "wave_time"), "s"),
        **dict.fromkeys(("wedge", "slope_up", "slope_down"), "rad/rad"),
        "from_rate": "rad/s",
        "variance": "rad²",
        "sway": "rad²",
    },
)
