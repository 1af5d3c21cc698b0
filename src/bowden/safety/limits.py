"""Every limit of the supervisor; the defaults are those of the default bench (docs/safety.md)."""

from typing import Annotated, NamedTuple

from bowden.core.guesses import answering_fields
from bowden.core.quantity import Quantity
from bowden.core.units import RADIANS
from bowden.models.drive.thermal import Thermal

FASTEST_RELEASE = 90.0 * RADIANS
"""Speed of a joint in a release, without an arm on the cable or where a force is to end [rad/s]."""
ARM_LOWERING = 40.0 * RADIANS
"""Speed at which an arm is let down [rad/s]."""


@answering_fields
class Limits(NamedTuple):
    """Limits, each with its meaning and unit; those without a key in rig.toml follow from its other sections.

    Times, temperatures and forces have ceilings, beyond which a limit would no longer limit: 180 °C is what the best
    usual insulation of a winding bears (IEC 60085, class H), 120 °C a power stage, 85 °C a magnet's and a textile's
    neighbourhood; ages of seconds are for trials against a twin on a computer that stalls, not for a limb.

    So have angles and speeds, in degrees as in rig.toml. A joint turns within one turn, 360° either way; no joint of a
    limb that a cable moves is quicker than 1150°/s (what the elbow of a throwing athlete reaches is twice that,
    unassisted). A motor may be counted before a gear: 100 turns, and as many times the joint's speed as the flattest
    cable, of slope 0.02, asks for.
    What follows (`follows`) is here as on the paper's bench; a rig has it by `rig.consistent`.
    """

    motor_low: Annotated[
        float, Quantity("smallest target of the motor", "rad", ge=-36000.0, le=36000.0, follows=True)
    ] = -0.3
    motor_high: Annotated[
        float, Quantity("largest target of the motor", "rad", ge=-36000.0, le=36000.0, follows=True)
    ] = 2.0
    motor_margin: Annotated[
        float, Quantity("how far the motor may be beyond its targets' range", "rad", ge=0.0, le=360.0, follows=True)
    ] = 0.05
    joint_low: Annotated[float, Quantity("smallest angle of the joint", "rad", ge=-360.0, le=360.0)] = -0.5
    joint_high: Annotated[float, Quantity("largest angle of the joint", "rad", ge=-360.0, le=360.0)] = 1.5
    sensor_span: Annotated[
        float, Quantity("largest size of an angle that an encoder can show", "rad", ge=0.0, le=72000.0, follows=True)
    ] = 6.5
    jump: Annotated[
        float, Quantity("change of a reading in one cycle, beyond what the speed limit allows", "rad", ge=0.0, le=12.0)
    ] = 0.02
    motor_speed: Annotated[
        float, Quantity("largest speed of the motor at the spool", "rad/s", ge=0.0, le=57000.0, follows=True)
    ] = 15.0
    joint_speed: Annotated[float, Quantity("largest speed of the joint", "rad/s", ge=0.0, le=1150.0)] = 8.0
    speed_filter: Annotated[float, Quantity("time constant of both measured speeds", "s", ge=0.0, le=0.1)] = 0.005
    target_speed: Annotated[
        float,
        Quantity(
            "largest change of the target in a cycle, over the cycle's time", "rad/s", ge=0.0, le=1e6, follows=True
        ),
    ] = 200.0
    target_reach: Annotated[
        float,
        Quantity("largest distance of the target from the measured motor", "rad", ge=0.0, le=36000.0, follows=True),
    ] = 0.9
    acceleration: Annotated[
        float,
        Quantity(
            "largest acceleration that a target may ask of the servo's model", "rad/s²", ge=0.0, le=1.2e7, follows=True
        ),
    ] = 2500.0
    servo_frequency: Annotated[float, Quantity("ω of the servo's model", "rad/s", key=None)] = 53.5767
    servo_damping: Annotated[float, Quantity("ζ of the servo's model", key=None)] = 1.0
    tracking: Annotated[
        float,
        Quantity(
            "largest distance of the motor from the servo's model at rest", "rad", ge=0.0, le=2300.0, follows=True
        ),
    ] = 0.1
    tracking_lag: Annotated[float, Quantity("growth of that distance with speed", "s", ge=0.0, le=0.1)] = 0.01
    tracking_time: Annotated[float, Quantity("how long it may be exceeded", "s", ge=0.0, le=0.1, follows=True)] = 0.005
    slope_low: Annotated[
        float, Quantity("smallest slope of the cable, joint over motor", "rad/rad", ge=0.0, le=100.0, follows=True)
    ] = 0.7
    slope_high: Annotated[float, Quantity("largest slope of the cable", "rad/rad", gt=0.0, le=100.0, follows=True)] = (
        1.05
    )
    play: Annotated[
        float,
        Quantity("largest distance of the joint from what these slopes allow", "rad", ge=0.0, le=57.0, follows=True),
    ] = 0.3
    joint_still: Annotated[
        float, Quantity("a change of the joint's reading that is a sign of life", "rad", ge=0.0, le=1.0)
    ] = 2e-4
    frozen_travel: Annotated[
        float,
        Quantity(
            "travel of the motor without a sign of life from the joint; at most 1.25 dead zones of an identified cable "
            "at twice its bend",
            "rad",
            ge=0.0,
            le=36000.0,
            follows=True,
        ),
    ] = 0.4
    measures_current: Annotated[bool, Quantity("whether the drive reports its current", key=None)] = True
    current_peak: Annotated[float, Quantity("largest current", "A", key=None)] = 20.0
    current_time: Annotated[float, Quantity("how long it may be exceeded", "s", ge=0.0, le=0.1, follows=True)] = 0.002
    saturation: Annotated[
        float, Quantity("share of the largest current at which the drive counts as saturated", ge=0.0, le=1.0)
    ] = 0.95
    saturation_time: Annotated[float, Quantity("how long it may be", "s", ge=0.0, le=1.0)] = 0.05
    i2t_time: Annotated[
        float, Quantity("how long the largest current may last from a start at rest", "s", ge=0.0, le=60.0)
    ] = 2.0
    thermal: Thermal = Thermal()
    winding_limit: Annotated[float, Quantity("largest temperature of the winding", "°C", ge=0.0, le=180.0)] = 125.0
    housing_limit: Annotated[
        float,
        Quantity(
            "largest temperature of the housing; 43 where it lies against skin (IEC 60601-1)",
            "°C",
            ge=0.0,
            le=85.0,
        ),
    ] = 48.0
    measures_temperature: Annotated[bool, Quantity("whether the drive reports its temperature")] = False
    drive_limit: Annotated[float, Quantity("largest temperature of the drive", "°C", ge=0.0, le=120.0)] = 80.0
    measures_tension: Annotated[bool, Quantity("whether the cable's tension is measured", key=None)] = False
    pull_gain: Annotated[
        float, Quantity("least tension per current that the gears pass on; 0 where it is not known", "N/A", key=None)
    ] = 0.0
    pull_doubt: Annotated[float, Quantity("tension that the gears' friction may take", "N", key=None)] = 0.0
    tension_high: Annotated[float, Quantity("largest tension of the cable", "N", ge=0.0, le=2000.0)] = 150.0
    tension_low: Annotated[float, Quantity("below it the cable is slack", "N", le=2000.0)] = 2.0
    measures_torque: Annotated[bool, Quantity("whether the joint's torque is measured", key=None)] = False
    torque_high: Annotated[
        float, Quantity("largest torque of the suit on the joint, either way, where measured", "N·m", ge=0.0, le=200.0)
    ] = 15.0
    slack_time: Annotated[
        float, Quantity("how long it may be slack, or motors on one joint apart", "s", ge=0.0, le=1.0)
    ] = 0.05
    reading_age: Annotated[
        float, Quantity("age of an angle that is still good", "cycles", ge=0.0, le=50.0, follows=True)
    ] = 2.0
    heartbeat_age: Annotated[
        float, Quantity("age of the drive's heartbeat that is still good", "s", ge=0.0, le=10.0, follows=True)
    ] = 0.05
    enable_time: Annotated[float, Quantity("from arming to the drive's operation enabled", "s", ge=0.0, le=10.0)] = 1.0
    disable_time: Annotated[
        float, Quantity("longest time with torque after the power was switched off", "s", ge=0.0, le=0.5, follows=True)
    ] = 0.05
    bus_errors: Annotated[
        float, Quantity("frames that could not be sent; one is forgiven each second", ge=0.0, le=100.0)
    ] = 2.5
    lateness: Annotated[
        float, Quantity("largest lateness of a cycle, and largest sum of the last ones", "s", ge=0.0, le=10.0)
    ] = 0.02
    clock_gap: Annotated[
        float, Quantity("longest time between two cycles that a late loop explains", "s", ge=0.0, le=10.0)
    ] = 0.5
    operator_age: Annotated[
        float,
        Quantity(
            "age of the operator's last sign of life; then R2",
            "s",
            ge=0.0,
            le=5.0,
        ),
    ] = 0.28
    console_lease: Annotated[
        float,
        Quantity(
            "age of the last sign of life of the console's page; then R2",
            "s",
            gt=0.0,
            le=2.0,
        ),
    ] = 0.5
    uses_emg: Annotated[bool, Quantity("whether EMG moves the reference", key=None)] = False
    emg_age: Annotated[
        float,
        Quantity(
            "age of the newest EMG sample that is still good",
            "s",
            ge=0.0,
            le=2.0,
        ),
    ] = 0.2
    preflight_time: Annotated[float, Quantity("from arming to running, at most", "s", ge=0.0, le=600.0)] = 60.0
    bridge_time: Annotated[float, Quantity("R1 at most, R2 or R3 afterwards", "s", ge=0.0, le=0.1, follows=True)] = (
        0.005
    )
    bridge_leak: Annotated[
        float, Quantity("share of good time by which bridged time is forgotten: worse readings stop", ge=0.0, le=1.0)
    ] = 0.02
    release_time: Annotated[
        float,
        Quantity(
            "of R2 with a slack cable; a taut one has also 1.3 times its way at `lowering`",
            "s",
            ge=0.0,
            le=0.2,
        ),
    ] = 0.2
    lowering: Annotated[
        float,
        Quantity(
            "largest speed of the joint in R2, by the cable's steepest slope; at most 40°/s on a worn suit",
            "rad/s",
            ge=15.0,
            le=90.0,
        ),
    ] = FASTEST_RELEASE
    force_release: Annotated[
        float, Quantity("the same where the cause of R2 is a force: a saturated drive", "rad/s", key=None)
    ] = FASTEST_RELEASE
    taut: Annotated[
        float, Quantity("motor angle at which the cable is just taut, the joint at its rest", "rad", key=None)
    ] = 0.0
    slack_sign: Annotated[
        float, Quantity("direction of the motor that lets the cable out: −1 or 1", ge=-1.0, le=1.0)
    ] = -1.0
    homed: Annotated[
        bool, Quantity("whether the cable is just taut at zero, and zero is not where the limb was found", key=None)
    ] = True
    released_current: Annotated[
        float,
        Quantity("largest current of a motor without power, and of one that holds a slack cable", "A", ge=0.0, le=10.0),
    ] = 0.3
    shared: Annotated[bool, Quantity("whether other motors pull at the same joint", key=None)] = False
    parting: Annotated[
        float, Quantity("largest distance of motors on one joint from where it asks each it to be", "rad", key=None)
    ] = 0.2
    parting_offset: Annotated[
        float, Quantity("motor less the other motor, with the joint at zero, by both cables", "rad", key=None)
    ] = 0.0
    parting_slope: Annotated[
        float, Quantity("motor less the other motor, over the joint, by both cables' slopes", "rad/rad", key=None)
    ] = 0.0
    parting_lag: Annotated[
        float, Quantity("growth of that distance with speed, of two servos that follow unlike", "s", key=None)
    ] = 0.0
    off_reference: Annotated[
        float,
        Quantity(
            "error beyond which the joint does not follow; left as it is, from the rig's own simulation",
            "rad",
            ge=0.0,
            le=180.0,
        ),
    ] = 0.5
    off_reference_time: Annotated[
        float, Quantity("how much longer it may be further off than nearer", "s", ge=0.0, le=10.0)
    ] = 1.0
    estimates_joint: Annotated[
        bool, Quantity("whether the joint's angle is an estimate, and no encoder's", key=None)
    ] = False
    joint_std: Annotated[
        float,
        Quantity("largest 1 σ of an estimated joint angle", "rad", ge=0.0, le=45.0),
    ] = 0.15
