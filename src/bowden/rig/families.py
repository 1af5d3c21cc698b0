"""What a family of drives offers a rig, and how one is found by its name: its module is loaded when a rig names it."""

import math
import pkgutil
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from bowden.core.errors import ParameterError, near
from bowden.core.registry import resolve
from bowden.core.signals import DriveReading
from bowden.models.suit.suit_angle import SpoolMap

_FOLDER = "hardware.drives.families"
"""Each family is a file of it that ends with its `FAMILY`; none is imported before a rig names it."""

DEFAULT = "cia402"
"""The family of a rig that names none."""

LONGEST_SILENCE = 50e-3
"""Time after our last word in which a drive's torque must be off, whatever has become of the loop [s]."""
LOST = 3.0
"""Cycles of silence, of drive or host, before which it is no fault: one frame may be lost, and the next one late."""


def longest_silence(sample_time: float) -> float:
    """`LONGEST_SILENCE`; of a loop so slow that `LOST` cycles, and 10 ms for the drive, take longer, these [s].

    >>> longest_silence(1e-3), round(longest_silence(20e-3), 3)
    (0.05, 0.07)
    """
    return max(LONGEST_SILENCE, LOST * sample_time + 10e-3)


class DriveNeeds(NamedTuple):
    """What a rig asks of its drive, whatever that is; in SI and radians at the spool and the joint."""

    gear: float = 5.0
    """Motor turns per spool turn [–]."""
    torque_constant: float = 16.7e-3
    """Torque per ampere at the motor's shaft [N·m/A]."""
    sample_time: float = 1e-3
    """One cycle [s]."""
    lowest_motor: float = -math.inf
    """Spool angle below which the rig never goes [rad]."""
    highest_motor: float = math.inf
    """Spool angle above which the rig never goes [rad]."""
    speed_limit: float = 0.0
    """Largest speed of the spool; 0 for no limit, as in the next two [rad/s]."""
    following_error: float = 0.0
    """Largest lag behind the target, at the spool [rad]."""
    current_limit: float = 0.0
    """Largest current [A]."""
    torque_offset: float = 0.0
    """Largest torque offset beside the target, at the spool; 0 where none is sent [N·m]."""
    spool: SpoolMap | None = None
    """Of a suit: motor angles are in the joint's coordinate, and the spool turns as this says."""
    heartbeat_age: float = math.inf
    """Age of the drive's sign of life from which the supervisor stops [s]."""
    lag_current: float = math.inf
    """Current that the rig's servo draws per lag behind its target, at rest; 0 where its current says nothing of that
    for a while, infinite where it is not known [A/rad]."""
    lag_time: float = 0.0
    """Lag behind its target, per speed, at which the rig's servo draws none: 2ζ/ω [s]."""


class TwinProcess(Protocol):
    """A drive that is played, in a process of its own."""

    path: Path
    """Socket at which `TwinControl` reaches it."""

    def run(self) -> None:
        """Be a drive until `stop`."""
        ...

    def stop(self) -> None:
        """Let `run` end; for signal handlers."""
        ...

    def attach(self, make: Any, place: Any = None) -> None:
        """Put a device beside the drive, with the same plant; see `hardware.twin.twin.Twin`."""
        ...

    def sense(self, sensor: Any, seed: int) -> None:
        """Put the twin of a joint's sensor that is no encoder beside the drive."""
        ...


class FoundDevice(NamedTuple):
    """Somebody who answers on a bus."""

    node: int
    """Its number there."""
    what: str
    """What kind of device it is."""
    identity: str
    """Who it is, in one line."""
    state: str
    """Of a drive, name of its `DriveState`; empty of others."""


