"""Before a run: are the limits sensible, are the sensors alive, does a small motion of the motor move the joint?

The current must change in that motion, since it accelerates a motor and pulls a cable. And it must pull where the rig
says so: of the mean current out and back, inertia and Coulomb friction take as much away as they add. What is left is
the cable's load, which no cable has in the direction in which it is let out.

Where a load cell says what the cable pulls, its reading must rise as the motor pulls, by more than it changed at rest.
"""

from enum import IntEnum
from functools import partial
from typing import NamedTuple

import numpy as np

from bowden.core.errors import SafetyError
from bowden.core.signals import DriveReading, DriveState
from bowden.core.units import DEGREES, RADIANS
from bowden.models.minimum_jerk import minimum_jerk_share
from bowden.rig.declaration import at, in_file, items_of
from bowden.safety.limits import Limits
from bowden.safety.supervisor import longest_release


class Preflight(NamedTuple):
    """The settings of a preflight."""

    listen: float = 0.5
    """How long the sensors are listened to before anything moves [s]."""
    first: float = 2.0 * RADIANS
    """First motion of the motor [rad]."""
    largest: float = 30.0 * RADIANS
    """Largest motion; the cable's whole play must lie within it [rad]."""
    speed: float = 20.0 * RADIANS
    """Mean speed of a motion [rad/s]."""
    moved: float = 0.5 * RADIANS
    """Motion of the joint that counts [rad]."""
    noise: float = 0.3 * RADIANS
    """Largest span of an angle at rest [rad]."""
    settle: float = 0.1
    """Wait after each motion [s]."""
    follows: float = 0.7
    """Share of its motion that the motor must have made [–]."""
    slope_sign: float = 1.0
    """Direction of the joint for a positive motion of the motor."""
    pull_sign: float = 1.0
    """Direction of the motor that pulls the cable: the motion goes there and comes back."""
    light: float = 0.3
    """Current below which the cable carries nothing [A]."""
    enable: float = 5.0
    """How long the drive may take to enable [s]."""
    low: float = -np.inf
    """Smallest target of the motor: one that rests beyond, as a release may leave it, is brought there first [rad]."""
    high: float = np.inf
    """Largest [rad]."""
    tension: float = 0.0
    """1 where the cable's tension is measured."""
    torque: float = 0.0
    """1 where the joint's torque is measured."""
    load_sign: float = 1.0
    """−1 of a cable that is let out in this motion, since another one pulls the joint: its load falls."""


class Step(IntEnum):
    """Where a preflight is."""

    ENABLE = 0
    LISTEN = 1
    OUT = 2
    BACK = 3
    DONE = 4


class Reason(IntEnum):
    """What a preflight found."""

    NONE = 0
    NOT_ENABLED = 1
    SENSORS = 2
    RESTLESS = 3
    MOTOR_STILL = 4
    MOTOR_WRONG_WAY = 5
    JOINT_STILL = 6
    JOINT_WRONG_WAY = 7
    CURRENT_STILL = 8
    SLACK_WRONG_WAY = 9
    LOAD_MISSING = 10
    LOAD_STILL = 11
    LOAD_WRONG_WAY = 12


REASONS = {
    Reason.NONE: "",
    Reason.NOT_ENABLED: "the drive does not enable; check its supply, enable input and STO",
    Reason.SENSORS: "an angle is missing; check the encoders' plugs and the drive's PDOs",
    Reason.RESTLESS: "an angle changes while the motor holds; keep the limb still, check for interference",
    Reason.MOTOR_STILL: "the motor does not make a small motion; check for a jam and the motor encoder",
    Reason.MOTOR_WRONG_WAY: "the motor's angle goes the wrong way; change the sign of its direction in rig.toml",
    Reason.JOINT_STILL: "the joint does not follow the motor; check for a slack or broken cable, tighten it",
    Reason.JOINT_WRONG_WAY: "the joint goes the wrong way; change the sign of its encoder's direction in rig.toml",
    Reason.CURRENT_STILL: "the drive reports an unchanging current while the motor turns; check 6077h and its PDO",
    Reason.SLACK_WRONG_WAY: "the cable pulls where it should be let out, as slack_sign of [limits] has it; turn that "
    "round, or the direction of the motor; and keep the limb still",
    Reason.LOAD_MISSING: "the load cell says nothing; check its plug, its supply and [load_cell]",
    Reason.LOAD_STILL: "the load cell does not change while the cable is pulled; check that the cable goes through it, "
    "its amplifier, and tighten the cable",
    Reason.LOAD_WRONG_WAY: "the load cell falls while the cable is pulled; change the sign of its scale in rig.toml",
}
"""What each reason means and what to do."""


