"""The supervisor at each of its boundaries: both sides of every limit, every change of mode, every sum and its unit.

Times and limits are sums of powers of two, so that "at the limit" is exact.
"""

import itertools
import math
from operator import attrgetter
from typing import Any, NamedTuple

import pytest

from bowden.core.kernel import compiled
from bowden.core.nested import flat, map_leaves, name_of, names
from bowden.core.signals import EMERGENCY_STOP, DriveReading, Power
from bowden.models.drive.servo import servo_predict
from bowden.models.drive.thermal import Thermal, ThermalState, cold, warm
from bowden.models.plausible import ReadingCheck, SensorState, beyond, follow, outside, persistence_time
from bowden.safety.detectors import REST
from bowden.safety.evidence import DEAD_SHARE, PULLED_SPEED
from bowden.safety.faults import Fault, Reaction, of
from bowden.safety.limits import Limits
from bowden.safety.release import AHEAD, OVERSPEED, WAITS, longest_release, release_target
from bowden.safety.state import Mode, Observed, PreflightResult, Request, SupervisorState, Verdict
from bowden.safety.supervisor import begin, supervise

DT = 2.0**-10
TINY = 1e-9
NAN, INF = math.nan, math.inf
LIMITS = Limits(
    **{"motor_low": -0.5, "motor_high": 2.0, "motor_margin": 1 / 16, "joint_low": -0.5, "joint_high": 1.5},
    **{"sensor_span": 6.5, "jump": 1 / 64, "motor_speed": 16.0, "joint_speed": 8.0, "speed_filter": 3 * DT},
    **{"target_speed": 128.0, "target_reach": 0.875, "acceleration": 4096.0},
    **{"servo_frequency": 32.0, "servo_damping": 0.75},
    **{"tracking": 0.125, "tracking_lag": 1 / 64, "tracking_time": 5 * DT},
    **{"slope_low": 0.75, "slope_high": 1.25, "play": 0.25, "joint_still": 2.0**-12, "frozen_travel": 0.375},
    **{"current_peak": 16.0, "current_time": 2 * DT, "saturation": 15 / 16, "saturation_time": 50 * DT},
    **{"measures_temperature": True, "measures_tension": True, "tension_high": 128.0, "slack_time": 48 * DT},
    **{
        "housing_limit": 70.0,
        "heartbeat_age": 1 / 16,
        "lateness": 1 / 64,
        "bridge_time": 5 * DT,
        "bridge_leak": 1 / 64,
    },
    **{"release_time": 256 * DT, "lowering": 2.5, "force_release": 5.0, "released_current": 0.25},
    **{"operator_age": 1.25, "uses_emg": True, "emg_age": 0.25},
    **{"off_reference": 0.5, "off_reference_time": 32 * DT},
)
THERMAL = LIMITS.thermal
READING = DriveReading(0.5, 0.375, 2.0, 20.0, 40.0, 0.0, 0.0, 0.01, 4.0, 0.0, 0.0, 0.0, 0.0)
BEGUN = begin(LIMITS, READING, cold(THERMAL))
RUNNING = BEGUN._replace(
    decided=BEGUN.decided._replace(mode=Mode.RUNNING, started=True),
    servo=BEGUN.servo._replace(enabled=True),
    stuck_current=BEGUN.stuck_current._replace(reading=2.0),
    stuck_load=BEGUN.stuck_load._replace(reading=20.0),
)


class Law(NamedTuple):
    requested_target: float = 0.5


Changes = dict[str, float]
ORDER: dict[str, Any] = {
    "limits": LIMITS,
    "state": RUNNING,
    "reading": READING,
    "observed": Observed(READING, 0.0, DT, Request.NONE, 0.1, True, PreflightResult.PASSED, 0.02),
    "law": Law(),
}
"""A running rig in order, standing still."""
PLACES = {name: f"state.{name}" for name in names(RUNNING) if "." in name} | {
    "requested_target": "law.requested_target"
}
"""What goes by a shorter name: ``motor.speed`` is the state's."""


def changed(state: Any, changes: Changes) -> Any:
    """A state with other values at paths such as ``motor.speed``."""
    return map_leaves(state, lambda path, old: type(old)(changes.get(name_of(path), old)))


def inputs(*changes: Changes) -> tuple[Limits, SupervisorState, Observed, float]:
    """A rig in order, but for changes such as {"reading.motor": 0.6, "motor.speed": 1.0}; the last of a name counts."""
    parts = dict(ORDER)
    for name, value in (item for one in changes for item in one.items()):
        part, _, field = PLACES.get(name, name).partition(".")
        parts[part] = changed(parts[part], {field: float(value)})
    observed = parts["observed"]._replace(reading=parts["reading"])
    return parts["limits"], parts["state"], observed, parts["law"].requested_target


def cycle(*changes: Changes, by: Any = supervise) -> tuple[SupervisorState, Verdict]:
    """One cycle of it."""
    made: tuple[SupervisorState, Verdict] = by(*inputs(*changes), DT)
    return made


def faults(*changes: Changes) -> set[Fault]:
    return set(of(cycle(*changes)[1].faults))


def motor_at(angle: float, joint: float = NAN) -> Changes:
    """A motor that has stood there, with the joint where the cable holds it."""
    joint = 0.75 * angle if math.isnan(joint) else joint
    at = dict.fromkeys(
        ("motor.value", "servo.position", "decided.previous_target", "state.target", "requested_target"), angle
    )
    return {
        **at,
        "reading.motor": angle,
        "stuck_joint.motor": angle,
        "stuck_load.motor": angle,
        "joint.value": joint,
        "decided.joint_at_release": joint,
        "decided.motor_at_release": angle,
        "reading.joint": joint,
    }


STOPPED: Changes = {
    "decided.mode": Mode.STOPPED,
    "decided.started": 0.0,
    "servo.enabled": 0.0,
    "reading.drive_state": 1.0,
    "reading.current": 0.0,
}
ARMED: Changes = {**STOPPED, "decided.mode": Mode.PREFLIGHT, "reading.drive_state": 3.0, "observed.preflight": 0.0}
RELEASING: Changes = {"decided.mode": Mode.RELEASING}
LATCHED: Changes = {"decided.mode": Mode.LATCHED, "decided.latched": 2.0**Fault.EMERGENCY}


def test_a_rig_in_order_is_left_alone() -> None:
    state, verdict = cycle()
    assert verdict == Verdict(0.5, Power.ON, Mode.RUNNING, Reaction.NONE, 0)
    moved = {"heat.winding", "heat.i2t"}
    both = zip(names(state), flat(RUNNING), flat(state), strict=True)
    assert {name for name, a, b in both if a != b} <= moved
    for changes in (STOPPED, ARMED, RELEASING):
        assert faults(changes) == set()
    for angle in (-0.4, 1.9):
        assert faults(motor_at(angle)) == set()


