"""What families of drives on a CAN bus have in common, whatever they speak: keys, rules, buses, and their declaration.

Their parameters have the fields `interface`, `channel`, `bitrate` and `node_id`, on CAN-FD `data_bitrate` too; `needs`,
what the rig asks for; and two methods, `rules` for `require`, and `identifiers` for `collision`.
"""

import importlib
import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, get_args, get_origin

from bowden.core.errors import DriveError, ParameterError
from bowden.core.quantity import Quantity, declared
from bowden.core.signals import DriveReading
from bowden.core.units import RADIANS
from bowden.hardware.buses.place import BusPlace
from bowden.models.suit.suit_angle import motor_of, spool_of
from bowden.rig.families import LOST, DriveFamily, DriveNeeds, TwinProcess

BusInterface = Annotated[
    str, Quantity("bowden_unix for the twin; on a rig socketcan, or serial for serial servos; others are untried")
]
BusChannel = Annotated[str, Quantity("can0, or /dev/ttyUSB0; of bowden_unix a folder, or a bare name")]
"""A bare name is a folder in the user's temporary one."""
BusBitrate = Annotated[int, Quantity("of the bus; SocketCAN takes its interface's own", "bit/s", gt=0)]
AnswerTimeout = Annotated[float, Quantity("longest wait for an answer at bring-up", "s", shown="ms", gt=0.0, le=1e4)]
MotorDirection = Annotated[
    Literal[1, -1], Quantity("1 where the drive's position rises as the spool pulls, otherwise -1")
]
Home = Annotated[
    Literal["counts", "here"],
    Quantity("counts: home is where positions are zero; here: where motor and joint are found at the start"),
]
HintedHome = Annotated[
    Literal["counts", "here", "hint"],
    Quantity(
        "counts: home is where positions are zero; here: where they are found at the start; hint: the zero nearest to "
        "motor_hint_deg"
    ),
]
MotorHome = Annotated[float, Quantity("angle of the spool at home", "rad", ge=-720.0, le=720.0)]
MotorHint = Annotated[
    float,
    Quantity(
        "where the spool is when a command begins, within half a turn of the rotor",
        "rad",
        ge=-720.0,
        le=720.0,
    ),
]

NoLimb = Annotated[
    bool,
    Quantity(
        "true where no limb can be in the rig; a drive that may keep its torque without us is powered on no other"
    ),
]

MOST_PUSH = 0.5
"""Largest torque offset, as a share of what the largest current gives: the drive's position loop must be able to beat
it."""
LONGEST_WATCHDOG = 39e-3
"""So that the torque is off 40 ms after our last word; of a slow loop, `family.LOST` cycles [s]."""
_ELSEWHERE = {
    "sample_time": Quantity("", "s", shown="ms", key="bench.sample_time_ms"),
    "gear": Quantity("", key="motor.gear"),
    "torque_constant": Quantity("", "N·m/A", key="motor.torque_constant_nm_per_a"),
    "current_limit": Quantity("", "A", key="motor.current_limit_a"),
    "lowest_motor": Quantity("", "rad", key="limits.motor_low_deg"),
    "highest_motor": Quantity("", "rad", key="limits.motor_high_deg"),
}
"""Parameters that other sections of a rig say."""
Rule = tuple[str, bool, str]
"""Name of a parameter, whether it is right, and what was expected."""


def most_push(drive: Any) -> float:
    """Largest torque offset that is allowed, at the spool; infinite where no current is asked for [N·m]."""
    push: float = MOST_PUSH * drive.needs.gear * drive.needs.torque_constant * (drive.needs.current_limit or math.inf)
    return push


