"""All for which `bowden run` refuses a rig: one list, which check, simulate and tune say before a run does."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from bowden.control.reference import Chirp, Multisine, PeriodicMinimumJerk, PointToPoint, Trajectory
from bowden.core.errors import ParameterError
from bowden.core.toml_text import quoted
from bowden.core.units import DEGREES
from bowden.design.power import unpowered
from bowden.plants.identified import IdentifiedCable
from bowden.plants.user_plant import UserPlant
from bowden.plants.worn_suit import elbow_dead_zone
from bowden.rig.consistent import contradictions
from bowden.rig.declaration import from_file, in_file, items_of
from bowden.rig.emg_run import EmgRun
from bowden.rig.families import family_of
from bowden.rig.joints import RigJoint
from bowden.rig.rig import Rig
from bowden.safety.limits import Limits
from bowden.sensing.intent import FOLLOWED_ACCELERATION, FOLLOWED_SPEED, TURNED_ACCELERATION, TURNED_SPEED

_INSTANTS = 601
_MOST = 200_000
"""Instants at which the speed of a reference is looked at: a run of 200 s at 1 kHz."""
_NEAR = 0.95
"""Share of a limit up to which a reference may go: a joint that follows it overshoots [–]."""
_PACE: dict[type, tuple[str, int]] = {
    PeriodicMinimumJerk: ("period", 1),
    PointToPoint: ("times", 1),
    Chirp: ("amplitude", -1),
    Multisine: ("amplitudes", -1),
}
"""Kind of a reference → the field by which it becomes slower, and whether that grows or shrinks."""
_ROUNDED = 0.005
"""Half a step in the third digit, by which a number that is to be written is on the slow side."""


def objections(rig: Rig) -> tuple[str, ...]:
    """What is wrong with a rig that `bowden run` refuses, in sentences; empty if it takes it."""
    found, all_rigs = [], [own for joint in rig.each_joint for _, own, _ in joint.motors]
    for joint in rig.each_joint:
        for name, own, _ in joint.motors:
            said = [*_of_motor(own, joint), *map(str, unpowered(own, all_rigs))]
            found += [f"motor {quoted(name)}: {one}" if name else one for one in said]
    return tuple(found)


def refusals(rig: Rig) -> tuple[str, ...]:
    """The same as notes, for whoever does not run it."""
    return as_notes(objections(rig))


def as_notes(objected: Iterable[str]) -> tuple[str, ...]:
    """Objections as notes."""
    return tuple(f"bowden run will refuse this rig: {one}" for one in objected)


def _of_motor(rig: Rig, joint: RigJoint) -> Iterator[str]:
    if rig.turned:
        yield str(turned(rig))
        return
    limits = rig.supervisor_limits
    try:
        _ = rig.drive_parameters
        if rig is joint.first:
            require_joint(rig)
    except ParameterError as error:
        yield str(error)
    needed = rig.encoders.late_cycles(rig.sample_time)
    if rig.plant is None and rig.delay < needed:
        yield (
            f"bench.delay_cycles is {rig.delay}, of {1e3 * rig.sample_time:g} ms; the joint's sensor alone is "
            f"{1e3 * rig.encoders.joint_late:.3g} ms late by the cable's log; expected at least {needed}, and the "
            "cycles that a command takes to the servo; correct it in [bench]"
        )
    if rig.worn is not None and rig.worn.motor.integral > 0.0 and not family_of(rig.drive).integrates:
        yield (
            f"suit.drive_integral_per_s is {rig.worn.motor.integral:g}, and the position loop of a drive of the family "
            f"{rig.drive.family} has no integral: write 0, or take another drive"
        )
    yield from contradictions(limits, rig.sample_time, opposed=joint.against(rig), given=rig.limits)
    if joint.shared:
        yield from reference_beyond(rig, limits)
    elif limits.joint_low < limits.joint_high:
        yield from mismatches(rig, limits)


def turned(rig: Rig) -> ParameterError:
    """That a cable's slope is negative."""
    return ParameterError(
        f"{rig.origin}: the cable's slope is negative",
        expected="a joint angle that grows with the motor's",
        do=rig.made_anew
        or (
            "write direction = -1 below the model in [cable], if the log counted the motor the other way round than "
            "this drive does; else change the sign of motor_direction or joint_direction of [drive], and measure again"
            if isinstance(rig.cable, IdentifiedCable)
            else "write the slope as a positive number, and give the drive's motor the direction in which the joint "
            "rises with it: motor_direction of [drive]"
        ),
    )