MOVING = {**motor_at(0.5), "servo.speed": 8.0}
AWAY, SPEED = servo_predict(0.5, 8.0, 0.5, 32.0, 0.75, DT)
"""Where a model that runs at 8 rad/s is a cycle later."""
LATER, _ = servo_predict(0.5, 8.0, 0.25, 32.0, 0.75, 3 * DT)
LAG = 0.125 + SPEED / 64
HEAT = warm(THERMAL, ThermalState(60.0, 50.0, 0.0), 2.0, DT)
WARM: Changes = {"heat.winding": 60.0, "heat.housing": 50.0}
LEAN: Changes = {"limits.tracking_time": 0.0, "limits.current_time": 0.0, "limits.saturation_time": 0.0}
LEAN |= {"limits.slack_time": 0.0}
SWINGING: Changes = {"stuck_current.travel": 2.0, "stuck_current.speed_change": 2.0}
STRAINED: Changes = {"limits.pull_gain": 16.0, "limits.pull_doubt": 16.0, "reading.current": 10.0}
PULLED: Changes = {"limits.slack_sign": 1.0, "reading.joint": 0.36, "joint.value": 0.36}
PUSHED: Changes = {**motor_at(-0.4, -0.35), "decided.mode": Mode.RELEASING, "decided.joint_at_release": 0.0}
Edge = tuple[Fault, str, float, float, Changes]
AT_JOINT: Changes = {"limits.measures_torque": 1.0, "limits.torque_high": 16.0, "reading.joint_torque": 3.0}
ESTIMATED = {"limits.estimates_joint": True, "limits.joint_std": 0.125}
OFF: Changes = {"observed.reference": 1.0, "timers.off_reference": 31 * DT + TINY}
"""A joint that has been off its reference for as long as it may."""
SHARED: Changes = {
    **{"limits.shared": 1.0, "limits.parting": 0.125, "limits.parting_lag": 1 / 64},
    **{"limits.parting_offset": 0.0625, "limits.parting_slope": 0.25},
    **{"neighbour.met": 1.0, "neighbour.apart_time": 48 * DT, "observed.neighbour": 0.0},
}
"""A motor of a pair at 0.5 and a joint at 0.375, with the other motor where it has been too far away for 48 cycles: it
is to be at 0.5 − 0.0625 − 0.25·0.375, and may be 2·0.125 away from there."""
ASKED = 0.5 - 0.0625 - 0.25 * 0.375
SLOWED, FILTERED = 4.0, 4.0 * (1.0 - DT / (3 * DT + DT))
"""A speed, and what the filter leaves of it in a cycle in which the motor stands."""
MUTE: Changes = {"stuck_load.reading": 20.0, "stuck_load.motor": 0.5}
WENT: Changes = {"stuck_joint.motor": 0.0}
KEPT: Changes = {**STOPPED, "timers.undisabled": 1.0}
PULLS = PULLED_SPEED * SLOWED / FILTERED
EDGES: list[Edge] = [
    (Fault.JOINT_LOST, "reading.joint", 6.5, 6.5 + TINY, {}),
    (Fault.JOINT_LOST, "reading.joint", -6.5, -6.5 - TINY, {}),
    (Fault.JOINT_JUMP, "reading.joint", 0.375 + 1 / 64 + 8 * DT, 0.375 + 1 / 64 + 8 * DT + TINY, {}),
    (
        *(Fault.JOINT_JUMP, "reading.joint", 0.375 + 1 / 64 + 8 * DT, 0.375 + 1 / 64 + 8 * DT + TINY),
        {"decided.mode": Mode.PREFLIGHT, "decided.started": 0.0},
    ),
    (Fault.JOINT_JUMP, "reading.joint", 0.375 - 1 / 64 - 8 * DT, 0.375 - 1 / 64 - 8 * DT - TINY, {}),
    (Fault.JOINT_JUMP, "reading.joint", 0.375 + 1 / 64 + 24 * DT, 0.4157, {"observed.elapsed": 3 * DT}),
    (Fault.JOINT_JUMP, "reading.joint", 0.375 + 1 / 64 + 24 * DT, 0.4157, {"joint.age": 2 * DT}),
    (Fault.JOINT_STALE, "reading.joint_age", 2.0, 2.0 + TINY, {}),
    (Fault.JOINT_STALE, "reading.joint_age", 0.0, -TINY, {}),
    (Fault.JOINT_FROZEN, "stuck_joint.motor", 0.275 + TINY, 0.275 - TINY, {}),
    (Fault.JOINT_FROZEN, "stuck_joint.motor", 0.725 - TINY, 0.725 + TINY, {}),
    (Fault.JOINT_FROZEN, "stuck_joint.travel", 0.075 - TINY, 0.075 + TINY, {}),
    *(
        (Fault.JOINT_FROZEN, name, 0.375 + sign * (2.0**-12 + TINY), 0.375 + sign * 2.0**-12, {**WENT, other: 1.0})
        for name, other in itertools.permutations(("stuck_joint.reading", "stuck_joint.previous_reading"))
        for sign in (-1.0, 1.0)
    ),
    (Fault.JOINT_MOTOR_MISMATCH, "reading.joint", 0.5, 0.5 - TINY, motor_at(1.0, 0.5)),
    (Fault.JOINT_MOTOR_MISMATCH, "reading.joint", 1.5, 1.5 + TINY, motor_at(1.0, 1.5)),
    (Fault.JOINT_MOTOR_MISMATCH, "reading.joint", -0.71875, -0.71875 - TINY, motor_at(-0.375, -0.71875)),
    (Fault.JOINT_MOTOR_MISMATCH, "reading.joint", -1 / 32, -1 / 32 + TINY, motor_at(-0.375, -1 / 32)),
    (Fault.JOINT_OVER_TRAVEL, "reading.joint", 1.5, 1.5 + TINY, motor_at(1.5, 1.5)),
    (Fault.JOINT_OVER_TRAVEL, "reading.joint", -0.5, -0.5 - TINY, motor_at(-0.4, -0.5)),
    (Fault.JOINT_OVER_SPEED, "joint.speed", 8.0, 8.0 + TINY, {"reading.joint": 0.375 + 8 * DT}),
    (Fault.JOINT_OVER_SPEED, "joint.speed", -8.0, -8.0 - TINY, {"reading.joint": 0.375 - 8 * DT}),
    (Fault.JOINT_OVER_SPEED, "reading.joint", 0.375 + 32 * DT, 0.375 + 32 * DT + TINY, {"limits.jump": 1.0}),
    (
        *(Fault.JOINT_OVER_SPEED, "reading.joint", 0.375 + 64 * DT, 0.375 + 64 * DT + TINY),
        {"limits.jump": 1.0, "observed.elapsed": 5 * DT},
    ),
    (Fault.MOTOR_LOST, "reading.motor", 6.5, 6.5 + TINY, {}),
    (Fault.MOTOR_LOST, "reading.motor", -6.5, -6.5 - TINY, {}),
    (Fault.MOTOR_JUMP, "reading.motor", 0.5 + 1 / 64 + 16 * DT, 0.5 + 1 / 64 + 16 * DT + TINY, {}),
    (Fault.MOTOR_JUMP, "reading.motor", 0.5 - 1 / 64 - 16 * DT, 0.5 - 1 / 64 - 16 * DT - TINY, {}),
    (Fault.MOTOR_JUMP, "reading.motor", 0.5 + 1 / 64 + 48 * DT, 0.5626, {"observed.elapsed": 3 * DT}),
    (Fault.MOTOR_STALE, "reading.motor_age", 2.0, 2.0 + TINY, {}),
    (Fault.MOTOR_STALE, "reading.motor_age", 0.0, -TINY, {}),
    (Fault.NOT_FOLLOWING, "reading.motor", 0.625, 0.625 + TINY, {**LEAN, "motor.value": 0.625}),
    (Fault.NOT_FOLLOWING, "reading.motor", 0.375, 0.375 - TINY, {**LEAN, "motor.value": 0.375}),
    (Fault.NOT_FOLLOWING, "reading.motor", AWAY + LAG - TINY, AWAY + LAG + TINY, {**MOVING, **LEAN, "limits.jump": 1}),
    (Fault.NOT_FOLLOWING, "reading.motor", AWAY - LAG + TINY, AWAY - LAG - TINY, {**MOVING, **LEAN, "limits.jump": 1}),
    (
        *(Fault.NOT_FOLLOWING, "reading.motor", 1 - AWAY + LAG - TINY, 1 - AWAY + LAG + TINY),
        {**MOVING, **LEAN, "limits.jump": 1, "servo.speed": -8.0},
    ),
    (
        Fault.NOT_FOLLOWING,
        "servo.tracking_error_time",
        4 * DT,
        4 * DT + TINY,
        {"motor.value": 0.7, "reading.motor": 0.7},
    ),
    (Fault.MOTOR_OVER_TRAVEL, "reading.motor", 2.0625, 2.0625 + TINY, motor_at(2.0625)),
    (Fault.MOTOR_OVER_TRAVEL, "reading.motor", -0.5625, -0.5625 - TINY, motor_at(-0.5625)),
    (Fault.MOTOR_OVER_SPEED, "motor.speed", 16.0, 16.0 + TINY, {"reading.motor": 0.5 + 16 * DT}),
    (Fault.MOTOR_OVER_SPEED, "motor.speed", -16.0, -16.0 - TINY, {"reading.motor": 0.5 - 16 * DT}),
    (Fault.MOTOR_OVER_SPEED, "reading.motor", 0.5 + 64 * DT, 0.5 + 64 * DT + TINY, {"limits.jump": 1.0}),
    (Fault.CURRENT_LOST, "reading.current", 32.0, 32.0 + TINY, {}),
    (Fault.CURRENT_LOST, "reading.current", -32.0, -32.0 - TINY, {}),
    (Fault.OVER_CURRENT, "reading.current", 16.0, 16.0 + TINY, LEAN),
    (Fault.OVER_CURRENT, "reading.current", -16.0, -16.0 - TINY, LEAN),
    (Fault.OVER_CURRENT, "timers.overload", DT, DT + TINY, {"reading.current": 17.0}),
    (Fault.SATURATED, "reading.current", 15.0, 15.0 + TINY, LEAN),
    (Fault.SATURATED, "reading.current", -15.0, -15.0 - TINY, LEAN),
    (Fault.SATURATED, "timers.saturated", 49 * DT, 49 * DT + TINY, {"reading.current": 15.5}),
    (Fault.SATURATED, "timers.saturated", 49 * DT, 49 * DT + TINY, {"reading.current": NAN}),
    (Fault.I2T, "heat.i2t", 440.0 - 64 * DT, 440.0 - 64 * DT + TINY, {"reading.current": 10.0}),
    (Fault.MOTOR_HOT, "limits.winding_limit", HEAT.winding, HEAT.winding - TINY, WARM),
    (Fault.MOTOR_HOT, "limits.housing_limit", HEAT.housing, HEAT.housing - TINY, WARM),
    (Fault.MOTOR_HOT, "heat.winding", -0.9e6, -1.1e6, {}),
    (Fault.MOTOR_HOT, "heat.housing", -0.9e6, -1.1e6, {"limits.winding_limit": 1e9}),
    (Fault.DRIVE_HOT, "reading.temperature", 80.0, 80.0 + TINY, {}),
    (Fault.DRIVE_HOT, "reading.temperature", -1e6, -1e6 - 1.0, {}),
    (Fault.TENSION_LOST, "reading.tension", 1e6, 1e6 + 1.0, {}),
    (Fault.TENSION_LOST, "reading.tension", -1e6, -1e6 - 1.0, {}),
    (Fault.OVER_TENSION, "reading.tension", 128.0, 128.0 + TINY, {}),
    (Fault.OVER_TENSION, "reading.current", 9.0, 9.0 + TINY, {**STRAINED, **LEAN}),
    (Fault.OVER_TENSION, "reading.current", -9.0, -9.0 - TINY, {**STRAINED, **LEAN, "limits.slack_sign": 1.0}),
    (Fault.OVER_TENSION, "reading.current", NAN, 10.0, {**STRAINED, **LEAN}),
    (Fault.OVER_TENSION, "limits.measures_current", 0.0, 1.0, {**STRAINED, **LEAN}),
    (Fault.OVER_TENSION, "timers.strained", 49 * DT, 49 * DT + TINY, STRAINED),
    (Fault.SLACK, "reading.tension", 2.0, 2.0 - TINY, LEAN),
    (Fault.SLACK, "timers.slack", 47 * DT, 47 * DT + TINY, {"reading.tension": 1.0}),
    (Fault.HEARTBEAT_LOST, "reading.heartbeat_age", 1 / 16, 1 / 16 + TINY, {}),
    (Fault.HEARTBEAT_LOST, "reading.heartbeat_age", 0.0, -TINY, {}),
    (Fault.NOT_ENABLED, "timers.armed", 1.0 - DT, 1.0 - DT + TINY, ARMED),
    (Fault.NOT_ENABLED, "reading.drive_state", 4.0, 3.0, {**ARMED, "timers.armed": 2.0}),
    (Fault.EMERGENCY, "reading.emergency", 0.0, 0x8130, STOPPED),
    (Fault.EMERGENCY, "reading.emergency", 0.0, -1.0, {}),
    (Fault.EMERGENCY_STOP, "reading.emergency", 0.0, EMERGENCY_STOP, STOPPED),
    (Fault.EMERGENCY_STOP, "reading.emergency", 0.0, EMERGENCY_STOP, {}),
    (Fault.BUS_ERRORS, "timers.bus_failures", 2.5 + DT, 2.5 + DT + TINY, {}),
    (Fault.BUS_ERRORS, "reading.bus_errors", 9.0, 10.0, {"timers.bus_errors": 7.0}),
    (Fault.BUS_ERRORS, "reading.bus_errors", 7.0, 8.0, {"timers.bus_errors": 7.0, "timers.bus_failures": 2.0}),
    (Fault.BUS_ERRORS, "reading.bus_errors", 1e9, -1.0, {"timers.bus_errors": 1e9}),
    (Fault.LATE, "observed.lateness", 1 / 64, 1 / 64 + TINY, {}),
    (Fault.LATE, "observed.lateness", -DT / 2, 1.0, {}),
    (Fault.LATE, "timers.late", 1 / 64 + 0.02 * DT - TINY, 1 / 64 + 0.02 * DT + TINY, {}),
    (
        *(Fault.LATE, "timers.late", 1 / 64 - 2.5 * DT + 0.08 * DT - TINY, 1 / 64 - 2.5 * DT + 0.08 * DT + TINY),
        {"observed.elapsed": 4 * DT},
    ),
    (Fault.CLOCK, "observed.elapsed", 0.05 * DT, 0.05 * DT - TINY, STOPPED),
    (Fault.CLOCK, "observed.elapsed", 0.5, 0.5 + TINY, {}),
    (Fault.CLOCK, "observed.lateness", -DT, -DT - TINY, {}),
    (Fault.CLOCK, "observed.lateness", 1e6, 1e6 + 1.0, {}),
    (Fault.TARGET_LOST, "requested_target", 2.0, 2.0 + TINY, motor_at(2.0)),
    (Fault.TARGET_LOST, "requested_target", -0.5, -0.5 - TINY, motor_at(-0.5)),
    (Fault.TARGET_STEP, "requested_target", 0.625, 0.625 + TINY, {}),
    (Fault.TARGET_STEP, "requested_target", 0.375, 0.375 - TINY, {}),
    (Fault.TARGET_STEP, "requested_target", 0.625, 0.625 + TINY, {"observed.elapsed": 0.5 * DT}),
    (Fault.TARGET_STEP, "requested_target", 0.875, 0.875 + TINY, {"observed.elapsed": 3 * DT}),
    (Fault.TARGET_STEP, "requested_target", 1.125, 1.125 + TINY, {"observed.elapsed": 5 * DT}),
    (Fault.TARGET_STEP, "requested_target", 1.125, 1.125 + TINY, {"observed.elapsed": 9 * DT}),
    (Fault.TARGET_TOO_FAR, "requested_target", 1.375, 1.375 + TINY, {}),
    (Fault.TARGET_TOO_FAR, "requested_target", -0.375, -0.375 - TINY, {}),
    (Fault.TARGET_TOO_HARD, "requested_target", 0.5625, 0.5625 + TINY, {"limits.acceleration": 64.0}),
    (Fault.TARGET_TOO_HARD, "requested_target", 0.4375, 0.4375 - TINY, {"limits.acceleration": 64.0}),
    (
        *(Fault.TARGET_TOO_HARD, "requested_target"),
        *(AWAY + (64.0 + 48.0 * SPEED) / 1024.0 + sign * TINY for sign in (-1.0, 1.0)),
        {**MOVING, "limits.acceleration": 64.0},
    ),
    (Fault.OPERATOR_LOST, "observed.operator_age", 1.25, 1.25 + TINY, {}),
    (Fault.OPERATOR_LOST, "observed.operator_age", -1.0, -1.0 - TINY, STOPPED),
    (Fault.PREFLIGHT_FAILED, "observed.preflight", 0.0, -1.0, ARMED),
    (Fault.PREFLIGHT_FAILED, "timers.armed", 60.0 - DT, 60.0 - DT + TINY, ARMED),
    (Fault.RECORDER_LOST, "observed.recorder", 1.0, 0.0, {}),
    (Fault.RECORDER_LOST, "observed.recorder", 1.0, 0.0, STOPPED),
    (Fault.EMG_LOST, "observed.emg_age", 0.25, 0.25 + TINY, {}),
    (Fault.EMG_LOST, "observed.emg_age", -1.0, -1.0 - TINY, STOPPED),
    (Fault.CURRENT_STUCK, "stuck_current.travel", 0.375, 0.375 + TINY, {"stuck_current.speed_change": 2.0}),
    (Fault.CURRENT_STUCK, "stuck_current.speed_change", 1.0, 1.0 + TINY, {"stuck_current.travel": 2.0}),
    (Fault.CURRENT_STUCK, "reading.current", 2.0 + TINY, 2.0, SWINGING),
    (Fault.CURRENT_STUCK, "reading.current", NAN, 2.0, SWINGING),
    (Fault.CURRENT_STUCK, "stuck_current.previous_reading", 3.0 + TINY, 3.0, {**SWINGING, "reading.current": 3.0}),
    *((Fault.NOT_DISABLED, "reading.current", sign * 0.25, sign * (0.25 + TINY), KEPT) for sign in (-1.0, 1.0)),
    (Fault.NOT_DISABLED, "reading.current", NAN, 1.0, KEPT),
    (Fault.NOT_DISABLED, "reading.motor_age", 2.0 + TINY, 2.0, {**KEPT, "reading.current": 1.0}),
    (Fault.NOT_DISABLED, "reading.drive_state", 3.0, 4.0, {**KEPT, "reading.motor_age": 9.0}),
    (Fault.NOT_DISABLED, "motor.speed", PULLS - TINY, PULLS + TINY, {**KEPT, "reading.current": NAN}),
    (Fault.NOT_DISABLED, "motor.speed", PULLS - TINY, PULLS + TINY, {**KEPT, "limits.measures_current": 0.0}),
    (Fault.NOT_DISABLED, "limits.slack_sign", 1.0, -1.0, {**KEPT, "motor.speed": 9.0, "reading.current": NAN}),
    (Fault.NOT_DISABLED, "reading.current", 0.25, NAN, {**KEPT, "motor.speed": 9.0}),
    (Fault.NOT_DISABLED, "limits.measures_current", 0.0, 1.0, {**KEPT, "reading.current": 9.0}),
    (Fault.NOT_DISABLED, "timers.undisabled", 0.05 - DT, 0.05 - DT + TINY, {**KEPT, "reading.current": 1.0}),
    (Fault.CURRENT_STUCK, "decided.mode", Mode.RELEASING, Mode.RUNNING, SWINGING),
    (Fault.CURRENT_STUCK, "limits.measures_current", 0.0, 1.0, SWINGING),
    (Fault.RELEASE_PULLS, "reading.joint", -0.35, -0.35 - TINY, PUSHED),
    (Fault.RELEASE_PULLS, "reading.joint", 0.35, 0.35 + TINY, {**RELEASING, **PULLED, "decided.joint_at_release": 0.0}),
    (Fault.RELEASE_PULLS, "decided.joint_at_release", 0.26 + TINY, 0.26 - TINY, {**RELEASING, **PULLED}),
    (Fault.RELEASE_PULLS, "limits.homed", 0.0, 1.0, {**RELEASING, **PULLED, "decided.joint_at_release": 0.0}),
    (Fault.RELEASE_PULLS, "decided.mode", Mode.RUNNING, Mode.RELEASING, {**PULLED, "decided.joint_at_release": 0.0}),
    (Fault.OTHER_RELEASED, "observed.others", 1.0, 2.0, {}),
    (Fault.OTHER_RELEASED, "observed.others", 3.0, 2.0, RELEASING),
    (Fault.OTHER_RELEASED, "observed.others", 0.0, 2.0, STOPPED),
    (Fault.OTHER_OFF, "observed.others", 2.0, 3.0, {}),
    (Fault.OTHER_OFF, "observed.others", 0.0, 3.0, STOPPED),
    (Fault.TORQUE_LOST, "reading.joint_torque", 1e6, 1e6 + 1.0, AT_JOINT),
    (Fault.TORQUE_LOST, "limits.measures_torque", 0.0, 1.0, {}),
    (Fault.TORQUE_LOST, "reading.joint_torque", -1e6, -1e6 - 1.0, AT_JOINT),
    (Fault.OVER_TORQUE, "limits.measures_torque", 0.0, 1.0, {"limits.torque_high": 0.5, "reading.joint_torque": 3.0}),
    (Fault.LOAD_STUCK, "stuck_load.motor", 0.36, 0.3, {**MUTE, "stuck_load.travel": 0.05}),
    (Fault.LOAD_STUCK, "stuck_load.motor", 0.64, 0.7, {**MUTE, "stuck_load.travel": 0.05}),
    (
        *(Fault.LOAD_STUCK, "limits.measures_torque", 0.0, 1.0),
        {
            **{"limits.measures_tension": 0.0, "reading.joint_torque": 3.0, "stuck_load.reading": 3.0},
            **{"stuck_load.travel": 0.1, "stuck_load.motor": 0.5},
        },
    ),
    (Fault.OVER_TORQUE, "reading.joint_torque", 16.0, 16.0 + TINY, AT_JOINT),
    (Fault.OVER_TORQUE, "reading.joint_torque", -16.0, -16.0 - TINY, AT_JOINT),
    (Fault.OVER_TORQUE, "limits.measures_torque", 0.0, 1.0, {**AT_JOINT, "reading.joint_torque": 17.0}),
    (Fault.LOAD_STUCK, "stuck_load.travel", 0.075 - TINY, 0.075 + TINY, MUTE),
    (Fault.LOAD_STUCK, "reading.tension", 20.0 + TINY, 20.0, {**MUTE, "stuck_load.travel": 0.1}),
    (Fault.LOAD_STUCK, "reading.tension", NAN, 20.0, {**MUTE, "stuck_load.travel": 0.1}),
    (
        *(Fault.LOAD_STUCK, "stuck_load.previous_reading", 21.0 + TINY, 21.0),
        {**MUTE, "stuck_load.travel": 0.1, "reading.tension": 21.0},
    ),
    (Fault.LOAD_STUCK, "limits.measures_tension", 0.0, 1.0, {**MUTE, "stuck_load.travel": 0.1}),
    (
        *(Fault.LOAD_STUCK, "reading.joint_torque", 3.0 + TINY, 3.0),
        {**AT_JOINT, "limits.measures_tension": 0.0, "stuck_load.reading": 3.0, "stuck_load.travel": 0.1},
    ),
    (*(Fault.LOAD_STUCK, "decided.mode", Mode.RELEASING, Mode.RUNNING), {**MUTE, "stuck_load.travel": 0.1}),
    (Fault.MOTORS_APART, "observed.neighbour", ASKED - 0.25, ASKED - 0.25 - TINY, SHARED),
    (Fault.MOTORS_APART, "observed.neighbour", ASKED + 0.25, ASKED + 0.25 + TINY, SHARED),
    (Fault.MOTORS_APART, "observed.neighbour", NAN, 0.0, SHARED),
    (Fault.MOTORS_APART, "observed.neighbour", 6.5 + TINY, 6.5, SHARED),
    (Fault.MOTORS_APART, "observed.neighbour", -6.5 - TINY, -6.5, SHARED),
    (Fault.MOTORS_APART, "neighbour.apart_time", 47 * DT, 47 * DT + TINY, SHARED),
    (Fault.MOTORS_APART, "neighbour.met", 0.0, 1.0, SHARED),
    (Fault.MOTORS_APART, "limits.shared", 0.0, 1.0, SHARED),
    (Fault.MOTORS_APART, "limits.slack_time", 49 * DT, 48 * DT, SHARED),
    (Fault.MOTORS_APART, "decided.started", 0.0, 1.0, SHARED),
    (Fault.MOTORS_APART, "decided.mode", Mode.RELEASING, Mode.RUNNING, SHARED),
    (Fault.MOTORS_APART, "decided.mode", Mode.RELEASING, Mode.BRIDGING, SHARED),
    (Fault.MOTORS_APART, "servo.enabled", 0.0, 1.0, {**SHARED, "reading.drive_state": 3.0}),
    (
        *(Fault.MOTORS_APART, "observed.neighbour"),
        *(ASKED - 0.25 - 2 / 64 * FILTERED + sign * TINY for sign in (1.0, -1.0)),
        {**SHARED, "motor.speed": SLOWED},
    ),
    (
        *(Fault.MOTORS_APART, "observed.neighbour"),
        *(ASKED - 0.25 - 2 / 64 * FILTERED + sign * TINY for sign in (1.0, -1.0)),
        {**SHARED, "motor.speed": -SLOWED},
    ),
    (Fault.JOINT_OFF_REFERENCE, "observed.reference", 0.875, 0.875 + TINY, OFF),
    (Fault.JOINT_OFF_REFERENCE, "observed.reference", -0.125, -0.125 - TINY, OFF),
    (Fault.JOINT_OFF_REFERENCE, "observed.reference", NAN, 1.0, OFF),
    (Fault.JOINT_OFF_REFERENCE, "observed.reference", 1e6 + 1.0, 1e6, OFF),
    (Fault.JOINT_OFF_REFERENCE, "observed.reference", -1e6 - 1.0, -1e6, OFF),
    (Fault.JOINT_OFF_REFERENCE, "reading.joint", 0.375, 0.375 - TINY, {**OFF, "observed.reference": 0.875}),
    (Fault.JOINT_OFF_REFERENCE, "timers.off_reference", 31 * DT, 31 * DT + TINY, OFF),
    (Fault.JOINT_OFF_REFERENCE, "limits.off_reference_time", 33 * DT, 32 * DT, OFF),
    (Fault.JOINT_OFF_REFERENCE, "decided.started", 0.0, 1.0, OFF),
    (Fault.JOINT_OFF_REFERENCE, "decided.mode", Mode.RELEASING, Mode.RUNNING, OFF),
    (Fault.JOINT_OFF_REFERENCE, "decided.mode", Mode.RELEASING, Mode.BRIDGING, OFF),
    (Fault.JOINT_OFF_REFERENCE, "servo.enabled", 0.0, 1.0, {**OFF, "reading.drive_state": 3.0}),
    (Fault.JOINT_UNSURE, "reading.joint_std", 0.125, 0.125 + TINY, ESTIMATED),
    (Fault.JOINT_UNSURE, "reading.joint_std", 0.0, NAN, ESTIMATED),
    (Fault.JOINT_UNSURE, "limits.estimates_joint", False, True, {**ESTIMATED, "reading.joint_std": 0.25}),
]
"""A fault; what shows it; its last good value, its first bad one; what else is so."""