def rules_of_rig(drive: Any, sample_times: tuple[float, float], most: Callable[[Any], float] = most_push) -> list[Rule]:
    """What must hold of what a rig asks of its drive, with the cycle's shortest and longest time [s]."""
    shortest, longest = sample_times
    needs = drive.needs
    push = 0.0 <= needs.torque_offset <= most(drive) and math.isfinite(needs.torque_offset)
    return [
        ("channel", bool(drive.channel.strip(".")) and "\0" not in drive.channel, "the name of a bus"),
        ("gear", 0.0 < needs.gear < 1e4, "a number above 0"),
        ("torque_constant", 0.0 < needs.torque_constant < math.inf, "a number above 0"),
        ("sample_time", shortest <= needs.sample_time <= longest, f"from {shortest:g} to {longest:g} s"),
        ("highest_motor", needs.lowest_motor < needs.highest_motor, "more than lowest_motor"),
        *(
            (name, 0.0 <= getattr(needs, name) < math.inf, "0 or more")
            for name in ("speed_limit", "following_error", "current_limit")
        ),
        ("torque_offset", push, f"0 to {most(drive):.4g} N·m, half of what the largest current gives"),
        ("answer_timeout", 0.01 <= drive.answer_timeout <= 10.0, "from 0.01 to 10 s"),
    ]


def rule_of_watchdog(drive: Any) -> Rule:
    """Of a watchdog: three cycles at least, and `LONGEST_WATCHDOG` at most where that is longer."""
    least = LOST * drive.needs.sample_time
    longest = max(LONGEST_WATCHDOG, least)
    fine = least - 1e-9 <= drive.watchdog <= longest + 1e-9
    return "watchdog", fine, f"three cycles, {least:g} s, to {longest:g} s"


def check_turn(drive: Any, scale: Any, turn: float, forgets: str, expected: str, do: str) -> None:
    """Refuse a range of the motor of which a restart of the drive forgets the turn.

    Args:
        drive: its parameters.
        scale: of its counts.
        turn: in counts.
        forgets: what turns, and who forgets: ``the servo, which forgets``.
        expected: instead.
        do: what to do.

    Raises:
        ParameterError: with both ends.
    """
    low, high = drive.needs.lowest_motor, drive.needs.highest_motor
    if math.isfinite(low) and math.isfinite(high):
        turns = abs(scale.counts(high) - scale.counts(low)) / turn
        if turns >= 1.0:
            raise ParameterError(
                f"the motor goes from {low / RADIANS:g} to {high / RADIANS:g}°, {turns:.2f} turns of {forgets} at "
                "power-off in which turn it is",
                expected=expected,
                do=do,
            )


TELL_TURN = 'set home = "hint" with motor_hint_deg in [drive], or home = "here"; or '
"""What to do where a drive forgets a turn."""

_BOUNDS = {"gt": "above", "ge": "at least", "lt": "below", "le": "at most"}


def _rules_declared(drive: Any) -> Iterator[Rule]:
    """The ranges and the choices that the fields declare."""
    for name, kind, quantity in declared(type(drive)):
        value = getattr(drive, name)
        if get_origin(kind) is Literal:
            yield name, value in get_args(kind), " or ".join(map(repr, get_args(kind)))
        elif kind in (int, float) and not quantity.follows:  # what follows from the cycle is longer for a slow one
            words = (f"{_BOUNDS[rule]} {bound:g}" for rule, bound in quantity.rules.items())
            yield name, quantity.holds(value), " and ".join(words) or "a finite number"


def require(drive: Any) -> None:
    """Refuse parameters of a drive that are outside their declared ranges, or break a rule of its family.

    `rules` of the parameters gives these, and may raise what no rule can say; they come after the declared ranges.

    Raises:
        ParameterError: the first that does, with what was expected.
    """
    quantities = {one.name: one.quantity for one in declared(type(drive))} | _ELSEWHERE
    for name, fine, expected in itertools.chain(_rules_declared(drive), drive.rules()):
        if not fine:
            value = getattr(drive if name in drive._fields else drive.needs, name)
            quantity = quantities.get(name, Quantity(""))
            shown = f"{value / quantity.factor:.6g}" if isinstance(value, float) else repr(value)
            raise ParameterError(
                f"drive: {quantity.named(name)} is {shown}", expected=expected, do="correct it in the rig"
            )


def _check_heartbeat(drive: Any, name: str) -> None:
    """Two heartbeats of the drive, with the time of the parameter `name` between them, come before it counts as lost.

    Raises:
        ParameterError: they do not.
    """
    between, age = getattr(drive, name), drive.needs.heartbeat_age
    if 2.0 * between > age:
        key = next(one.quantity.named(name) for one in declared(type(drive)) if one.name == name)
        raise ParameterError(
            f"drive.{key} is {1e3 * between:g}, and limits.heartbeat_age_s is {age:g}",
            expected="two heartbeats of the drive within that age, so that one lost frame does no harm",
            do="correct one of them",
        )


