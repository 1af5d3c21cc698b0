"""What stands round a law on the chip: the EMG detector before it, the safety gate behind it."""

import inspect
import math
from typing import Any

from bowden.core.errors import ParameterError
from bowden.core.kernel import kernel
from bowden.core.signals import EMERGENCY_STOP, DriveState, Sample
from bowden.cycle.one_cycle import Filters, filtered_sample
from bowden.export.kinds import identifier
from bowden.export.module import Constant, Module, Public
from bowden.hardware.emg.listener import filters_of
from bowden.hardware.ports import Power
from bowden.models.drive.thermal import cold
from bowden.safety.evidence import validate_readings
from bowden.safety.faults import Fault
from bowden.safety.limits import Limits
from bowden.safety.state import Mode, Observed, Request, SupervisorState
from bowden.safety.supervisor import begin, supervise
from bowden.sensing.course import CourseSettings, course_start, course_step
from bowden.sensing.detector import Detector
from bowden.sensing.detectors import DEFAULT
from bowden.sensing.envelope import DEFAULTS, envelope_start, envelope_step, prepare_envelope
from bowden.sensing.wearer_file import MuscleCalibration

UNFILTERED = Filters()


@kernel
def begun(begin: Any) -> Any:
    """The state that was worked out in Python."""
    return begin


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
        raise ParameterError(
            f"the EMG's rate is {rate:g} Hz",
            expected=f"from {kind.safe:g} to {kind.quickest:g} Hz",
            do="change --emg-rate",
        )
    settings, smoothing = (kind.settings, DEFAULTS) if wearer is None else filters_of(wearer, kind)
    detector = kind.prepared(rate, settings)
    chain = Constant(prepare_envelope(rate, smoothing), "the filters' sections")
    detection, *_ = inspect.signature(kind.step).parameters
    before = {"begin": Constant(kind.start(detector, math.nan), "a state before the first sample")}
    detected = {detection: Constant(detector, "the detector at this rate"), "state": before["begin"].value}
    smoothed = "One sample: its envelope, and the signal without offset and mains, in the signal's own unit."
    active = "One sample, NAN if missing: 1 in a contraction; trouble is 1 for flat, 2 for movement or mains."
    envelope = Module(
        "envelope",
        f"The envelope of an EMG signal of {rate:g} samples a second.",
        [
            Public("start", envelope_start, ("state",), "Before the first sample."),
            Public("step", envelope_step, ("state", "signal", "return"), smoothed, {"chain": chain}),
        ],
    )
    onset = Module(
        identifier(kind.name),
        f"Contractions in an EMG signal of {rate:g} samples a second.",
        [
            Public("start", begun, ("state",), "Before the first sample.", before),
            Public("step", kind.step, ("state", "return", "trouble"), active, detected),
        ],
    )
    return envelope, onset


@kernel
def sense(
    limits: Limits,
    filters: Filters,
    supervisor: SupervisorState,
    sample: Sample,
    observed: Observed,
    dt: float,
) -> Sample:
    """What the law is given in a cycle, as `cycle.one_cycle` gives it."""
    return filtered_sample(filters, sample, validate_readings(limits, supervisor, observed, dt), observed.reading, dt)


def course_module(settings: CourseSettings) -> Module:
    """The reference that follows from contractions."""
    low, given = {"low": Constant(settings.intent.low)}, {"settings": Constant(settings)}
    moved = "One cycle of dt [s]: who contracts, the share of MVC or NAN, and where the joint should be."
    return Module(
        "course",
        "Where the joint should be by contractions.",
        [
            Public("start", course_start, ("state",), "At rest, extended.", low),
            Public("step", course_step, ("state", "reference"), moved, given),
        ],
    )


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