@pytest.mark.parametrize("edge", EDGES, ids=lambda edge: f"{edge[0].name} {edge[1]} {edge[3]:g}")
def test_a_detector_speaks_beyond_its_limit_and_not_at_it(edge: Edge) -> None:
    fault, name, good, bad, also = edge
    assert fault not in faults(also, {name: good})
    assert fault in faults(also, {name: bad})


REFUSED = {
    **{"reading.motor": Fault.MOTOR_LOST, "reading.joint": Fault.JOINT_LOST, "reading.current": Fault.CURRENT_LOST},
    **{"reading.tension": Fault.TENSION_LOST, "reading.joint_torque": Fault.TORQUE_LOST},
    **{"reading.temperature": Fault.DRIVE_HOT, "reading.motor_age": Fault.MOTOR_STALE},
    **{"reading.joint_age": Fault.JOINT_STALE, "reading.heartbeat_age": Fault.HEARTBEAT_LOST},
    **{"reading.emergency": Fault.EMERGENCY, "reading.bus_errors": Fault.BUS_ERRORS},
    **{"reading.foreign": Fault.SECOND_MASTER, "observed.lateness": Fault.CLOCK, "observed.elapsed": Fault.CLOCK},
    **{"observed.operator_age": Fault.OPERATOR_LOST, "observed.emg_age": Fault.EMG_LOST},
}
"""What is observed with power and without it, and what it is where it is no number."""