class PreflightState(NamedTuple):
    """Where it is, and what it has seen."""

    step: float
    since: float
    """Since the step began [s]."""
    motor: float
    """Where the motor began, or the nearest place that it may be sent to [rad]."""
    joint: float
    """Where the joint began [rad]."""
    low: float
    """Smallest angle of the joint while it was listened to [rad]."""
    high: float
    """Largest [rad]."""
    motor_low: float
    """The same of the motor [rad]."""
    motor_high: float
    """[rad]"""
    amplitude: float
    """Of this motion [rad]."""
    far_motor: float
    """Where the motor was at the far end [rad]."""
    far_joint: float
    """Where the joint was [rad]."""
    current_low: float
    """Smallest current since the drive is enabled [A]."""
    current_high: float
    """Largest [A]."""
    charge: float
    """Current over time in this motion, out and back [A·s]."""
    load: float
    """What the load cell said last at rest, 0 where there is none [N or N·m]."""
    load_low: float
    """Its smallest reading while it was listened to."""
    load_high: float
    """Its largest."""
    far_load: float
    """What it said at the far end."""
    reason: float
    """Number of a `Reason`."""


class PreflightOutcome(NamedTuple):
    """What a preflight says in a cycle."""

    result: float
    """0 not done, 1 passed, −1 failed: as `safety.supervisor.Observed` wants it."""
    reason: float
    """Number of a `Reason`."""


def begin(settings: Preflight, reading: DriveReading) -> PreflightState:
    """Before the first cycle."""
    return _at(Step.ENABLE, settings, settings.first, reading)


