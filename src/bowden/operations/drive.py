"""`drive`: who is on a bus, what a drive says of itself, and where its zero is; the motor gets no power."""

import contextlib
import math
import sys
from collections.abc import Callable, Iterator
from dataclasses import KW_ONLY, dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from bowden.core.documented import Documented
from bowden.operations.confirm import say, say_torque
from bowden.operations.support.operation import GivenRig, Operation, Quiet
from bowden.operations.support.results import Result

if TYPE_CHECKING:
    from bowden.live.drive_look import DriveLook
    from bowden.rig.rig import Rig

_LISTENED = 1.1
"""So long a load cell is read [s]."""
_FAR = 0.1
"""Share of the largest load allowed beyond which a moved zero is reported [–]."""
_SETTLE = 0.1
"""So long the drive is read before its last reading is taken [s]."""
_SHOW = 0.1
"""Between two pictures on a terminal [s]."""


@dataclass(frozen=True)
class DeviceFound(Documented):
    """A device on the bus."""

    node: int
    what: str
    """What kind of device it is."""
    identity: str
    """Who it is."""
    state: str
    """State of a drive; empty for other devices."""


@dataclass(frozen=True)
class DriveProbe(Result["DriveProbe"]):
    """Who answers on a bus."""

    bus: dict[str, str]
    """Where was looked, and the node of the rig."""
    devices: tuple[DeviceFound, ...]
    """Who answers, by their numbers."""


@dataclass(frozen=True)
class ReadingRange(Documented):
    """What a reading went through."""

    least: float | None
    most: float | None
    last: float | None


@dataclass(frozen=True)
class DriveReadings(Documented):
    """Readings of a drive."""

    drive: str
    """Identity of the drive."""
    cycles: int
    """Number of readings."""
    readings: dict[str, ReadingRange]
    """Each by its name, with its unit: motor_deg at the spool, joint_deg, current_a, tension_n, joint_torque_nm and
    temperature_c; null where it is not measured."""
    states: tuple[str, ...]
    """The drive's states, in their order."""


@dataclass(frozen=True)
class DriveMonitor(DriveReadings, Result["DriveMonitor"]):
    """Readings and emergencies of a drive."""

    silent_s: dict[str, float | None]
    """Longest time without an angle, of motor and joint; null where none ever came."""
    emergencies: tuple[str, ...]
    """Emergencies that the drive sent, in words."""
    _: KW_ONLY
    look: "DriveLook | None"
    period: float = 0.0


@dataclass(frozen=True)
class DriveZero(DriveReadings, Result["DriveZero"]):
    """Where a drive's zero is."""

    keys: dict[str, float]
    """Key of [drive] → value that makes the present position these angles; none where it is so already."""


@dataclass(frozen=True)
class DriveTare(Result["DriveTare"]):
    """Where a load cell's zero is."""

    drive: str
    """Who the drive and the load cell are."""
    load: float
    """Load on the load cell, as given, in `unit`."""
    read: float
    """Mean of what it read with the rig's present zero, in `unit`."""
    span: float
    """Largest less smallest reading, in `unit`."""
    unit: str
    """Unit of the load: N of a tension, N·m of a torque."""
    section: str
    """Section of rig.toml: load_cell or drive."""
    keys: dict[str, float]
    """Key of that section → value that makes the reading this load; none where it is so already."""


def drive_probe(rig: GivenRig, *, motor: str | None = None, channel: str | None = None) -> DriveProbe:
    """List the devices on a rig's bus: it listens, then asks. Nothing is set, nothing gets power.

    Args:
        rig: the rig, with its [drive].
        motor: the motor, of a rig with several.
        channel: the bus, in place of the rig's.

    Raises:
        DriveError: nobody answers.

    Examples:
        bowden drive probe rig.toml
        bowden drive probe rig.toml --channel can1
    """
    from bowden.core.errors import DriveError
    from bowden.hardware.buses.link import Links
    from bowden.rig.families import family_of

    parameters = _given(rig, motor, channel).drive_parameters
    family = family_of(parameters)
    if family.probe is None:
        do = "bowden drive monitor asks the one that the rig names"
        raise DriveError(f"a drive of the family {family.name} says nothing of itself", do=do)
    found = family.probe(parameters, Links())
    bus = family.address(parameters)
    if not found:
        raise DriveError(
            f"nobody answers on the bus {bus.get('channel', '')} ({bus.get('interface', '')})",
            do="switch the drive on; check the cable, its termination at both ends, and the bit rate",
        )
    return DriveProbe(dict(bus), tuple(DeviceFound(**one._asdict()) for one in found))