def require_joint(rig: Rig) -> None:
    """Refuse a rig that does not measure its joint: laws feed it back, an excitation looks for it, and the supervisor
    watches the cable by it.

    Raises:
        ParameterError: with what to do.
    """
    if not rig.joint_sensor.estimated and not family_of(rig.drive).measures_joint(rig.drive):
        raise ParameterError(
            f"{rig.origin}: the joint's angle is not measured (drive.joint is none)",
            expected="an encoder at the joint, or what its angle is estimated from: an IMU, a stretch sensor, or the "
            "motor alone",
            do='set joint = "cia406" in [drive] for a CANopen encoder (CiA 406) beside the drive, or source of '
            "[joint_sensor]",
        )


def mismatches(rig: Rig, limits: Limits) -> Iterator[str]:
    """What of a rig its own limits would end a run for.

    Args:
        rig: of a motor whose joint no other moves.
        limits: the supervisor's.
    """
    yield from reference_beyond(rig, limits)
    slope, ends = rig.basis.flat, (limits.slope_low, limits.slope_high)
    if not ends[0] <= slope <= ends[1]:
        yield (
            f"the cable's slope is {slope:.4g}, and slope_low = {ends[0]:.4g}, slope_high = {ends[1]:.4g}: the joint "
            "would seem to disagree with its motor; leave both out of [limits]"
        )
        return
    if rig.worn is not None:
        lost = elbow_dead_zone(rig.worn.flexor.half_width)
        if lost > limits.play:
            yield (
                f"the suit's cables lose {lost * DEGREES:.3g}° of the straight elbow at a reversal (suit.play_mm, or "
                f"the model in [cable]), and play_deg = {limits.play * DEGREES:.3g} in [limits] calls that a broken "
                "cable: leave play_deg out, or take a cable that loses less"
            )
    if rig.worn is not None or rig.plant is not None:
        return
    start, begin = rig.start_motor, rig.begin
    allowed = sorted(end * start for end in ends)
    if rig.initial_motor is None and not allowed[0] - limits.play <= begin <= allowed[1] + limits.play:
        yield (
            f"the joint is at {begin * DEGREES:.4g}° where the motor is at {start * DEGREES:.4g}°, and the supervisor "
            f"counts both from where the cable is just taut (slope {slope:.4g}, play {limits.play * DEGREES:.3g}°): "
            "correct offset in [cable], or motor_zero_deg and joint_zero_deg below its model; bowden init --model "
            "finds them"
        )
    yield from _weak(rig, limits, _path(rig))


def reference_beyond(rig: Rig, limits: Limits) -> Iterator[str]:
    """That a reference, or motions by EMG, ask the joint to go where or as fast as the supervisor ends the run."""
    if rig.emg_run is not None:
        yield from _motions_beyond(rig.emg_run, rig.basis.flat, limits)
    if rig.emg_run is not None or rig.pushing is not None:
        return
    time = np.arange(0.0, rig.duration, max(rig.sample_time, rig.duration / _MOST))
    path, velocity, acceleration = rig.trajectory.sample(time).T
    low, high = float(path.min()), float(path.max())
    if not limits.joint_low <= low <= high <= limits.joint_high:
        yield (
            f"the reference goes from {low * DEGREES:.4g}° to {high * DEGREES:.4g}°, and the joint's limits are "
            f"{limits.joint_low * DEGREES:.4g}° to {limits.joint_high * DEGREES:.4g}°: correct [reference], or "
            "joint_low_deg and joint_high_deg of [limits]"
        )
    fastest, hardest = float(np.abs(velocity).max()), float(np.abs(acceleration).max())
    times, why = _too_fast(fastest, hardest, rig.basis.flat, limits)
    if times > 1.0:
        yield f"the reference moves the joint at up to {fastest * DEGREES:.4g}°/s, beyond {why}: {_slower(rig, times)}"


def _motions_beyond(run: EmgRun, slope: float, limits: Limits) -> Iterator[str]:
    """The same of motions by EMG."""
    intent, given = run.course.intent, run.course.intent.duration
    low, high = intent.low * DEGREES, intent.high * DEGREES
    if not limits.joint_low < intent.low < intent.high < limits.joint_high:
        yield (
            f"emg.low_deg is {low:g} and high_deg {high:g}; expected within the joint's limits, "
            f"{limits.joint_low * DEGREES:g} to {limits.joint_high * DEGREES:g}: correct them, or [limits]"
        )
        return
    way, turned = intent.high - intent.low, not run.course.proportional
    speed, acceleration = (TURNED_SPEED, TURNED_ACCELERATION) if turned else (FOLLOWED_SPEED, FOLLOWED_ACCELERATION)
    times, why = _too_fast(speed * way / given, acceleration * way / given**2, slope, limits)
    if times > 1.0:
        yield (
            f"emg.duration_s is {given:g}, for {high - low:g}°; expected at least "
            f"{math.ceil(100.0 * times * given) / 100.0:g} s, by {why}: make it longer, or the range smaller"
        )