PLAINLY: dict[Fault, Changes] = {
    Fault.MOTOR_JUMP: {"reading.motor": 1.5},
    Fault.DRIVE_DROPPED: {"reading.drive_state": 1.0},
    Fault.DRIVE_FAULT: {"reading.drive_state": 6.0},
    Fault.SECOND_MASTER: {"reading.foreign": 1.0},
}
"""What shows a fault that has no limit, or is bridged at its limit."""


@pytest.mark.parametrize("fault", list(Fault), ids=lambda fault: fault.name)
def test_each_fault_is_seen_first_and_has_its_reaction_in_its_time(fault: Fault) -> None:
    shown = [PLAINLY[fault]] if fault in PLAINLY else [{**e[4], e[1]: e[3]} for e in EDGES if e[0] == fault]
    reached = Reaction.NONE
    for changes in shown:
        limits, state, observed, target = inputs(changes)
        for k in range(1 + math.ceil(fault.within / DT)):
            state, verdict = supervise(limits, state, observed, target, DT)
            assert fault in of(verdict.faults) or k > 0
            reached = max(reached, verdict.reaction)
    assert reached >= fault.then


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_no_number_is_a_fault_in_every_mode(name: str) -> None:
    for value, mode in itertools.product((NAN, INF, -INF), ({}, ARMED, RELEASING, STOPPED, LATCHED)):
        assert REFUSED[name] in faults(AT_JOINT, mode, {name: value}), (value, mode)
    if name == "reading.foreign":
        assert Fault.SECOND_MASTER not in faults({name: 0.0})
        assert Fault.SECOND_MASTER in faults({name: 1.0})


def test_motors_of_a_pair_must_have_met_before_they_can_part() -> None:
    apart, near = {**SHARED, "neighbour.met": 0.0}, {"observed.neighbour": ASKED}
    for _ in range(2):
        state, _ = cycle(apart)
        assert (state.neighbour.met, state.neighbour.apart_time) == (0.0, 0.0)
    state, _ = cycle(apart, near)
    assert (state.neighbour.met, state.neighbour.apart_time) == (1.0, 0.0)
    state, _ = cycle(SHARED, {"neighbour.apart_time": DT})
    assert (state.neighbour.met, state.neighbour.apart_time) == (1.0, 2 * DT)
    state, _ = cycle(SHARED, {"neighbour.apart_time": DT, "observed.elapsed": 3 * DT})
    assert state.neighbour.apart_time == 4 * DT
    state, _ = cycle(SHARED, near)
    assert (state.neighbour.met, state.neighbour.apart_time) == (1.0, 0.0)
    for over in (RELEASING, {"decided.started": 0.0}, STOPPED, {"limits.shared": 0.0}):
        state, _ = cycle(SHARED, near, over)
        assert (state.neighbour.met, state.neighbour.apart_time) == (0.0, 0.0)


def test_while_the_other_motor_is_not_known_nothing_is_forgotten_and_nothing_said() -> None:
    for lost in (NAN, 6.5 + TINY, -6.5 - TINY):
        for met in (0.0, 1.0):
            state, verdict = cycle(SHARED, {"observed.neighbour": lost, "neighbour.met": met})
            assert (state.neighbour.met, state.neighbour.apart_time) == (met, 0.0)
            assert verdict.faults == 0.0
        state, _ = cycle(SHARED, {"observed.neighbour": lost, "neighbour.met": 0.0, "limits.parting": 9.0})
        assert state.neighbour.met == 0.0, "an angle that cannot be is not near"


def test_without_power_a_load_cell_may_keep_its_value_wherever_the_motor_is_turned() -> None:
    turned = {**STOPPED, **MUTE, "stuck_load.motor": 0.3, "stuck_load.travel": 9.0}
    state, _ = cycle(turned)
    assert (state.stuck_load.motor, state.stuck_load.travel) == (0.5, pytest.approx(-0.15))
    state, _ = cycle({**turned, "reading.tension": NAN})
    assert state.stuck_load.reading == 20.0


def test_without_power_a_current_may_keep_its_value_whatever_the_servo_s_model_does() -> None:
    kept = {"reading.current": 2.0, "stuck_current.travel": 9.0, "stuck_current.speed_change": 9.0}
    for changes, stuck in (({}, 9.0), (STOPPED | {"reading.current": 2.0}, 0.0)):
        state, _ = cycle(kept, changes)
        assert (state.stuck_current.travel, state.stuck_current.speed_change) == (stuck, stuck)


def test_a_load_that_is_no_number_is_not_remembered_and_not_too_much() -> None:
    for wild in (NAN, INF, -INF, 1e6 + 1.0, -1e6 - 1.0):
        state, _ = cycle(MUTE, {"reading.tension": wild})
        assert state.stuck_load.reading == 20.0
        assert Fault.OVER_TORQUE not in faults(AT_JOINT, {"reading.joint_torque": wild})
        current = cycle(SWINGING, {"reading.current": wild})[0].stuck_current
        assert current == (2.0, RUNNING.stuck_current.previous_reading, 0.0, 0.0)
    for told in (-1e6, 21.0, 1e6):
        state, _ = cycle(MUTE, {"reading.tension": told, "reading.current": told})
        assert (state.stuck_load.reading, state.stuck_current.reading) == (told, told)


def test_the_age_of_a_sample_is_its_own_whatever_the_load_cell_says() -> None:
    for torque in (NAN, 3.0):
        state, _ = cycle({"reading.sample_age": 0.25, "reading.joint_torque": torque})
        assert state.sample_age == 0.25


def test_what_is_stuck_in_a_release_changes_nothing() -> None:
    assert cycle(MUTE, RELEASING, {"stuck_load.travel": 0.1})[1].faults == 0.0
    assert cycle(SWINGING, RELEASING)[1].faults == 0.0


def test_a_current_that_is_not_known_means_no_tension() -> None:
    blind = {"limits.measures_current": 0.0, "limits.measures_tension": 0.0}
    small = {"limits.tension_high": 0.5, "limits.tension_low": 0.25}
    assert Fault.OVER_TENSION not in faults({**STRAINED, **LEAN, **blind, **small})


DRIVE = {Fault.DRIVE_DROPPED, Fault.DRIVE_FAULT}


@pytest.mark.parametrize("number", [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, NAN])
def test_a_drive_must_stay_enabled_while_it_has_power_and_may_be_anything_but_in_fault_without(number: float) -> None:
    at = {"reading.drive_state": number}
    broken = {Fault.DRIVE_FAULT} if number in (6.0, 7.0) else set()
    for mode in (Mode.PREFLIGHT, Mode.RUNNING, Mode.BRIDGING, Mode.RELEASING):
        dropped = {Fault.DRIVE_DROPPED} if number != 4.0 and not broken else set()
        assert faults(at, {"decided.mode": mode}) & DRIVE == dropped | broken
    for without in ({**STOPPED, **at}, {**ARMED, **at}, {**LATCHED, **at, "servo.enabled": 1.0}):
        assert faults(without) & DRIVE == broken


