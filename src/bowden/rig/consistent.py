"""The supervisor's limits as one consistent set: those that a rig does not write follow from its other parts.

Each rule is that of the paper's bench, carried over to another cable, joint range or cycle; there it gives the numbers
of `safety.limits.Limits`. With s, the slope over the bench's, and p, the cable's play beyond what the bench's allows:

- the motor's range reaches from the play below where the cable is taut to the play beyond the joint's upper end;
- speeds, accelerations and distances of the motor are the bench's over s, as they move the joint by the same;
- times are the bench's, or what they need in cycles where that is longer.

A limit that is written rules. Whether all of them go together says `contradictions`.
"""

import math
from functools import partial
from typing import NamedTuple

import numpy as np

from bowden.core.units import DEGREES, RADIANS
from bowden.rig.declaration import at, in_file, items_of
from bowden.rig.families import LOST
from bowden.rig.sections import FOLLOWING, USUAL
from bowden.safety.limits import Limits
from bowden.safety.release import OVERSPEED, longest_release, steepest

PLAYS = 1.5
"""Distance of the joint from where its slopes have it that is the cable's play, over its dead zone."""
BRIDGED = 0.005
"""R1 at most, but for one cycle where that is longer [s]."""
OLDEST = 0.010
"""Age of an angle that is still good, but for one cycle where that is longer [s]."""
CROSSING = 2.0
"""What the target may go in a cycle, over the dead zone: a law crosses it at a reversal, and a half of it beyond."""
AT_THE_JOINT = {
    "motor_margin": 30.0 * RADIANS,
    "motor_speed": 5700.0 * RADIANS,
    "target_reach": 180.0 * RADIANS,
    "tracking": 45.0 * RADIANS,
    "frozen_travel": 90.0 * RADIANS,
}
"""What these may come to at the joint: tolerances are no larger than what they are to find. A joint that is 45° from
where its motor should have it is no longer led, and a target half a turn away is none of a law's [rad, rad/s]."""
SLOWEST = 0.020
"""Cycle of a loop with power: three of them are the longest that a drive waits for us [s]."""
WIDEST = 57.0 * RADIANS
"""Of `play`, whether it is written or follows [rad]."""
STEP = 0.9
"""Of `target_reach`: what the target may go in a cycle at most."""
USUAL_CYCLE = 0.001
"""Of the paper's bench. In a longer one the target may go as far as in this, and on as fast as the motor can [s]."""
SPAN = 1.25
"""What an encoder shows over what angles at their limits may come to."""


class Basis(NamedTuple):
    """What limits follow from, beside the joint's own range and speed."""

    slope: float
    """Of the cable, over that of the paper's bench [–]."""
    flat: float
    """Of the cable [rad/rad]."""
    width: float
    """Dead zone of the cable at the motor; 0 where it is not known [rad]."""
    low: float
    """Least angle of the joint that a run asks for, zero included [rad]."""
    fastest: float
    """Speed that the servo reaches at most [rad/s]."""
    sample_time: float
    """One cycle [s]."""


def follow(given: Limits, basis: Basis) -> Limits:
    """The limits with those that are not written, NaN in `given`, as they follow.

    >>> from bowden.rig.sections import UNWRITTEN, USUAL
    >>> follow(UNWRITTEN, Basis(1.0, 0.938, 0.0, 0.0, 100.0, 1e-3)) == USUAL
    True
    """
    slope, flat, width, low, fastest, dt = basis
    play = max(USUAL.play, PLAYS * width * flat)
    more = (play - USUAL.play) / flat
    found = _filled(
        given,
        slope_low=USUAL.slope_low * slope,
        slope_high=USUAL.slope_high * slope,
        motor_margin=USUAL.motor_margin / slope,
        acceleration=USUAL.acceleration / slope,
        tracking=USUAL.tracking / slope,
        target_reach=USUAL.target_reach / slope,
        frozen_travel=USUAL.frozen_travel / slope,
        play=play,
        motor_speed=min(USUAL.motor_speed / slope, OVERSPEED * fastest),  # a servo at its limit is not over it
        motor_low=USUAL.motor_low / slope + max(low, given.joint_low) / flat - more,
        motor_high=USUAL.motor_high / slope + (given.joint_high - USUAL.joint_high) / flat + more,
        bridge_time=max(BRIDGED, dt),
        reading_age=min(USUAL.reading_age, max(1.0, math.floor(OLDEST / dt + 1e-9))),
        tracking_time=max(USUAL.tracking_time, dt),
        current_time=max(USUAL.current_time, dt),
        heartbeat_age=max(USUAL.heartbeat_age, LOST * dt),
        disable_time=max(USUAL.disable_time, LOST * dt),
    )
    leap = USUAL.target_speed / slope * min(dt, USUAL_CYCLE) + found.motor_speed * max(0.0, dt - USUAL_CYCLE)
    return _filled(  # what follows from those
        found,
        target_speed=min(max(leap, CROSSING * width), STEP * found.target_reach) / dt,
        sensor_span=max(USUAL.sensor_span, SPAN * _widest(found, dt)),
    )


