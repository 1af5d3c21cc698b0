"""Friction of a suit's drive, gears and sheaths from a run that goes to and fro: half of what the torques differ by.

    F = ½·median over the spool's angles of (torque going up − torque going down)

At one angle the load of cables and arm is nearly the same both ways, and friction has the other sign. What is found is
what the motor's torque has to make up for, at the spool: bearings, gears and sheaths together.
"""

import numpy as np

from bowden.core.errors import LogError
from bowden.records.trace import Trace

BINS, SLOWEST = 20, 0.02
"""Of the spool's angle, and its speed below which friction may have any size up to its own [rad/s]."""


def spool_friction(trace: Trace, after: float = 0.0) -> float:
    """The friction at the spool [N·m], to about a tenth where nobody works against it.

    Args:
        trace: of `bowden.sim.run.simulate` on a suit, best slow and without compensation.
        after: time from which on it counts [s].

    Raises:
        LogError: the run does not go both ways over the same angles.
    """
    torque, speed = trace["current"] * float(trace.settings["torque_constant"]), trace["motor_velocity"]
    angle, counts = trace["spool"], trace.time >= after
    low, high = np.quantile(angle[counts], (0.1, 0.9))
    place = np.floor(BINS * (angle - low) / max(high - low, 1e-9))
    found = []
    for k in range(BINS):
        here = counts & (place == k)
        up, down = torque[here & (speed > SLOWEST)], torque[here & (speed < -SLOWEST)]
        if len(up) and len(down):
            found.append(0.5 * (up.mean() - down.mean()))
    if len(found) < BINS // 2:
        raise LogError(
            f"friction of the spool: {len(found)} of {BINS} angles were passed both ways",
            expected=f"{BINS // 2} or more, faster than {SLOWEST:g} rad/s",
            do="take a run that flexes and extends",
        )
    return float(np.median(found))