def step(
    settings: Preflight, state: PreflightState, reading: DriveReading, dt: float
) -> tuple[PreflightState, float, PreflightOutcome]:
    """One cycle: wait for the drive, listen, then move out and back, minimum jerk, further until the joint follows.

    Args:
        settings: the preflight's.
        state: from the cycle before.
        reading: of the drive.
        dt: cycle time [s].

    Returns:
        The state, the motor's wish [rad], what came of it.
    """
    since = state.since + dt
    seen = np.isfinite(reading.motor) and np.isfinite(reading.joint)
    load = _load(settings, reading)
    if state.step == Step.DONE:
        return _answer(state, state.motor)
    state = state._replace(since=since)
    if not seen and state.step <= Step.LISTEN:  # in motion, a gap is the supervisor's to bridge
        return _fail(state, Reason.SENSORS) if since > settings.listen else _answer(state, state.motor)
    if not np.isfinite(load) and state.step == Step.LISTEN and since > settings.listen:
        return _fail(state, Reason.LOAD_MISSING)
    if state.step == Step.ENABLE:
        if reading.drive_state == DriveState.OPERATION_ENABLED:
            state = _at(Step.LISTEN, settings, state.amplitude, reading)
        elif since > settings.enable:
            return _fail(state, Reason.NOT_ENABLED)
        return _answer(state, _within(settings, reading.motor))
    state = state._replace(
        current_low=min(state.current_low, reading.current), current_high=max(state.current_high, reading.current)
    )
    if state.step == Step.LISTEN:
        coming = settings.settle if state.motor != state.far_motor else 0.0
        if since < coming:
            return _answer(_hearing(state, reading, load), state.motor)
        state = state._replace(
            low=min(state.low, reading.joint),
            high=max(state.high, reading.joint),
            motor_low=min(state.motor_low, reading.motor),
            motor_high=max(state.motor_high, reading.motor),
            load=load,
            load_low=np.fmin(state.load_low, load),
            load_high=np.fmax(state.load_high, load),
        )
        if since < coming + settings.listen:
            return _answer(state, state.motor)
        if state.high - state.low > settings.noise or state.motor_high - state.motor_low > settings.noise:
            return _fail(state, Reason.RESTLESS)
        return _answer(state._replace(step=float(Step.OUT), since=0.0), state.motor)

    duration = state.amplitude / settings.speed
    way = float(minimum_jerk_share(since / duration))
    out = settings.pull_sign * state.amplitude
    wish = state.motor + out * (way if state.step == Step.OUT else 1.0 - way)
    if since <= duration + settings.settle:
        state = state._replace(charge=state.charge + dt * reading.current)
    if since < duration + settings.settle or not seen:
        return _answer(state, wish)
    if state.step == Step.OUT:
        went = (reading.motor - state.motor) * settings.pull_sign
        if went < -0.3 * state.amplitude:
            return _fail(state, Reason.MOTOR_WRONG_WAY)
        if went < settings.follows * state.amplitude:
            return _fail(state, Reason.MOTOR_STILL)
        state = state._replace(far_motor=reading.motor, far_joint=reading.joint, far_load=load)
        return _answer(state._replace(step=float(Step.BACK), since=0.0), wish)
    still = state.current_low == state.current_high  # or changed by less than a count, in a motion as small as this
    if settings.pull_sign * state.charge < -2.0 * settings.light * (duration + settings.settle):
        return _fail(state, Reason.SLACK_WRONG_WAY)
    moved = (state.far_joint - state.joint) * settings.pull_sign * settings.slope_sign
    # a torque has the joint's sign, a tension that of no direction
    way = settings.pull_sign * settings.slope_sign if settings.torque else settings.load_sign
    risen = (state.far_load - state.load) * way
    span = state.load_high - state.load_low
    watched = settings.tension + settings.torque > 0.0
    if watched and risen < -span and moved >= settings.moved:
        return _fail(state, Reason.LOAD_WRONG_WAY)
    mute = watched and not risen > span
    if moved >= settings.moved and not still and not mute:
        return _answer(state._replace(step=float(Step.DONE)), state.motor)
    if moved <= -settings.moved:
        return _fail(state, Reason.JOINT_WRONG_WAY)
    larger = 2.0 * state.amplitude
    if larger > settings.largest:
        why = Reason.CURRENT_STILL if still else Reason.JOINT_STILL
        return _fail(state, Reason.LOAD_STILL if mute and moved >= settings.moved and not still else why)
    return _answer(state._replace(step=float(Step.OUT), since=0.0, amplitude=larger, charge=0.0), state.motor)


