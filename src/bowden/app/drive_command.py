"""``bowden drive``: who is on a bus, what a drive says of itself, and where its zero is; the motor gets no power."""

import contextlib
import math
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bowden.app.command import Command
from bowden.app.console import print_json, seconds
from bowden.app.given_rig import read_given
from bowden.app.next_step import say_next
from bowden.hardware.drives.of_rig import open_drive

if TYPE_CHECKING:
    from bowden.hardware.ports import Drive
    from bowden.live.drive_look import DriveLook
    from bowden.rig.rig import Rig

GROUP = "Find drives on a bus, look at one, and set its zero; without power."

Rig_ = Annotated[Path, typer.Argument(help="The rig, with its [drive].", metavar="RIG")]
Channel = Annotated[str | None, typer.Option(help="The bus, in place of the rig's.")]
Axis = Annotated[str | None, typer.Option(help="The axis, of a rig with several.")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")]


def probe(rig: Rig_, axis: Axis = None, channel: Channel = None, json: Json = False) -> None:
    """Say who answers on the bus of a rig: it is listened to, then asked. Nothing is set, nothing gets power."""
    from bowden.core.errors import DriveError, counted
    from bowden.hardware.buses.link import Links
    from bowden.rig.families import family_of

    given = read_given(rig, axis).on_bus(channel)
    parameters = given.drive_parameters
    family = family_of(parameters)
    if family.probe is None:
        raise DriveError(
            f"a drive of the family {family.name} says nothing of itself",
            do="bowden drive monitor asks the one that the rig names",
        )
    found = family.probe(parameters, Links())
    bus = family.address(parameters)
    where = f"{bus.get('channel', '')} ({bus.get('interface', '')})"
    if not found:
        raise DriveError(
            f"nobody answers on the bus {where}",
            do="switch the drive on; check the cable, its termination at both ends, and the bit rate",
        )
    if json:
        print_json({"bus": dict(bus), "devices": [one._asdict() for one in found], "seconds": seconds()})
        return
    print(f"{counted(len(found), 'device')} on the bus {where}:")
    for one in found:
        state = f"; {one.state.lower().replace('_', ' ')}" if one.state else ""
        ours = "  ← [drive] of this rig" if str(one.node) == bus.get("node") else ""
        print(f"  {one.node:3d}  {one.what}: {one.identity}{state}{ours}")
    say_next("drive", "monitor", rig, *_asked(axis, channel))


def monitor(
    rig: Rig_,
    axis: Axis = None,
    channel: Channel = None,
    duration: Annotated[float | None, typer.Option(help="[s]; until Ctrl-C where none is given.")] = None,
    json: Json = False,
) -> None:
    """Show what a drive says of itself, live, until Ctrl-C: angles, current, temperature, state, faults.

    The drive is brought up, as before a run, and gets no power: turn motor and joint by hand, and look.
    """
    from bowden.core.errors import DriveError, ParameterError
    from bowden.live.drive_look import AGES
    from bowden.rig.families import family_of

    if duration is not None and not 0.0 < duration <= 1e6:
        raise ParameterError(f"--duration is {duration:g}", expected="seconds above 0", do="correct it")
    if duration is None and json:
        raise ParameterError("--json needs an end", do="add --duration 10")
    given = read_given(rig, axis).on_bus(channel)
    look: DriveLook | None = None
    with _brought_up(given) as (drive, identity), contextlib.suppress(KeyboardInterrupt):
        _tell(identity)
        for look in _looked(drive, given, math.inf if duration is None else duration):
            _show(look, given)
    if look is None:
        return
    said = look.said(family_of(given.drive).explain)
    period = given.sample_time
    if json:
        silent = {name: round(period * look.oldest[name], 4) if name in look.oldest else None for name in AGES}
        print_json({"drive": identity, **_document(look), "silent_s": silent, "said": said, "seconds": seconds()})
    else:
        _print_summary(look, said, period)
    lost = look.silent_now(period)
    if lost:
        raise DriveError(
            f"the angle of the {' and the '.join(lost)} has not come for {max(lost.values()):.1f} s",
            do="look at the plugs of bus and encoder, at both terminations, and at the drive's supply",
        )
    if not json:
        say_next("confirm", rig, *_asked(axis, channel))


def zero(
    rig: Rig_,
    motor_deg: Annotated[float, typer.Option(help="Angle of the motor, at its spool, where it is now [°].")] = 0.0,
    joint_deg: Annotated[float, typer.Option(help="Angle of the joint where it is now [°].")] = 0.0,
    axis: Axis = None,
    channel: Channel = None,
    json: Json = False,
) -> None:
    """Say which lines of [drive] make the present position these angles; the motor gets no power, nothing is written.

    Put the joint where its angle is known, with the cable just taut, and call this.
    """
    from bowden.core.errors import ParameterError
    from bowden.core.units import RADIANS
    from bowden.live.drive_look import require_zero, zero_keys
    from bowden.rig.families import family_of

    for name, value in (("--motor-deg", motor_deg), ("--joint-deg", joint_deg)):
        if not math.isfinite(value):
            raise ParameterError(f"{name} is {value:g}", expected="degrees", do="correct it")
    given = read_given(rig, axis).on_bus(channel)
    require_zero(given.drive)
    with _brought_up(given) as (drive, identity):
        _tell(identity)
        *_, look = _looked(drive, given, _SETTLE)
    assert look.last is not None
    keys = zero_keys(given.drive, given.drive_parameters, look.last, motor_deg * RADIANS, joint_deg * RADIANS)
    keys = {name: round(value, 4) for name, value in keys.items()}
    hint = family_of(given.drive).zero_hint
    if hint:
        _tell(hint)
    if json:
        print_json({"drive": identity, "keys": keys, **_document(look), "seconds": seconds()})
        return
    if not keys:
        print("The present position has these angles already.")
        return
    where = "[drive] of the rig" if axis is None else f"[axis.drive] of the axis {axis}"
    print(f"Write these lines below {where}, in place of those that are there:")
    for name, value in keys.items():
        print(f"  {name} = {value:g}")
    say_next("confirm", rig, *_asked(axis, channel))


def _asked(axis: str | None, channel: str | None) -> list[str]:
    """The same options for the next command."""
    given = (("--axis", axis), ("--channel", channel))
    return [word for name, one in given if one is not None for word in (name, one)]


def tare(
    rig: Rig_,
    load: Annotated[float, typer.Option(help="What hangs on the load cell now [N or N·m].")] = 0.0,
    axis: Axis = None,
    channel: Channel = None,
    json: Json = False,
) -> None:
    """Say which line of rig.toml makes what the load cell reads now zero, or a known load; the motor gets no power.

    Let the cable hang slack, or hang a known weight on it, and call this. Nothing is written.
    """
    from bowden.core.errors import ParameterError
    from bowden.live.drive_look import require_load_cell
    from bowden.live.drive_look import tare as tared

    if not math.isfinite(load):
        raise ParameterError(f"--load is {load:g}", expected="N or N·m", do="correct it")
    given = read_given(rig, axis).on_bus(channel)
    require_load_cell(given)
    with _brought_up(given) as (drive, identity):
        _tell(identity)
        looks = _looked(drive, given, _LISTENED)
        readings = [look.last for look in looks if look.last is not None and look.cycles * given.sample_time > _SETTLE]
    found = tared(given, readings, load)
    keys = {name: round(value, 4) for name, value in found.keys.items()}
    limits = given.supervisor_limits
    most = limits.torque_high if limits.measures_torque else limits.tension_high
    if abs(found.read - load) > _FAR * most:
        off = f"{found.read - load:+.3g} {found.unit}"
        _tell(f"bowden: note: the zero moves by {off}: is nothing but that load on the cell, and is its scale right?")
    if json:
        document = {"read": found.read, "span": found.span, "unit": found.unit, "section": found.section, "keys": keys}
        print_json({"drive": identity, "load": load, **document, "seconds": seconds()})
        return
    print(f"It reads {found.read:.4g} {found.unit}, ±{0.5 * found.span:.2g}. Write this line below [{found.section}]:")
    for name, value in keys.items():
        print(f"  {name} = {value:g}")
    say_next("drive", "monitor", rig)


_LISTENED = 1.1
"""So long a load cell is read [s]."""
_FAR = 0.1
"""Of the largest load allowed: a zero that moves by more is told [–]."""
_SETTLE = 0.1
"""So long the drive is read before its last reading is taken [s]."""
_SHOW = 0.1
"""Between two pictures on a terminal [s]."""


@contextlib.contextmanager
def _brought_up(given: "Rig") -> Iterator[tuple["Drive", str]]:
    """The rig's drive without power, and who it is; let go of at the end, and its torque is printed."""
    from bowden.hardware.buses.link import Links
    from bowden.hardware.ports import TORQUE_LEFT

    drive = open_drive(given.drive_parameters, given.load_cell, Links())
    try:
        yield drive, drive.bring_up()
    finally:
        left = TORQUE_LEFT[drive.close()]
        if left:
            _tell(f"bowden: {left}")


def _looked(drive: "Drive", given: "Rig", duration: float) -> Iterator["DriveLook"]:
    from bowden.core.clock import MonotonicClock
    from bowden.live.drive_look import looked_at

    return looked_at(drive, MonotonicClock(), given.sample_time, duration)


def _tell(sentence: str) -> None:
    print(sentence, file=sys.stderr)


def _show(look: "DriveLook", given: "Rig") -> None:
    """One line on a terminal, ten times a second."""
    from bowden.core.signals import EMERGENCY_STOP

    if look.cycles % max(1, round(_SHOW / given.sample_time)) or not sys.stderr.isatty():
        return
    assert look.last is not None
    silent = look.silent_now(given.sample_time)
    parts = [f"{name} {value} {unit}" for name, value, unit in _values(look) if name not in silent]
    parts += [f"{name} SILENT FOR {age:.1f} s" for name, age in silent.items()]
    parts += ["EMERGENCY STOP"] if look.last.emergency == EMERGENCY_STOP else []
    line = f"{look.states[-1].lower().replace('_', ' ')}: {', '.join(parts)}"
    print(f"\r\x1b[K{line}", end="", file=sys.stderr, flush=True)


def _values(look: "DriveLook") -> Iterator[tuple[str, str, str]]:
    from bowden.live.drive_look import SHOWN

    for name, (_, factor, unit) in SHOWN.items():
        value = getattr(look.last, name)
        if math.isfinite(value):
            yield name, f"{factor * value:.2f}", unit


def _document(look: "DriveLook") -> dict[str, Any]:
    from bowden.live.drive_look import SHOWN

    ranges = {}
    for name, (shown, factor, _) in SHOWN.items():
        there = name in look.least
        last = getattr(look.last, name)
        ranges[shown] = {
            "least": round(factor * look.least[name], 4) if there else None,
            "most": round(factor * look.most[name], 4) if there else None,
            "last": round(factor * last, 4) if math.isfinite(last) else None,
        }
    return {"cycles": look.cycles, **ranges, "states": look.states}


def _print_summary(look: "DriveLook", said: list[str], period: float) -> None:
    from bowden.live.drive_look import SHOWN, SILENT

    if sys.stderr.isatty():
        print(file=sys.stderr)
    rows = [("cycles", str(look.cycles)), ("states", ", ".join(one.lower().replace("_", " ") for one in look.states))]
    for name, (_, factor, unit) in SHOWN.items():
        if name in look.least:
            rows.append((name, f"{factor * look.least[name]:.2f} to {factor * look.most[name]:.2f} {unit}"))
        else:
            rows.append((name, "not measured"))
    silent = {name: period * age for name, age in look.oldest.items() if period * age > SILENT}
    rows += [("silent", f"the {name}'s angle, for {age:.1f} s at the longest") for name, age in silent.items()]
    rows += [("emergency", text) for text in said]
    for name, text in rows:
        print(f"{name:<12} {text}")


COMMANDS = (
    Command(
        "drive probe",
        probe,
        "Say who answers on the bus of a rig.",
        ("bowden drive probe rig.toml", "bowden drive probe rig.toml --channel can1"),
        place=43,
    ),
    Command(
        "drive monitor",
        monitor,
        "Show live what a drive says of itself, without power.",
        ("bowden drive monitor rig.toml", "bowden drive monitor rig.toml --duration 10 --json"),
        place=43,
    ),
    Command(
        "drive zero",
        zero,
        "Say which lines of rig.toml make the present position zero.",
        ("bowden drive zero rig.toml", "bowden drive zero rig.toml --joint-deg 90"),
        place=43,
    ),
    Command(
        "drive tare",
        tare,
        "Say which line of rig.toml makes what the load cell reads now zero.",
        ("bowden drive tare rig.toml", "bowden drive tare rig.toml --load 20"),
        place=43,
    ),
)
