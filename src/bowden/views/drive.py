"""What a drive says of itself, in a terminal."""

import sys
from collections.abc import Mapping

from bowden.core.errors import counted
from bowden.operations.drive import DriveMonitor, DriveProbe, DriveTare, DriveZero
from bowden.views.text import Call, rows, say_next


def show_drive_probe(found: DriveProbe, call: Call) -> None:
    """Who answers, and which one the rig means."""
    bus = found.bus
    where = f"{bus.get('channel', '')} ({bus.get('interface', '')})"
    print(f"{counted(len(found.devices), 'device')} on the bus {where}:")
    for one in found.devices:
        state = f"; {one.state.lower().replace('_', ' ')}" if one.state else ""
        ours = "  ← [drive] of this rig" if str(one.node) == bus.get("node") else ""
        print(f"  {one.node:3d}  {one.what}: {one.identity}{state}{ours}")
    say_next("drive", "monitor", call["rig"], *call.repeated("motor", "channel"))


def show_drive_monitor(found: DriveMonitor, call: Call) -> None:
    """The ranges of what was read."""
    from bowden.live.drive_look import SHOWN, SILENT

    look = found.look
    assert look is not None
    if sys.stderr.isatty():
        print(file=sys.stderr)
    lines = [
        ("cycles", str(look.cycles)),
        ("states", ", ".join(one.lower().replace("_", " ") for one in look.states)),
    ]
    for name, (_, factor, unit) in SHOWN.items():
        if name in look.least:
            lines.append((name, f"{factor * look.least[name]:.2f} to {factor * look.most[name]:.2f} {unit}"))
        else:
            lines.append((name, "not measured"))
    silent = {name: found.period * age for name, age in look.oldest.items() if found.period * age > SILENT}
    lines += [("silent", f"the {name}'s angle, for {age:.1f} s at the longest") for name, age in silent.items()]
    rows([*lines, *(("emergency", text) for text in found.emergencies)], least=12)
    if not look.silent_now(found.period):
        say_next("confirm", call["rig"], *call.repeated("motor", "channel"))


def show_drive_zero(found: DriveZero, call: Call) -> None:
    """The lines to write."""
    if not found.keys:
        print("The present position has these angles already.")
        return
    motor = call["motor"]
    where = "[drive] of the rig" if motor is None else f"[motor.drive] of the motor {motor}"
    print(f"Write these lines below {where}, in place of those that are there:")
    _keys(found.keys)
    say_next("confirm", call["rig"], *call.repeated("motor", "channel"))


def show_drive_tare(found: DriveTare, call: Call) -> None:
    """The line to write."""
    half = f"±{0.5 * found.span:.2g}"
    print(f"It reads {found.read:.4g} {found.unit}, {half}. Write this line below [{found.section}]:")
    _keys(found.keys)
    say_next("drive", "monitor", call["rig"])


def _keys(keys: Mapping[str, float]) -> None:
    for name, value in keys.items():
        print(f"  {name} = {value:g}")
