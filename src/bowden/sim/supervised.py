"""The closed loop with a drive and the supervisor in it, on a fake clock, with faults: one compiled function a law."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.control.law import Law, law_start, law_step
from bowden.control.reference import Trajectory
from bowden.core.kernel import kernel, specialise
from bowden.core.signals import DriveReading, Reference, Sample
from bowden.models.cable.bouc_wen import advance_prepared
from bowden.models.drive.encoder import reading
from bowden.models.drive.motor import Motor
from bowden.models.drive.motor import current as motor_current
from bowden.models.drive.servo import ServoState, servo_step
from bowden.models.drive.thermal import ThermalState, cold
from bowden.models.plausible import Followed, follow
from bowden.plants.bench import Bench, bench_at, prepare_bench
from bowden.safety.limits import Limits
from bowden.safety.supervisor import Observed, begin, supervise
from bowden.sim.injected import Around, Injected, asleep, disturbed, misled, misread
from bowden.sim.run import inputs_of
from bowden.sim.scenario import BendPath, constant_bend

SPOOL_RADIUS = 0.02
"""Of the tension that is simulated [m]."""


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
    """Cycles of the run in which the verdict was not the wish."""


@kernel
def run_supervised(
    gains: Any,
    bench: Any,
    motor: Motor,
    limits: Limits,
    thermal: ThermalState,
    references: NDArray[np.float64],
    widths: NDArray[np.float64],
    slope_factors: NDArray[np.float64],
    normals: NDArray[np.float64],
    encoders: Any,
    initial_motor: float,
    dt: float,
    substeps: int,
    kinds: NDArray[np.int64],
    onsets: NDArray[np.int64],
    joints: NDArray[np.float64],
    motors: NDArray[np.float64],
    out: NDArray[np.float64],
) -> None:
    """One run from a stopped supervisor: armed, run as soon as the drive is enabled, and on after any stop."""
    cycles = references.shape[1]
    plant = bench_at(bench, ServoState(initial_motor, 0.0, 0.0), 0.0, widths[0], slope_factors[0])
    seen = Sample(plant.joint, plant.motor.position)
    law, wish = law_step(gains, law_start(gains, seen), seen, Reference(references[0, 0], 0.0, 0.0), dt)
    law = law_start(gains, seen)
    blank = DriveReading(seen.motor, seen.joint, 0.0, 5.0, 40.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0)
    state = begin(limits, blank, thermal)
    out[:6] = -1.0
    out[6:] = 0.0
    out[0] = 0.0
    target, power, drive, applied, ran = initial_motor, 0.0, 1.0, initial_motor, -1
    broken, pushed, slipped, anchor, frozen = 0.0, 0.0, 0.0, 0.0, 0.0
    joint_seen, motor_seen = Followed(seen.joint, 0.0, 0.0), Followed(seen.motor, 0.0, 0.0)
    loose = deaf = runs_away = jams = dead = tears = 0.0
    k, missed = 0, 0
    while k < cycles:
        # the drive: its angles of now, its state after what it was told in the cycle before
        drive = min(drive + 1.0, 4.0) if power > 2.5 else 1.0
        if deaf == 0.0:
            applied = target
        joint = frozen if loose > 0.0 and abs(plant.motor.position - anchor) < 0.8 else plant.joint
        joint += pushed - broken
        joints[k] = reading(joint, normals[k, 0], encoders[0])
        motors[k] = reading(plant.motor.position, normals[k, 1], encoders[1]) + slipped
        on = power > 2.5 and dead == 0.0
        load = 0.938 * (motor.pretension + motor.spring * joint) * (0.0 if loose + tears > 0.0 else 1.0)
        current = motor_current(plant.motor.acceleration, 0.0, 0.0, motor) + load / (motor.gear * motor.torque_constant)
        current = (motor.current_limit if jams > 0.0 else current) if on else 0.0
        tension = max(0.0, load / SPOOL_RADIUS)
        told = DriveReading(motors[k], joints[k], current, tension, 40.0, 0.0, 0.0, 0.01, drive, 0.0, 0.0)
        request = 1.0 if k == 0 else 2.0 if ran < 0 else 0.0
        around = Around(missed * dt, (missed + 1) * dt, request, 0.05, 1.0, 1.0, 0.02)
        missed = 0
        for i in range(len(kinds)):
            kind, since = kinds[i], k - onsets[i]
            if since >= 0:
                told = misread(kind, since, told, joints, motors, k)
                around = disturbed(kind, since, around, dt)
                missed = min(max(missed, asleep(kind, since)), cycles - 1 - k)
                if kind == 17 and loose == 0.0:
                    loose, anchor, frozen = 1.0, plant.motor.position, plant.joint
                elif kind == 18:
                    tears = 1.0
                    broken += (plant.joint + 0.2 - broken) * dt / 0.03
                elif kind == 19:
                    pushed += 4.0 * dt
                elif kind == 20:
                    slipped += 2.0 * dt
                elif kind == 21:
                    runs_away = 1.0
                elif kind == 23:
                    jams = 1.0
                elif kind == 31:
                    deaf, dead = 1.0, 1.0 if since > 50 else dead
                elif kind >= 35 and kind <= 37:
                    dead = 1.0
        if out[2] < 0.0 and k >= onsets[0]:
            off_joint, off_motor = abs(told.joint - joint), abs(told.motor - plant.motor.position)
            gone = motors[k] - motors[onsets[0]]
            if shows(kinds[0], off_joint, off_motor, joint, plant.motor, gone, told, applied, around.lateness):
                out[2] = k

        # the law: it gets the last angles that can be
        joint_seen, _, _ = follow(joint_seen, told.joint, dt, limits.sensor_span, limits.jump, limits.joint_speed, 1.0)
        motor_seen, _, _ = follow(motor_seen, told.motor, dt, limits.sensor_span, limits.jump, limits.motor_speed, 1.0)
        seen = Sample(joint_seen.value, motor_seen.value)
        wish = seen.motor
        if ran >= 0:
            j = k - ran
            law, wish = law_step(gains, law, seen, Reference(references[0, j], references[1, j], references[2, j]), dt)
        for i in range(len(kinds)):
            if k >= onsets[i]:
                wish = misled(kinds[i], k - onsets[i], wish, dt)
        surroundings = (told,) + around[:]  # noqa: RUF005 - Numba takes no star in a tuple
        state, verdict = supervise(limits, state, Observed(*surroundings), wish, dt)

        # what came of it
        most = limits.target_speed * max(dt, min(around.elapsed, 5.0 * dt)) * 1.000001
        fine = limits.motor_low <= verdict.target <= limits.motor_high and abs(verdict.target - target) <= most
        out[0] += 0.0 if fine and verdict.power in (0.0, 3.0) else 1.0
        if ran < 0 and verdict.mode == 2.0:
            ran = k + 1
        if ran >= 0:
            out[10] += 1.0 if verdict.target != wish or verdict.power < 3.0 else 0.0
            if out[4] < 0.0:
                out[7] = max(out[7], verdict.reaction)
            for i in range(52):
                weight = 2.0**i
                if np.floor(verdict.faults / weight) % 2.0 == 1.0 and np.floor(out[8] / weight) % 2.0 == 0.0:
                    out[8] += weight
            if verdict.reaction > 0.0 and out[3] < 0.0:
                out[3] = k
            if verdict.reaction > 1.5 and out[4] < 0.0:
                out[4], out[9] = k, verdict.faults
            if verdict.power < 3.0 and out[5] < 0.0:
                out[5] = k
        out[6] = verdict.mode
        target, power = verdict.target, verdict.power

        # the plant, for as many cycles as the loop takes
        joints[k : k + missed + 1], motors[k : k + missed + 1] = joints[k], motors[k]
        for i in range(len(kinds)):
            if k < onsets[i] <= k + missed:
                onsets[i] = k + missed + 1  # what happens meanwhile is seen then
        for j in range(k, k + missed + 1):
            h, travel, width = plant.h, 0.0, widths[j]
            servo, spool = bench.servo, plant.motor
            for _ in range(substeps):
                aim = applied
                if not on:
                    aim = spool.position * (1.0 - dt / 0.1)
                elif runs_away > 0.0:
                    aim = spool.position + 0.93
                before = spool.position
                spool = servo_step(spool, aim, servo)
                if jams > 0.0:
                    spool = ServoState(before, 0.0, 0.0)
                piece = (spool.position - before) / width
                if piece * travel < 0.0:
                    h, travel = advance_prepared(h, travel, bench.hysteresis), 0.0
                travel += piece
            h = advance_prepared(h, travel, bench.hysteresis)
            plant = bench_at(bench, spool, h, widths[j + 1], slope_factors[j + 1])
        k += missed + 1
    out[1] = ran


@kernel
def shows(
    kind: int,
    off_joint: float,
    off_motor: float,
    joint: float,
    motor: ServoState,
    gone: float,
    told: DriveReading,
    applied: float,
    lateness: float,
) -> bool:
    """Whether an injected fault matters by now; until then nothing could tell it from a rig in order.

    A wrong joint angle hides within the cable's play and slopes, a wrong motor angle within what the servo's model is
    trusted to: `docs/safety.md` has these figures. All else matters at once.
    """
    if kind == 3 or kind == 7 or kind == 8 or kind == 17 or kind == 18:
        return off_joint > 0.6 or abs(gone) > 0.5
    if kind == 11 or kind == 15 or kind == 16:
        return off_motor > 0.15 + 0.02 * abs(motor.velocity)
    if kind == 19:
        return told.joint > 1.5
    if kind == 20:
        return off_motor > 0.15 + 0.02 * abs(motor.velocity)
    if kind == 21:
        return abs(motor.velocity) > 15.0
    if kind == 22:
        return told.tension > 150.0
    if kind == 23:
        return abs(applied - motor.position) > 0.25
    if kind == 31:
        return told.drive_state > 6.5
    if kind == 38 or kind == 39:
        return lateness > 0.0
    if kind == 26:
        return told.temperature > 80.0
    if kind == 30 or kind == 29:
        return told.heartbeat_age > 0.05 or kind == 29
    return True


def supervised(
    bench: Bench,
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
) -> Outcome:
    """Run a law against the bench under the supervisor.

    Args:
        bench: the plant.
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
    inputs = inputs_of(bench, reference, duration, bend or constant_bend(bench.sheath.bend), seed)
    faults = injected or ((Injected.NOTHING, duration),)
    out, cycles = np.empty(len(Outcome._fields)), len(inputs.time)
    specialise(run_supervised, law.name, law_start=law.start_kernel, law_step=law.step_kernel)(
        law.gains,
        prepare_bench(bench),
        bench.motor,
        limits,
        thermal or cold(limits.thermal),
        inputs.references,
        inputs.sheath.widths,
        inputs.sheath.slope_factors,
        inputs.normals,
        (bench.joint_encoder, bench.motor_encoder),
        float(initial_motor),
        bench.sample_time,
        bench.substeps,
        np.array([int(kind) for kind, _ in faults]),
        np.array([round(begin_at / bench.sample_time) for _, begin_at in faults]),
        np.empty(cycles),
        np.empty(cycles),
        out,
    )
    return Outcome(*out.tolist())
