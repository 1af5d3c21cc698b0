"""The drive, the supervisor's limits and the loop's settings as a rig has them."""

from bowden.core.errors import ParameterError
from bowden.core.units import RADIANS
from bowden.cycle.one_cycle import Filters
from bowden.hardware.drives.parameters import DriveParameters, check_parameters, most_push
from bowden.hardware.realtime import Settings
from bowden.models.suit.suit_angle import spool_map
from bowden.plants.bench import Bench
from bowden.plants.suit_parts import Suit
from bowden.rig import schema as schema
from bowden.rig.live_schema import limits_of
from bowden.safety.limits import Limits


def limits(rig: schema.Rig, bench: Bench) -> Limits:
    """[limits], with the servo's model, the motor's currents and what is measured from the other sections."""
    given = limits_of(rig.limits)
    return given._replace(
        servo_frequency=bench.servo.natural_frequency,
        servo_damping=bench.servo.damping,
        current_peak=bench.motor.current_limit,
        thermal=given.thermal._replace(resistance=bench.motor.resistance),
        measures_current=1.0,
        measures_tension=float(rig.drive.tension_n_per_mv != 0.0),
    )


def drive_parameters(rig: schema.Rig, bench: Bench, suit: Suit | None = None) -> DriveParameters:
    """[drive], with gear, torque constant and cycle from the bench, and what the rig asks for from [limits].

    On a suit the gear is its own, and motor angles are in the joint's coordinate.

    Raises:
        ParameterError: values that make no sense together.
    """
    given, allowed = rig.drive, limits(rig, bench)
    if not allowed.motor_low < allowed.motor_high:
        low, high = (f"{angle / RADIANS:g}" for angle in (allowed.motor_low, allowed.motor_high))
        raise ParameterError(
            f"limits.motor_low_deg is {low} and motor_high_deg {high}",
            expected="motor_low_deg below motor_high_deg",
            do="correct them in rig.toml",
        )
    parameters = DriveParameters(
        interface=given.interface,
        channel=given.channel,
        bitrate=given.bitrate,
        node_id=given.node_id,
        host_id=given.host_id,
        motor_counts_per_turn=given.motor_counts_per_turn,
        gear=bench.motor.gear if suit is None else suit.motor.gear,
        motor_direction=given.motor_direction,
        joint_counts_per_turn=given.joint_counts_per_turn,
        joint_direction=given.joint_direction,
        motor_home=given.motor_home_deg * RADIANS,
        joint_home=given.joint_home_deg * RADIANS,
        home_here=given.home == "here",
        torque_constant=bench.motor.torque_constant,
        tension_scale=given.tension_n_per_mv,
        tension_zero=given.tension_zero_mv,
        sample_time=bench.sample_time,
        heartbeat_time=given.heartbeat_ms * schema.MILLISECONDS,
        heartbeat_timeout=given.heartbeat_timeout_ms * schema.MILLISECONDS,
        drive_heartbeat_time=given.drive_heartbeat_ms * schema.MILLISECONDS,
        lowest_motor=allowed.motor_low,
        highest_motor=allowed.motor_high,
        speed_limit=allowed.motor_speed,
        following_error=allowed.target_reach,
        current_limit=allowed.current_peak,
        torque_offset=0.0 if suit is None else suit.motor.friction_feedforward,
        answer_timeout=given.answer_timeout_ms * schema.MILLISECONDS,
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
            f"drive.drive_heartbeat_ms is {given.drive_heartbeat_ms:g}, and limits.heartbeat_age_s is "
            f"{allowed.heartbeat_age:g}",
            expected="two of the drive's heartbeats within that age, so that one lost frame is none",
            do="correct one of them",
        )
    return parameters


def on_bus(drive: DriveParameters, channel: str | None, interface: str | None) -> DriveParameters:
    """The drive on another bus than the rig's, where one is given.

    Raises:
        ParameterError: a channel that is none.
    """
    moved = drive._replace(
        channel=drive.channel if channel is None else channel,
        interface=drive.interface if interface is None else interface,
    )
    check_parameters(moved)
    return moved


def settings(rig: schema.Rig) -> Settings:
    """What [live] asks of the system."""
    return Settings(rig.live.priority, rig.live.cpu, rig.live.lock_memory)


def filters(rig: schema.Rig) -> Filters:
    """The filters of [live].

    Raises:
        ParameterError: a cut-off that the cycle is too slow for.
    """
    highest = 0.5e3 / rig.bench.sample_time_ms
    for name in ("joint_cutoff_hz", "motor_cutoff_hz"):
        if getattr(rig.live, name) > highest:
            raise ParameterError(
                f"live.{name} is {getattr(rig.live, name):g}",
                expected=f"at most {highest:g}, half the loop's rate",
                do="correct it, or leave it out",
            )
    return Filters(rig.live.joint_cutoff_hz * schema.HERTZ, rig.live.motor_cutoff_hz * schema.HERTZ)
