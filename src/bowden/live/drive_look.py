"""A drive looked at without power: what it says of itself, cycle by cycle, and where its angles have their zero."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from bowden.core.clock import SECOND, TimeSource
from bowden.core.errors import DriveError
from bowden.core.quantity import declared
from bowden.core.signals import EMERGENCY_STOP, DriveReading, DriveState
from bowden.core.units import DEGREES
from bowden.hardware.ports import Drive, Power
from bowden.rig.declaration import in_file
from bowden.rig.families import family_of
from bowden.rig.rig import Rig

SHOWN: Mapping[str, tuple[str, float, str]] = {
    "motor": ("motor_deg", DEGREES, "°"),
    "joint": ("joint_deg", DEGREES, "°"),
    "current": ("current_a", 1.0, "A"),
    "tension": ("tension_n", 1.0, "N"),
    "joint_torque": ("joint_torque_nm", 1.0, "N·m"),
    "temperature": ("temperature_c", 1.0, "°C"),
}
"""Field of a reading → its name at the rim, what it is multiplied by for that, and its unit."""
AGES: Mapping[str, str] = {"motor": "motor_age", "joint": "joint_age"}
"""Angle of `SHOWN` → field of a reading with its age."""
SILENT = 0.1
"""An angle that is older does not come any more [s]."""
_WITH_TORQUE = frozenset({DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE})


@dataclass
class DriveLook:
    """Readings of a drive that was watched."""

    cycles: int = 0
    last: DriveReading | None = None
    least: dict[str, float] = field(default_factory=dict)
    """Field of `SHOWN` → smallest value that came; none of what never came."""
    most: dict[str, float] = field(default_factory=dict)
    """Likewise, largest."""
    oldest: dict[str, float] = field(default_factory=dict)
    """Angle that has come → largest age that it has had since then [cycles]."""
    states: list[str] = field(default_factory=list)
    """Names of the drive's states, in their order."""
    emergencies: list[float] = field(default_factory=list)
    """Codes that it sent, in their order."""

    def take(self, reading: DriveReading) -> None:
        """Take in what came in one cycle."""
        before = 0.0 if self.last is None else self.last.emergency
        self.cycles, self.last = self.cycles + 1, reading
        for name in SHOWN:
            value = getattr(reading, name)
            if math.isfinite(value):
                self.least[name] = min(value, self.least.get(name, value))
                self.most[name] = max(value, self.most.get(name, value))
        for name, field_ in AGES.items():
            age = getattr(reading, field_)
            if math.isfinite(age):
                self.oldest[name] = max(age, self.oldest.get(name, age))
        state = DriveState(int(reading.drive_state)).name
        if not self.states or self.states[-1] != state:
            self.states.append(state)
        if reading.emergency and reading.emergency != before:  # an input that stays open says so in each cycle
            self.emergencies.append(reading.emergency)

    def silent_now(self, period: float) -> dict[str, float]:
        """Angles that have come and do not come any more → for how long [s].

        Args:
            period: of a cycle [s].
        """
        ages = {name: period * getattr(self.last, AGES[name]) for name in self.oldest}
        return {name: age for name, age in ages.items() if age > SILENT}

    def explained(self, explain: Callable[[int], str]) -> list[str]:
        """Emergencies that the drive sent, in words."""
        return ["emergency stop" if code == EMERGENCY_STOP else explain(int(code)) for code in self.emergencies]


def looked_at(drive: Drive, clock: TimeSource, period: float, seconds: float = math.inf) -> Iterator[DriveLook]:
    """Cycles of a drive that is brought up and gets no power: after each what has been seen so far.

    Args:
        drive: brought up; every cycle it is sent power off.
        clock: to go by.
        period: of a cycle [s].
        seconds: how long.

    Raises:
        DriveError: the drive has torque although it is sent power off.
    """
    look, deadline = DriveLook(), clock.now()
    for _ in range(math.ceil(seconds / period)) if math.isfinite(seconds) else iter(int, 1):
        now = clock.now()
        reading = drive.read(now / SECOND)
        drive.write(0.0, Power.OFF, now / SECOND)
        look.take(reading)
        if reading.drive_state in _WITH_TORQUE:
            raise DriveError("the drive has torque although it was switched off", do="press the emergency stop")
        yield look
        deadline = max(deadline + round(period * SECOND), now)
        clock.sleep_until(deadline)


