"""Where in the slot of its hysteresis a cable should be, ahead of each reversal (see `bowden.control.bowden`).

q ∈ [−1, 1] is the planned place: +1 while the joint rises, −1 while it falls, and between them while the motor crosses
the dead zone. The motor is then sent to (reference − o + b·q)/a. Portable subset.
"""

from typing import NamedTuple

import numpy as np

from bowden.core.kernel import kernel, sel
from bowden.core.signals import Reference

UNHURRIED = 0.03
"""A reference slower than this [rad/s] may be waited for by a joint that is behind it."""


class SlotPlan(NamedTuple):
    """The plan with its derivatives."""

    side: float
    """Side of the slot that is wanted: +1 while the joint rises, −1 while it falls [–]."""
    slot: float
    """q [–]."""
    slot_from: float
    """q where the present jump began [–]."""
    phase: float
    """Share of the present jump that is done; 1 where there is none [–]."""
    rate: float
    """dq/dt [1/s]."""
    growth: float
    """d²q/dt² [1/s²]."""


@kernel
def wanted_side(
    side: float,
    slow_error: float,
    reference: Reference,
    early: float,
    least_speed: float,
    tolerance: float,
    patience: float,
    settled: float,
) -> float:
    """The side that the reference wants `early` ahead, unless a lasting error wants the other.

    A joint that is further than the reference, by more than `tolerance`, and that the reference will not catch up with
    within `patience`, is brought back through the slot, if the last crossing has `settled`. One that is still behind a
    slow reference that is about to turn is left where it is.
    """
    ahead = reference.velocity + reference.acceleration * early
    wanted = sel(np.abs(ahead) > least_speed, np.sign(ahead), side)
    beyond = slow_error * side  # positive: the joint is further than the reference, in the direction of motion
    need = (reference.velocity - slow_error / patience) * side
    waits = (wanted != side) * (beyond < -tolerance) * (np.abs(ahead) < UNHURRIED)
    back = (need < -tolerance / patience) * (beyond > tolerance) * (settled > 0.5)
    return sel(back, -side, sel(waits, side, wanted))


@kernel
def jumped(plan: SlotPlan, side: float, duration: float, dt: float) -> SlotPlan:
    """Cross the slot by minimum jerk in `duration` [s], whatever the reference does."""
    flip = side != plan.side
    slot_from = sel(flip, plan.slot, plan.slot_from)
    x = sel(flip, 0.0, np.fmin(1.0, plan.phase + dt / duration))
    span = side - slot_from
    return SlotPlan(
        side=side,
        slot=slot_from + span * x * x * x * (10.0 + x * (6.0 * x - 15.0)),
        slot_from=slot_from,
        phase=x,
        rate=span * 30.0 * x * x * (1.0 + x * (x - 2.0)) / duration,
        growth=span * 60.0 * x * (1.0 + x * (2.0 * x - 3.0)) / (duration * duration),
    )


@kernel
def followed(plan: SlotPlan, side: float, per_angle: float, reference: Reference, dt: float) -> SlotPlan:
    """Move through the slot with the reference, dq = `per_angle`·dφ, as a soft cable does by itself."""
    moved = plan.slot + dt * per_angle * reference.velocity
    inside = sel(np.abs(moved) < 1.0, per_angle, 0.0)
    slot = np.fmax(-1.0, np.fmin(1.0, moved))
    return SlotPlan(side, slot, slot, 1.0, inside * reference.velocity, inside * reference.acceleration)
