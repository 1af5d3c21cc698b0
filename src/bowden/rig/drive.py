"""The supervisor's limits, the drive and the loop's filters as they follow from a rig."""

import math
from pathlib import Path
from typing import Any

from bowden.control.admittance.interaction import Doubt
from bowden.control.knowledge import with_cable
from bowden.core.errors import ParameterError
from bowden.core.units import HERTZ, RADIANS
from bowden.cycle.one_cycle import Filters
from bowden.models.cable.bouc_wen import upright
from bowden.models.drive.geared_motor import no_load_speed
from bowden.models.suit.suit_angle import spool_map, steepest_spool
from bowden.plants.suit_parts import Suit
from bowden.plants.worn_suit import USUAL_DEAD_ZONE, elbow_dead_zone
from bowden.rig.consistent import Basis, follow
from bowden.rig.families import DriveNeeds, family_of, longest_silence
from bowden.rig.load_cell import ROOM, check_cell, collision, devices
from bowden.rig.plant import plain_cable
from bowden.rig.rig import Rig
from bowden.rig.sections import DEFAULT_CABLE
from bowden.safety.evidence import DEAD_SHARE
from bowden.safety.limits import ARM_LOWERING, FASTEST_RELEASE, Limits
from bowden.safety.release import steepest

_WIDER = 2.0
"""Bend of the sheath over that at which the cable was identified, up to which limits know its dead zone [–]."""
_LEAST_TRAVEL = 0.1
"""Travel of the motor, of the bench's slope, that shows a frozen joint where the cable has next to no dead zone: what
noise, a joint that follows late and a limb that is held do not explain [rad]."""
_BELOW = 0.5
"""Speed of a release over those at which joint and motor are too fast. An arm that friction lets go of goes for a
moment at twice the speed of its motor."""


def supervisor_limits(rig: Rig) -> Limits:
    """All limits of the supervisor, those that follow from other parts too: the servo's model, the motor's currents and
    what is measured.
    """
    family, basis, suit, cell = family_of(rig.drive), rig.basis, rig.worn, rig.load_cell
    dead_zone, written = _WIDER * rig.knowledge.width, not math.isnan(rig.limits.frozen_travel)
    given = follow(rig.limits, basis)
    taut = rig.home / rig.slope if suit is None else 0.0
    fastest = _BELOW * min(given.joint_speed, given.motor_speed * float(steepest(given)))
    travel = max(_LEAST_TRAVEL / basis.slope, dead_zone / DEAD_SHARE)
    travel = min(given.frozen_travel, travel) if written else travel
    gain, doubt = (given.pull_gain, given.pull_doubt) if suit is None else _pull(suit)
    return given._replace(
        frozen_travel=given.frozen_travel if math.isnan(dead_zone) else travel,
        servo_frequency=rig.servo.natural_frequency,
        servo_damping=rig.servo.damping,
        current_peak=rig.motor.current_limit,
        thermal=given.thermal._replace(resistance=rig.motor.resistance),
        measures_current=True,
        estimates_joint=rig.joint_sensor.estimated,
        measures_tension=family.measures_tension(rig.drive) or (cell.enabled and cell.measures == "tension"),
        measures_torque=family.measures_torque(rig.drive) or (cell.enabled and cell.measures == "torque"),
        lowering=min(given.lowering, fastest, math.inf if suit is None else ARM_LOWERING),
        force_release=min(FASTEST_RELEASE, fastest),
        taut=min(max(taut, given.motor_low), given.motor_high),
        homed=family.homed(rig.drive),
        pull_gain=gain,
        pull_doubt=doubt,
    )


def _pull(suit: Suit) -> tuple[float, float]:
    """What a motor's current says at least of the flexor's tension T, whose spool has the radius r:

        T ≥ (η·N·kτ·I − (1 + doubt)·F)/r

    with the gears' loss as if all of the current's torque went through it, friction F of drive, gears and feeder as
    large as it may be and against the pull, with the feeder's drag on the flexor, and nothing of the extensor's
    tension, which pulls the same way. What the motor's inertia takes is no tension: at its largest speed v it is gone
    after 2·J·v/(η·N·kτ·I), 12 ms on the default suit, which the supervisor waits for and longer.
    """
    motor, radius, doubt = suit.motor, suit.spool_radius, 1.0 + Doubt().friction
    gain = motor.efficiency * motor.gear * motor.torque_constant / radius
    return gain, doubt * motor.friction / radius + doubt * suit.flexor.feeder_drag


