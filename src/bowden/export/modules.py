"""What is exported of a rig: its law, the safety gate behind it, and the EMG detector before it, as modules of C."""

import inspect
import math
import re
from collections.abc import Callable
from typing import Any, NamedTuple

from bowden.control.conditioning import Conditioned, Conditioning, condition_start, condition_step
from bowden.control.law import Law, law_start, law_step
from bowden.core.errors import ParameterError
from bowden.core.kernel import kernel
from bowden.core.signals import DriveState, Power, Reference, Sample
from bowden.cycle.one_cycle import Filters, filtered_sample
from bowden.export.unit import Module, identifier
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
    """One cycle, to be called once in every sample time: the motor's target angle [rad].

    The conditioner makes of the reference what the law is shown, and the law makes its command.
    """
    conditioned, shown = condition_step(conditioning, state.conditioned, reference, sample_time)
    law, command = law_step(gains, state.law, sample, shown, sample_time)
    return LawState(law, conditioned), command


@kernel
def begun(begin: Any) -> Any:
    """The state before the first sample."""
    return begin


@kernel
def sense(
    limits: Limits, filters: Filters, supervisor: SupervisorState, sample: Sample, observed: Observed, dt: float
) -> Sample:
    """The sample of a law in this cycle: the last valid angles; before `supervise`, of its state."""
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
    conversions: dict[str, Callable[..., Any]] = {"motor_angle": motor_of, "spool_angle": spool_of}
    converted = {"suit": (encoders, "how the spool turns with the elbow")}
    if isinstance(encoders, counts.Counts):
        conversions = {one.__name__: one for one in (counts.motor_angle, counts.joint_angle, counts.motor_counts)}
        converted = {"counts": (encoders, "how the rig's encoders count")}
    sample = Sample(0.0, 0.0)
    constants = {
        "gains": (law.gains, "the law's gains"),
        "conditioning": (law.conditioning, "what the conditioner knows of the rig"),
        "sample_time": (float(sample_time), "length of a cycle [s]"),
    }
    return Module(
        re.sub(r"_+", "_", identifier(law.name)).lower(),
        f"The control law {law.name!r}: {law.source}.",
        {
            "start": (begin_cycles, "state"),
            "step": (cycle, "state return"),
            "minimum_jerk": (minimum_jerk, "return"),
            "minimum_jerk_from": (minimum_jerk_from, "return"),
            **{name: (one, "return") for name, one in conversions.items() if encoders is not None},
        },
        constants | converted,
        state=LawState(law.start(sample), condition_start(law.conditioning, sample)),
        parts=(("law_start", law.start_kernel), ("law_step", law.step_kernel)),
        units=law.state_units,
    )


def safety_module(limits: Limits, filters: Filters = UNFILTERED) -> Module:
    """The supervisor, with a rig's limits as constants, and the angles that it lets the law see."""
    return Module(
        "safety",
        "The supervisor: it stands last before the wire, and may only refuse or stop.",
        {
            "cold": (cold, "warmth"),
            "begin": (begin, "state"),
            "sense": (sense, "return"),
            "supervise": (supervise, "state verdict"),
        },
        {
            "limits": (limits, "the rig's limits"),
            "filters": (filters, "in front of the law"),
            "thermal": (limits.thermal, "the motor's thermal side"),
        },
        enums=(Request, Mode, DriveState, Power, Fault),
    )


def joint_module(model: JointModel, reach: MotorReach, sample_time: float) -> Module:
    """The estimate of the joint's angle, where no encoder measures it.

    Args:
        model: of cable and sensor.
        reach: of the motor.
        sample_time: length of a cycle [s].
    """
    return Module(
        "joint",
        "The joint's angle from the motor's, corrected by a sensor.",
        {"start": (track_start, "state"), "step": (track_step, "state")},
        {
            "model": (model, "of cable and sensor"),
            "reach": (reach, "what a motor's reading may be"),
            "dt": (float(sample_time), "length of a cycle [s]"),
        },
        state=track_start(model),
    )


def course_module(settings: CourseSettings) -> Module:
    """The reference that follows from contractions."""
    return Module(
        "course",
        "Where the joint should be by contractions.",
        {"start": (course_start, "state"), "step": (course_step, "state reference")},
        {"low": (settings.intent.low, ""), "settings": (settings, "")},
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
    detector = kind.prepared(rate, settings)
    start = kind.start(detector, math.nan)
    detection, *_ = inspect.signature(kind.step).parameters
    envelope = Module(
        "envelope",
        f"The envelope of an EMG signal of {rate:g} samples a second.",
        {"start": (envelope_start, "state"), "step": (envelope_step, "state signal return")},
        {"chain": (prepare_envelope(rate, smoothing), "the filters' sections")},
    )
    onset = Module(
        identifier(kind.name),
        f"Contractions in an EMG signal of {rate:g} samples a second.",
        {"start": (begun, "state"), "step": (kind.step, "state return trouble")},
        {"begin": (start, "a state before the first sample"), detection: (detector, "the detector at this rate")},
        state=start,
    )
    return envelope, onset
