"""The drive, the supervisor's limits and the loop's settings as a rig has them."""

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from bowden.control.admittance.interaction import Doubt
from bowden.core.errors import ParameterError
from bowden.core.units import HERTZ, RADIANS
from bowden.cycle.one_cycle import Filters
from bowden.models.drive.holding_brake import HoldingBrake
from bowden.models.suit.suit_angle import spool_map
from bowden.plants.bench import Bench
from bowden.plants.suit_parts import Suit
from bowden.rig.consistent import Basis, follow
from bowden.rig.families import DriveNeeds, family_of, longest_silence, resolved
from bowden.rig.load_cell import ROOM, LoadCellParameters, check_cell
from bowden.rig.settings import LiveSettings
from bowden.safety.evidence import DEAD_SHARE
from bowden.safety.limits import ARM_LOWERING, FASTEST_RELEASE, Limits
from bowden.safety.release import steepest

_LEAST_TRAVEL = 0.1
"""Travel of the motor, of the bench's slope, that shows a frozen joint where the cable has next to no dead zone: what
noise, a joint that follows late and a limb that is held do not explain [rad]."""
_BELOW = 0.5
"""Speed of a release over those at which joint and motor are too fast. An arm that friction lets go of goes for a
moment at twice the speed of its motor."""


NO_CELL = LoadCellParameters()


