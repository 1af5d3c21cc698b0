"""`confirm`: one angle turned by hand, without power, beside what both encoders say of it."""

import contextlib
import select
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from bowden.operations.support.operation import GivenRig, Operation
from bowden.operations.support.results import Result, degrees

if TYPE_CHECKING:
    from collections.abc import Callable

    from bowden.hardware.ports import TorqueLeft


@dataclass(frozen=True)
class Confirmation(Result["Confirmation"]):
    """Scales and directions of both encoders, confirmed by hand."""

    drive: str
    """Who the drive is."""
    told_deg: float
    """By how much the joint was seen to go."""
    joint_deg: float
    """By how much it went by its encoder or its sensor; null where the motor alone says where it is."""
    motor_deg: float
    """By how much the motor went by its encoder."""
    file: Path
    """Where it is kept that this drive's angles are confirmed."""


def confirm(rig: GivenRig, *, motor: str | None = None, channel: str | None = None) -> Confirmation:
    """Confirm the encoders' scales of a rig by one angle turned by hand.

    Turn the joint and say by how much: scales and directions of both encoders are compared with it. Once for a drive
    and its scales, before bowden run and bowden measure power it; a twin needs none.

    Args:
        rig: the rig, with its [drive] and [limits].
        motor: the motor, of a rig with several: one after the other.
        channel: the bus, in place of the rig's.

    Raises:
        ParameterError: there is no terminal, or the encoders say something else.
        DriveError: a bus or drive that cannot be used.
        StreamError: the joint's sensor cannot be read.

    Examples:
        bowden confirm rig.toml
        bowden confirm rig.toml --channel can1
    """
    from math import nan

    from bowden.core.clock import MonotonicClock
    from bowden.core.errors import ParameterError
    from bowden.hardware.buses.link import Links
    from bowden.hardware.drives.of_rig import open_drive
    from bowden.hardware.joint_stream import of_twin
    from bowden.hardware.ports import serial_of
    from bowden.live import by_hand
    from bowden.live.joint_estimate import RestingSensor
    from bowden.operations.support import given

    if not sys.stdin.isatty():
        raise ParameterError("there is no terminal to take an angle from", do="run it at a terminal, beside the rig")
    whole = given.rig_of(rig).only(motor).on_bus(channel)
    sensor = of_twin(whole.joint_sensor, whole.drive)
    with contextlib.ExitStack() as stack:
        at_joint = None  # it is opened first: while it is waited for, no drive is
        if sensor.sensed:
            at_joint = stack.enter_context(contextlib.closing(RestingSensor(sensor, whole.sample_time)))
        drive = open_drive(whole.drive_parameters, whole.load_cell, Links())
        identity = drive.bring_up()
        stack.callback(lambda: say_torque(drive.close(), say))
        say(identity)
        moved, before, after = by_hand.turned(drive, _line, say, MonotonicClock(), whole.sample_time, sensor, at_joint)
    joint, spool = after.joint - before.joint, after.motor - before.motor
    joint = nan if sensor.source == "motor" else joint
    kept = by_hand.confirm(whole, moved, joint, spool, serial_of(drive))
    return Confirmation(identity, degrees(moved), degrees(joint), degrees(spool), Path(kept))


def say(sentence: str) -> None:
    """To who stands at the rig, while they look at it."""
    print(sentence, file=sys.stderr)


def say_torque(left: "TorqueLeft", told: "Callable[[str], None]") -> None:
    """Say whether a drive that was let go of may still have torque."""
    from bowden.hardware.ports import TORQUE_LEFT

    if TORQUE_LEFT[left]:
        told(f"bowden: {TORQUE_LEFT[left]}")


def _line() -> str | None:
    """A line that was entered; None of none yet, and the empty text of a terminal that is gone."""
    ready, _, _ = select.select([sys.stdin], [], [], 0.0)
    return sys.stdin.readline() if ready else None


OPERATIONS = (Operation("confirm", confirm, 45),)
