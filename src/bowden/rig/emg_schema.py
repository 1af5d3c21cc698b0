"""The keys of rig.toml for a run by EMG: [emg]."""

from typing import Literal

from bowden.core.units import RADIANS
from bowden.hardware.emg.course import CourseSettings
from bowden.rig.section import Section, key

_COURSE = CourseSettings()


class EmgSection(Section):
    """EMG in place of [reference]: contractions move the joint between low and high."""

    source: str | None = key(
        None, "lsl:NAME, trigno:HOST or file:PATH; left out, the run goes by [reference]", examples=["lsl:EMG"]
    )
    wearer: str | None = key(
        None, "file of bowden emg calibrate, found from this file; proportional needs it", examples=["wearer.toml"]
    )
    flexor: str | None = key(None, "channel of the muscle that flexes; the first one if left out", examples=["biceps"])
    extensor: str | None = key(
        None, "channel of the muscle that extends; left out, one muscle takes turns", examples=["triceps"]
    )
    mode: Literal["trigger", "proportional"] = key(
        "trigger", "trigger: a contraction begins a motion; proportional: the joint follows the envelope"
    )
    low_deg: float = key(round(_COURSE.intent.low / RADIANS, 6), "joint angle at rest", "°", ge=-720.0, le=720.0)
    high_deg: float = key(round(_COURSE.intent.high / RADIANS, 6), "joint angle flexed", "°", ge=-720.0, le=720.0)
    duration_s: float = key(_COURSE.intent.duration, "of the whole motion", "s", gt=0.0, le=60.0)
    full_percent: float = key(
        round(100.0 * _COURSE.full, 2), "envelope of a full flexion, where proportional", "% MVC", gt=0.0, le=100.0
    )