def limits(
    given: Limits,
    basis: Basis,
    bench: Bench,
    drive: Any,
    dead_zone: float = math.nan,
    suit: Suit | None = None,
    cell: LoadCellParameters = NO_CELL,
    taut: float = 0.0,
) -> Limits:
    """A rig's limits, with the servo's model, the motor's currents and what is measured from its other parts.

    Args:
        given: what the rig says of them.
        basis: what those follow from that it does not.
        bench: of the rig.
        drive: of the rig.
        dead_zone: the widest that its identified cable has, NaN where none is identified [rad].
        suit: where one is worn.
        cell: a load cell of its own.
        taut: motor angle at which the cable is just taut, the joint at its rest [rad].
    """
    family, written = family_of(drive), not math.isnan(given.frozen_travel)
    given = follow(given, basis)
    fastest = _BELOW * min(given.joint_speed, given.motor_speed * float(steepest(given)))
    travel = max(_LEAST_TRAVEL / basis.slope, dead_zone / DEAD_SHARE)
    travel = min(given.frozen_travel, travel) if written else travel
    gain, doubt = (given.pull_gain, given.pull_doubt) if suit is None else _pull(suit)
    return given._replace(
        frozen_travel=given.frozen_travel if math.isnan(dead_zone) else travel,
        servo_frequency=bench.servo.natural_frequency,
        servo_damping=bench.servo.damping,
        current_peak=bench.motor.current_limit,
        thermal=given.thermal._replace(resistance=bench.motor.resistance),
        measures_current=True,
        measures_tension=family.measures_tension(drive) or (cell.there and cell.measures == "tension"),
        measures_torque=family.measures_torque(drive) or (cell.there and cell.measures == "torque"),
        lowering=min(given.lowering, fastest, math.inf if suit is None else ARM_LOWERING),
        force_release=min(FASTEST_RELEASE, fastest),
        taut=min(max(taut, given.motor_low), given.motor_high),
        homed=family_of(drive).homed(drive),
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


def drive_needs(allowed: Limits, bench: Bench, suit: Suit | None = None) -> DriveNeeds:
    """What a rig asks of its drive: gear, torque constant and cycle from the bench, and the rest from its limits.

    On a suit the gear is its own, and motor angles are in the joint's coordinate.

    Args:
        allowed: of `limits`.
        bench: of the rig.
        suit: where one is worn.

    Raises:
        ParameterError: limits that contradict one another.
    """
    if not allowed.motor_low < allowed.motor_high:
        low, high = (f"{angle / RADIANS:g}" for angle in (allowed.motor_low, allowed.motor_high))
        raise ParameterError(
            f"limits.motor_low_deg is {low} and motor_high_deg {high}",
            expected="motor_low_deg below motor_high_deg",
            do="correct them in rig.toml",
        )
    motor, servo = (bench.motor, bench.servo) if suit is None else (suit.motor, suit.motor.servo)
    stiffness = motor.inertia * servo.natural_frequency**2
    slow = suit is not None and 0.0 < suit.motor.integral < SURE_INTEGRAL
    return DriveNeeds(
        gear=motor.gear,
        torque_constant=bench.motor.torque_constant,
        sample_time=bench.sample_time,
        lowest_motor=allowed.motor_low,
        highest_motor=allowed.motor_high,
        speed_limit=min(allowed.motor_speed, servo.speed_limit),  # a drive is not asked for more than it can
        following_error=allowed.target_reach,
        current_limit=allowed.current_peak,
        torque_offset=0.0 if suit is None else suit.motor.friction_feedforward,
        spool=None if suit is None else spool_map(suit.geometry, suit.spool_radius),
        heartbeat_age=allowed.heartbeat_age,
        lag_current=0.0 if slow else stiffness / (motor.gear * motor.torque_constant),
        lag_time=2.0 * servo.damping / servo.natural_frequency,
    )


def drive_parameters(given: Any, needs: DriveNeeds, folder: Path) -> Any:
    """A rig's drive with what the rig asks of it.

    Args:
        given: what the rig says of the drive itself, parameters of a family.
        needs: of `drive_needs`.
        folder: from which the files that it names are found.

    Raises:
        ParameterError: values that make no sense together, or a drive that would keep its torque without us.
    """
    most = most_push(given, needs)
    if needs.torque_offset > most:
        raise ParameterError(
            f"suit.friction_feedforward_nm is {needs.torque_offset:g}",
            expected=f"at most {most:.4g}, half of what the largest current gives at the spool",
            do="correct it, or the current's limit in [limits]",
        )
    family = family_of(given)
    parameters = family.completed(given, needs)
    watch, longest = family.watchdog(parameters), longest_silence(needs.sample_time)
    if not (watch <= longest or (family.holds and math.isinf(watch))):
        never = "never" if math.isinf(watch) else f"{1e3 * watch:g} ms after our last word"
        raise ParameterError(
            f"the drive ({family.name}) takes its torque off {never}, should the loop die",
            expected=f"a drive that does it within {1e3 * longest:g} ms by itself",
            do="set the drive's own timeout with its maker's tool, and say it in [drive]; or take another drive",
        )
    return family.found_from(parameters, folder)


def check_brake(brake: HoldingBrake, drive: Any, allowed: Limits, suit: Suit | None) -> None:
    """Refuse a holding brake that nothing could release or engage, or that could trap a limb.

    Args:
        brake: of the rig.
        drive: of the rig.
        allowed: of `limits`.
        suit: where one is worn.

    Raises:
        ParameterError: a drive without the output, no suit, or a brake that holds more than the cable may pull.
    """
    if suit is None:
        raise ParameterError(
            "it has no effect here: the bench's motor bears any load, and draws no current that a brake would save",
            expected="suit.worn = true",
            do="wear a suit, or delete [brake]",
        )
    family = family_of(drive)
    if not family.brakes(drive):
        raise ParameterError(
            f"the drive ({family.name}) has no output for a holding brake",
            expected=family.brake_hint,
            do="correct [drive], or delete [brake]",
        )
    most = allowed.tension_high * suit.spool_radius / suit.motor.gear
    if brake.holding_torque > most:
        raise ParameterError(
            f"brake.holding_torque_nm is {brake.holding_torque:g}",
            expected=f"at most {most:.3g}: a brake that stays engaged, should this computer or the supply fail, must "
            "slip before the cable pulls more than limits.tension_high_n",
            do="take a smaller brake",
        )


def check_load(drive: Any, cell: LoadCellParameters, allowed: Limits, sample_time: float) -> None:
    """Refuse a load cell that could not show what the supervisor is to see.

    Args:
        drive: of the rig.
        cell: of the rig.
        allowed: of `limits`.
        sample_time: of a cycle [s].

    Raises:
        ParameterError: two of them, a range below the largest load allowed, or values that make no sense.
    """
    family = family_of(drive)
    at_drive = family.measures_tension(drive) or family.measures_torque(drive)
    if at_drive and cell.there:
        raise ParameterError(
            "[load_cell] names a device, and [drive] has a load cell at the drive's input",
            expected="one load cell",
            do="delete tension_n_per_mv and torque_nm_per_mv of [drive], or source of [load_cell]",
        )
    torque = allowed.measures_torque
    most, key = (allowed.torque_high, "torque_high_nm") if torque else (allowed.tension_high, "tension_high_n")
    if cell.there:
        check_cell(cell, sample_time, most, key)
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


def devices(drive: Any, cell: LoadCellParameters) -> list[Any]:
    """What `collision` compares: the drive's parameters and, where there is one on a bus, its load cell."""
    return [drive, resolved("drives.of_rig").device_of(drive, cell)] if cell.there else [drive]


def collision(one: Any, other: Any) -> str:
    """What keeps two of the `devices` from being on one bus, where they are; empty of others."""
    said: str = resolved("drives.on_can").collision(one, other)
    return said


def shortest_cycles(drives: Iterable[Any]) -> dict[str, tuple[int, float]]:
    """Of each bus whose time is known: how many drives are on it, and the shortest cycle that it carries with them [s].

    Args:
        drives: of a rig, with what the rig asks of them.
    """
    on: dict[tuple[str, str], list[Any]] = {}
    for drive in drives:
        if family_of(drive).cycle_time is not None:
            on.setdefault((drive.channel, drive.family), []).append(drive)
    times = {}
    for (channel, _), there in on.items():
        shortest = family_of(there[0]).cycle_time
        assert shortest is not None  # as was looked above
        times[channel] = len(there), shortest(there)
    return times


def most_push(given: Any, needs: DriveNeeds) -> float:
    """Largest torque offset that the drive takes, at the spool [N·m]."""
    return family_of(given).most_push(given, needs)


def filters(live: LiveSettings, sample_time: float) -> Filters:
    """The filters in front of the law.

    Raises:
        ParameterError: a cut-off that the cycle is too slow for.
    """
    highest = 0.5 / sample_time
    for name, cutoff in (("joint_cutoff_hz", live.joint_cutoff), ("motor_cutoff_hz", live.motor_cutoff)):
        if cutoff > highest * HERTZ:
            raise ParameterError(
                f"live.{name} is {cutoff / HERTZ:g}",
                expected=f"at most {highest:g}, half the loop's rate",
                do="correct it, or leave it out",
            )
    return Filters(live.joint_cutoff, live.motor_cutoff)
