"""A live run without processes, bus or clock: script, supervisor and law on the twin's bench in simulated time."""

from pathlib import Path

import numpy as np

from bowden.core.units import DEGREES
from bowden.cycle.one_cycle import TargetSource
from bowden.hardware.ports import Power
from bowden.hardware.twin.bench import TwinBench
from bowden.live.live_run import live_run
from bowden.live.row import NOTHING_READ
from bowden.models.drive.thermal import cold
from bowden.rig.rig import Rig
from bowden.safety.state import Mode, Observed, Request
from support.simulated_drive import SimulatedDrive

LONGEST = 60.0
"""Preflight and approach are over by then [s]."""


def rmse_deg(rig: Path, law: str, seconds: float) -> float:
    """The joint's measured error under the law, root mean square, of a run from arming to the end of its reference [°].

    Args:
        rig: the rig.toml.
        law: name.
        seconds: how long the law leads.
    """
    read = Rig.read(rig).with_law(law).replace(duration=seconds)
    live = live_run(read)
    cycle, script = live.cycle(), live.script()
    drive = SimulatedDrive(TwinBench(read.bench, read.bend_path, read.duration, read.seed, read.start_motor, 0.0))
    cycle.begin(NOTHING_READ, cold(live.limits.thermal))
    mode, target, errors = Mode.STOPPED, cycle.state.supervisor.target, []
    for k in range(1, round((LONGEST + seconds) / cycle.period)):
        now = k * cycle.period
        reading = drive.read(now)
        ready = mode == Mode.PREFLIGHT and script.outcome == 1.0
        request = Request.ARM if k == 20 else Request.RUN if ready else Request.NONE
        plan = script.plan(mode, target, reading, 1)
        observed = Observed(reading, 0.0, cycle.period, request, 0.0, True, script.outcome, 0.0)
        _, verdict = cycle.step(observed, plan)
        mode, target = verdict.mode, verdict.target
        drive.write(target, Power(int(verdict.power)), now)
        if plan.source >= TargetSource.LAW_BEGINS:
            errors.append(reading.joint - plan.reference.position)
        if script.done:
            break
    assert script.done, "the run came to no end"
    return float(np.sqrt(np.mean(np.square(errors)))) * DEGREES
