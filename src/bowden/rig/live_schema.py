"""The keys of rig.toml that only the live loop needs: [drive], [limits] and [live]."""

import inspect
import re
from typing import Any, Literal

from pydantic import create_model

from bowden.core.units import RADIANS
from bowden.hardware.drives.parameters import DriveParameters
from bowden.hardware.realtime import Settings
from bowden.models.drive.thermal import Thermal
from bowden.rig.section import Section, key
from bowden.safety.limits import Limits

_DRIVE, _SETTINGS = DriveParameters(), Settings()


def _milliseconds(seconds: float, meaning: str, **rules: Any) -> Any:
    return key(round(1e3 * seconds, 6), meaning, "ms", gt=0.0, **rules)


class DriveSection(Section):
    """The CiA 402 drive on its CANopen bus; `bowden twin` plays it."""

    interface: str = key(_DRIVE.interface, "python-can's name of the bus: bowden_unix for the twin, socketcan on a rig")
    channel: str = key(_DRIVE.channel, "its channel: can0; of bowden_unix a folder, or a bare name")
    bitrate: int = key(_DRIVE.bitrate, "of the bus; SocketCAN takes its interface's own", "bit/s", gt=0)
    node_id: int = key(_DRIVE.node_id, "the drive's number on the bus", ge=1, le=126)
    host_id: int = key(_DRIVE.host_id, "ours, under which our heartbeat goes out", ge=1, le=127)
    motor_counts_per_turn: float = key(
        _DRIVE.motor_counts_per_turn, "of the motor's encoder, at the motor's shaft", gt=0.0, lt=1e9
    )
    motor_direction: Literal[1, -1] = key(1, "1 where the motor's counts rise as the spool pulls, otherwise -1")
    joint_counts_per_turn: float = key(_DRIVE.joint_counts_per_turn, "of the joint's encoder", gt=0.0, lt=1e9)
    joint_direction: Literal[1, -1] = key(1, "1 where the joint's counts rise with its angle, otherwise -1")
    home: Literal["counts", "here"] = key(
        "counts", "home is where the counts are zero, or where motor and joint are found when a command begins"
    )
    motor_home_deg: float = key(0.0, "angle of the spool at home", "°", ge=-720.0, le=720.0)
    joint_home_deg: float = key(0.0, "angle of the joint at home", "°", ge=-720.0, le=720.0)
    tension_n_per_mv: float = key(0.0, "cable tension per millivolt at the drive's analog input; 0 for none", "N/mV")
    tension_zero_mv: float = key(0.0, "voltage of that input without tension", "mV")
    heartbeat_ms: float = _milliseconds(_DRIVE.heartbeat_time, "between two heartbeats of ours", le=13.0)
    heartbeat_timeout_ms: float = _milliseconds(
        _DRIVE.heartbeat_timeout, "without our heartbeat the drive takes its torque off after this", le=40.0
    )
    drive_heartbeat_ms: float = _milliseconds(_DRIVE.drive_heartbeat_time, "between the drive's heartbeats", le=1000.0)
    answer_timeout_ms: float = _milliseconds(_DRIVE.answer_timeout, "longest wait for an answer at bring-up", le=1e4)


class LiveSection(Section):
    """The loop of `bowden run`: what it asks of the system, filters, and the way to where the run begins."""

    priority: int = key(_SETTINGS.priority, "of SCHED_FIFO; 0 for the ordinary scheduler", ge=0, le=99)
    cpu: int | None = key(None, "processor to stay on", examples=[1], ge=0)
    lock_memory: bool = key(_SETTINGS.lock_memory, "keep all of its memory from being swapped out")
    joint_cutoff_hz: float = key(0.0, "low-pass on the joint angle that the law sees; 0 for none", "Hz", ge=0.0)
    motor_cutoff_hz: float = key(0.0, "low-pass on the motor angle that the law sees; 0 for none", "Hz", ge=0.0)
    approach_deg_per_s: float = key(
        20.0, "top speed of the motor on its way to where the run begins", "°/s", gt=0.0, le=360.0
    )


_SUFFIX: dict[str, tuple[str, float, str]] = {
    "rad": ("_deg", RADIANS, "°"),
    "rad/s": ("_deg_per_s", RADIANS, "°/s"),
    "rad/s²": ("_deg_per_s2", RADIANS, "°/s²"),
    "s": ("_s", 1.0, "s"),
    "A": ("_a", 1.0, "A"),
    "N": ("_n", 1.0, "N"),
    "°C": ("_c", 1.0, "°C"),
    "K/W": ("_k_per_w", 1.0, "K/W"),
    "J/K": ("_j_per_k", 1.0, "J/K"),
}
"""Unit inside → ending of the key, what one of the key's unit is inside, and the key's unit."""

_ELSEWHERE = {
    "servo_frequency",
    "servo_damping",
    "current_peak",
    "thermal",
    "measures_current",
    "measures_tension",
    "uses_emg",
}
"""Limits that follow from other sections."""


def _keys_of(kind: type[Limits] | type[Thermal], prefix: str) -> dict[str, tuple[str, float, Any]]:
    """Key of rig.toml → field, factor to SI, and its `Field`; meaning and unit are what the source says beside it."""
    found = {}
    source = inspect.getsource(kind)
    for name, default in kind._field_defaults.items():
        if name in _ELSEWHERE or (kind is Thermal and name == "resistance"):
            continue
        text = re.search(
            rf'^    {name}: float = \S+(?:  # ([^\n]*)|\n    """(.*?)""")', source, re.MULTILINE | re.DOTALL
        )
        said = " ".join(((text[1] or text[2]) if text else "").split())
        unit = re.search(r"\[([^\]]+)\]", said)
        suffix, factor, shown = _SUFFIX.get(unit[1] if unit else "", ("", 1.0, "–"))
        meaning = re.sub(r"\s*\[[^\]]+\]", "", said).strip(" ;.")
        meaning = meaning if len(meaning) > 4 else name.replace("_", " ")
        rules: dict[str, Any] = {} if default < 0.0 or name.endswith("_low") else {"ge": 0.0}
        value = float(f"{default / factor:.4g}")
        found[f"{prefix}{name}{suffix}"] = (name, factor, key(value, meaning, shown, **rules))
    return found


_LIMITS, _THERMAL = _keys_of(Limits, ""), _keys_of(Thermal, "thermal_")
LimitsSection: type[Section] = create_model(  # type: ignore[call-overload]  # its fields come from `Limits`
    "LimitsSection",
    __base__=Section,
    __doc__="What the supervisor allows, and the motor's thermal model; see docs/safety.md.",
    **{name: (float, field) for name, (_, _, field) in (_LIMITS | _THERMAL).items()},
)


def limits_of(section: Section) -> Limits:
    """The supervisor's limits that a [limits] section names, in SI; those that follow from elsewhere as they are."""
    given = section.model_dump()
    thermal = {field: given[name] * factor for name, (field, factor, _) in _THERMAL.items()}
    limits = {field: given[name] * factor for name, (field, factor, _) in _LIMITS.items()}
    return Limits(**limits, thermal=Thermal(**thermal))