def family(
    parameters: Any,
    title: str,
    *,
    driver: str,
    node: str,
    probe: str,
    options: tuple[str, ...],
    watchdog: Callable[[Any], float],
    scales: tuple[str, ...],
    explain: Callable[[int], str],
    most: Callable[[Any], float] = most_push,
    follows: Callable[[Any], Any] = lambda drive: drive,
    beats: str = "",
    **rest: Any,
) -> DriveFamily:
    """A family of drives on CAN.

    What talks to a bus is named, in the room of hardware, and loaded when it is wanted.

    Args:
        parameters: the default.
        title: what it is.
        driver: class of the driver, as ``drives.ak_drive.AkDrive``.
        node: class of the twin.
        probe: function that finds who is on a bus.
        options: what ``bowden twin --object`` takes, of `_FORMS`.
        watchdog: see `DriveFamily.watchdog`.
        scales: the fields that make angles of its counts.
        explain: see `DriveFamily.explain`.
        most: the largest torque offset of whole parameters [N·m].
        follows: the parameters with what follows from the rig where they do not say it.
        beats: name of the time between two heartbeats of the drive; empty of one without.
        rest: other fields of `DriveFamily`.
    """

    def twin(given: Any, plant: Any, clock: Callable[[], float], texts: Sequence[str]) -> TwinProcess:
        require(given)
        overrides, make = dict(_override(text, options) for text in texts), _named(node)
        process: TwinProcess = _named("twin.twin.Twin")(
            place(given), given.node_id, clock, lambda send, journal: make(given, plant, send, journal, overrides)
        )
        return process

    def completed(given: Any, needs: DriveNeeds) -> Any:
        drive = follows(given._replace(needs=needs))
        require(drive)
        if beats:
            _check_heartbeat(drive, beats)
        return drive

    if hasattr(parameters, "joint"):
        rest |= {"measures_joint": lambda given: given.joint != "none"}
    return DriveFamily(
        name=parameters.family,
        title=title,
        parameters=parameters,
        completed=completed,
        open=lambda given, links: _named(driver)(given, links),
        twin=twin,
        node=lambda: _named(node),
        moved=lambda given, channel, interface: given._replace(
            channel=given.channel if channel is None else channel,
            interface=given.interface if interface is None else interface,
        ),
        address=lambda given: {"interface": given.interface, "channel": given.channel, "node": str(given.node_id)},
        control=control,
        claim=lambda given: _named("buses.opening.claim")(given.interface, given.channel, "host").close,
        watchdog=watchdog,
        most_push=lambda given, needs: most(given._replace(needs=needs)),
        measures_tension=rest.pop("measures_tension", lambda given: False),
        scales=lambda given: tuple(getattr(given, name) for name in scales),
        homed=lambda given: given.home != "here",
        simulated=lambda given: bool(given.interface == "bowden_unix"),
        explain=explain,
        probe=lambda given, links: _named(probe)(given, links),
        zeroed=zeroed,
        **rest,
    )


def _named(what: str) -> Any:
    """What a module of the hardware has by that name."""
    module, _, name = what.rpartition(".")
    return getattr(importlib.import_module(f"bowden.hardware.{module}"), name)


_FORMS = {"object": "6502:0=0x25", "register": "0x102=4", "setting": "axis0.config.enable_watchdog=0"}
"""What a twin may be told otherwise with ``--object`` → how that is written: an object of CANopen with its index and
sub-index, a numbered register, a named setting."""


def _override(text: str, forms: Sequence[str]) -> tuple[Any, float | None]:
    """An object, register or setting of a twin, and its value; ``none`` takes it away.

    Raises:
        ParameterError: it is none of those that the family has.
    """
    name, equals, said = text.partition("=")
    form = "object" if ":" in name else "register" if name.startswith("0x") else "setting"
    try:
        if name and equals and form in forms:
            if form == "object":
                index, sub = name.split(":")
                return (int(index, 16), int(sub)), None if said == "none" else int(said, 0)
            return int(name, 16) if form == "register" else name, None if said == "none" else float(said)
    except ValueError:
        pass
    examples = (*(_FORMS[one] for one in forms), _FORMS[forms[0]].partition("=")[0] + "=none")
    raise ParameterError(f"--object is {text!r}", expected=f"like {' or '.join(examples)}")