def _too_fast(velocity: float, acceleration: float, slope: float, limits: Limits) -> tuple[float, str]:
    """How many times as long a motion of the joint has to take at least, and by which limit.

    Args:
        velocity: its largest [rad/s].
        acceleration: likewise [rad/s²].
        slope: of the cable.
        limits: the supervisor's.
    """
    each = (
        (velocity, limits.joint_speed, "the joint's speed, limits.joint_speed_deg_per_s"),
        (velocity / slope, limits.motor_speed, "the motor's speed, limits.motor_speed_deg_per_s"),
        (acceleration / slope, limits.acceleration, "the motor's acceleration, limits.acceleration_deg_per_s2"),
    )
    times = [asked / (_NEAR * limit) if limit > 0.0 else math.inf for asked, limit, _ in each]
    times[2] = math.sqrt(times[2])
    worst = max(range(3), key=lambda i: times[i])
    return times[worst], f"{100.0 * _NEAR:g} % of {each[worst][2]} = {each[worst][1] * DEGREES:.4g}"


def _slower(rig: Rig, times: float) -> str:
    """What to write into [reference], so that its motion is so many times as slow."""
    slow = slower(rig.reference, times)
    return "take a slower motion, or a smaller one" if slow is None else f"write {slow[0]} into [reference]"


def slower(reference: Trajectory, times: float) -> tuple[str, Trajectory] | None:
    """A reference whose motion is so many times as slow, rounded to that side, and the line that says so in a file;
    None of a kind that has no number for it."""
    field, power = _PACE.get(type(reference), ("", 0))
    for item in items_of(type(reference)) if field and math.isfinite(times) else ():
        if item.path == (field,):
            given = in_file(getattr(reference, field), item.quantity)
            scaled = np.atleast_1d(given) * times**power * (1.0 + power * _ROUNDED)
            listed = [float(f"{value:.3g}") for value in scaled.tolist()]
            written: Any = listed if isinstance(given, list) else listed[0]
            return f"{item.key} = {written}", replace(
                cast(Any, reference), **{field: from_file(written, item.quantity)}
            )
    return None


def _path(rig: Rig) -> NDArray[np.float64]:
    """Positions of the reference along a run [rad]."""
    return rig.trajectory.sample(np.linspace(0.0, rig.duration, _INSTANTS))[:, 0]


def _weak(rig: Rig, limits: Limits, path: NDArray[np.float64]) -> Iterator[str]:
    """Whether the motor can hold the joint's spring along the reference."""
    plant, motor = rig.cabled, rig.motor
    if isinstance(plant, UserPlant) or plant.simulated_cable.physical:
        return
    load = rig.slope * (motor.pretension + motor.spring * (path - rig.home))
    current = load / (motor.gear * motor.torque_constant)
    peak, lasting = float(np.abs(current).max()), float(np.sqrt(np.mean(current**2)))
    more = max(peak / (limits.saturation * limits.current_peak), lasting / limits.thermal.continuous_current)
    if more > 1.0 or math.isnan(more):
        yield (
            f"to hold the joint's spring through a cable of slope {rig.slope:.4g} the motor needs {peak:.3g} A, "
            f"{lasting:.3g} A RMS; it has {limits.current_peak:.3g} A, {limits.thermal.continuous_current:.3g} A for "
            f"long: write its gear in [motor], {motor.gear:.4g} now, {math.ceil(more * motor.gear):g} would do, or "
            "spring_nm_per_rad and pretension_nm as they are"
        )


def refuse_sources(rig: Rig) -> None:
    """Refuse motors whose joints are moved by what moves a joint that is alone: EMG and the wearer's push.

    A run refuses them, and so does a check of what would run.

    Args:
        rig: whole.

    Raises:
        ParameterError: a motor has one of them.
    """
    for name, own, _ in rig.motors:
        for there, key in ((own.emg.source is not None, "emg.source"), (own.admittance.enabled, "admittance.enabled")):
            if there:
                raise ParameterError(
                    f"motor {quoted(name)}: {key} is set in a rig with several motors",
                    expected="[reference] for each: EMG and the wearer's push move a joint that is alone",
                    do="delete it, or take that motor alone, with --motor",
                )
