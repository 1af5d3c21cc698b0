"""What is exported of a rig: its law, the safety gate behind it, and the EMG detector before it, as modules of C."""

import inspect
import math
import re
from typing import Any, NamedTuple

from bowden.control.conditioning import Conditioned, Conditioning, condition_start, condition_step
from bowden.control.law import Law, law_start, law_step
from bowden.core.errors import ParameterError
from bowden.core.kernel import kernel
from bowden.core.signals import EMERGENCY_STOP, DriveState, Power, Reference, Sample
from bowden.cycle.one_cycle import Filters, filtered_sample
from bowden.export.kinds import identifier
from bowden.export.unit import Constant, Module, Public
from bowden.hardware.emg.listener import filters_of
from bowden.models.drive.thermal import cold
from bowden.models.minimum_jerk import minimum_jerk, minimum_jerk_from
from bowden.models.suit.suit_angle import SpoolMap, motor_of, spool_of
from bowden.rig import counts
from bowden.safety.evidence import validate_readings
from bowden.safety.faults import Fault
from bowden.safety.limits import Limits
from bowden.safety.state import Mode, Observed, Request, SupervisorState
from bowden.safety.supervisor import begin, supervise
from bowden.sensing.course import CourseSettings, course_start, course_step
from bowden.sensing.detector import Detector
from bowden.sensing.detectors import DEFAULT
from bowden.sensing.envelope import DEFAULTS, envelope_start, envelope_step, prepare_envelope
from bowden.sensing.joint_angle import JointModel, MotorReach, track_start, track_step
from bowden.sensing.wearer_file import MuscleCalibration

UNFILTERED = Filters()


class LawState(NamedTuple):
    """What is remembered from one cycle to the next."""

    law: Any
    """By the law."""
    conditioned: Conditioned
    """By the conditioner of its reference."""


@kernel
def begin_cycles(gains: Any, conditioning: Conditioning, sample: Sample) -> LawState:
    """The state in which a law begins at a sample."""
    return LawState(law_start(gains, sample), condition_start(conditioning, sample))


@kernel
def cycle(
    gains: Any, conditioning: Conditioning, state: LawState, sample: Sample, reference: Reference, sample_time: float
) -> tuple[LawState, float]:
    """One cycle: the conditioner makes of the reference what the law is shown, and the law makes its command."""
    conditioned, shown = condition_step(conditioning, state.conditioned, reference, sample_time)
    law, command = law_step(gains, state.law, sample, shown, sample_time)
    return LawState(law, conditioned), command


@kernel
def begun(begin: Any) -> Any:
    """The state that was worked out in Python."""
    return begin


@kernel
def sense(
    limits: Limits, filters: Filters, supervisor: SupervisorState, sample: Sample, observed: Observed, dt: float
) -> Sample:
    """What the law is given in a cycle, as `cycle.one_cycle` gives it."""
    return filtered_sample(filters, sample, validate_readings(limits, supervisor, observed, dt), observed.reading, dt)


def law_module(law: Law, sample_time: float, encoders: counts.Counts | SpoolMap | None = None) -> Module:
    """``NAME_start`` and ``NAME_step``, with the law's gains as constants, and the conditioner of its reference within.

    What `bowden.cycle.one_cycle` does between source and requested target is one function of C. The cycle's length is a
    constant like the gains, so that what they fix together is worked out by the compiler, and never in a cycle.
    ``NAME_minimum_jerk`` from rest and ``NAME_minimum_jerk_from`` a motion are references; ``NAME_motor_angle``,
    ``NAME_joint_angle`` and ``NAME_motor_counts``, on a suit ``NAME_spool_angle``, convert.

    Args:
        law: with its gains.
        sample_time: length of a cycle [s].
        encoders: how the rig's count, or on a suit how its spool turns; None for code without conversions.
    """
    given = {
        "gains": Constant(law.gains, "the law's gains"),
        "conditioning": Constant(law.conditioning, "what the conditioner knows of the rig"),
    }
    steps = given | {"state": state_of(law), "sample_time": Constant(float(sample_time), "length of a cycle [s]")}
    to_rest = "to rest at an end [rad]: the reference at a time since it began [s], of a duration [s]"
    begun = "The state in which a law begins at a sample."
    stepped = f"One cycle, to be called every {sample_time:g} s: the motor's target angle [rad]."
    to_rest = "to rest at an end [rad]: the reference at a time since it began [s], of a duration [s]"
    return Module(
        prefix(law),
        f"The control law {law.name!r}: {law.source}.",
        [
            Public("start", begin_cycles, ("state",), begun, given),
            Public("step", cycle, ("state", "return"), stepped, steps),
            Public("minimum_jerk", minimum_jerk, ("return",), f"The motion of minimum jerk from rest {to_rest}."),
            Public("minimum_jerk_from", minimum_jerk_from, ("return",), f"The same from a motion {to_rest}."),
            *([] if encoders is None else _conversions(encoders)),
        ],
        parts=(("law_start", law.start_kernel), ("law_step", law.step_kernel)),
        units=dict(law.state_units),
    )


