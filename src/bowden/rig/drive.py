"""The drive, the supervisor's limits and the loop's settings as a rig has them."""

from bowden.core.errors import ParameterError
from bowden.core.units import HERTZ, RADIANS
from bowden.cycle.one_cycle import Filters
from bowden.hardware.drives.parameters import DriveParameters, check_parameters, most_push
from bowden.hardware.realtime import Settings
from bowden.models.suit.suit_angle import spool_map
from bowden.plants.bench import Bench
from bowden.plants.suit_parts import Suit
from bowden.rig.settings import LiveSettings
from bowden.safety.limits import Limits


def limits(given: Limits, bench: Bench, drive: DriveParameters) -> Limits:
    """A rig's limits, with the servo's model, the motor's currents and what is measured from its other parts."""
    return given._replace(
        servo_frequency=bench.servo.natural_frequency,
        servo_damping=bench.servo.damping,
        current_peak=bench.motor.current_limit,
        thermal=given.thermal._replace(resistance=bench.motor.resistance),
        measures_current=1.0,
        measures_tension=float(drive.tension_scale != 0.0),
    )


def drive_parameters(
    given: DriveParameters, allowed: Limits, bench: Bench, suit: Suit | None = None
) -> DriveParameters:
    """A rig's drive, with gear, torque constant and cycle from the bench, and what the rig asks for from its limits.

    On a suit the gear is its own, and motor angles are in the joint's coordinate.

    Args:
        given: what the rig says of the drive itself.
        allowed: of `limits`.
        bench: of the rig.
        suit: where one is worn.

    Raises:
        ParameterError: values that make no sense together.
    """
    if not allowed.motor_low < allowed.motor_high:
        low, high = (f"{angle / RADIANS:g}" for angle in (allowed.motor_low, allowed.motor_high))
        raise ParameterError(
            f"limits.motor_low_deg is {low} and motor_high_deg {high}",
            expected="motor_low_deg below motor_high_deg",
            do="correct them in rig.toml",
        )
    parameters = given._replace(
        gear=bench.motor.gear if suit is None else suit.motor.gear,
        torque_constant=bench.motor.torque_constant,
        sample_time=bench.sample_time,
        lowest_motor=allowed.motor_low,
        highest_motor=allowed.motor_high,
        speed_limit=allowed.motor_speed,
        following_error=allowed.target_reach,
        current_limit=allowed.current_peak,
        torque_offset=0.0 if suit is None else suit.motor.friction_feedforward,
        spool=None if suit is None else spool_map(suit.geometry, suit.spool_radius),
    )
    if parameters.torque_offset > most_push(parameters):
        raise ParameterError(
            f"suit.friction_feedforward_nm is {parameters.torque_offset:g}",
            expected=f"at most {most_push(parameters):.4g}, half of what the largest current gives at the spool",
            do="correct it, or the current's limit in [limits]",
        )
    check_parameters(parameters)
    if 2.0 * parameters.drive_heartbeat_time > allowed.heartbeat_age:
        raise ParameterError(
            f"drive.drive_heartbeat_ms is {1e3 * given.drive_heartbeat_time:g}, and limits.heartbeat_age_s is "
            f"{allowed.heartbeat_age:g}",
            expected="two of the drive's heartbeats within that age, so that one lost frame is none",
            do="correct one of them",
        )
    return parameters


def settings(live: LiveSettings) -> Settings:
    """What the live loop asks of the system."""
    return Settings(live.priority, live.cpu, live.lock_memory)


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