MOVED_BY_HAND: Changes = {"reading.motor": 1.5, "reading.joint": 1.25}
FREE: Changes = {"requested_target": NAN, "reading.drive_state": 4.0}
UNMEASURED: Changes = {"limits.measures_current": 0.0, "limits.measures_tension": 0.0}
UNMEASURED |= {"limits.measures_temperature": 0.0}
TARGET_FAULTS = {Fault.TARGET_LOST, Fault.TARGET_STEP, Fault.TARGET_TOO_FAR, Fault.TARGET_TOO_HARD}
JUMPS = {Fault.MOTOR_JUMP, Fault.JOINT_JUMP, Fault.JOINT_FROZEN}
CURRENTS = {Fault.CURRENT_LOST, Fault.OVER_CURRENT, Fault.SATURATED, Fault.I2T}
TENSIONS = {Fault.TENSION_LOST, Fault.OVER_TENSION, Fault.SLACK}
LONG: Changes = {"timers.overload": 9.0, "timers.saturated": 9.0, "timers.slack": 9.0, "servo.tracking_error_time": 9.0}
QUIET: list[tuple[str, set[Fault], Changes]] = [
    ("moved by hand, stopped", JUMPS, {**STOPPED, **MOVED_BY_HAND}),
    ("moved by hand, latched", JUMPS, {**LATCHED, **MOVED_BY_HAND}),
    ("motor turned by hand", JUMPS, {**STOPPED, "reading.motor": 1.0}),
    ("model of a drive that is not enabled", {Fault.NOT_FOLLOWING}, {**ARMED, **LONG, "servo.position": 1.5}),
    ("current not measured", CURRENTS, {**UNMEASURED, **LONG, "reading.current": NAN}),
    ("a current that is not measured counts not", CURRENTS, {**UNMEASURED, **LONG, "reading.current": 20.0}),
    ("nothing heats without current", {Fault.I2T}, {**UNMEASURED, "heat.i2t": 440.02}),
    ("current unknown without power", {Fault.I2T, Fault.SATURATED}, {**STOPPED, **LONG, "reading.current": NAN}),
    ("i2t unknown without power", {Fault.I2T}, {**STOPPED, "reading.current": NAN, "heat.i2t": 440.02}),
    ("unknown is at the peak, not beyond", {Fault.OVER_CURRENT}, {**LONG, "reading.current": NAN}),
    ("temperature not measured", {Fault.DRIVE_HOT}, {**UNMEASURED, "reading.temperature": NAN}),
    ("tension not measured", TENSIONS, {**UNMEASURED, **LONG, "reading.tension": NAN}),
    ("a tension that is not measured counts not", TENSIONS, {**UNMEASURED, **LONG, "reading.tension": 999.0}),
    ("nor a small one", TENSIONS, {**UNMEASURED, **LONG, "reading.tension": 0.0}),
    ("slack before the drive is enabled", TENSIONS, {**ARMED, **LONG, "reading.tension": 0.0}),
    ("tension lost is not slack", TENSIONS - {Fault.TENSION_LOST}, {**LONG, "reading.tension": NAN}),
    ("EMG in a run without", {Fault.EMG_LOST}, {"limits.uses_emg": 0.0, "observed.emg_age": NAN}),
    ("long since armed", {Fault.NOT_ENABLED, Fault.PREFLIGHT_FAILED}, {"timers.armed": 99.0}),
    ("preflight's outcome when it is over", {Fault.PREFLIGHT_FAILED}, {"observed.preflight": -1.0}),
    ("preflight's outcome when stopped", {Fault.PREFLIGHT_FAILED}, {**STOPPED, "observed.preflight": -1.0}),
    ("no preflight yet", {Fault.PREFLIGHT_FAILED, Fault.NOT_ENABLED}, {**STOPPED, "timers.armed": 99.0}),
    ("a late cycle that is a clock's step", {Fault.LATE}, {"observed.elapsed": 0.6, "observed.lateness": 0.6}),
    ("a target while stopped", TARGET_FAULTS, {**STOPPED, **FREE}),
    ("a target while latched", TARGET_FAULTS, {**LATCHED, **FREE}),
    ("a target while releasing", TARGET_FAULTS, {**RELEASING, **FREE}),
    (
        "a far target while releasing",
        TARGET_FAULTS,
        {**RELEASING, **FREE, "requested_target": 1.9, "limits.acceleration": 1.0},
    ),
    ("a target before the drive is enabled", TARGET_FAULTS, {**ARMED, "requested_target": NAN}),
    ("a far target before the drive is enabled", TARGET_FAULTS, {**ARMED, "requested_target": 1.9}),
    (
        "a target that moved before, while nothing leads it",
        TARGET_FAULTS,
        {**STOPPED, "decided.previous_target": -0.25},
    ),
    (
        "a target far from the motor while nothing leads it",
        TARGET_FAULTS,
        {
            **STOPPED,
            "state.target": -0.5,
            "decided.previous_target": -0.5,
            "reading.motor": 1.5,
            "limits.acceleration": 1.0,
        },
    ),
]
"""What is so, which faults it is none of."""


@pytest.mark.parametrize("quiet", QUIET, ids=lambda quiet: quiet[0])
def test_a_detector_is_silent_where_its_signal_says_nothing(quiet: tuple[str, set[Fault], Changes]) -> None:
    _, silent, changes = quiet
    assert faults(changes) & silent == set()


def test_a_target_that_is_lost_is_no_other_fault_and_a_preflight_that_is_over_none() -> None:
    for requested_target in (NAN, 9.0, INF):
        assert faults({"requested_target": requested_target}) == {Fault.TARGET_LOST}
    assert faults({"observed.preflight": -1.0}) == set()
    assert faults(ARMED, {"reading.drive_state": 4.0, "timers.armed": 2.0}) == set()


@pytest.mark.parametrize("mode", [Mode.PREFLIGHT, Mode.RUNNING, Mode.BRIDGING])
def test_a_target_that_cannot_be_is_seen_wherever_it_might_lead(mode: Mode) -> None:
    assert Fault.TARGET_LOST in faults({"decided.mode": mode, "requested_target": NAN})


def heated(current: float, time: float, winding: float = 60.0) -> ThermalState:
    return warm(THERMAL, ThermalState(winding, 50.0, 100.0), current, time)