def drive_monitor(
    rig: GivenRig,
    *,
    motor: str | None = None,
    channel: str | None = None,
    duration: float | None = None,
    quiet: Quiet = False,
) -> Iterator[DriveMonitor]:
    """Show a drive's readings live, without power, until Ctrl-C: angles, current, temperature, state, faults.

    The drive is brought up, as before a run, and gets no power: turn motor and joint by hand, and look.

    Args:
        rig: the rig, with its [drive].
        motor: the motor, of a rig with several.
        channel: the bus, in place of the rig's.
        duration: how long [s]; until Ctrl-C where none is given.

    Yields:
        What it has said, once it is over.

    Raises:
        DriveError: an angle has not come.
        ParameterError: no end is given where one is needed.

    Examples:
        bowden drive monitor rig.toml
        bowden drive monitor rig.toml --duration 10 --json
    """
    from bowden.core.errors import DriveError, ParameterError
    from bowden.live.drive_look import AGES
    from bowden.operations.support.given import check_number
    from bowden.rig.families import family_of

    if duration is not None:
        check_number("duration", duration, 0.01, 1e6)
    if duration is None and quiet:
        raise ParameterError("--json needs an end", do="add --duration 10")
    whole = _given(rig, motor, channel)
    look: DriveLook | None = None
    with _brought_up(whole) as (identity, looked), contextlib.suppress(KeyboardInterrupt):
        for look in looked(math.inf if duration is None else duration):
            _show(look, whole)
    if look is None:
        return
    period = whole.sample_time
    silent = {name: round(period * look.oldest[name], 4) if name in look.oldest else None for name in AGES}
    told = look.explained(family_of(whole.drive).explain)
    yield DriveMonitor(
        **_readings(look, identity),
        silent_s=silent,
        emergencies=tuple(told),
        look=look,
        period=period,
    )
    if lost := look.silent_now(period):
        raise DriveError(
            f"the angle of the {' and the '.join(lost)} has not come for {max(lost.values()):.1f} s",
            do="look at the plugs of bus and encoder, at both terminations, and at the drive's supply",
        )


def drive_zero(
    rig: GivenRig,
    *,
    motor_deg: float = 0.0,
    joint_deg: float = 0.0,
    motor: str | None = None,
    channel: str | None = None,
) -> DriveZero:
    """Print the lines of rig.toml that make the present position zero, or other angles; the motor gets no power.

    Put the joint where its angle is known, with the cable just taut, and call this. Nothing is written.

    Args:
        rig: the rig, with its [drive].
        motor_deg: angle of the motor, at its spool, where it is now [°].
        joint_deg: angle of the joint where it is now [°].
        motor: the motor, of a rig with several.
        channel: the bus, in place of the rig's.

    Raises:
        DriveError: a bus or drive that cannot be used.
        ParameterError: angles that cannot be.

    Examples:
        bowden drive zero rig.toml
        bowden drive zero rig.toml --joint-deg 90
    """
    from bowden.core.units import RADIANS
    from bowden.live.drive_look import require_zero, zero_keys
    from bowden.operations.support.given import check_number
    from bowden.rig.families import family_of

    for name, angle in (("motor_deg", motor_deg), ("joint_deg", joint_deg)):
        check_number(name, angle, -1e6, 1e6)
    whole = _given(rig, motor, channel)
    require_zero(whole.drive)
    with _brought_up(whole) as (identity, looked):
        *_, look = looked(_SETTLE)
    assert look.last is not None
    keys = zero_keys(whole.drive, whole.drive_parameters, look.last, motor_deg * RADIANS, joint_deg * RADIANS)
    if hint := family_of(whole.drive).zero_hint:
        say(hint)
    return DriveZero(**_readings(look, identity), keys={name: round(value, 4) for name, value in keys.items()})


