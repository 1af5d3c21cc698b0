"""``bowden confirm``: one angle turned by hand, without power, beside what both encoders say of it."""

import contextlib
import select
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bowden.app.command import Command
from bowden.app.console import print_json, seconds
from bowden.app.given_rig import read_given
from bowden.hardware.drives.of_rig import open_drive

if TYPE_CHECKING:
    from bowden.hardware.ports import TorqueLeft


def confirm(
    rig: Annotated[Path, typer.Argument(help="The rig, with its [drive] and [limits].")],
    axis: Annotated[str | None, typer.Option(help="The axis, of a rig with several: one after the other.")] = None,
    channel: Annotated[str | None, typer.Option(help="The bus, in place of the rig's.")] = None,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")] = False,
) -> None:
    """Turn the joint by hand and say by how much: scales and directions of both encoders are compared with it.

    Once for a drive and its scales, before bowden run and bowden measure power it; a twin needs none.
    """
    from bowden.core.clock import MonotonicClock
    from bowden.core.errors import ParameterError
    from bowden.core.units import DEGREES
    from bowden.hardware.buses.link import Links
    from bowden.hardware.ports import serial_of
    from bowden.live import by_hand

    if not sys.stdin.isatty():
        raise ParameterError("there is no terminal to take an angle from", do="run it at a terminal, beside the rig")
    given = read_given(rig, axis).on_bus(channel)
    drive = open_drive(given.drive_parameters, given.load_cell, Links())
    with contextlib.ExitStack() as stack:
        identity = drive.bring_up()
        stack.callback(lambda: _tell_torque(drive.close()))
        _tell(identity)
        moved, before, after = by_hand.turned(drive, _line, _tell, MonotonicClock(), given.sample_time)
    joint, motor = after.joint - before.joint, after.motor - before.motor
    kept = by_hand.confirm(given, moved, joint, motor, serial_of(drive))
    if json:
        angles = {"told_deg": moved * DEGREES, "joint_deg": joint * DEGREES, "motor_deg": motor * DEGREES}
        print_json({"drive": identity, **angles, "file": str(kept), "seconds": seconds()})
    else:
        print(f"Confirmed: joint {joint * DEGREES:.1f}°, motor {motor * DEGREES:.1f}°, by hand {moved * DEGREES:g}°.")


def _tell(sentence: str) -> None:
    print(sentence, file=sys.stderr)


def _tell_torque(left: "TorqueLeft") -> None:
    from bowden.hardware.ports import TORQUE_LEFT

    if TORQUE_LEFT[left]:
        _tell(f"bowden: {TORQUE_LEFT[left]}")


def _line() -> str | None:
    """A line that was entered; None of none yet, and the empty text of a terminal that is gone."""
    ready, _, _ = select.select([sys.stdin], [], [], 0.0)
    return sys.stdin.readline() if ready else None


COMMANDS = (
    Command(
        "confirm",
        confirm,
        "Confirm the encoders' scales of a rig by one angle turned by hand.",
        (
            "bowden confirm rig.toml",
            "bowden confirm rig.toml --channel can1",
        ),
        place=45,
    ),
)
