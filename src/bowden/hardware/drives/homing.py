"""Homing by hand, of any family whose angles count from a home: what makes the present position some angles."""

import math
from typing import Any, TypeVar

from bowden.core.errors import DriveError
from bowden.core.signals import DriveReading
from bowden.models.suit.suit_angle import motor_of, spool_of

Parameters = TypeVar("Parameters", bound=Any)


def zeroed(drive: Parameters, values: DriveReading, motor: float = 0.0, joint: float = 0.0) -> Parameters:
    """The parameters with which the position that was read is at these angles.

    Where the turn of the rotor is told by a hint, the hint is the motor's angle from here on.

    Args:
        drive: with which it was read; it has `home`, `motor_home`, `joint_home` and `spool`.
        values: what was read.
        motor: angle of the motor there [rad].
        joint: angle of the joint there [rad].

    Raises:
        DriveError: nothing has been read.
    """
    if not (math.isfinite(values.motor) and math.isfinite(values.joint)):
        raise DriveError("the drive has not reported a position yet", do="read a few cycles first")
    if drive.home == "here":  # the next bring-up finds the present position by itself
        return drive._replace(motor_home=motor, joint_home=joint)
    moved, spool = drive.motor_home + motor - values.motor, drive.needs.spool
    if spool is not None:  # what is added is an angle of the spool
        turned = spool_of(drive.motor_home, spool) + spool_of(motor, spool) - spool_of(values.motor, spool)
        moved = motor_of(turned, spool)
    hint = {"motor_hint": motor} if drive.home == "hint" else {}
    return drive._replace(motor_home=float(moved), joint_home=drive.joint_home + joint - values.joint, **hint)