OF_ALL = ""
"""In place of a key: what all nodes of a network share."""
_SHARED = frozenset({OF_ALL, "host_id", "reply_id"})
"""Keys whose frames two drives may have in common."""


class Device(NamedTuple):
    """Another device on a bus, of classic CAN, for `collision`."""

    interface: str
    channel: str
    bitrate: int
    taken: dict[int, str]
    """Identifier → key with its section."""

    def identifiers(self) -> dict[int, str]:
        """Of its frames."""
        return self.taken


def collision(one: Any, other: Any) -> str:
    """Reason for which two drives cannot share their bus; empty if they can, or are on two.

    Their frames must differ: a drive whose number is that of another one's encoder would be led by that one's joint.
    `identifiers` of their parameters says which there are: identifier → key of [drive] that it follows from.

    Args:
        one: parameters of a drive, or a `Device`.
        other: those of another, of any family.
    """
    if any(getattr(one, key, None) != getattr(other, key, "") for key in ("interface", "channel")):
        return ""
    rates = [(getattr(drive, "bitrate", 0), getattr(drive, "data_bitrate", 0)) for drive in (one, other)]
    if rates[0] != rates[1]:
        said = " and ".join(f"{slow} bit/s{f' with CAN-FD at {quick} bit/s' if quick else ''}" for slow, quick in rates)
        return f"share the bus {one.channel}, but speak at {said}: name another channel"
    asked = {drive.table.block()[:2] for drive in (one, other) if hasattr(drive, "table")}
    if len(asked) > 1:  # two questions in a cycle, and the second would meet the answers to the first
        return f"share the line {one.channel}, and their servos have what a cycle reads elsewhere: name another channel"
    ours, theirs = (drive.identifiers() if hasattr(drive, "identifiers") else {} for drive in (one, other))
    for identifier in sorted({*ours} & {*theirs}):
        keys = ours[identifier], theirs[identifier]
        if keys[0] != keys[1] or keys[0] not in _SHARED:
            said = " and ".join((key if "." in key else f"drive.{key}") if key else "the network" for key in keys)
            return f"share the bus {one.channel}, and {said} make the same frames ({identifier:03X}h)"
    return ""


def place(parameters: Any) -> BusPlace:
    """Which bus."""
    quick, table = getattr(parameters, "data_bitrate", 0), getattr(parameters, "table", None)
    classic = BusPlace(parameters.interface, parameters.channel, parameters.bitrate)
    if table is not None:
        return classic._replace(packets=table.protocol)
    return classic._replace(fd=True, data_bitrate=quick) if quick else classic


def control(parameters: Any) -> Path:
    """Socket of the twin of this node."""
    path: Path = _named("twin.control.control_path")(parameters.interface, parameters.channel, parameters.node_id)
    return path


def zeroed(drive: Any, values: DriveReading, motor: float = 0.0, joint: float = 0.0) -> Any:
    """The parameters with which the position that was read is at these angles.

    Where the turn of the rotor is told by a hint, the hint is the motor's angle from here on.

    Args:
        drive: with which it was read; it has `home`, `motor_home`, `joint_home` and `spool`.
        values: what was read.
        motor: angle of the motor there [rad].
        joint: angle of the joint there [rad].

    Raises:
        DriveError: nothing has been read.
    """
    if not (math.isfinite(values.motor) and math.isfinite(values.joint)):
        raise DriveError("the drive has not reported a position yet", do="read a few cycles first")
    if drive.home == "here":  # the next bring-up finds the present position by itself
        return drive._replace(motor_home=motor, joint_home=joint)
    moved, spool = drive.motor_home + motor - values.motor, drive.needs.spool
    if spool is not None:  # what is added is an angle of the spool
        turned = spool_of(drive.motor_home, spool) + spool_of(motor, spool) - spool_of(values.motor, spool)
        moved = motor_of(turned, spool)
    hint = {"motor_hint": motor} if drive.home == "hint" else {}
    return drive._replace(motor_home=float(moved), joint_home=drive.joint_home + joint - values.joint, **hint)