HOT: Changes = {"heat.winding": 60.0, "heat.housing": 50.0, "heat.i2t": 100.0}
R1: Changes = {"reading.joint": NAN}
R2: Changes = {"observed.operator_age": 9.0}
R3: Changes = {"reading.emergency": 1.0}
THRICE: Changes = {"observed.elapsed": 3 * DT}
HALF = 0.5 * DEAD_SHARE * LIMITS.frozen_travel
BACKWARDS: Changes = {"servo.speed": -8.0}
LEFT_BEHIND: Changes = {**motor_at(0.5, 0.8), **RELEASING, "decided.joint_ahead_time": 2 * DT}
"""A cable that its joint has left behind in a release, as soon as that was elsewhere when it began."""
ESTIMATES: list[tuple[str, float, Changes]] = [
    ("timers.armed", 1 + DT, {**ARMED, "timers.armed": 1.0}),
    ("timers.armed", 1 + 3 * DT, {**ARMED, "timers.armed": 1.0, "observed.elapsed": 3 * DT}),
    ("timers.armed", 1 + DT, {**ARMED, "timers.armed": 1.0, "observed.elapsed": NAN}),
    ("timers.armed", 1 + DT, {**ARMED, "timers.armed": 1.0, "observed.elapsed": 3 * DT, "observed.lateness": NAN}),
    ("timers.armed", 0.0, {**STOPPED, "timers.armed": 1.0}),
    ("timers.armed", 0.0, {"timers.armed": 1.0}),
    ("timers.undisabled", 1 + DT, {**STOPPED, "timers.undisabled": 1.0, "reading.drive_state": 4.0}),
    (
        "timers.undisabled",
        1 + 3 * DT,
        {**STOPPED, "timers.undisabled": 1.0, "reading.drive_state": 4.0, "observed.elapsed": 3 * DT},
    ),
    ("timers.undisabled", 0.0, {**STOPPED, "timers.undisabled": 1.0, "reading.drive_state": 3.0}),
    ("timers.undisabled", 1 + DT, {**STOPPED, "timers.undisabled": 1.0, "reading.drive_state": 6.0}),
    ("timers.undisabled", 0.0, {**STOPPED, "timers.undisabled": 1.0, "reading.drive_state": 7.0}),
    ("timers.undisabled", 0.0, {"timers.undisabled": 1.0}),
    ("timers.off_reference", 3 * DT, {"observed.reference": 1.0, "timers.off_reference": 2 * DT}),
    ("timers.off_reference", 3 * DT, {"observed.reference": 1.0, **THRICE}),
    ("timers.off_reference", 4 * DT, {"observed.reference": 0.375, "timers.off_reference": 5 * DT}),
    ("timers.off_reference", 2 * DT, {"observed.reference": 0.375, "timers.off_reference": 5 * DT, **THRICE}),
    ("timers.off_reference", 0.0, {"observed.reference": 0.375}),
    ("timers.off_reference", 0.0, {"timers.off_reference": 5 * DT}),
    ("timers.off_reference", 0.0, {**OFF, **RELEASING}),
    ("sample_age", 3 * DT, {"reading.sample_age": 3 * DT}),
    ("sample_age", 0.0, {"reading.sample_age": NAN}),
    ("sample_age", 0.0, {"reading.sample_age": -DT}),
    ("motor.age", 4 * DT, {"state.sample_age": 3 * DT, "reading.motor": NAN}),
    ("motor.age", 3 * DT, {"observed.elapsed": 4 * DT, "reading.sample_age": DT, "reading.motor": NAN}),
    ("motor.age", 0.0, {"reading.sample_age": 3 * DT, "reading.motor": NAN}),
    ("joint.age", DT, {"reading.joint_age": 1.0}),
    ("motor.age", DT, {"reading.motor_age": 1.0}),
    ("joint.age", 0.0, {"reading.motor_age": 1.0}),
    ("motor.age", 0.0, {"reading.joint_age": 1.0}),
    ("timers.late", 0.0, {}),
    ("timers.late", 1 / 64 - 0.02 * DT, {"timers.late": 1 / 64}),
    ("timers.late", 2.5 * DT - 0.08 * DT, {"observed.elapsed": 4 * DT}),
    ("timers.bus_failures", 3 - DT, {"reading.bus_errors": 3.0}),
    ("timers.bus_failures", 4 - DT, {"reading.bus_errors": 99.0}),
    ("timers.bus_failures", 1 - 3 * DT, {"timers.bus_failures": 1.0, "observed.elapsed": 3 * DT}),
    ("timers.bus_failures", 1 - DT, {"timers.bus_failures": 1.0, "timers.bus_errors": 5.0}),
    ("timers.bus_failures", 0.0, {}),
    ("timers.bus_errors", 9.0, {"reading.bus_errors": 9.0}),
    ("timers.bus_errors", 7.0, {"reading.bus_errors": NAN, "timers.bus_errors": 7.0}),
    ("timers.bus_errors", 7.0, {"reading.bus_errors": INF, "timers.bus_errors": 7.0}),
    ("motor.value", 0.5, {"reading.motor": NAN}),
    ("motor.age", 2 * DT, {"reading.motor": NAN, "motor.age": DT}),
    ("motor.age", 0.0, {"motor.age": DT}),
    ("joint.age", 4 * DT, {"reading.joint": NAN, "joint.age": DT, "observed.elapsed": 3 * DT}),
    ("joint.value", 0.376, {"reading.joint": 0.376}),
    ("stuck_joint.reading", 0.376, {"reading.joint": 0.376}),
    ("stuck_joint.reading", 0.375, {"reading.joint": 0.375 + 2.0**-13}),
    ("stuck_joint.previous_reading", 0.375, {"reading.joint": 0.376, "stuck_joint.previous_reading": 0.3}),
    ("stuck_joint.previous_reading", 0.3, {"reading.joint": 0.375 + 2.0**-13, "stuck_joint.previous_reading": 0.3}),
    ("stuck_joint.reading", 0.375, {"reading.joint": 0.376, "stuck_joint.previous_reading": 0.376}),
    ("stuck_joint.motor", 0.51, {"reading.joint": 0.376, "reading.motor": 0.51}),
    ("stuck_joint.motor", 0.5, {"reading.motor": 0.51}),
    ("stuck_joint.motor", 0.51, {**STOPPED, "reading.motor": 0.51}),
    ("stuck_joint.motor", 0.51, {**LATCHED, "reading.motor": 0.51}),
    ("stuck_joint.motor", 0.5, {**RELEASING, "reading.motor": 0.51}),
    ("stuck_joint.travel", -HALF, {"reading.joint": 0.376, "stuck_joint.travel": 0.1}),
    ("stuck_current.reading", 3.0, {"reading.current": 3.0}),
    ("stuck_current.previous_reading", 2.0, {"reading.current": 3.0, "stuck_current.previous_reading": 7.0}),
    ("stuck_current.previous_reading", 7.0, {"reading.current": NAN, "stuck_current.previous_reading": 7.0}),
    ("stuck_current.previous_reading", 7.0, {"stuck_current.previous_reading": 7.0}),
    ("stuck_current.reading", 2.0, {"reading.current": 7.0, "stuck_current.previous_reading": 7.0}),
    ("stuck_load.reading", 21.0, {"reading.tension": 21.0}),
    ("stuck_load.reading", 20.0, {"reading.tension": 7.0, "stuck_load.previous_reading": 7.0}),
    ("stuck_load.reading", 20.0, {"reading.tension": NAN}),
    ("stuck_load.previous_reading", 20.0, {"reading.tension": 21.0}),
    ("stuck_load.previous_reading", 7.0, {"stuck_load.previous_reading": 7.0}),
    ("stuck_current.reading", 2.0, {"reading.current": NAN}),
    ("stuck_current.reading", 2.0, {"reading.current": INF}),
    ("stuck_current.reading", 2.0, {"reading.current": -INF}),
    ("stuck_current.travel", 1 + (AWAY - 0.5), {**MOVING, "stuck_current.travel": 1.0}),
    ("stuck_current.travel", 1 + (AWAY - 0.5), {**MOVING, **BACKWARDS, "stuck_current.travel": 1.0}),
    ("stuck_current.travel", 0.0, {**MOVING, "stuck_current.travel": 1.0, "reading.current": 3.0}),
    ("stuck_current.speed_change", 1 + (8.0 - SPEED), {**MOVING, "stuck_current.speed_change": 1.0}),
    ("stuck_current.speed_change", 1 + (8.0 - SPEED), {**MOVING, **BACKWARDS, "stuck_current.speed_change": 1.0}),
    ("stuck_current.speed_change", 0.0, {**MOVING, "stuck_current.speed_change": 1.0, "reading.current": 3.0}),
    ("servo.position", 0.51, {**ARMED, "reading.motor": 0.51}),
    ("servo.speed", 0.0, {**ARMED, "servo.speed": 3.0}),
    ("servo.position", AWAY, MOVING),
    ("servo.position", AWAY, {**MOVING, "reading.sample_age": 2e6}),
    ("servo.speed", SPEED, MOVING),
    ("servo.position", LATER, {**MOVING, "observed.elapsed": 3 * DT, "decided.previous_target": 0.25}),
    ("decided.previous_target", 0.25, {"state.target": 0.25, "requested_target": 0.25}),
    ("servo.enabled", 1.0, {**ARMED, "reading.drive_state": 4.0}),
    ("servo.enabled", 0.0, ARMED),
    ("servo.enabled", 1.0, {"reading.drive_state": 3.0}),
    ("servo.enabled", 0.0, {**STOPPED, "reading.drive_state": 4.0}),
    ("servo.enabled", 0.0, {**LATCHED, "reading.drive_state": 4.0}),
    (
        "servo.tracking_error_time",
        3 * DT,
        {"motor.value": 0.7, "reading.motor": 0.7, "servo.tracking_error_time": 2 * DT},
    ),
    ("servo.tracking_error_time", 3 * DT, {"motor.value": 0.7, "reading.motor": 0.7, **THRICE}),
    ("servo.tracking_error_time", 0.0, {"servo.tracking_error_time": 2 * DT}),
    ("timers.overload", 3 * DT, {"reading.current": 17.0, "observed.elapsed": 3 * DT}),
    ("timers.overload", 0.0, {"timers.overload": DT}),
    ("timers.saturated", 3 * DT, {"reading.current": 15.5, "timers.saturated": 2 * DT}),
    ("timers.saturated", 3 * DT, {"reading.current": 15.5, **THRICE}),
    ("timers.saturated", 0.0, {"timers.saturated": DT}),
    ("timers.slack", 3 * DT, {"reading.tension": 1.0, "timers.slack": 2 * DT}),
    ("timers.slack", 3 * DT, {"reading.tension": 1.0, **THRICE}),
    ("timers.slack", 0.0, {"timers.slack": DT}),
    ("heat.winding", heated(2.0, DT).winding, HOT),
    ("heat.winding", heated(5.0, 3 * DT).winding, {**HOT, "reading.current": -5.0, "observed.elapsed": 3 * DT}),
    ("heat.winding", heated(5.0, 0.1).winding, {**HOT, "reading.current": 5.0, "observed.elapsed": 0.4}),
    ("heat.winding", heated(16.0, DT).winding, {**HOT, "reading.current": NAN}),
    ("heat.winding", heated(0.0, DT).winding, {**HOT, **STOPPED, "reading.current": NAN}),
    ("heat.winding", heated(0.0, DT).winding, {**HOT, **UNMEASURED, "reading.current": 9.0}),
    ("heat.housing", heated(2.0, DT).housing, HOT),
    ("heat.i2t", heated(10.0, DT).i2t, {**HOT, "reading.current": 10.0}),
    ("timers.strained", 3 * DT, {**STRAINED, "timers.strained": 2 * DT}),
    ("timers.strained", 5 * DT, {**STRAINED, "timers.strained": 2 * DT, "observed.elapsed": 3 * DT}),
    ("timers.strained", 0.0, {**STRAINED, "timers.strained": 2 * DT, "reading.current": 9.0}),
    ("timers.strained", DT, {**STRAINED, "limits.pull_doubt": 8.0, "reading.current": 9.0}),
    ("decided.bridged_time", 3 * DT, {**R1, "decided.bridged_time": 2 * DT}),
    ("decided.bridged_time", 5 * DT, {**R1, "decided.bridged_time": 2 * DT, "observed.elapsed": 3 * DT}),
    ("decided.bridged_time", 2 * DT - 3 * DT / 64, {"decided.bridged_time": 2 * DT, "observed.elapsed": 3 * DT}),
    ("decided.bridged_time", 0.0, {"decided.bridged_time": DT / 128}),
    ("decided.bridged_time", 0.0, {**STOPPED, **R1, "decided.bridged_time": DT}),
    ("decided.bridged_time", 0.0, {**LATCHED, **R1, "decided.bridged_time": DT}),
    ("decided.started", 1.0, {}),
    ("decided.started", 0.0, {**STOPPED, "decided.started": 1.0}),
    ("decided.started", 0.0, {**LATCHED, "decided.started": 1.0}),
    ("decided.release_time", DT, R2),
    ("decided.release_time", DT, {**R2, "state.sample_age": 2 * DT}),
    ("decided.release_time", 4 * DT, {**RELEASING, "decided.release_time": DT, "observed.elapsed": 3 * DT}),
    ("decided.release_time", 0.0, {"decided.release_time": DT}),
    ("decided.joint_at_release", 0.375, {"decided.joint_at_release": 0.1}),
    ("decided.joint_at_release", 0.1, {**RELEASING, "decided.joint_at_release": 0.1}),
    ("decided.motor_at_release", 0.5, {"decided.motor_at_release": 0.1}),
    ("decided.motor_at_release", 0.1, {**RELEASING, "decided.motor_at_release": 0.1}),
    (
        "decided.joint_ahead_time",
        3 * DT,
        {**LEFT_BEHIND, "decided.motor_at_release": 1.5, "decided.joint_at_release": 0.9},
    ),
    (
        "decided.joint_ahead_time",
        3 * DT,
        {**LEFT_BEHIND, "decided.motor_at_release": 0.5, "decided.joint_at_release": 0.65},
    ),
    (
        "decided.joint_ahead_time",
        0.0,
        {**LEFT_BEHIND, "decided.motor_at_release": 1.5, "decided.joint_at_release": 0.8},
    ),
    ("decided.target_met_motor", 1.0, {**RELEASING}),
    ("decided.target_met_motor", 1.0, {**motor_at(0.0), **RELEASING}),
    ("decided.target_met_motor", 0.0, {**motor_at(0.3), **RELEASING, "state.target": 0.5}),
    (
        "decided.target_met_motor",
        1.0,
        {**motor_at(0.3), **RELEASING, "state.target": 0.5, "decided.target_met_motor": 1.0},
    ),
    ("decided.target_met_motor", 0.0, {"decided.target_met_motor": 1.0}),
]
"""A field of the state, its value after the cycle, what is so."""


@pytest.mark.parametrize("estimate", ESTIMATES, ids=lambda estimate: f"{estimate[0]} {estimate[1]:g}")
def test_estimates_and_sums(estimate: tuple[str, float, Changes]) -> None:
    field, value, changes = estimate
    state, _ = cycle(changes)
    assert attrgetter(field)(state) == pytest.approx(value, rel=1e-12, abs=1e-15)


WRONG: dict[str, tuple[int, Changes]] = {
    "nothing": (0, {}),
    "a warning": (0, {"observed.recorder": 0.0}),
    "R1, then R2": (1, R1),
    "R1, then R3": (1, {"reading.motor": NAN}),
    "R2": (2, R2),
    "R3": (3, R3),
    "R2 beside what R1 would bridge to R2": (2, {**R1, **R2}),
    "R2 beside what R1 would bridge to R3": (3, {**R2, "reading.motor": NAN}),
}
"""What is wrong, and the reaction to it in a running rig."""


def next_mode(mode: Mode, request: Request, wrong: str, preflight: float) -> Mode:
    """The table of modes in docs/safety.md, in words."""
    reaction, changes = WRONG[wrong]
    if mode == Mode.STOPPED:
        return Mode.PREFLIGHT if request == Request.ARM and not changes else Mode.STOPPED
    if mode == Mode.LATCHED:
        return Mode.STOPPED if request == Request.ACKNOWLEDGE else Mode.LATCHED
    if reaction == 3 or (mode == Mode.RELEASING and wrong == "R1, then R3"):
        return Mode.LATCHED
    if mode == Mode.RELEASING or reaction == 2 or request == Request.STOP:
        return Mode.RELEASING
    if reaction == 1:
        return Mode.BRIDGING
    if mode == Mode.PREFLIGHT and not (request == Request.RUN and preflight == 1.0 and wrong != "a warning"):
        return Mode.PREFLIGHT
    return Mode.RUNNING


LATCHABLE = [fault for fault in Fault if fault.latched]
TOLD = {Mode.LATCHED: 3, Mode.RELEASING: 2, Mode.BRIDGING: 1}
"""The reaction that is told in a mode; none in the others."""


@pytest.mark.parametrize("mode", list(Mode), ids=lambda mode: mode.name)
def test_every_change_of_mode(mode: Mode) -> None:
    before = {Mode.STOPPED: STOPPED, Mode.LATCHED: LATCHED, Mode.PREFLIGHT: {"decided.started": 0.0}}.get(mode, {})
    for request, wrong, preflight in itertools.product(Request, WRONG, (0.0, 1.0)):
        changes = {"decided.mode": mode, "observed.request": request, "observed.preflight": preflight}
        state, verdict = cycle(before, changes, WRONG[wrong][1])
        wanted = next_mode(mode, request, wrong, preflight)
        told = (mode.name, request.name, wrong, preflight)
        assert (verdict.mode, state.decided.mode) == (wanted, wanted), told
        assert verdict.power == (0.0 if wanted in (Mode.STOPPED, Mode.LATCHED) else 3.0), told
        assert verdict.reaction == TOLD.get(wanted, 0), told
        ran = mode in (Mode.RUNNING, Mode.BRIDGING, Mode.RELEASING) or (
            request == Request.RUN and preflight == 1.0 and wanted == Mode.RUNNING
        )
        assert state.decided.started == float(ran and mode not in (Mode.STOPPED, Mode.LATCHED)), told


