"""Every fault that the supervisor knows: its reactions, how soon, what shows it, and what the operator does then.

A set of faults is a whole number in which fault number n has the bit 2ⁿ.
"""

from collections.abc import Iterable
from enum import IntEnum
from typing import NamedTuple

from bowden.core.kernel import kernel


class Reaction(IntEnum):
    """Reaction to a fault; the largest value is the most severe, and wins (docs/safety.md)."""

    NONE = 0
    R1 = 1
    """Bridge: hold the last valid target, for a few milliseconds at most."""
    R2 = 2
    """Release: let the joint down until the cable is just taut, then take the power off."""
    R3 = 3
    """Take the power off at once."""


WARNS, R1, R2, R3 = Reaction  # a warning asks for no reaction in a run


# fmt: off
class Fault(IntEnum):
    """A fault; its number is its bit. Reaction at once, and once R1 has lasted too long (`WARNS`: it keeps a run
    from beginning, and does nothing to one that has begun); time limit from its showing to R2 or R3 [s];
    meaning; detector; remedy.
    """

    at_once: Reaction
    then: Reaction
    within: float
    meaning: str
    detector: str
    remedy: str

    def __new__(
        cls, at_once: Reaction, then: Reaction, within: float, meaning: str, detector: str, remedy: str
    ) -> "Fault":
        """Number the rows in their order."""
        fault = int.__new__(cls, len(cls.__members__))
        fault._value_ = len(cls.__members__)
        fault.at_once, fault.then, fault.within = at_once, then, within
        fault.meaning, fault.detector, fault.remedy = meaning, detector, remedy
        return fault

    @property
    def latched(self) -> bool:
        """True if it holds the power off until an operator acknowledges: all but warnings, once R1 has ended."""
        return self.then > Reaction.NONE

    JOINT_LOST = (R1, R2, 0.008, "joint angle missing or impossible", "|joint| ≤ sensor_span does not hold",
                  "look at the joint encoder's plug, supply and zero")
    JOINT_JUMP = (R1, R2, 0.020, "joint angle jumps", "|change| > jump + joint_speed × time",
                  "look for a loose plug, interference, a slipping encoder or a wrong direction of the joint encoder")
    JOINT_STALE = (R1, R2, 0.020, "joint angle is late", "joint_age > reading_age",
                   "look at the bus load and at the drive's PDO settings")
    JOINT_FROZEN = (R2, R2, 0.008, "joint angle does not change",
                    "one count at most while the motor turns frozen_travel, or in strokes beyond the dead zone",
                    "look at the joint encoder, its coupling and the cable")
    JOINT_MOTOR_MISMATCH = (R2, R2, 0.008, "joint and motor disagree",
                            "joint outside slope_low…slope_high × motor ± play",
                            "look for a broken or slack cable and for wrong zeros or directions of the encoders")
    JOINT_OVER_TRAVEL = (R3, R3, 0.010, "joint beyond its range", "joint outside joint_low…joint_high",
                         "bring the limb back by hand; look at the reference and the joint's zero")
    JOINT_OVER_SPEED = (R3, R3, 0.020, "joint too fast", "filtered speed > joint_speed",
                        "look for a torn cable; slow the reference down")
    MOTOR_LOST = (R1, R3, 0.008, "motor angle missing or impossible", "|motor| ≤ sensor_span does not hold",
                  "look at the motor encoder's plug and supply; home again")
    MOTOR_JUMP = (R1, R3, 0.020, "motor angle jumps", "|change| > jump + motor_speed × time",
                  "look for a loose plug, interference or a wrong direction of the motor encoder")
    MOTOR_STALE = (R1, R3, 0.020, "motor angle is late", "motor_age > reading_age",
                   "look at the bus, its load and the drive's supply")
    NOT_FOLLOWING = (R3, R3, 0.020, "motor does not follow its model", "|motor − model| > tracking for 5 ms",
                     "look for a jam, a frozen motor encoder, a wrong servo model (`bowden identify-servo`)")
    MOTOR_OVER_TRAVEL = (R3, R3, 0.010, "motor beyond its range", "motor outside motor_low…motor_high ± motor_margin",
                         "let the cable out by hand and home again")
    MOTOR_OVER_SPEED = (R3, R3, 0.020, "motor too fast", "filtered speed > motor_speed",
                        "slow the reference down; look for a torn cable")
    CURRENT_LOST = (R1, R2, 0.008, "no motor current", "missing, or beyond twice its peak", "look at the drive's PDOs")
    OVER_CURRENT = (R3, R3, 0.010, "current beyond its peak", "|current| > current_peak for 2 ms",
                    "look for a short circuit; compare current_peak with the drive's own limit")
    SATURATED = (R2, R2, 0.060, "drive at its limit", "|current| > 95 % of its peak for 50 ms (then laws wind up)",
                 "take load from the cable; look for a jam")
    I2T = (R2, R2, 0.008, "peak current for too long", "∫(I² − Ic²) beyond i2t_time at the peak",
           "let the motor rest for a minute; take load away")
    MOTOR_HOT = (R2, R2, 0.008, "motor too warm", "thermal model beyond winding_limit or housing_limit",
                 "let the motor cool for some minutes; the model goes on over restarts")
    DRIVE_HOT = (R2, R2, 0.008, "drive too warm", "its temperature missing or > drive_limit, where measured",
                 "let the drive cool; look at its airflow")
    TENSION_LOST = (R1, R2, 0.008, "no tension", "missing or impossible, where measured",
                    "look at the load cell's plug")
    OVER_TENSION = (R3, R3, 0.004, "cable pulls too hard",
                    "tension > tension_high, measured, or, on a suit, the least by its current for 50 ms",
                    "first check for a caught limb or a jam")
    SLACK = (R2, R2, 0.060, "cable slack or torn", "tension < tension_low for 50 ms, where measured",
             "check the cable; tighten it again")
    HEARTBEAT_LOST = (R3, R3, 0.004, "drive silent", "its heartbeat older than heartbeat_age",
                      "look at the bus cable, its termination and the drive's supply")
    NOT_ENABLED = (R3, R3, 0.004, "drive does not enable", "not in operation enabled within enable_time of arming",
                   "look at the drive's enable input, STO and supply")
    DRIVE_DROPPED = (R3, R3, 0.004, "drive switched off or restarted by itself",
                     "its state, while it should be enabled",
                     "look at its enable input, STO, emergency stop and supply; home again after a restart")
    DRIVE_FAULT = (R3, R3, 0.004, "drive in fault", "its state is fault or fault reaction",
                   "read the error code, correct the cause, acknowledge")
    EMERGENCY = (R3, R3, 0.004, "emergency from the drive", "an emergency frame with an error code",
                 "read the text of the code, correct the cause, acknowledge")
    BUS_ERRORS = (R3, R3, 0.008, "bus fails", "more than two frames not sent within a second, or bus-off",
                  "look at the bus cable, both terminations and the bit rate")
    LATE = (R2, R2, 0.004, "loop too late", "lateness, or the sum of the last ones, > lateness",
            "run `bowden doctor`; close other programs")
    CLOCK = (R2, R2, 0.004, "clock stepped", "time between cycles not in 0…clock_gap, or a cycle too early",
             "run `bowden doctor`; was the computer asleep?")
    TARGET_LOST = (R1, R2, 0.008, "law's target missing or out of range",
                   "motor_low ≤ target ≤ motor_high does not hold",
                   "look at the reference, the gains, the law's state in the log")
    TARGET_STEP = (R1, R2, 0.008, "law's target jumps", "change in a cycle > target_speed",
                   "look at the reference and the gains; start where the joint is")
    TARGET_TOO_FAR = (R1, R2, 0.008, "law's target too far away", "|target − motor| > target_reach",
                      "look at the gains; does the law wind up?")
    TARGET_TOO_HARD = (R1, R2, 0.008, "law's target too hard", "servo's model would accelerate beyond acceleration",
                       "look at the gains; run `bowden check`")
    OPERATOR_LOST = (R2, R2, 0.004, "operator gone",
                     "no sign of life from the operator's process for operator_age; not a hung connection",
                     "come back to the terminal, acknowledge")
    PREFLIGHT_FAILED = (R2, R2, 0.004, "preflight failed, or armed for too long", "its outcome, or preflight_time",
                        "read its reason; arm again when you are ready to run")
    RECORDER_LOST = (WARNS, WARNS, 0.0, "nothing is recorded", "recorder dead, behind, disk full, or its file gone",
                     "make room on the disk, leave the log in its place, begin another run; a running loop goes on, no "
                     "new one is armed")
    EMG_LOST = (R2, R2, 0.004, "EMG lost",
                "newest sample older than emg_age, or a bad signal while the joint is not at rest",
                "no samples: look at the program that sends, its base station and network, and at this computer; "
                "a bad signal: look at the electrodes; then begin again")
    NOT_DISABLED = (R3, R3, 0.004, "drive keeps its torque",
                    "for disable_time after power off: its state has torque, |current| > released_current, or, where "
                    "that is not known, the motor pulls at 1 rad/s",
                    "press the emergency stop, and keep away; do not use this drive before it has been repaired "
                    "(after HEARTBEAT_LOST: the bus). If "
                    "its motor turns freely, released_current of [limits] is below what it reads without torque")
    SECOND_MASTER = (R3, R3, 0.004, "another master on the bus",
                     "a frame came that this host alone may send, or more readings of a drive than it was asked for",
                     "end the other program, take the other device off the bus, or look for two with one number")
    EMERGENCY_STOP = (R3, R3, 0.004, "emergency stop pressed", "its input, where the rig names one, or safe torque off",
                      "find out why it was pressed; release it, and acknowledge")
    CURRENT_STUCK = (R2, R2, 0.004, "motor current does not change",
                     "one count at most while the motor turns frozen_travel and 1 rad/s of its speed",
                     "look at 6077h of the drive and its PDO")
    RELEASE_PULLS = (R3, R3, 0.004, "release pulls",
                     "joint 20° to the slack side of where the cable is just taut, and 6° further since R2 began",
                     "change the sign of slack_sign in [limits], or the motor's direction")
    OTHER_RELEASED = (R2, R2, 0.004, "another motor is being released", "a fault of another motor asks for R2",
                     "look at the fault of the other motor; an acknowledgement is for all motors")
    OTHER_OFF = (R3, R3, 0.004, "another motor is off", "a fault of another motor asks for R3",
                "look at the fault of the other motor; an acknowledgement is for all motors")
    TORQUE_LOST = (R1, R2, 0.008, "no torque of the joint", "missing or impossible, where measured",
                   "look at the load cell's plug and supply")
    OVER_TORQUE = (R3, R3, 0.004, "too much torque on the joint", "|joint torque| > torque_high, where measured",
                   "first check for a caught limb or a jam")
    LOAD_STUCK = (R2, R2, 0.008, "load cell does not change",
                  "one count at most while the motor turns frozen_travel, less the cable's dead zone",
                  "look at the load cell, its amplifier and how it sends")
    MOTORS_APART = (R2, R2, 0.060, "motors on one joint go apart",
                    "½·|motor − the other's − parting_offset − parting_slope × joint| > parting + parting_lag × "
                    "speed for 50 ms, once both have been nearer",
                    "look for a law that drifts, other slopes of the cables than the rig says, a slipping spool; run "
                    "`bowden check`")
    JOINT_OFF_REFERENCE = (R2, R2, 0.004, "joint does not follow its reference",
                           "|joint − reference| > off_reference for off_reference_time longer than it is not",
                           "look for a held limb, a slipping spool, a cable beside its pulley, a law that gives up; "
                           "run `bowden check`")
    JOINT_UNSURE = (R2, R2, 0.004, "joint angle too uncertain", "1 σ > joint_std",
                    "look at the joint's sensor and at [joint_sensor], and for a torn cable")
