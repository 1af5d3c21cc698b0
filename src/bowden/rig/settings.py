"""Sections of a rig that are not one part's own: live loop, joint sensor and EMG, with what [emg] names."""

import hashlib
from pathlib import Path
from typing import Annotated, Literal, NamedTuple

from bowden.core.bounded import open_file
from bowden.core.guesses import answering_fields
from bowden.core.quantity import Quantity
from bowden.core.units import RADIANS
from bowden.sensing import wearer_file
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


class JointSensor(NamedTuple):
    """Where the joint's angle comes from (docs/drives.md)."""

    source: Annotated[
        Literal["encoder", "imu", "stretch", "motor"],
        Quantity("encoder: by [drive]; motor: the cable's model alone"),
    ] = "encoder"
    stream: Annotated[
        str | None,
        Quantity(
            "udp:PORT, udp:ADDRESS:PORT, serial:DEVICE@BAUD, can:CHANNEL@IDENTIFIER or lsl:NAME", example="udp:5005"
        ),
    ] = None
    gives: Annotated[
        Literal["angle", "quaternion", "inertial"],
        Quantity("imu: °; w, x, y, z; or rates [°/s] and accelerations [g]"),
    ] = "angle"
    bodies: Annotated[int, Quantity("imu: on how many", ge=1, le=2)] = 1
    axis: Annotated[
        tuple[float, ...], Quantity("imu: in the first body's frame, flexing positive", ge=-1.0, le=1.0)
    ] = (0.0, 0.0, 1.0)
    zero: Annotated[tuple[float, ...], Quantity("imu: w, x, y, z at the joint's zero", ge=-1.0, le=1.0)] = (
        *(1.0, 0.0, 0.0, 0.0),
    )
    curve_values: Annotated[tuple[float, ...], Quantity("stretch: readings", ge=-1e9, le=1e9)] = ()
    curve_angles: Annotated[tuple[float, ...], Quantity("stretch: their angles", "rad", ge=-360.0, le=360.0)] = ()
    period: Annotated[float, Quantity("between samples", "s", shown="ms", ge=1.0, le=100.0)] = 0.010
    delay: Annotated[float, Quantity("age of a sample that comes", "s", shown="ms", ge=0.0, le=100.0)] = 0.010
    noise: Annotated[float, Quantity("of a sample, 1 σ", "rad", ge=0.01, le=20.0)] = 2.0 * RADIANS
    offset: Annotated[float, Quantity("lasting error, 1 σ", "rad", ge=0.0, le=20.0)] = 0.0
    drift: Annotated[float, Quantity("imu: its speed", "rad/s", ge=0.0, le=10.0)] = RADIANS / 60.0
    cable_error: Annotated[float, Quantity("of the cable's model, 1 σ", "rad", ge=0.1, le=30.0)] = 4.0 * RADIANS

    @property
    def estimated(self) -> bool:
        """True if the joint's angle is an estimate."""
        return self.source != "encoder"

    @property
    def sensed(self) -> bool:
        """True if a sensor corrects it."""
        return self.source in ("imu", "stretch")


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


def found_emg(given: EmgSettings, folder: Path, source: str | None = None) -> EmgSettings:
    """The settings with what they name looked up: the wearer's levels, and a recording's place and identity.

    Args:
        given: the settings.
        folder: where their files are found from.
        source: in place of theirs; its file is found from here.

    Raises:
        ParameterError: a wearer's file that cannot be used.
    """
    named = given.source if source is None else source
    if given.wearer is not None and given.levels is None and (named or (folder / given.wearer).exists()):
        given = given._replace(levels=wearer_file.read(folder / given.wearer))
    if named is None:
        return given
    given = given._replace(source=named)
    kind, _, rest = named.partition(":")
    if kind != "file":
        return given._replace(place="", recording="")
    path = (Path() if source is not None else folder) / rest
    return given._replace(place=f"file:{path}", recording=identity(path))


def identity(path: Path) -> str:
    """SHA-256 of a file; empty where it cannot be read, which whoever opens it says better."""
    try:
        with open_file(path) as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except (OSError, ValueError):
        return ""