def contradictions(limits: Limits, dt: float, *, opposed: bool = False) -> list[str]:
    """What in a rig's limits cannot go together, in sentences; empty if all can.

    Args:
        limits: the supervisor's.
        dt: cycle time [s].
        opposed: whether the cable pulls the joint down, against another one: it is let out as the joint goes up.
    """
    written = partial(_written, limits)
    reaction = limits.bridge_time + 2.0 * dt
    brake = limits.motor_speed * reaction
    found = [
        (f"{written(name)}, but must be a number above 0")
        for name, value in limits._asdict().items()
        if name in _POSITIVE and not 0.0 < value < np.inf
    ]
    found += [
        f"{written(f'thermal.{name}')}, but must be a number above 0"
        for name, value in limits.thermal._asdict().items()
        if name != "ambient" and not 0.0 < value < np.inf
    ]
    if not limits.motor_low < limits.motor_high:
        found.append(f"{written('motor_low')} is not below {written('motor_high')}")
    if not limits.joint_low < limits.joint_high:
        found.append(f"{written('joint_low')} is not below {written('joint_high')}")
    if limits.measures_tension == 1.0 and not limits.tension_low < limits.tension_high:
        found.append(f"{written('tension_low')} is not below {written('tension_high')}")
    if not limits.slope_low <= limits.slope_high:
        found.append(f"{written('slope_low')} is above {written('slope_high')}")
    if found:
        return found
    ends = (limits.motor_low, limits.motor_high)
    reach = [slope * motor for slope in (limits.slope_low, limits.slope_high) for motor in ends]
    if max(map(abs, (*ends, limits.joint_low, limits.joint_high))) + brake > limits.sensor_span:
        found.append(
            f"an angle at its limit ({written('motor_low', 'motor_high', 'joint_low', 'joint_high')}), and "
            f"{brake * DEGREES:.0f}° in {reaction * 1e3:.0f} ms, is beyond {written('sensor_span')}"
        )
    if limits.joint_high > max(reach) + limits.play or limits.joint_low < min(reach) - limits.play:
        low, high = (min(reach) - limits.play) * DEGREES, (max(reach) + limits.play) * DEGREES
        found.append(
            f"{written('joint_low', 'joint_high')} would never act: with slopes and play "
            f"({written('slope_low', 'slope_high', 'play')}) the motor ({written('motor_low', 'motor_high')}) brings "
            f"the joint no further than {low:.4g}° to {high:.4g}°"
        )
    if longest_release(limits) > _LONGEST:
        found.append(
            f"a release takes {longest_release(limits):.1f} s from the end of the motor's range "
            f"({written('motor_low', 'motor_high')}), at {limits.lowering * DEGREES:.3g}°/s of the joint on the "
            f"steepest slope ({written('slope_high')}), and must not take more than {_LONGEST:g} s: make that range or "
            f"slope smaller, or raise what bounds the speed: lowering, half of joint_speed or of motor_speed"
        )
    if limits.tracking_lag * limits.motor_speed + limits.tracking >= limits.target_reach:
        widest = (limits.tracking_lag * limits.motor_speed + limits.tracking) * DEGREES
        found.append(
            f"{written('tracking', 'tracking_lag')} let the motor be {widest:.4g}° off at {written('motor_speed')}, "
            f"{written('target_reach')} less: a motor that does not follow would be seen too late"
        )
    if limits.target_speed * dt >= limits.target_reach:
        found.append(
            f"{written('target_speed')} allows more in one cycle of {1e3 * dt:g} ms than {written('target_reach')}"
        )
    if limits.heartbeat_age < 2.0 * dt or limits.reading_age * dt > 0.01:
        found.append(
            f"{written('heartbeat_age')} is below two cycles of {1e3 * dt:g} ms, or {written('reading_age')} is above "
            "10 ms"
        )
    if limits.lateness + limits.bridge_time > limits.heartbeat_age:
        found.append(
            f"{written('lateness')} and {written('bridge_time')} are longer together than the drive's own watch over "
            f"the loop lets a cycle be, {written('heartbeat_age')}"
        )
    if limits.thermal.continuous_current >= limits.current_peak:
        found.append(f"{written('thermal.continuous_current')} is not below {written('current_peak')}")
    if not limits.thermal.ambient < limits.housing_limit < limits.winding_limit:
        found.append(
            f"{written('housing_limit')} is not between {written('thermal.ambient')} and {written('winding_limit')}"
        )
    if limits.thermal.winding_capacity * limits.thermal.winding_to_housing < _QUICKEST:
        parts = written("thermal.winding_capacity", "thermal.winding_to_housing")
        found.append(f"the winding would cool within {_QUICKEST:g} s: {parts} are too small together")
    if limits.slack_sign not in (-1.0, 1.0):
        found.append(f"{written('slack_sign')} is neither −1 nor 1")
    out, back = (limits.motor_low, limits.motor_high)[:: 1 if limits.slack_sign < 0.0 else -1]
    if abs(out - limits.taut) > abs(back - limits.taut) and not opposed:
        found.append(
            f"{written('slack_sign')} lets the cable out towards the far end of the motor's range "
            f"({written('motor_low', 'motor_high')}), but there it pulls, since it is just taut at "
            f"{limits.taut * DEGREES:.4g}°"
        )
    measured = {name: value for name, value in limits._asdict().items() if name.startswith(("measures_", "uses_"))}
    found += [f"{written(name)} is neither 0 nor 1" for name, value in measured.items() if value not in (0.0, 1.0)]
    return found


