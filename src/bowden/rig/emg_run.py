"""What a run by EMG goes by: the stream, its channels, the wearer's levels and the motions, from [emg] and --emg."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bowden.core.errors import ParameterError, StreamError
from bowden.core.registry import resolve
from bowden.core.units import RADIANS
from bowden.rig.settings import EmgSettings, identity
from bowden.sensing.course import CourseSettings
from bowden.sensing.detector import Detector
from bowden.sensing.detectors import DEFAULT, detector_named
from bowden.sensing.intent import IntentSettings
from bowden.sensing.wearer_file import MuscleCalibration


@dataclass(frozen=True)
class EmgRun:
    """A run by EMG, all but its stream."""

    source: str
    flexor: str | None
    """Name of the channel; None for the first."""
    extensor: str | None
    wearer: MuscleCalibration | None
    where: str
    """The wearer's file."""
    course: CourseSettings
    recording: str = ""
    """SHA-256 of the recording that is the source."""
    detector: Detector = DEFAULT
    """Of contractions."""

    @property
    def wanted(self) -> tuple[str, ...]:
        """Channels that the stream must have."""
        return tuple(name for name in (self.flexor, self.extensor) if name is not None)

    def settings(self) -> dict[str, Any]:
        """What the log keeps of it."""
        levels = None if self.wearer is None else self.wearer._asdict()
        course = self.course._asdict() | {"intent": self.course.intent._asdict()}
        return {"source": self.source, "flexor": self.flexor, "extensor": self.extensor, "course": course} | {
            "wearer": levels,
            "wearer_file": self.where or None,
            "detector": self.detector.name,
        }


def emg_run(given: EmgSettings) -> EmgRun | None:
    """What a rig's EMG asks for; None where the run goes by the reference.

    Raises:
        ParameterError: settings that do not fit one another.
        StreamError: what names no source.
    """
    if given.source is None:
        return None
    resolve("hardware.emg.sources:open_source")(given.source)
    if not given.low < given.high:
        raise ParameterError(
            f"emg.low_deg is {given.low / RADIANS:g} and high_deg {given.high / RADIANS:g}",
            expected="low_deg below high_deg",
            do="correct them in rig.toml",
        )
    if given.extensor is not None and given.extensor == given.flexor:
        raise ParameterError(
            f"emg.flexor and emg.extensor are both {given.flexor!r}",
            expected="two channels, or no extensor",
            do="correct them in rig.toml",
        )
    if given.levels is None and given.mode == "proportional":
        raise ParameterError(
            "emg.mode is 'proportional', and there is no emg.wearer",
            expected="a file of a maximum contraction",
            do="measure one with bowden emg calibrate",
        )
    return EmgRun(
        given.place or given.source,
        given.flexor,
        given.extensor,
        given.levels,
        given.wearer or "",
        course_of(given),
        given.recording,
        detector_named(given.detector),
    )


def check_recording(run: EmgRun) -> None:
    """See that the recording is still the one that the rig was made with.

    Raises:
        StreamError: it has changed.
    """
    kind, _, path = run.source.partition(":")
    if kind == "file" and run.recording and (now := identity(Path(path))) and now != run.recording:
        raise StreamError(
            f"{path} has changed since the rig was read", expected="the recording that was checked", do="start again"
        )


def course_of(given: EmgSettings) -> CourseSettings:
    """How contractions move the reference."""
    intent = IntentSettings(given.low, given.high, given.duration, 1 if given.extensor is None else 2)
    return CourseSettings(intent, given.mode == "proportional", given.full)
