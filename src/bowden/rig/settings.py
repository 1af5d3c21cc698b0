"""Sections of a rig that are not one part's own parameters: live loop and EMG."""

from typing import Annotated, Literal, NamedTuple

from bowden.core.guesses import answering_fields
from bowden.core.quantity import Quantity
from bowden.core.units import RADIANS
from bowden.sensing.course import CourseSettings
from bowden.sensing.wearer_file import MuscleCalibration

_COURSE = CourseSettings()


@answering_fields
class LiveSettings(NamedTuple):
    """The loop of `bowden run`: what it asks of the system, filters, and the way to where the run begins."""

    priority: Annotated[int, Quantity("of SCHED_FIFO; 0 for the ordinary scheduler", ge=0, le=99)] = 80
    cpu: Annotated[int | None, Quantity("processor to stay on", ge=0, example=1)] = None
    lock_memory: Annotated[bool, Quantity("keep all of its memory from being swapped out")] = True
    joint_cutoff: Annotated[
        float, Quantity("low-pass on the joint angle that the law sees; 0 for none", "rad/s", shown="Hz", ge=0.0)
    ] = 0.0
    motor_cutoff: Annotated[
        float, Quantity("low-pass on the motor angle that the law sees; 0 for none", "rad/s", shown="Hz", ge=0.0)
    ] = 0.0
    approach: Annotated[
        float,
        Quantity(
            "top speed of the motor on its way to where the run begins", "rad/s", gt=0.0, le=36000.0, follows=True
        ),
    ] = 20.0 * RADIANS


@answering_fields
class EmgSettings(NamedTuple):
    """EMG in place of [reference]: contractions move the joint between low and high."""

    source: Annotated[
        str | None,
        Quantity("lsl:NAME, trigno:HOST or file:PATH; left out, the run goes by [reference]", example="lsl:EMG"),
    ] = None
    wearer: Annotated[
        str | None,
        Quantity("file of bowden emg calibrate, found from this file; proportional needs it", example="wearer.toml"),
    ] = None
    flexor: Annotated[
        str | None, Quantity("channel of the muscle that flexes; the first one if left out", example="biceps")
    ] = None
    extensor: Annotated[
        str | None,
        Quantity("channel of the muscle that extends; left out, one muscle takes turns", example="triceps"),
    ] = None
    mode: Annotated[
        Literal["trigger", "proportional"],
        Quantity("trigger: a contraction begins a motion; proportional: the joint follows the envelope"),
    ] = "trigger"
    detector: Annotated[str, Quantity("what finds contractions in the signal")] = "onset"
    low: Annotated[float, Quantity("joint angle at rest", "rad", ge=-720.0, le=720.0)] = _COURSE.intent.low
    high: Annotated[float, Quantity("joint angle flexed", "rad", ge=-720.0, le=720.0)] = 70.0 * RADIANS
    duration: Annotated[float, Quantity("of a motion from one end to the other", "s", gt=0.0, le=60.0)] = (
        _COURSE.intent.duration
    )
    full: Annotated[
        float, Quantity("envelope of a full flexion, where proportional", shown="% MVC", gt=0.0, le=100.0)
    ] = _COURSE.full
    levels: MuscleCalibration | None = None
    """What the wearer's file says."""
    place: str = ""
    """The source as this machine finds it, with a recording's whole path."""
    recording: str = ""
    """SHA-256 of the recording that the source names."""