SURE_INTEGRAL = 40.0
"""Integral of a drive's position loop from which on its current passes zero sooner than a motor is called inert. At a
slow turn, while friction holds the motor, it is within a tenth of what the servo would draw for 0.2 s·k/integral, k
being how many times the rig's stiffness is too large; for k = 4 that is the 20 ms of `LagWatch` [1/s]."""


def basis(rig: Rig) -> Basis:
    """What limits that are not written follow from."""
    width = 0.0
    if rig.worn is not None and (lost := elbow_dead_zone(rig.worn.flexor.half_width)) > USUAL_DEAD_ZONE:
        width = lost
    if rig.worn is not None or (rig.plant is not None and not rig.own_plant.slope > 0.0):
        return Basis(1.0, DEFAULT_CABLE.slope, width, 0.0, rig.bench.servo.speed_limit, rig.sample_time)
    if rig.plant is None:
        width = with_cable(rig.knowledge, upright(plain_cable(rig)), rig.bench.sheath.gap, identified=True).width
    low, fastest = min(0.0, rig.reference_ends[0]), rig.bench.servo.speed_limit
    return Basis(rig.slope / DEFAULT_CABLE.slope, rig.slope, width, low, fastest, rig.sample_time)


def home(rig: Rig) -> float:
    """The joint's rest, where the cable is just taut: zero, or the end of the reference where the cable is longer,
    or where zero is outside the joint's range [rad].
    """
    if rig.worn is not None:
        return 0.0
    low, high = rig.reference_ends
    if rig.limits.joint_low < 0.0 < rig.limits.joint_high:
        low, high = min(0.0, low), max(0.0, high)
    end = low if rig.limits.slack_sign < 0.0 else high
    return min(max(end, rig.limits.joint_low), rig.limits.joint_high)


def drive_needs(rig: Rig) -> DriveNeeds:
    """What a rig asks of its drive, whatever it is: gear, torque constant and cycle, and the rest from its limits.

    On a suit the gear is its own, and motor angles are in the joint's coordinate.

    Raises:
        ParameterError: limits that contradict one another.
    """
    allowed, suit = rig.supervisor_limits, rig.worn
    if not allowed.motor_low < allowed.motor_high:
        low, high = (f"{angle / RADIANS:g}" for angle in (allowed.motor_low, allowed.motor_high))
        raise ParameterError(
            f"limits.motor_low_deg is {low} and motor_high_deg {high}",
            expected="motor_low_deg below motor_high_deg",
            do="correct them in rig.toml",
        )
    motor, servo = (rig.motor, rig.servo) if suit is None else (suit.motor, suit.motor.servo)
    stiffness = motor.inertia * servo.natural_frequency**2
    fastest, spool = servo.speed_limit, None
    if suit is not None:
        spool = spool_map(suit.geometry, suit.spool_radius)
        turned = steepest_spool(allowed.motor_low, allowed.motor_high, spool)
        fastest = min(fastest, no_load_speed(suit.motor) / turned)
    slow = suit is not None and 0.0 < suit.motor.integral < SURE_INTEGRAL
    return DriveNeeds(
        gear=motor.gear,
        torque_constant=rig.motor.torque_constant,
        sample_time=rig.sample_time,
        lowest_motor=allowed.motor_low,
        highest_motor=allowed.motor_high,
        speed_limit=min(allowed.motor_speed, fastest),  # a drive is not asked for more than it can
        following_error=allowed.target_reach,
        current_limit=allowed.current_peak,
        torque_offset=0.0 if suit is None else suit.motor.friction_feedforward,
        spool=spool,
        heartbeat_age=allowed.heartbeat_age,
        lag_current=0.0 if slow else stiffness / (motor.gear * motor.torque_constant),
        lag_time=2.0 * servo.damping / servo.natural_frequency,
    )