LONGEST, UPWARDS = longest_release(LIMITS), longest_release(LIMITS._replace(slack_sign=1.0))
TAUT_NOW: Changes = {**motor_at(0.05), **RELEASING}
LAST: list[tuple[str, float, Mode, Mode, Changes]] = [
    ("decided.bridged_time", 4.5 * DT, Mode.BRIDGING, Mode.RELEASING, R1),
    ("decided.bridged_time", 4.5 * DT, Mode.BRIDGING, Mode.LATCHED, {"reading.motor": NAN}),
    ("decided.bridged_time", 2.5 * DT, Mode.BRIDGING, Mode.RELEASING, {**R1, "observed.elapsed": 3 * DT}),
    ("decided.release_time", LONGEST - 1.5 * DT, Mode.RELEASING, Mode.STOPPED, RELEASING),
    (
        "decided.release_time",
        LONGEST - 3.5 * DT,
        Mode.RELEASING,
        Mode.STOPPED,
        {**RELEASING, "observed.elapsed": 3 * DT},
    ),
    ("decided.release_time", 254.5 * DT, Mode.RELEASING, Mode.LATCHED, {**TAUT_NOW, "decided.latched": 1.0}),
    ("decided.release_time", 254.5 * DT, Mode.RELEASING, Mode.LATCHED, {**TAUT_NOW, **R2}),
    (
        *("decided.release_time", UPWARDS - 1.5 * DT, Mode.RELEASING, Mode.STOPPED),
        {**motor_at(-0.25), **RELEASING, "limits.slack_sign": 1.0},
    ),
    ("decided.release_time", 254.5 * DT, Mode.RELEASING, Mode.STOPPED, TAUT_NOW),
    (
        *("decided.release_time", 254.5 * DT, Mode.RELEASING, Mode.STOPPED),
        {**motor_at(0.3), **RELEASING, "limits.taut": 0.25},
    ),
]
"""A time that runs out, its last value, the mode up to it and the mode beyond it, what else is so."""


@pytest.mark.parametrize("last", LAST, ids=lambda last: f"{last[0]} {last[3].name}")
def test_times_run_out_in_their_cycle(last: tuple[str, float, Mode, Mode, Changes]) -> None:
    name, value, before, after, also = last
    for time, wanted in ((value, before), (value + TINY, after)):
        _, verdict = cycle(also, {name: time})
        assert verdict.mode == wanted
        assert (verdict.power == 0.0) is (wanted in (Mode.LATCHED, Mode.STOPPED))
        assert verdict.reaction == TOLD.get(wanted, 0)


def test_a_release_that_begins_is_not_over_whatever_was_counted_before() -> None:
    stale = {"decided.release_time": 9.0, "reading.current": 0.0}
    assert cycle(stale, {"observed.request": Request.STOP})[1].mode == Mode.RELEASING
    assert cycle(stale, R2)[1].mode == Mode.RELEASING


def test_the_longest_release_is_from_the_end_at_which_the_cable_pulls() -> None:
    for changed, way, steepest in (
        ({}, 2.0, 1.25),
        ({"motor_low": -3.0}, 2.0, 1.25),
        ({"slack_sign": 1.0}, 0.5, 1.25),
        ({"taut": -0.5}, 2.5, 1.25),
        ({"slope_low": -2.5}, 2.0, 2.5),
    ):
        takes = LIMITS.release_time + WAITS * way * steepest / LIMITS.lowering
        assert longest_release(LIMITS._replace(**changed)) == pytest.approx(takes, rel=1e-15), changed


def test_a_load_is_let_down_until_the_servo_is_where_the_cable_is_taut_or_the_cable_is_slack() -> None:
    lowering: Changes = {**RELEASING, "decided.release_time": 0.5}
    assert cycle(lowering, motor_at(0.05 + TINY))[1].mode == Mode.RELEASING
    assert cycle(lowering, motor_at(0.05))[1].mode == Mode.STOPPED
    upwards = {**lowering, "limits.slack_sign": 1.0, "limits.lowering": 0.625}
    assert cycle(upwards, motor_at(-0.05 - TINY))[1].mode == Mode.RELEASING
    assert cycle(upwards, motor_at(-0.05))[1].mode == Mode.STOPPED
    elsewhere = {**lowering, "limits.taut": -0.25}
    assert cycle(elsewhere, motor_at(-0.2 + TINY))[1].mode == Mode.RELEASING
    assert cycle(elsewhere, motor_at(-0.2 - TINY))[1].mode == Mode.STOPPED
    then: Changes = {
        "decided.motor_at_release": 1.0,
        "decided.joint_at_release": 0.74,
        "decided.joint_ahead_time": AHEAD,
    }
    ahead = [cycle(lowering, motor_at(0.5, 0.75 + more), then)[1].mode for more in (0.0, TINY)]
    assert ahead == [Mode.RELEASING, Mode.STOPPED]
    down: Changes = {**then, "decided.motor_at_release": -1.0, "decided.joint_at_release": -0.74}
    ahead = [cycle(upwards, motor_at(-0.25, -0.4375 - more), down)[1].mode for more in (0.0, TINY)]
    assert ahead == [Mode.RELEASING, Mode.STOPPED]
    slack = {**lowering, **motor_at(0.5, 0.8), **then}
    assert cycle(slack)[1].mode == Mode.STOPPED
    for doubtful in (
        {"decided.joint_ahead_time": AHEAD - DT},
        {"decided.joint_ahead_time": 0.0, "observed.elapsed": 0.1},  # one sample, however long its cycle
        {"decided.joint_at_release": 0.8, "limits.joint_still": 0.0},  # a joint that stands still
        {"decided.motor_at_release": 0.5, "decided.joint_at_release": 0.7},  # it was as wrong before
    ):
        assert cycle(slack, doubtful)[1].mode == Mode.RELEASING, doubtful
    for elapsed, counted in ((3.0 * DT, 3.0 * DT), (0.1, 5.0 * DT)):  # of a late cycle, five cycles at most
        state, _ = cycle(slack, {"decided.joint_ahead_time": 0.0, "observed.elapsed": elapsed})
        assert state.decided.joint_ahead_time == pytest.approx(counted)
    encoder = (Fault.JOINT_LOST, Fault.JOINT_JUMP, Fault.JOINT_STALE, Fault.JOINT_FROZEN)
    of_joint = (*encoder, Fault.JOINT_MOTOR_MISMATCH, Fault.JOINT_UNSURE)
    for fault in LATCHABLE:
        mode = cycle(slack, {"decided.latched": 2.0**fault})[1].mode
        assert mode == (Mode.RELEASING if fault in of_joint else Mode.LATCHED), fault


def test_without_an_enabled_drive_there_is_nothing_to_release() -> None:
    _, verdict = cycle(ARMED, {"observed.request": Request.STOP})
    assert (verdict.mode, verdict.power) == (Mode.RELEASING, 0.0)
    _, verdict = cycle(ARMED, RELEASING)
    assert (verdict.mode, verdict.power) == (Mode.STOPPED, 0.0)


def test_nothing_runs_on_a_drive_that_is_not_enabled() -> None:
    state, verdict = cycle(ARMED, {"observed.request": Request.RUN, "observed.preflight": 1.0})
    assert (verdict.mode, state.decided.started) == (Mode.PREFLIGHT, 0.0)


def test_a_latch_keeps_each_fault_apart() -> None:
    for fault in LATCHABLE:
        for mode in (Mode.LATCHED, Mode.RELEASING, Mode.RUNNING):
            state, verdict = cycle({"decided.mode": mode, "decided.latched": 2.0**fault})
            assert (state.decided.latched, verdict.faults) == (2.0**fault, 2.0**fault)
    every = sum(2.0**fault for fault in LATCHABLE)
    state, verdict = cycle(LATCHED, {"decided.latched": every})
    assert (state.decided.latched, verdict.faults) == (every, every)
    state, verdict = cycle(LATCHED, {"decided.latched": every, "observed.request": Request.ACKNOWLEDGE})
    assert state.decided.latched == 0.0


def test_a_latch_is_left_by_acknowledge_alone() -> None:
    for request, latched in itertools.product(Request, (0.0, 1.0)):
        _, verdict = cycle(LATCHED, {"decided.started": 0.0, "decided.latched": latched, "observed.request": request})
        assert verdict.mode == (Mode.STOPPED if request == Request.ACKNOWLEDGE else Mode.LATCHED)


def test_what_leads_to_a_stop_is_latched_and_nothing_else() -> None:
    joint, operator, recorder = 2.0**Fault.JOINT_LOST, 2.0**Fault.OPERATOR_LOST, 2.0**Fault.RECORDER_LOST
    warned: Changes = {"observed.recorder": 0.0}
    for changes, latched, told in (
        (R1, 0.0, joint),
        (warned, 0.0, recorder),
        ({**R2, **warned}, operator, operator + recorder),
        ({**R2, **R1}, operator + joint, operator + joint),
        ({**LATCHED, **R2}, 2.0**Fault.EMERGENCY, 2.0**Fault.EMERGENCY + operator),
        ({**STOPPED, **R2}, 0.0, operator),
    ):
        state, verdict = cycle(changes)
        assert (state.decided.latched, verdict.faults) == (latched, told), changes


SLACKER_UP: Changes = {**RELEASING, "limits.slack_sign": 1.0}


def still(motor: float) -> Changes:
    """A motor that stands there, and not at its target."""
    return {"reading.motor": motor, "motor.value": motor}


