"""The loop's own process, which `session` starts: it takes the rig, compiles, brings the drive up, and cycles.

It says what happens as lines of JSON on standard output, none of them while it cycles: ``ready``, ``ended`` or
``error``. It may be started before there is a rig for it, and imports meanwhile what every run needs; where none comes,
it ends without a word.
"""

import contextlib
import json
import os
import signal
import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bowden.core.errors import SafetyError
from bowden.live.child import say, spoken

if TYPE_CHECKING:
    from bowden.live.live_run import Live


def main() -> int:
    """``python -m bowden.live.loop_process``, with a rig and the places of a run as JSON on standard input."""
    return spoken(_whole, "the loop failed")


def _whole() -> int:
    _import()
    given = sys.stdin.read()
    return _run(json.loads(given)) if given else 0


def _import() -> None:
    """Import what takes long, while whoever started this process still prepares the run."""
    import bowden.hardware.buses.link
    import bowden.hardware.realtime
    import bowden.live.live_run
    import bowden.live.loop  # noqa: F401


def _run(given: dict[str, Any]) -> int:
    from bowden.control import user_law
    from bowden.live.live_run import live_run
    from bowden.rig.rig import Rig

    live = live_run(Rig.unpack(given["rig"]), measure=given["measure"]).following(given["off_reference"])
    with contextlib.ExitStack() as stack:
        for motor in live.motors:
            stack.enter_context(user_law.explained(motor.law))
        return _cycle(live, given)


def _cycle(live: "Live", given: dict[str, Any]) -> int:
    from bowden.core.clock import MonotonicClock
    from bowden.core.errors import error_context
    from bowden.hardware.buses.link import Links
    from bowden.hardware.drives.of_rig import open_drive
    from bowden.hardware.ports import serial_of
    from bowden.hardware.realtime import Settings, become_realtime
    from bowden.live import drive_memory
    from bowden.live.by_hand import require_same
    from bowden.live.control_block import ControlBlock
    from bowden.live.loop import Loop, LoopMotor
    from bowden.live.ring import RingWriter
    from bowden.live.row import NOTHING_READ
    from bowden.models.drive.thermal import ThermalState
    from bowden.safety.state import Mode

    emg = Path(given["emg"]) if given["emg"] else None
    links, parts = Links(), []
    for motor, thermal, latched in zip(live.motors, given["thermal"], given["latched"], strict=True):
        course = motor.course(emg, given["start_ns"])
        cycle = motor.cycle()
        cycle.begin(NOTHING_READ, ThermalState(*thermal), latched)
        drive = open_drive(motor.rig.drive_parameters, motor.rig.load_cell, links)
        made = (drive, cycle, motor.script(course), course, motor.push(), motor.brake(drive), motor.estimate())
        parts.append(LoopMotor(*made))
    ring, block = RingWriter(Path(given["ring"])), ControlBlock(Path(given["block"]))
    loop = Loop(
        *(parts, ring, block, MonotonicClock(), given["start_ns"]),
        independent=live.independent,
        encoders=live.encoders,
        neighbours=live.neighbours,
    )
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, lambda *_: loop.quit())
    try:
        drives = []
        for motor, one in zip(live.motors, parts, strict=True):
            if os.getppid() != given["operator"]:
                raise SafetyError("the operator's process has ended before the drive was brought up", do="run it again")
            with error_context(motor.said):
                drives.append(one.drive.bring_up())
                if one.estimate is not None:
                    one.estimate.wait()
        each = list(zip(live.motors, parts, strict=True))
        require_same([(motor.name, motor.rig, serial_of(one.drive)) for motor, one in each])
        asked = live.rig.live
        grants = become_realtime(Settings(asked.priority, asked.cpu, asked.lock_memory))
        named = [f"{name}: {drive}" if name else drive for name, drive in zip(live.names, drives, strict=True)]
        say("ready", {"drive": "; ".join(named), "drives": drives, "grants": [asdict(grant) for grant in grants]})
    except BaseException:
        with contextlib.ExitStack() as stack:  # each, whatever becomes of another one
            stack.callback(ring.close)
            for one in reversed(parts):
                stack.callback(one.drive.close)
        raise
    drives_of = [motor.rig.drive_parameters for motor in live.motors]
    try:
        ended = loop.run()
    except SafetyError:
        for parameters in drives_of if given["remembers"] else ():  # by no fault that the supervisor knows
            drive_memory.keep_latch(parameters, 0)
        raise
    if given["remembers"]:  # the operator's process may be gone
        for parameters, end in zip(drives_of, ended.motors, strict=True):
            if end.mode == Mode.LATCHED:
                drive_memory.keep_latch(parameters, end.faults)
    say("ended", ended._asdict())
    return 0


if __name__ == "__main__":
    sys.exit(main())