def require_zero(given: Any) -> Callable[[Any, DriveReading, float, float], Any]:
    """How the zero of a drive is found, `DriveFamily.zeroed`; to be asked before its bus is opened.

    Raises:
        DriveError: this family's zero is set with its maker's tool.
    """
    family = family_of(given)
    if family.zeroed is None:
        raise DriveError(
            f"the zero of a drive of the family {family.name} is not found by this command",
            do="set it with its maker's tool, or the home angles in [drive] by what bowden drive monitor shows",
        )
    return family.zeroed


class Tare(NamedTuple):
    """Which lines make what a load cell reads now a known load."""

    section: str
    """Of rig.toml."""
    keys: dict[str, float]
    """Key → value, in the file's unit."""
    read: float
    """Mean of what it read [N or N·m]."""
    span: float
    """Largest less smallest of it."""
    unit: str


def require_load_cell(rig: Rig) -> None:
    """Refuse a rig that measures no load; to be asked before its bus is opened.

    Raises:
        DriveError: it has no load cell.
    """
    limits = rig.supervisor_limits
    if not (limits.measures_tension or limits.measures_torque):
        raise DriveError("the rig has no load cell", expected="[load_cell], or a scale at the drive's input in [drive]")


def tare(rig: Rig, readings: Sequence[DriveReading], load: float) -> Tare:
    """The lines of a rig.toml with which what was read is this load.

    Args:
        rig: with a load cell.
        readings: of some cycles, with that load and nothing else on it.
        load: that is known [N or N·m].

    Raises:
        DriveError: the rig has no load cell, it says nothing, or its reading does not keep still.
    """
    require_load_cell(rig)
    limits, cell = rig.supervisor_limits, rig.load_cell
    torque = limits.measures_torque
    unit, most = ("N·m", limits.torque_high) if torque else ("N", limits.tension_high)
    values = [one.joint_torque if torque else one.tension for one in readings]
    values = [value for value in values if math.isfinite(value)]
    if len(values) < 0.5 * len(readings) or not values:
        raise DriveError("the load cell says nothing", do="check its plug, its supply, and its keys in rig.toml")
    read, span = sum(values) / len(values), max(values) - min(values)
    if span > STILL * most:
        raise DriveError(
            f"the load cell's reading changes by {span:.3g} {unit} while it is tared",
            expected=f"at most {STILL * most:.3g}",
            do="let the cable hang slack, keep still, and look for interference",
        )
    if cell.enabled:
        return Tare("load_cell", {"zero": cell.zero + (read - load) / cell.scale}, read, span, unit)
    family = family_of(rig.drive)
    assert family.tared is not None  # one that measures a load
    return Tare("drive", _changed(rig.drive, family.tared(rig.drive, read, load), rig.drive), read, span, unit)


STILL = 0.05
"""Of the largest load allowed: what a reading may change by while it is tared [–]."""


def zero_keys(given: Any, parameters: Any, reading: DriveReading, motor: float, joint: float) -> dict[str, float]:
    """The keys of [drive] with which what was read is at these angles, as they stand in rig.toml, in its units.

    Args:
        given: the drive's parameters as the rig has them, of a family that `require_zero` takes.
        parameters: the same with what the rig asks for.
        reading: what was read.
        motor: angle of the motor there [rad].
        joint: angle of the joint there [rad].

    Raises:
        DriveError: nothing was read.
    """
    return _changed(given, require_zero(given)(parameters, reading, motor, joint), parameters)


def _changed(given: Any, new: Any, old: Any) -> dict[str, float]:
    """The keys of [drive] whose values differ, in the file's units."""
    changed = [one for one in declared(type(given)) if getattr(new, one.name) != getattr(old, one.name)]
    return {one.quantity.named(one.name): in_file(getattr(new, one.name), one.quantity) for one in changed}