def drive_parameters(rig: Rig) -> Any:
    """All that is to be known of the drive, as its family has it, with what the rig asks of it.

    Raises:
        ParameterError: values that make no sense together, or a drive that would keep its torque without us.
    """
    check_load(rig)
    given, needs, family = rig.drive, rig.drive_needs, family_of(rig.drive)
    most = family.most_push(given, needs)
    if needs.torque_offset > most:
        raise ParameterError(
            f"suit.friction_feedforward_nm is {needs.torque_offset:g}",
            expected=f"at most {most:.4g}, half of what the largest current gives at the spool",
            do="correct it, or the current's limit in [limits]",
        )
    parameters = family.completed(given, needs)
    watch, longest = family.watchdog(parameters), longest_silence(needs.sample_time)
    if not (watch <= longest or (family.holds and math.isinf(watch))):
        never = "never" if math.isinf(watch) else f"{1e3 * watch:g} ms after our last word"
        raise ParameterError(
            f"the drive ({family.name}) takes its torque off {never}, should the loop die",
            expected=f"a drive that does it within {1e3 * longest:g} ms by itself",
            do="set the drive's own timeout with its maker's tool, and say it in [drive]; or take another drive",
        )
    return family.found_from(parameters, Path(rig.origin).parent)


def check_brake(rig: Rig) -> None:
    """Refuse a holding brake that nothing could release or engage, or that could trap a limb.

    Raises:
        ParameterError: a drive without the output, no suit, or a brake that holds more than the cable may pull.
    """
    suit, family = rig.worn, family_of(rig.drive)
    if suit is None:
        raise ParameterError(
            "it has no effect here: the bench's motor bears any load, and draws no current that a brake would save",
            expected="suit.worn = true",
            do="wear a suit, or delete [brake]",
        )
    if not family.brakes(rig.drive):
        raise ParameterError(
            f"the drive ({family.name}) has no output for a holding brake",
            expected=family.brake_hint,
            do="correct [drive], or delete [brake]",
        )
    most = rig.supervisor_limits.tension_high * suit.spool_radius / suit.motor.gear
    if rig.brake.holding_torque > most:
        raise ParameterError(
            f"brake.holding_torque_nm is {rig.brake.holding_torque:g}",
            expected=f"at most {most:.3g}: a brake that stays engaged, should this computer or the supply fail, must "
            "slip before the cable pulls more than limits.tension_high_n",
            do="take a smaller brake",
        )


def check_load(rig: Rig) -> None:
    """Refuse a load cell that could not show what the supervisor is to see.

    Raises:
        ParameterError: two of them, a range below the largest load allowed, or values that make no sense.
    """
    drive, cell, allowed = rig.drive, rig.load_cell, rig.supervisor_limits
    family = family_of(drive)
    at_drive = family.measures_tension(drive) or family.measures_torque(drive)
    if at_drive and cell.enabled:
        raise ParameterError(
            "[load_cell] names a device, and [drive] has a load cell at the drive's input",
            expected="one load cell",
            do="delete tension_n_per_mv and torque_nm_per_mv of [drive], or source of [load_cell]",
        )
    torque = allowed.measures_torque
    most, key = (allowed.torque_high, "torque_high_nm") if torque else (allowed.tension_high, "tension_high_n")
    if cell.enabled:
        check_cell(cell, rig.sample_time, most, key)
        problem = collision(*devices(drive, cell)) if hasattr(drive, "interface") else ""
        if problem:
            raise ParameterError(
                f"drive and load cell {problem}",
                expected="one speed and frames that differ, or a bus for each",
                do="correct one, or write channel in [load_cell]",
            )
    elif at_drive and not most <= ROOM * family.load_range(drive):
        told, unit = family.load_range(drive), "N·m" if torque else "N"
        raise ParameterError(
            f"limits.{key} is {most:g}, and the load cell at the drive's input can tell {told:.4g} {unit}",
            expected=f"at most {ROOM * told:.4g}: beyond its range it would not see too much load",
            do="make the limit smaller, or correct the scale, zero and analog_range_mv in [drive]",
        )


def filters(rig: Rig) -> Filters:
    """The filters in front of the law.

    Raises:
        ParameterError: a cut-off that the cycle is too slow for.
    """
    live, highest = rig.live, 0.5 / rig.sample_time
    for name, cutoff in (("joint_cutoff_hz", live.joint_cutoff), ("motor_cutoff_hz", live.motor_cutoff)):
        if cutoff > highest * HERTZ:
            raise ParameterError(
                f"live.{name} is {cutoff / HERTZ:g}",
                expected=f"at most {highest:g}, half the loop's rate",
                do="correct it, or leave it out",
            )
    return Filters(live.joint_cutoff, live.motor_cutoff)