_ELSEWHERE = {"current_peak": "motor.current_limit_a"}
"""What another section of rig.toml says."""


def _written(limits: Limits, *names: str) -> str:
    """Limits as they stand in rig.toml, by its keys and in its units.

    Args:
        limits: the supervisor's.
        names: of their fields, of the thermal model with ``thermal.``.
    """
    items = {".".join(item.path): item for item in items_of(Limits)}
    said = []
    for name in names:
        value = at(limits, tuple(name.split(".")))
        key = items[name].key if name in items else _ELSEWHERE.get(name, name)
        said.append(f"{key} = {in_file(value, items[name].quantity) if name in items else value:.6g}")
    return ", ".join(said)


def require(limits: Limits, dt: float, verdict: str, *, opposed: bool = False) -> None:
    """Refuse a run whose limits contradict one another, or whose gains do not hold.

    Args:
        limits: the supervisor's.
        dt: cycle time [s].
        verdict: of `bowden check` on these gains (`design.check.VerdictName`).
        opposed: see `contradictions`.

    Raises:
        SafetyError: with every contradiction, or the verdict.
    """
    found = contradictions(limits, dt, opposed=opposed)
    if found:
        raise SafetyError(f"limits contradict one another: {'; '.join(found)}", do="correct them in rig.toml")
    if verdict not in ("holds", "little_margin", "limit_cycle"):
        raise SafetyError(f"`bowden check` says {verdict!r}", expected="gains that hold", do="run `bowden tune`")


_LONGEST = 5.0
"""Of a release that lets a load down: whoever is in the suit waits for it [s]."""
_QUICKEST = 1.0
"""Shortest thermal time constant: `models.drive.thermal.rested` goes in steps of a second, and none is so small [s]."""

_POSITIVE = (
    *("sensor_span", "jump", "motor_speed", "joint_speed", "speed_filter", "target_speed", "target_reach"),
    *("acceleration", "servo_frequency", "servo_damping", "tracking", "play", "frozen_travel", "current_peak"),
    *("saturation", "i2t_time", "heartbeat_age", "enable_time", "lateness", "clock_gap", "operator_age"),
    *("console_lease", "emg_age", "preflight_time", "bridge_time", "release_time", "lowering", "released_current"),
    *("torque_high", "off_reference", "off_reference_time"),
)


def _within(settings: Preflight, motor: float) -> float:
    """The nearest place that a motor may be sent to [rad]; NaN for NaN."""
    return min(max(motor, settings.low), settings.high)


def _at(where: Step, settings: Preflight, amplitude: float, reading: DriveReading) -> PreflightState:
    motor, joint, current, start = reading.motor, reading.joint, reading.current, _within(settings, reading.motor)
    ends = (joint, joint, motor, motor)
    load = _load(settings, reading)
    return PreflightState(
        *(float(where), 0.0, start, joint, *ends, amplitude, motor, joint, current, current, 0.0),
        *(load, load, load, load, float(Reason.NONE)),
    )


def _load(settings: Preflight, reading: DriveReading) -> float:
    """What the load cell says; 0 where there is none."""
    if settings.tension:
        return reading.tension
    return reading.joint_torque if settings.torque else 0.0


def _hearing(state: PreflightState, reading: DriveReading, load: float) -> PreflightState:
    """Begin again to measure how still both angles are, and the load cell."""
    motor, joint = reading.motor, reading.joint
    still = state._replace(joint=joint, low=joint, high=joint, motor_low=motor, motor_high=motor)
    return still._replace(load=load, load_low=load, load_high=load)


def _answer(state: PreflightState, wish: float) -> tuple[PreflightState, float, PreflightOutcome]:
    result = 0.0 if state.step != Step.DONE else 1.0 if state.reason == Reason.NONE else -1.0
    return state, wish, PreflightOutcome(result, state.reason)


def _fail(state: PreflightState, reason: Reason) -> tuple[PreflightState, float, PreflightOutcome]:
    return _answer(state._replace(step=float(Step.DONE), reason=float(reason)), state.motor)
