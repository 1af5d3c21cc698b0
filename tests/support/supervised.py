"""The loop under the supervisor on a drive and a clock that can break: one compiled function a law.

Its cycle is `bowden.cycle.one_cycle` with the parts that it has live; faults are injected round it, at sensors, bus,
drive and clock, and in the law.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.control.conditioning import condition_start
from bowden.control.law import Law, law_start
from bowden.control.reference import Trajectory
from bowden.control.source import TABLE, Measurement, source_start
from bowden.core.kernel import kernel, reached, specialise
from bowden.core.nested import flat
from bowden.core.signals import DriveReading, Power, Reference, Sample
from bowden.cycle.one_cycle import (
    HOLD,
    LAW,
    LAW_BEGINS,
    SUPERVISED,
    CycleSettings,
    CycleState,
    Filters,
    Plan,
    law_and_source,
    one_cycle,
)
from bowden.models.cable.sheath_path import BendPath, constant_bend
from bowden.models.drive.thermal import ThermalState, cold
from bowden.plants.plant import Plant, SheathPath, sheath_at
from bowden.safety.faults import Fault, Reaction
from bowden.safety.limits import Limits
from bowden.safety.state import Mode, Observed, PreflightResult, Request, Verdict
from bowden.safety.supervisor import begin
from bowden.sim.injected import FAULT, Injected
from bowden.sim.run import inputs_of
from support.injected_drive import (
    DriveSettings,
    Place,
    drive_moved,
    drive_read,
    drive_reading,
    drive_start,
    settings_of,
    true_joint,
)
from support.injection import NANOSECOND, asleep, disturbed, in_seconds, misled_gains, misled_start, misled_step


class Outcome(NamedTuple):
    """What the supervisor made of a run; cycles, −1 for what never was."""

    bad: float
    """Cycles in which the target was not finite, not in its limits, or too fast."""
    ran: float
    """Cycle in which the law got the motor."""
    shown: float
    """Cycle in which the first fault began to matter."""
    first: float
    """First cycle with a reaction."""
    released: float
    """First cycle with R2 or R3."""
    off: float
    """First cycle without power after the run began."""
    mode: float
    """At the end."""
    reaction: float
    """The worst until and with the first R2 or R3."""
    faults: float
    """All that were ever active after the run began."""
    stopping: float
    """Those of the cycle with R2 or R3."""
    differs: float
    """Cycles of the run in which the verdict was not the requested target."""


RECORDED = ("requested_target", *Verdict._fields)
"""What is kept of every cycle that the loop did not miss."""
OPERATOR_AGE, EMG_AGE = 0.05, 0.02
"""Of an operator and an EMG that are well [s]."""
POWER_OFF, POWER_ON, FAULTS = float(Power.OFF), float(Power.ON), len(Fault)


@kernel
def run_supervised(
    settings: CycleSettings,
    drive_settings: DriveSettings,
    thermal: ThermalState,
    references: NDArray[np.float64],
    sheath: SheathPath,
    normals: NDArray[np.float64],
    initial_motor: float,
    delay: int,
    joints: NDArray[np.float64],
    motors: NDArray[np.float64],
    record: NDArray[np.float64],
    out: NDArray[np.float64],
) -> None:
    """One run from a stopped supervisor: armed, run as soon as the drive is enabled, and on after any stop.

    A command reaches the drive `delay` cycles after its sample, a power state a cycle later at the soonest.

    Args:
        settings: of the cycle; the gains are `Misled`, and have the faults that are injected.
        drive_settings: of the drive and its plant.
        thermal: how warm the motor is.
        references: of the joint (3, n).
        sheath: at the edges of the cycles.
        normals: of the encoders' noise (n, 2).
        initial_motor: motor angle at rest [rad].
        delay: [cycles]
        joints: memory (n,) for what the joint's encoder said, before faults.
        motors: likewise.
        record: to be filled (`RECORDED`, n).
        out: to be filled with the `Outcome`.
    """
    cycles, dt, limits = references.shape[1], drive_settings.dt, settings.limits
    kinds, onsets, now = settings.gains.kinds, settings.gains.onsets, settings.gains.now
    drive = drive_start(drive_settings, initial_motor, sheath_at(sheath, 0))
    seen = Sample(drive.place.joint, drive.place.motor, math.nan, math.nan)
    drive, first = drive_reading(drive_settings, drive, np.zeros(normals.shape[1]))
    state = CycleState(
        seen,
        law_start(settings.gains, seen),
        condition_start(settings.conditioning, seen),
        source_start(settings.source, Measurement(seen.joint, seen.motor, 0.0, math.nan, math.nan, math.nan)),
        begin(limits, first, thermal),
    )
    record[:, :] = math.nan
    period = np.floor(dt / NANOSECOND + 0.5)
    out[:6] = -1.0
    out[6:] = 0.0
    out[0] = 0.0
    target, mode, ran, k, missed = initial_motor, Mode.STOPPED, -1, 0, 0
    while k < cycles:
        # the drive, and what is wrong with what it says
        power = record[2, k - max(delay, 1)] if k >= max(delay, 1) else POWER_OFF
        drive, told = drive_read(drive_settings, drive, power, k, normals, kinds, onsets, joints, motors)

        # the clock and all else that the loop observes
        request = Request.ARM if k == 0 else Request.RUN if ran < 0 else Request.NONE
        due = k - missed  # the reference is that of the deadline
        late, elapsed = in_seconds(missed * period), in_seconds((missed + 1) * period)
        passed, alone = PreflightResult.PASSED, Reaction.NONE
        observed = Observed(told, late, elapsed, request, OPERATOR_AGE, True, passed, EMG_AGE, alone, 0.0, math.nan)
        missed = 0
        for i in range(len(kinds)):
            if k >= onsets[i]:
                observed = disturbed(kinds[i], k - onsets[i], observed, dt)
                missed = min(max(missed, asleep(kinds[i], k - onsets[i])), cycles - 1 - k)

        # the cycle
        plan = Plan(HOLD, 0.0, Reference(math.nan, math.nan, math.nan))
        if ran >= 0 and (mode == Mode.RUNNING or mode == Mode.BRIDGING):
            j = due - ran
            reference = Reference(references[0, j], references[1, j], references[2, j])
            plan = Plan(LAW_BEGINS if j == 0 else LAW, 0.0, reference)
        now[0] = k
        state, _, requested_target, verdict = one_cycle(settings, state, observed, plan, dt)
        said = flat(verdict)
        for j in range(k, k + missed + 1):
            record[0, j] = requested_target
            for i in range(len(said)):
                record[1 + i, j] = said[i]

        # what came of it
        if out[2] < 0.0 and k >= onsets[0]:
            off_joint, off_motor = abs(told.joint - true_joint(drive)), abs(told.motor - drive.place.motor)
            gone = motors[k] - motors[onsets[0]]
            if shows(kinds[0], off_joint, off_motor, drive.place, gone, told, drive.applied, observed.lateness):
                out[2] = k
        most = limits.target_speed * max(dt, min(observed.elapsed, 5.0 * dt)) * 1.000001
        fine = limits.motor_low <= verdict.target <= limits.motor_high and abs(verdict.target - target) <= most
        out[0] += 0.0 if fine and (verdict.power == Power.OFF or verdict.power == Power.ON) else 1.0
        target, mode = verdict.target, verdict.mode
        if ran < 0 and mode == Mode.RUNNING:
            ran = k + 1
        if ran >= 0:
            out[10] += 1.0 if target != requested_target or verdict.power != Power.ON else 0.0
            if out[4] < 0.0:
                out[7] = max(out[7], said[3])
            for i in range(FAULTS):
                if verdict.faults >> i & 1 and not int(out[8]) >> i & 1:
                    out[8] += 2.0**i
            if verdict.reaction != Reaction.NONE and out[3] < 0.0:
                out[3] = k
            if verdict.reaction >= Reaction.R2 and out[4] < 0.0:
                out[4], out[9] = k, verdict.faults
            if verdict.power != Power.ON and out[5] < 0.0:
                out[5] = k
        out[6] = said[2]

        # the plant, for as many cycles as the loop takes
        for i in range(len(kinds)):
            if k < onsets[i] <= k + missed:
                onsets[i] = k + missed + 1  # what happens meanwhile is seen then
        for j in range(k, k + missed + 1):
            joints[j], motors[j] = joints[k], motors[k]
            reached = record[1, j - delay] if j >= delay else initial_motor
            drive = drive_moved(drive_settings, drive, reached, sheath_at(sheath, j), sheath_at(sheath, j + 1))
        k += missed + 1
    out[1] = ran


@kernel
def shows(
    kind: int,
    off_joint: float,
    off_motor: float,
    place: Place,
    gone: float,
    told: DriveReading,
    applied: float,
    lateness: float,
) -> bool:
    """Whether an injected fault matters by now; until then nothing could tell it from a rig in order.

    A wrong joint angle hides within the cable's play and slopes, a wrong motor angle within what the servo's model is
    trusted to: `docs/safety.md` has these figures. All else matters at once.
    """
    late_or_turned = kind == Injected.JOINT_FROZEN or kind == Injected.JOINT_DELAY or kind == Injected.JOINT_SIGN
    if late_or_turned or kind == Injected.SLACK or kind == Injected.BROKEN_CABLE:
        return off_joint > 0.6 or abs(gone) > 0.5
    late_or_turned = kind == Injected.MOTOR_FROZEN or kind == Injected.MOTOR_DELAY or kind == Injected.MOTOR_SIGN
    if late_or_turned or kind == Injected.MOTOR_OVER_TRAVEL:
        return off_motor > 0.15 + 0.02 * abs(place.velocity)
    if kind == Injected.JOINT_OVER_TRAVEL:
        return told.joint > 1.5
    if kind == Injected.OVER_SPEED:
        return abs(place.velocity) > 15.0
    if kind == Injected.OVER_TENSION:
        return told.tension > 150.0
    if kind == Injected.JAM:
        return abs(applied - place.motor) > 0.25
    if kind == Injected.HOST_SILENT:
        return told.drive_state == FAULT
    if kind == Injected.OVERRUN or kind == Injected.OVERRUNS:
        return lateness > 0.0
    if kind == Injected.DRIVE_HOT:
        return told.temperature > 80.0
    if kind == Injected.HEARTBEAT_SILENT:
        return told.heartbeat_age > 0.05
    return True


def supervised(
    plant: Plant,
    law: Law,
    reference: Trajectory,
    limits: Limits,
    *,
    duration: float,
    bend: BendPath | None = None,
    seed: int = 0,
    initial_motor: float = 0.0,
    injected: tuple[tuple[Injected, float], ...] = (),
    thermal: ThermalState | None = None,
) -> tuple[Outcome, NDArray[np.float64]]:
    """Run a law against a plant under the supervisor; the outcome, and what was requested and judged (`RECORDED`, n).

    Args:
        plant: any.
        law: with its gains.
        reference: the joint's desired motion, from the moment the law has the motor.
        limits: the supervisor's.
        duration: of the run, with the ten cycles of arming [s].
        bend: the sheath's; constant where it is not given.
        seed: of the encoders' noise.
        initial_motor: motor angle at rest [rad].
        injected: faults and when they begin [s]; of the first it is told when it showed.
        thermal: how warm the motor is; cold where it is not given.
    """
    dynamics = plant.dynamics()
    inputs = inputs_of(plant, reference, duration, bend or constant_bend(plant.sheath.bend), seed, dynamics)
    out, cycles = np.empty(len(Outcome._fields)), len(inputs.time)
    record = np.empty((len(RECORDED), cycles))
    parts = law_and_source(law) | {"law_start": misled_start, "law_step": misled_step}
    parts |= {"sound_start": law.start_kernel, "sound_step": law.step_kernel}
    parts |= reached(run_supervised, dynamics.kernels())
    specialise(run_supervised, f"{law.name}_{dynamics.name}", **parts, **SUPERVISED)(
        CycleSettings(
            misled_gains(law, injected, plant.sample_time), law.conditioning, TABLE.settings, Filters(), limits
        ),
        settings_of(plant, dynamics),
        thermal or cold(limits.thermal),
        inputs.references,
        inputs.sheath,
        inputs.normals,
        float(initial_motor),
        plant.delay,
        np.empty(cycles),
        np.empty(cycles),
        record,
        out,
    )
    return Outcome(*out.tolist()), record