@dataclass(frozen=True)
class DriveFamily:
    """A family of drives. `parameters` stands for any value of the NamedTuple of which the default is one."""

    name: str
    """``[drive] family``."""
    title: str
    """What it is, in a sentence."""
    parameters: Any
    """Default of its NamedTuple, whose declared fields are the keys of [drive]; ``family`` is one of them."""
    completed: Callable[[Any, DriveNeeds], Any]
    """``completed(parameters, needs)``: the parameters with what the rig asks for; raises a ParameterError for values
    that make no sense together, before anything is opened."""
    open: Callable[[Any, Any], Any]
    """``open(parameters, links)``: a `bowden.hardware.ports.Drive` on the buses of this process; nothing is sent before
    `bring_up`."""
    twin: Callable[[Any, Any, Callable[[], float], Sequence[str]], TwinProcess]
    """``twin(parameters, plant, clock, options)``: who plays the drive; the options are the command line's --object."""
    node: Callable[[], Any]
    """Class of the drive's twin on a bus that is there, see `hardware.twin.node.TwinNode`."""
    moved: Callable[[Any, str | None, str | None], Any]
    """``moved(parameters, channel, interface)``: the same drive on another bus, where one is given."""
    address: Callable[[Any], Mapping[str, str]]
    """Which drive it is: what distinguishes it from others on this computer."""
    control: Callable[[Any], Path]
    """Socket of its twin."""
    claim: Callable[[Any], Callable[[], None]]
    """Claim the host's part on the bus, and how to let go of it; raises a DriveError where another run has it."""
    watchdog: Callable[[Any], float]
    """``watchdog(parameters)``: time without a word of ours after which the drive takes its torque off by itself, or
    stops where it `holds`, with the time in which it looks [s]; infinite for one that would keep it, which no run is
    given but of a family that `holds`."""
    most_push: Callable[[Any, DriveNeeds], float]
    """``most_push(parameters, needs)``: largest torque offset that it takes, at the spool [N·m]."""
    measures_tension: Callable[[Any], bool]
    """True if it reports the cable's tension."""
    scales: Callable[[Any], Sequence[Any]]
    """``scales(parameters)``: what makes angles of its counts, for whoever has confirmed them by hand."""
    homed: Callable[[Any], bool]
    """True if its angles count from a place of the rig, and not from where motor and joint are found."""
    simulated: Callable[[Any], bool]
    """True if nobody but a twin can be at its bus, so that no motor and no limb is."""
    explain: Callable[[int], str]
    """What the code of an emergency means."""
    probe: Callable[[Any, Any], Sequence[FoundDevice]] | None = None
    """``probe(parameters, links)``: who answers on the bus, without power or a setting; None of a family whose devices
    say nothing of themselves."""
    zeroed: Callable[[Any, DriveReading, float, float], Any] | None = None
    """``zeroed(parameters, reading, motor, joint)``: the parameters with which what was read is at these angles of
    motor and joint [rad]; None of a family whose zero is set with its maker's tool alone."""
    zero_hint: str = ""
    """How the drive's own position is set, and what it loses with its supply; empty where neither applies."""
    measures_torque: Callable[[Any], bool] = lambda _: False
    """True if it reports the joint's torque."""
    load_range: Callable[[Any], float] = lambda _: math.inf
    """Largest tension [N] or torque [N·m] that its input can tell."""
    tared: Callable[[Any, float, float], Any] | None = None
    """``tared(parameters, read, load)``: the parameters with which what was `read` is this load [N or N·m]; None of a
    family without an input for a load cell."""
    measures_joint: Callable[[Any], bool] = lambda _: True
    """True if the joint's angle is measured at all; a rig without it is not run, since law and supervisor need it."""
    unseen_watch: Callable[[Any], str] = lambda _: ""
    """Why nobody knows that its torque goes when this computer dies, as nobody sees over the bus that its `watchdog`
    works, or as it has none; empty where bring-up tries it or reads it back. With a limb in the rig such a drive is
    refused, and without one the rig has to say so (`no_limb`)."""
    holds: bool = False
    """True if it keeps its torque without a host by its nature; `unseen_watch` says how."""
    cycle_time: Callable[[Sequence[Any]], float] | None = None
    """``cycle_time(drives)``: shortest cycle with these drives of the family on one bus [s]; None where it is not
    known."""
    integrates: bool = True
    """False if its position loop can have no integral."""
    no_limb: Callable[[Any], bool] = lambda _: False
    """True if the rig says that no limb can be in it."""
    brakes: Callable[[Any], bool] = lambda _: False
    """True if it has an output for a holding brake, and the rig says how that works."""
    brake_hint: str = "a drive with one, such as those of the family cia402"
    """What `brakes` wants."""
    example: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    """Section → key → value of a bench with such a drive that are others than usual, for ``bowden init --drive``."""
    found_from: Callable[[Any, Path], Any] = lambda parameters, _: parameters
    """``found_from(parameters, folder)``: the parameters with the files that they name found from there."""


_REGISTERED: dict[str, DriveFamily] = {}


def register(family: DriveFamily) -> DriveFamily:
    """Add a family that is not one of the package's files, before a rig that names it is read."""
    _REGISTERED[family.name] = family
    return family


def names() -> tuple[str, ...]:
    """The families that there are; none of them is imported for it."""
    found = (module.name for module in pkgutil.iter_modules(resolve(_FOLDER).__path__))
    return tuple(dict.fromkeys((DEFAULT, *found, *_REGISTERED)))


def family_named(name: str) -> DriveFamily:
    """The family of a name.

    Raises:
        ParameterError: there is none.
    """
    if name in _REGISTERED:
        return _REGISTERED[name]
    if name not in names():
        raise ParameterError(f"drive.family is {name!r}", expected=near(name, names()), do="correct it in rig.toml")
    family: DriveFamily = resolve(f"{_FOLDER}.{name}:FAMILY")
    return family


def family_of(parameters: Any) -> DriveFamily:
    """The family whose parameters these are."""
    return family_named(parameters.family)


def shortest_cycles(drives: Iterable[Any]) -> dict[str, tuple[int, float]]:
    """Of each bus whose time is known: how many drives are on it, and the shortest cycle that it carries with them [s].

    Args:
        drives: of a rig, with what the rig asks of them.
    """
    on: dict[tuple[str, str], list[Any]] = {}
    for drive in drives:
        if family_of(drive).cycle_time is not None:
            on.setdefault((drive.channel, drive.family), []).append(drive)
    times = {}
    for (channel, _), there in on.items():
        shortest = family_of(there[0]).cycle_time
        assert shortest is not None  # as was looked above
        times[channel] = len(there), shortest(there)
    return times
