"""Facts that docs/background/hazards.md rests on and that no other test shows: above all what is not seen, and when."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bowden.control import LAWS
from bowden.control.reference import PeriodicMinimumJerk
from bowden.core.errors import SafetyError
from bowden.core.signals import DriveReading, DriveState
from bowden.cycle.one_cycle import Cycle
from bowden.hardware.ports import Power
from bowden.live.preflight import Preflight
from bowden.live.row import AT
from bowden.live.script import Script
from bowden.models.drive.thermal import cold
from bowden.safety.faults import Fault, Reaction, of
from bowden.safety.last_word import LastWord
from bowden.safety.limits import Limits
from bowden.safety.state import Mode, Observed, PreflightResult, Request, SupervisorState, Verdict
from bowden.safety.supervisor import begin, supervise
from loop_rig import LoopRig, twin_bench
from support.simulated_drive import SimulatedDrive

DT, LIMITS = 1e-3, Limits(tracking=9.0)
SLOPE = 0.9


def running(motor: float) -> SupervisorState:
    """A supervisor that lets the law lead, with a joint that follows."""
    state = begin(LIMITS, reading(motor, SLOPE * motor), cold(LIMITS.thermal))
    for request in (Request.ARM, Request.NONE, Request.RUN, *([Request.NONE] * 9)):
        state, verdict = cycle(state, motor, SLOPE * motor, request)
    assert verdict.mode == Mode.RUNNING
    return state


def reading(motor: float, joint: float) -> DriveReading:
    return DriveReading(motor, joint, 2.0 + 0.1 * motor, math.nan, math.nan, 0.0, 0.0, 0.01, 4.0, 0.0, 0.0, 0.0, 0.0)


def cycle(state: SupervisorState, motor: float, joint: float, request: float = 0.0) -> tuple[SupervisorState, Verdict]:
    observed = Observed(reading(motor, joint), 0.0, DT, request, 0.1, True, PreflightResult.PASSED, 0.0)
    return supervise(LIMITS, state, observed, motor, DT)


def test_a_frozen_joint_encoder_is_seen_by_the_motors_travel() -> None:
    """It takes `frozen_travel` of the motor; in small strokes to and fro it is a limb that stands."""
    for stroke, seen in ((0.15, False), (0.45, True)):
        state = running(0.5)
        for k in range(2000):
            state, verdict = cycle(state, 0.5 + stroke * math.sin(2e-3 * math.pi * k), SLOPE * 0.5)
            if of(verdict.faults):
                break
        assert (Fault.JOINT_FROZEN in of(verdict.faults)) is seen


def test_two_encoders_that_drift_together_are_not_seen() -> None:
    """Until the angles that they show reach the end of a range: the limb is as much further."""
    state, limb, drift = running(0.3), SLOPE * 0.3, 0.0
    while not of((turn := cycle(state, 0.3 + drift / SLOPE, limb + drift))[1].faults):
        state, drift = turn[0], drift + 1e-3
    assert of(turn[1].faults) == [Fault.JOINT_OVER_TRAVEL]
    assert limb + drift == pytest.approx(LIMITS.joint_high, abs=2e-3)


WHOLE = Verdict(0.5, Power.ON, Mode.RUNNING, Reaction.NONE, 0)


@pytest.mark.parametrize(
    "broken",
    [
        *(WHOLE._replace(target=target) for target in (math.nan, math.inf, 2.001, -0.301, 1.6, -0.2)),
        *(WHOLE._replace(power=power) for power in (1.0, 2.0, -3.0, math.nan)),
        *(WHOLE._replace(mode=mode) for mode in (float(Mode.STOPPED), float(Mode.LATCHED), 2.5, 6.0, math.nan)),
    ],
    ids=str,
)
def test_what_no_supervisor_says_is_a_broken_verdict(broken: Verdict) -> None:
    limits = Limits(target_speed=100.0)  # half a radian in a cycle that is late
    judge = LastWord(limits, DT, 0.5).judge
    for target in (1.0, 1.5, 2.0, 1.5, 1.0, 0.5, 0.0, -0.3, 0.2, 0.5):
        judge(WHOLE._replace(target=target))
    judge(Verdict(0.5, Power.OFF, Mode.LATCHED, Reaction.R3, 1))
    with pytest.raises(SafetyError, match="verdict is broken"):
        judge(broken)


def test_no_verdict_that_is_broken_reaches_the_drive(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As if the compiled function had written over its own verdict in the middle of a run."""
    drive, sent = SimulatedDrive(twin_bench()), list[tuple[float, Power]]()
    write, step = drive.write, Cycle.step
    cycles = 0

    def written(target: float, power: Power, *rest: Any) -> None:
        sent.append((target, power))
        write(target, power, *rest)

    def overwritten(self: Cycle, *given: Any) -> tuple[float, Verdict]:
        nonlocal cycles
        cycles += 1
        requested_target, verdict = step(self, *given)
        return requested_target, verdict._replace(target=verdict.target + 1.5) if cycles == 1300 else verdict

    monkeypatch.setattr(drive, "write", written)
    table = PeriodicMinimumJerk(0.0, 0.3, 2.0).sample(np.arange(5000) * 1e-3)
    script = Script(table, 0.0, 0.5, Preflight(), 1e-3)
    rig = LoopRig(tmp_path, LAWS["adaptive"], Limits(), drive, script)
    monkeypatch.setattr(Cycle, "step", overwritten)
    with pytest.raises(SafetyError, match="verdict is broken"):
        rig.run()
    assert len(sent) == 1301, "one more as the loop ends, before any drive is closed"
    assert [power for _, power in sent[-3:]] == [Power.ON, Power.OFF, Power.OFF]
    last = rig.reader.last()
    assert last is not None
    assert (last[AT["mode"]], last[AT["power"]], last[AT["command"]]) == (Mode.LATCHED, 0.0, sent[-3][0]), "recorded"
    assert np.abs(np.diff([target for target, _ in sent])).max() < 0.5
    assert drive.read(0.0).drive_state == DriveState.SWITCH_ON_DISABLED, "closed"