# fmt: on


def bits_of(faults: Iterable[Fault]) -> int:
    """The set of these faults.

    >>> bits_of([Fault.JOINT_LOST, Fault.JOINT_STALE])
    5
    """
    return sum(1 << fault for fault in faults)


class Reactions(NamedTuple):
    """Which faults ask for which reaction."""

    r1: int
    r2: int
    r3: int


AT_ONCE = Reactions(*(bits_of(fault for fault in Fault if fault.at_once is reaction) for reaction in (R1, R2, R3)))
"""In the cycle in which a fault is found."""
EVENTUALLY = Reactions(*(bits_of(fault for fault in Fault if fault.then is reaction) for reaction in (R1, R2, R3)))
"""Once R1 has lasted too long."""
LATCHING = bits_of(fault for fault in Fault if fault.latched)
"""Faults that are latched once they have led to R2 or R3."""


@kernel
def worst_reaction(faults: int, asked: Reactions) -> Reaction:
    """The worst reaction that any of these faults asks for."""
    if (faults & asked.r3) != 0:
        return Reaction.R3
    if (faults & asked.r2) != 0:
        return Reaction.R2
    if (faults & asked.r1) != 0:
        return Reaction.R1
    return Reaction.NONE


OF_OTHERS = (Fault.OTHER_RELEASED, Fault.OTHER_OFF)
"""Faults of a motor that is stopped because of another motor."""


def of(bits: float) -> list[Fault]:
    """The faults of a set, worst reaction first."""
    return sorted((fault for fault in Fault if int(bits) >> fault & 1), key=lambda fault: -fault.then)


def shown_to_others(latched: int) -> Reaction:
    """Reaction that one motor reports to the supervisors of the others: the worst of those faults of its own that
    latched it.

    What merely follows from another motor is left out: two motors would hold each other.

    >>> shown_to_others(bits_of([Fault.SLACK])), shown_to_others(bits_of([Fault.SLACK, Fault.DRIVE_FAULT]))
    (<Reaction.R2: 2>, <Reaction.R3: 3>)
    >>> shown_to_others(bits_of([Fault.OTHER_OFF]))
    <Reaction.NONE: 0>
    """
    return worst_reaction(latched & ~bits_of(OF_OTHERS), EVENTUALLY)
