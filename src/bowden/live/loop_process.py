"""The loop's own process, which `session` starts: it takes the rig, compiles, brings the drive up, and cycles.

It says what happens as lines of JSON on standard output, none of them while it cycles: ``ready``, ``ended`` or
``error``.
"""

import json
import signal
import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bowden.core.errors import BowdenError, SafetyError
from bowden.live.left_behind import sweep

if TYPE_CHECKING:
    from bowden.live.live_run import Live


def main() -> int:
    """``python -m bowden.live.loop_process``, with a rig and the places of a run as JSON on standard input."""
    given = json.load(sys.stdin)
    try:
        return _run(given)
    except BowdenError as error:
        _say("error", str(error))
    except Exception as error:  # so that the operator learns why there is no loop
        _say("error", f"the loop failed: {type(error).__name__}: {error}")
        raise
    finally:
        sweep()
    return 2


def _run(given: dict[str, Any]) -> int:
    from bowden.control import user_law
    from bowden.live.live_run import live_run
    from bowden.rig.rig import Rig

    live = live_run(Rig.unpack(given["rig"]), measure=given["measure"])
    with user_law.explained(live.law):
        return _cycle(live, given)


def _cycle(live: "Live", given: dict[str, Any]) -> int:
    from bowden.core.clock import MonotonicClock
    from bowden.hardware.buses.link import Links
    from bowden.hardware.drives.family import family_of
    from bowden.hardware.realtime import become_realtime
    from bowden.live import latch_file
    from bowden.live.control_block import ControlBlock
    from bowden.live.loop import Loop
    from bowden.live.preflight import REASONS, Reason
    from bowden.live.ring import RingWriter
    from bowden.live.row import NOTHING_READ
    from bowden.models.drive.thermal import ThermalState
    from bowden.safety.supervisor import Mode

    emg = Path(given["emg"]) if given["emg"] else None
    course = live.course(emg, given["start_ns"])
    cycle, script, push = live.cycle(), live.script(course), live.push()
    cycle.begin(NOTHING_READ, ThermalState(*given["thermal"]), given["latched"])
    ring, block = RingWriter(Path(given["ring"])), ControlBlock(Path(given["block"]))
    parameters = live.rig.drive_parameters
    drive = family_of(parameters).open(parameters, Links())
    loop = Loop(drive, cycle, script, ring, block, MonotonicClock(), given["start_ns"], course, push)
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, lambda *_: loop.quit())
    try:
        identity = drive.bring_up()
        grants = become_realtime(live.rig.system)
        _say("ready", {"drive": identity, "grants": [asdict(grant) for grant in grants]})
    except BaseException:
        drive.close()
        ring.close()
        raise
    try:
        ended = loop.run()
    except SafetyError:
        if given["remembers"]:  # by no fault that the supervisor knows
            latch_file.write(parameters, 0.0)
        raise
    if given["remembers"] and ended.mode == Mode.LATCHED:  # the operator's process may be gone
        latch_file.write(parameters, ended.faults)
    _say("ended", asdict(ended) | {"reason": REASONS[Reason(int(script.reason))]})
    return 0


def _say(what: str, value: Any) -> None:
    print(json.dumps({what: value}, ensure_ascii=False), flush=True)


if __name__ == "__main__":
    sys.exit(main())