def _conversions(encoders: counts.Counts | SpoolMap) -> list[Public]:
    if isinstance(encoders, SpoolMap):
        given = {"suit": Constant(encoders, "how the spool turns with the elbow")}
        angle_of = "The motor's angle in the joint's coordinate [rad] from the spool's [rad]."
        return [
            Public("motor_angle", motor_of, ("return",), angle_of, given),
            Public("spool_angle", spool_of, ("return",), "The other way round [rad].", given),
        ]
    given = {"counts": Constant(encoders, "how the rig's encoders count")}
    counted = "from counts of an encoder that counts as in its log"
    return [
        Public("motor_angle", counts.motor_angle, ("return",), f"The motor's angle [rad] {counted}.", given),
        Public("joint_angle", counts.joint_angle, ("return",), f"The joint's angle [rad] {counted}.", given),
        Public("motor_counts", counts.motor_counts, ("return",), "A target [rad] in counts.", given),
    ]


def state_of(law: Law) -> LawState:
    """What the code of a law remembers, as an example."""
    sample = Sample(0.0, 0.0)
    return LawState(law.start(sample), condition_start(law.conditioning, sample))


def prefix(law: Law) -> str:
    """What every name of the law's code begins with."""
    return re.sub(r"_+", "_", identifier(law.name)).lower()


def safety_module(limits: Limits, filters: Filters = UNFILTERED) -> Module:
    """The supervisor, with a rig's limits as constants, and the angles that it lets the law see."""
    bound = {"limits": Constant(limits, "the rig's limits")}
    seen = bound | {"filters": Constant(filters, "in front of the law")}
    thermal = {"thermal": Constant(limits.thermal, "the motor's thermal side")}
    stopped = "Stopped, with the motor as warm as the last run left it."
    sensed = "The sample of a law in this cycle: the last valid angles; before supervise, of its state."
    judged = "One cycle of dt [s]: the requested target [rad] or less, and whether there is power."
    return Module(
        "safety",
        "The supervisor: it stands last before the wire, and may only refuse or stop.",
        [
            Public("cold", cold, ("warmth",), "A motor as warm as its surroundings.", thermal),
            Public("begin", begin, ("state",), stopped, bound),
            Public("sense", sense, ("return",), sensed, seen),
            Public("supervise", supervise, ("state", "verdict"), judged, bound),
        ],
        enums=(Request, Mode, DriveState, Power, Fault),
        numbers={"emergency_stop": (EMERGENCY_STOP, "among the codes of `emergency`, for an emergency stop")},
    )


def joint_module(model: JointModel, reach: MotorReach, sample_time: float) -> Module:
    """The estimate of the joint's angle, where no encoder measures it.

    Args:
        model: of cable and sensor.
        reach: of the motor.
        sample_time: length of a cycle [s].
    """
    known = {"model": Constant(model, "of cable and sensor")}
    given = known | {"reach": Constant(reach, "what a motor's reading may be"), "dt": Constant(float(sample_time))}
    stepped = "One cycle, some time after the last one: the motor's angle, its age [cycles], the sensor's value or NAN."
    return Module(
        "joint",
        "The joint's angle from the motor's, corrected by a sensor.",
        [
            Public("start", track_start, ("state",), "Before the motor's first reading.", known),
            Public("step", track_step, ("state",), stepped, given | {"state": track_start(model)}),
        ],
    )


def course_module(settings: CourseSettings) -> Module:
    """The reference that follows from contractions."""
    moved = "One cycle of dt [s]: who contracts, the share of MVC or NAN, and where the joint should be."
    low, given = {"low": Constant(settings.intent.low)}, {"settings": Constant(settings)}
    return Module(
        "course",
        "Where the joint should be by contractions.",
        [
            Public("start", course_start, ("state",), "At rest, extended.", low),
            Public("step", course_step, ("state", "reference"), moved, given),
        ],
    )


def emg_modules(
    rate: float, kind: Detector = DEFAULT, wearer: MuscleCalibration | None = None
) -> tuple[Module, Module]:
    """The envelope of an EMG signal, and the detector of contractions in it.

    Args:
        rate: samples a second [Hz].
        kind: the detector.
        wearer: whom it is set to, as in a run; None for nobody.

    Raises:
        ParameterError: a rate that the detector does not take.
    """
    if not kind.safe <= rate <= kind.quickest:
        expected = f"from {kind.safe:g} to {kind.quickest:g} Hz"
        raise ParameterError(f"the EMG's rate is {rate:g} Hz", expected=expected, do="change --emg-rate")
    settings, smoothing = (kind.settings, DEFAULTS) if wearer is None else filters_of(wearer, kind)
    detector, first = kind.prepared(rate, settings), "Before the first sample."
    start = kind.start(detector, math.nan)
    detection, *_ = inspect.signature(kind.step).parameters
    chain = {"chain": Constant(prepare_envelope(rate, smoothing), "the filters' sections")}
    before = {"begin": Constant(start, "a state before the first sample")}
    given = {detection: Constant(detector, "the detector at this rate"), "state": start}
    smoothed = "One sample: its envelope, and the signal without offset and mains, in the signal's own unit."
    active = "One sample, NAN if missing: 1 in a contraction; trouble is 1 for flat, 2 for movement or mains."
    envelope = Module(
        "envelope",
        f"The envelope of an EMG signal of {rate:g} samples a second.",
        [
            Public("start", envelope_start, ("state",), first),
            Public("step", envelope_step, ("state", "signal", "return"), smoothed, chain),
        ],
    )
    onset = Module(
        identifier(kind.name),
        f"Contractions in an EMG signal of {rate:g} samples a second.",
        [
            Public("start", begun, ("state",), first, before),
            Public("step", kind.step, ("state", "return", "trouble"), active, given),
        ],
    )
    return envelope, onset