def _filled(limits: Limits, **following: float) -> Limits:
    """The limits with these in place of those that are not written."""
    unwritten = {name: value for name, value in following.items() if math.isnan(getattr(limits, name))}
    return limits._replace(**unwritten)  # type: ignore[arg-type]


def _widest(limits: Limits, dt: float) -> float:
    """Largest angle that joint or motor may come to before it is stopped [rad]."""
    ends = (limits.motor_low, limits.motor_high, limits.joint_low, limits.joint_high)
    return max(map(abs, ends)) + limits.motor_speed * (limits.bridge_time + 2.0 * dt)


def contradictions(limits: Limits, dt: float, *, opposed: bool = False, given: Limits | None = None) -> list[str]:
    """What in a rig's limits cannot go together, in sentences; empty if all can.

    Args:
        limits: the supervisor's.
        dt: cycle time [s].
        opposed: whether the cable pulls the joint down, against another one: it is let out as the joint goes up.
        given: what of them the rig writes, as in `follow`; all where it is not given.
    """
    written = partial(_written, limits, limits if given is None else given)
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
    if limits.measures_tension and not limits.tension_low < limits.tension_high:
        found.append(f"{written('tension_low')} is not below {written('tension_high')}")
    if not limits.slope_low <= limits.slope_high:
        found.append(f"{written('slope_low')} is above {written('slope_high')}")
    if found:
        return found
    if dt > SLOWEST:
        found.append(
            f"bench.sample_time_ms = {1e3 * dt:g} is above {1e3 * SLOWEST:g}: a drive would keep its torque too long"
        )
    if limits.play > WIDEST:
        found.append(
            f"{written('play')} is above {WIDEST * DEGREES:g}°: a joint so far from its motor is not held; take a "
            "cable that loses less"
        )
    slope = float(steepest(limits))
    for name, most in AT_THE_JOINT.items():
        if getattr(limits, name) * slope > most * (1.0 + 1e-9):
            found.append(
                f"{written(name)} is {getattr(limits, name) * slope * DEGREES:.4g} at the joint by the steepest slope "
                f"({written('slope_high')}), more than {most * DEGREES:g}: it would no longer limit"
            )
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
    found += [
        f"{written(name)} is below two cycles of {1e3 * dt:g} ms"
        for name in ("heartbeat_age", "disable_time")
        if getattr(limits, name) < 2.0 * dt
    ]
    if limits.reading_age * dt > max(OLDEST, dt):
        found.append(f"{written('reading_age')} is more than {1e3 * max(OLDEST, dt):g} ms")
    if limits.bridge_time > max(BRIDGED, dt):
        found.append(f"{written('bridge_time')} is above {1e3 * max(BRIDGED, dt):g} ms, or one cycle")
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


def _written(limits: Limits, given: Limits, *names: str) -> str:
    """Limits as they stand in rig.toml, by its keys and in its units.

    Args:
        limits: the supervisor's.
        given: what of them is written; what is not is named without its key.
        names: of their fields, of the thermal model with ``thermal.``.
    """
    items = {".".join(item.path): item for item in items_of(Limits)}
    said = []
    for name in names:
        value = at(limits, tuple(name.split(".")))
        key = items[name].key if name in items else _ELSEWHERE.get(name, name)
        number = (in_file(value, items[name].quantity) if name in items else None) or f"{value:.6g}"
        if name in FOLLOWING and math.isnan(getattr(given, name)) and given is not limits:
            unit = items[name].quantity.file_unit.strip("–")
            said.append(f"the {name.replace('_', ' ')} that follows ({number:.4g}{unit})")
        else:
            said.append(f"{key} = {number}")
    return ", ".join(said)


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