def drive_tare(rig: GivenRig, *, load: float = 0.0, motor: str | None = None, channel: str | None = None) -> DriveTare:
    """Print the line of rig.toml that zeroes the load cell, or makes it read a known load; the motor gets no power.

    Let the cable hang slack, or hang a known weight on it, and call this. Nothing is written.

    Args:
        rig: the rig, with its [drive].
        load: what hangs on the load cell now [N or N·m].
        motor: the motor, of a rig with several.
        channel: the bus, in place of the rig's.

    Raises:
        DriveError: a bus or drive that cannot be used.
        ParameterError: a load that cannot be, or a rig without a load cell.

    Examples:
        bowden drive tare rig.toml
        bowden drive tare rig.toml --load 20
    """
    from bowden.live.drive_look import require_load_cell, tare
    from bowden.operations.support.given import check_number

    check_number("load", load, -1e6, 1e6)
    whole = _given(rig, motor, channel)
    require_load_cell(whole)
    with _brought_up(whole) as (identity, looked):
        readings = [
            look.last
            for look in looked(_LISTENED)
            if look.last is not None and look.cycles * whole.sample_time > _SETTLE
        ]
    found = tare(whole, readings, load)
    limits = whole.supervisor_limits
    most = limits.torque_high if limits.measures_torque else limits.tension_high
    off = f"{found.read - load:+.3g} {found.unit}"
    far = f"the zero moves by {off}: is nothing but that load on the cell, and is its scale right?"
    return DriveTare(
        identity,
        load,
        found.read,
        found.span,
        found.unit,
        found.section,
        {name: round(value, 4) for name, value in found.keys.items()},
        notes=(far,) if abs(found.read - load) > _FAR * most else (),
    )


def _given(rig: Any, motor: str | None, channel: str | None) -> "Rig":
    from bowden.operations.support.given import rig_of

    return rig_of(rig).only(motor).on_bus(channel)


@contextlib.contextmanager
def _brought_up(given: "Rig") -> Iterator[tuple[str, Callable[[float], Iterator["DriveLook"]]]]:
    """Who the rig's drive is, which gets no power, and looks at it for a time [s]; let go of at the end, and its torque
    is printed.
    """
    from bowden.core.clock import MonotonicClock
    from bowden.hardware.buses.link import Links
    from bowden.hardware.drives.of_rig import open_drive
    from bowden.live.drive_look import looked_at

    drive = open_drive(given.drive_parameters, given.load_cell, Links())
    try:
        say(identity := drive.bring_up())
        yield identity, partial(looked_at, drive, MonotonicClock(), given.sample_time)
    finally:
        say_torque(drive.close(), say)


def _show(look: "DriveLook", given: "Rig") -> None:
    """One line on a terminal, ten times a second."""
    from bowden.core.signals import EMERGENCY_STOP

    if look.cycles % max(1, round(_SHOW / given.sample_time)) or not sys.stderr.isatty():
        return
    assert look.last is not None
    silent = look.silent_now(given.sample_time)
    parts = [f"{name} {value} {unit}" for name, value, unit in values_of(look) if name not in silent]
    parts += [f"{name} SILENT FOR {age:.1f} s" for name, age in silent.items()]
    parts += ["EMERGENCY STOP"] if look.last.emergency == EMERGENCY_STOP else []
    line = f"{look.states[-1].lower().replace('_', ' ')}: {', '.join(parts)}"
    print(f"\r\x1b[K{line}", end="", file=sys.stderr, flush=True)


def values_of(look: "DriveLook") -> Iterator[tuple[str, str, str]]:
    """What was read last: name, value and unit of each."""
    from bowden.live.drive_look import SHOWN

    for name, (_, factor, unit) in SHOWN.items():
        value = getattr(look.last, name)
        if math.isfinite(value):
            yield name, f"{factor * value:.2f}", unit


def _readings(look: "DriveLook", identity: str) -> dict[str, Any]:
    """The fields of `DriveReadings`."""
    from bowden.live.drive_look import SHOWN

    ranges = {}
    for name, (shown, factor, _) in SHOWN.items():
        last = getattr(look.last, name)
        least, most = (round(factor * found[name], 4) if name in found else None for found in (look.least, look.most))
        ranges[shown] = ReadingRange(least, most, round(factor * last, 4) if math.isfinite(last) else None)
    return {"drive": identity, "cycles": look.cycles, "readings": ranges, "states": tuple(look.states)}


GROUP = "Find drives on a bus, look at one, and set its zero; without power."
OPERATIONS = (
    Operation("drive probe", drive_probe, 43),
    Operation("drive monitor", drive_monitor, 43),
    Operation("drive zero", drive_zero, 43),
    Operation("drive tare", drive_tare, 43),
)