DRAGGED: Changes = {"decided.target_met_motor": 1.0, "reading.motor": 0.49}
STRAINING: Changes = {"reading.current": 16.0, "timers.saturated": 1.0}
TARGETS: list[tuple[str, float, Changes]] = [
    ("the requested target", 0.51, {"requested_target": 0.51}),
    (
        "the requested target, in preflight",
        0.51,
        {"requested_target": 0.51, "decided.mode": Mode.PREFLIGHT, "decided.started": 0.0},
    ),
    ("the motor, until the drive is enabled", 0.49, {**ARMED, "requested_target": 0.51, "reading.motor": 0.49}),
    ("the last, while bridging", 0.5, {**R1, "requested_target": 0.51, "reading.motor": 0.49}),
    ("the last, not the one before", 0.5, {**R1, "decided.previous_target": 0.51}),
    ("the last, also when the requested target is wrong", 0.5, {"requested_target": NAN, "reading.motor": 0.49}),
    ("down from the target", 0.5 - 2 * DT, {**RELEASING, "requested_target": 0.6}),
    ("down from the last, not the one before", 0.5 - 2 * DT, {**RELEASING, "decided.previous_target": 0.4}),
    ("not towards a tighter motor", 0.5 - 2 * DT, {**RELEASING, "reading.motor": 0.51}),
    ("up from the target", 0.5 + 2 * DT, {**SLACKER_UP, "reading.motor": 0.49, "limits.taut": 1.0}),
    ("up from the motor", 0.51 + 2 * DT, {**SLACKER_UP, **still(0.51), "limits.taut": 1.0}),
    ("from the first cycle on", 0.5 - 2 * DT, {**R2, "requested_target": 0.51}),
    ("from where the motor is", 0.49 - 2 * DT, {**R2, **still(0.49)}),
    ("a load that drags the motor on is braked", 0.5 - 2 * DT, {**RELEASING, **DRAGGED}),
    ("from where the motor is, until the target has been there", 0.49 - 2 * DT, {**RELEASING, **still(0.49)}),
    ("quicker out of a force", 0.5 - 4 * DT, {**RELEASING, "decided.latched": 2.0**Fault.SATURATED}),
    ("quicker out of a force from the first cycle on", 0.5 - 4 * DT, STRAINING),
    ("no quicker for another cause", 0.5 - 2 * DT, {**RELEASING, "decided.latched": 2.0**Fault.OVER_TENSION}),
    ("to where the cable is taut elsewhere", 0.25, {**motor_at(0.25 + DT), **RELEASING, "limits.taut": 0.25}),
    ("a load in a late cycle", 0.5 - 6 * DT, {**RELEASING, "observed.elapsed": 3 * DT}),
    ("a load in a very late cycle", 0.5 - 18 * DT, {**RELEASING, "observed.elapsed": 9 * DT}),
    ("a load in a stall, for a tenth of a second", 0.3, {**RELEASING, "observed.elapsed": 0.2}),
    ("a load to where the cable is taut", 0.0, {**motor_at(DT), **RELEASING}),
    ("a load no further", -0.25, {**motor_at(-0.25), **RELEASING}),
    ("a load upwards", 2 * DT - 0.25, {**motor_at(-0.25), **SLACKER_UP}),
    ("a load upwards to where the cable is taut", 0.0, {**motor_at(-DT), **SLACKER_UP}),
    ("a load upwards no further", 0.25, {**motor_at(0.25), **SLACKER_UP}),
    ("to the lowest", -0.5, {**motor_at(-0.499), **RELEASING, "limits.taut": -1.0}),
    ("to the highest", 2.0, {**motor_at(1.999), **SLACKER_UP, "limits.taut": 3.0}),
    ("the motor, when stopped", 0.51, {**STOPPED, "reading.motor": 0.51, "requested_target": 0.6}),
    ("the motor, when a release is over", 0.49, {**RELEASING, "decided.release_time": 9.0, "reading.motor": 0.49}),
    ("the motor, when latched", 0.51, {**LATCHED, "reading.motor": 0.51, "requested_target": 0.6}),
    ("the motor, at once with R3", 0.51, {**R3, "reading.motor": 0.51, "requested_target": 0.6}),
    ("its last good angle", 0.5, {**STOPPED, "reading.motor": NAN}),
    ("no faster than its limit, upwards", 0.625, {**STOPPED, "reading.motor": 1.5}),
    ("no faster than its limit, downwards", 0.375, {**STOPPED, "reading.motor": -0.25}),
    (
        "from the last target, not the one before",
        0.625,
        {**STOPPED, "reading.motor": 1.5, "decided.previous_target": 0.75},
    ),
    ("downwards too", 0.375, {**STOPPED, "reading.motor": -0.25, "decided.previous_target": 0.25}),
    ("in a late cycle more", 0.875, {**STOPPED, "reading.motor": 1.5, "observed.elapsed": 3 * DT}),
    ("in a very late cycle no more than five", 1.125, {**STOPPED, "reading.motor": 1.5, "observed.elapsed": 9 * DT}),
    (
        "by the time between two cycles, not two samples",
        0.625,
        {**STOPPED, "reading.motor": 1.5, "state.sample_age": 2 * DT},
    ),
    ("in an early cycle no less", 0.625, {**STOPPED, "reading.motor": 1.5, "observed.elapsed": DT / 2}),
    ("no higher than its limit", 2.0, {**STOPPED, **motor_at(1.95), "reading.motor": 3.0}),
    ("no lower than its limit", -0.5, {**STOPPED, **motor_at(-0.45), "reading.motor": -3.0}),
]
"""Whereto, the target, what is so."""


@pytest.mark.parametrize("row", TARGETS, ids=lambda row: row[0])
def test_the_target(row: tuple[str, float, Changes]) -> None:
    _, target, changes = row
    state, verdict = cycle(changes)
    assert verdict.target == state.target == pytest.approx(target, abs=1e-12)


@pytest.mark.parametrize("case", list(itertools.product((-1.0, 1.0), (0.0, 1.0))))
def test_a_release_waits_at_the_motor_while_that_is_too_quick(case: tuple[float, float]) -> None:
    out, force = case
    allowed = (LIMITS.force_release if force else LIMITS.lowering) / 1.25
    limits = LIMITS._replace(slack_sign=out, taut=out, slope_low=-1.25, slope_high=1.0)
    goes = out * allowed * DT
    for speed, waits in ((OVERSPEED * allowed - TINY, False), (OVERSPEED * allowed + TINY, True), (-9.0, False)):
        motor = SensorState(-0.125 * out, out * speed, 0.0)
        target = release_target(limits, 1.0, 0.0, motor, force, DT)
        assert target == pytest.approx(-0.125 * out if waits else goes, abs=1e-12), speed
        ahead = release_target(limits, 1.0, 0.0, motor._replace(value=0.125 * out), force, DT)
        assert ahead == pytest.approx(goes, abs=1e-12), "the target never goes back further than it came"


@pytest.mark.parametrize("case", list(itertools.product((0.25, -0.25), (-1.0, 1.0))))
def test_a_release_pulls_beyond_where_the_cable_is_taut_on_this_rig(case: tuple[float, float]) -> None:
    """By the slope, of those that the cable may have, that leaves the joint the most room."""
    taut, out = case
    room = max(out * slope * taut for slope in (LIMITS.slope_low, LIMITS.slope_high)) + REST
    for more, pulls in ((TINY, True), (-TINY, False)):
        joint = out * (room + more)
        place = {**motor_at(joint, joint), **RELEASING, "limits.slack_sign": out, "limits.taut": taut}
        place |= {"decided.joint_at_release": joint - 0.2 * out, "limits.joint_low": -1.0, "limits.homed": 1.0}
        assert (Fault.RELEASE_PULLS in faults(place)) is pulls


def test_it_begins_within_its_limits_whatever_it_reads() -> None:
    for motor, target in (
        (3.0, 2.0),
        (-3.0, -0.5),
        (1.0, 1.0),
        (NAN, 0.0),
        (6.5, 2.0),
        (6.6, 0.0),
        (-6.5, -0.5),
        (-6.6, 0.0),
    ):
        assert begin(LIMITS, READING._replace(motor=motor), cold(THERMAL)).target == target
    for joint, known in ((-6.5, -6.5), (6.5, 6.5), (-6.6, 0.0), (NAN, 0.0)):
        assert begin(LIMITS, READING._replace(joint=joint), cold(THERMAL)).joint.value == known


def test_inside_holds_its_ends_and_lasting_counts_while_a_condition_holds() -> None:
    assert [outside(x, -1.0, 2.0) for x in (-1.0, 0.0, 2.0)] == [0.0] * 3
    assert [outside(x, -1.0, 2.0) for x in (-1.0 - TINY, 2.0 + TINY, NAN, INF, -INF)] == [1.0] * 5
    assert [beyond(x, 2.0) for x in (-INF, 2.0, 2.0 + TINY, INF, NAN)] == [0.0, 0.0, 1.0, 1.0, 1.0]
    assert (persistence_time(True, 0.25, 0.5), persistence_time(False, 0.25, 0.5)) == (0.75, 0.0)


def test_a_reading_is_used_as_it_is_or_not_at_all() -> None:
    before = SensorState(0.5, 2.0, 0.25)

    def after(value: float, came: bool = True) -> ReadingCheck:
        return follow(before, value, came, 0.25, 4.0, 0.125, 3.0, 0.5)

    good = SensorState(1.5, 2.0 + (1.0 - 2.0 * 0.5) / (0.5 + 0.5), 0.0)
    assert after(1.5) == (good, 0.0, 0.0)
    good = SensorState(0.75, 2.0 + (0.25 - 2.0 * 0.5) / (0.5 + 0.5), 0.0)
    assert after(0.75) == (good, 0.0, 0.0)
    kept = SensorState(0.5, 2.0, 0.5)
    assert after(0.5 + 0.125 + 3.0 * 0.5)[1:] == (0.0, 0.0)
    assert after(0.5 + 0.125 + 3.0 * 0.5 + TINY) == (kept, 0.0, 1.0)
    assert after(0.5 - 0.125 - 3.0 * 0.5 - TINY) == (kept, 0.0, 1.0)
    assert after(4.0 + TINY) == (kept, 1.0, 0.0)
    assert after(NAN) == (kept, 1.0, 0.0)
    assert after(0.5, came=False) == (kept, 0.0, 0.0), "an old one says nothing"
    assert after(0.5)[0] == SensorState(0.5, 2.0 - 2.0 * 0.5 / (0.5 + 0.5), 0.0), "a new one says that all stood still"
    again = follow(SensorState(0.5, 2.0, 0.0), 0.5, True, 0.0, 4.0, 0.125, 3.0, 0.0)
    assert again == (SensorState(0.5, 2.0, 0.0), False, False), (
        "one sample twice, without a filter, says nothing of speed"
    )
    assert after(0.75, came=False) == after(0.75), "what has changed is a reading, whatever is said of it"


def test_the_servo_s_prediction_solves_its_equation_at_the_end_of_the_step() -> None:
    for omega, zeta, time in itertools.product((5.0, 60.0), (0.3, 1.5), (1e-3, 0.2)):
        position, velocity = servo_predict(0.2, -3.0, 0.9, omega, zeta, time)
        assert position - 0.2 == pytest.approx(time * velocity)
        acceleration = omega**2 * (0.9 - position) - 2.0 * zeta * omega * velocity
        assert velocity + 3.0 == pytest.approx(time * acceleration)


def test_the_motor_s_heat_goes_nowhere_but_into_its_nodes_and_surroundings() -> None:
    motor, time = Thermal(0.5, 2.0, 5.0, 12.0, 80.0, 21.0, 3.0), 0.25
    before = ThermalState(70.0, 40.0, 2.0)
    after = warm(motor, before, 4.0, time)
    winding, housing = 12.0 * (after.winding - 70.0), 80.0 * (after.housing - 40.0)
    copper = 0.5 * (1.0 + 0.0039 * 50.0) * 16.0
    assert winding == pytest.approx((copper - 30.0 / 2.0) * time)
    assert winding + housing == pytest.approx((copper - 19.0 / 5.0) * time)
    assert after.i2t == pytest.approx(2.0 + (16.0 - 9.0) * time)
    assert warm(motor, before, -4.0, time) == after
    assert warm(motor, before, 2.0, time).i2t == pytest.approx(2.0 - 5.0 * time)
    assert warm(motor, before, 2.0, 1.0).i2t == 0.0


def test_compiled_and_interpreted_agree_in_every_bit() -> None:
    """At each boundary, on either side."""
    twin = compiled(supervise)
    at = [(also, {name: value}) for _, name, good, bad, also in EDGES for value in (good, bad)]
    at += [(changes,) for _, _, changes in (*ESTIMATES, *QUIET, *TARGETS)]
    for changes in at:
        state, verdict = cycle(*changes)
        other, same = cycle(*changes, by=twin)
        assert tuple(map(float, verdict)) == tuple(map(float, same)), changes
        assert flat(state) == flat(other), changes
