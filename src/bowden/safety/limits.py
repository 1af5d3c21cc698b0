"""What a rig may do: every limit of the supervisor; the defaults are those of the default bench (docs/safety.md)."""

from typing import NamedTuple

from bowden.models.drive.thermal import Thermal


class Limits(NamedTuple):
    """Limits; each comment is a meaning with its unit, and docs/safety.md is made of them."""

    motor_low: float = -0.3  # smallest target of the motor [rad]
    motor_high: float = 2.0  # largest target of the motor [rad]
    motor_margin: float = 0.05  # how far the motor may be beyond its targets' range [rad]
    joint_low: float = -0.5  # smallest angle of the joint [rad]
    joint_high: float = 1.5  # largest angle of the joint [rad]
    sensor_span: float = 6.5  # largest size of an angle that an encoder can show [rad]
    jump: float = 0.02  # change of a reading in one cycle, beyond what the speed limit allows [rad]
    motor_speed: float = 15.0  # largest speed of the motor at the spool [rad/s]
    joint_speed: float = 8.0  # largest speed of the joint [rad/s]
    speed_filter: float = 0.005  # time constant of both measured speeds [s]
    target_speed: float = 200.0  # largest change of the target in a cycle, over the cycle's time [rad/s]
    target_reach: float = 0.9  # largest distance of the target from the measured motor [rad]
    acceleration: float = 2500.0  # largest acceleration that a target may ask of the servo's model [rad/s²]
    servo_frequency: float = 53.5767  # ω of the servo's model [rad/s]
    servo_damping: float = 1.0  # ζ of the servo's model [–]
    tracking: float = 0.1  # largest distance of the motor from the servo's model at rest [rad]
    tracking_lag: float = 0.01  # what the distance may grow by with speed [s]
    tracking_time: float = 0.005  # how long it may be exceeded [s]
    slope_low: float = 0.7  # smallest slope of the cable, joint over motor [rad/rad]
    slope_high: float = 1.05  # largest slope of the cable [rad/rad]
    play: float = 0.3  # largest distance of the joint from what these slopes allow [rad]
    joint_still: float = 2e-4  # A change of the joint's reading that is a sign of life [rad]
    frozen_travel: float = 0.4  # travel of the motor without a sign of life from the joint [rad]
    measures_current: float = 1.0  # 1 where the drive tells its current, else 0
    current_peak: float = 20.0  # largest current [A]
    current_time: float = 0.002  # how long it may be exceeded [s]
    saturation: float = 0.95  # share of the largest current at which the drive counts as saturated [–]
    saturation_time: float = 0.05  # how long it may be [s]
    i2t_time: float = 2.0  # how long the largest current may last from a start at rest [s]
    thermal: Thermal = Thermal()  # the motor's thermal model, with its continuous current
    winding_limit: float = 125.0  # [°C]
    housing_limit: float = 70.0  # [°C]; skin and textile may touch it
    measures_temperature: float = 0.0  # 1 where the drive tells its temperature, else 0
    drive_limit: float = 80.0  # [°C]
    measures_tension: float = 0.0  # 1 where the cable's tension is measured, else 0
    tension_high: float = 150.0  # [N]
    tension_low: float = 2.0  # below it the cable is slack [N]
    slack_time: float = 0.05  # how long it may be slack [s]
    reading_age: float = 2.0  # age of an angle that is still good [cycles]
    heartbeat_age: float = 0.05  # age of the drive's heartbeat that is still good [s]
    enable_time: float = 1.0  # from arming to the drive's operation enabled [s]
    bus_errors: float = 2.5  # frames that could not be sent; one is forgiven each second [–]
    lateness: float = 0.02  # largest lateness of a cycle, and largest sum of the last ones [s]
    clock_gap: float = 0.5  # longest time between two cycles that a late loop explains [s]
    operator_age: float = 1.0  # age of the operator's last sign of life [s]
    uses_emg: float = 0.0  # 1 where EMG moves the reference, else 0
    emg_age: float = 0.2  # age of the newest EMG sample that is still good [s]
    preflight_time: float = 60.0  # from arming to running, at most [s]
    bridge_time: float = 0.005  # R1 at most, R2 or R3 afterwards [s]
    bridge_leak: float = 0.02  # share of good time by which bridged time is forgotten: worse readings stop [–]
    release_time: float = 0.2  # R2 at most, power off afterwards [s]
    pay_out: float = 7.0  # speed at which R2 lets the cable out [rad/s]
    slack_sign: float = -1.0  # direction of the motor that lets the cable out: −1 or 1
    released_current: float = 0.3  # current [A] below which the cable carries nothing, if it lasts for `released_time`
    released_time: float = 0.02  # [s]
