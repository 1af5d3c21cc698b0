"""Which column of a log is the time, the motor, the joint or whatever is looked for, and in which unit."""

import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from bowden.core.errors import LogError
from bowden.core.files import printable
from bowden.core.units import RADIANS
from bowden.records.units import UNITS, unit_of

TIMES = (
    "time",
    "t",
    "timestamp",
    "times",
    "elapsed",
    "seconds",
    "sec",
    "clock",
    "datetime",
    "date_time",
    "x_value",
    "stamp",
    "ms",
    "us",
    "ns",
)
"""Common names of a column of times, the likeliest first."""

CABLE: Mapping[str, Sequence[str]] = {
    "time": TIMES,
    "motor": (
        *("motor_measured", "motor", "motor_angle", "motor_position", "motor_pos", "phi_in", "theta_in", "q_in"),
        *("phi_motor", "theta_motor", "q_motor", "input", "input_angle", "proximal", "proximal_angle", "actuator"),
        *("actuator_angle", "spindle", "spool", "drive", "in"),
    ),
    "joint": (
        *("joint_measured", "joint", "joint_angle", "joint_position", "joint_pos", "phi_out", "theta_out", "q_out"),
        *("phi_joint", "theta_joint", "q_joint", "output", "output_angle", "distal", "distal_angle", "elbow"),
        *("elbow_angle", "jaw", "pulley", "load", "link", "out"),
    ),
}
"""Role in a cable's log → common names, the likeliest first: what an encoder read before what a simulation knows."""

_PLACES = {
    "motor": (
        "motor",
        "servo",
        "actuator",
        "spool",
        "drum",
        "winch",
        "spindle",
        "capstan",
        "drive",
        "proximal",
        "pulley",
    ),
    "joint": (
        *("joint", "elbow", "knee", "wrist", "finger", "thumb", "hip", "ankle", "shoulder", "jaw", "hand", "limb"),
        *("load", "link", "distal", "pulley"),
    ),
}
"""Words in a column's name that say on which side it was measured; the last one, only where no other does."""
ANGLES = ("deg", "rad", "turns", "counts", "mdeg", "mrad")
"""Units of an angle."""
LENGTHS = {"mm": 1.0, "cm": 10.0}
"""Unit of a length of cable, which a spool winds up → what one of it is [mm]."""
_TIME_UNITS = ("s", "ms", "us", "ns")
_NO_ANGLE = ("torque", "force", "current", "volt", "temp", "vel", "speed", "emg", "target", "command", "cmd", "ref")

FACTORS = {
    **{"deg": RADIANS, "rad": 1.0, "turns": math.tau, "mdeg": 1e-3 * RADIANS, "mrad": 1e-3},
    **{"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
}
"""Unit → what one of it is in SI; what a count is, its encoder says."""


@dataclass(frozen=True)
class LogColumn:
    """Where a signal is found."""

    index: int
    """Position among the columns, from 0."""
    name: str
    """As written in the log."""
    unit: str | None
    """As `bowden.records.units.UNITS` has it; None where the log does not say."""
    by_word: bool = False
    """True if a word in its name says what it is, and not the name itself."""


def split_name(name: str) -> tuple[str, str | None]:
    """A column's plain name and the unit at its end.

    >>> split_name("Motor Angle [deg]"), split_name("time_s"), split_name("joint")
    (('motor_angle', 'deg'), ('time', 's'), ('joint', None))
    """
    text = name.strip().strip('"').strip()
    parts = re.fullmatch(r"(.*?)[\s_./-]*[\[(]\s*(\S+?)\s*[\])]|(.+)[\s_./-]+(\S+?)", text)
    base, unit = text, None
    if parts:
        named = (parts[2] or parts[4] or "").lower()
        if named in UNITS:
            base, unit = parts[1] if parts[2] else parts[3], UNITS[named]
    return re.sub(r"[^0-9a-zµ°]+", "_", base.lower()).strip("_"), unit


def find_columns(
    names: Sequence[str],
    given: Mapping[str, str | None],
    where: str,
    known: Mapping[str, Sequence[str]] = CABLE,
    optional: Collection[str] = (),
    units: Mapping[str, str] = MappingProxyType({}),
) -> dict[str, LogColumn]:
    """Time, motor and joint, or other roles, among a log's columns.

    Args:
        names: the columns as written.
        given: role → name that the user gave, or None to guess.
        where: the log, for messages.
        known: role → its common names.
        optional: roles that a log need not have, unless the user names a column for them.
        units: name → unit, where the log says it apart from the names.

    Raises:
        LogError: a column is not there, and the message lists those that are; or is there twice.
    """
    wishes = {role: given.get(role) for role in known}
    places = {role: _guess(known[role], names) if one is None else _named(one, names) for role, one in wishes.items()}
    said = [split_name(name)[1] or unit_of(units.get(name, "")) for name in names]
    times = [k for k, unit in enumerate(said) if unit in _TIME_UNITS]
    if places.get("time", 0) is None and wishes["time"] is None and len(times) == 1:
        places["time"] = times[0]
    pair = _by_words(names, said) if {*_PLACES} <= {*known} else {}
    words = {side: place for side, place in pair.items() if wishes[side] is None and place != places[side]}
    if all(places[side] is not None for side in pair):
        words = {}
    found: dict[str, LogColumn] = {}
    missing: list[str] = []
    for role, place in (places | words).items():
        wanted = wishes[role]
        if place is not None:
            found[role] = LogColumn(place, printable(names[place].strip()), said[place], role in words)
        elif wanted is not None or role not in optional:
            missing.append(f"a column {wanted!r} for the {role}" if wanted is not None else f"a {role} column")
    listed = ", ".join(repr(name.strip()) for name in names[:12]) + (", …" if len(names) > 12 else "")
    if missing:
        *first, last = known
        options, keywords = (
            ", ".join(form.format(role) for role in first) + (" and " if first else "") + form.format(last)
            for form in ("--{}", "{}=")
        )
        no_time = missing[0] == "a time column"
        rate = "; of a log without times, give the rows' rate: --rate 1000, or rate= in Python" if no_time else ""
        raise LogError(
            f"{where}: no {' and no '.join(part.removeprefix('a ') for part in missing)} among {listed}",
            do=f"name the columns: {options}, or {keywords} in Python{rate}",
        )
    written = [printable(name.strip()) for name in names]
    for column in found.values():
        if written.count(column.name) > 1:
            raise LogError(
                f"{where}: {written.count(column.name)} columns are called {column.name!r}",
                expected="a name of its own for each",
                do="rename or delete one",
            )
    if len({column.index for column in found.values()}) < len(found):
        chosen = ", ".join(f"{role} = {column.name!r}" for role, column in found.items())
        raise LogError(f"{where}: one column is taken twice ({chosen})", expected="three different columns")
    return found


def sides_in(given: Mapping[str, str | None], names: Sequence[str]) -> set[str]:
    """Which of motor and joint are among a file's columns."""
    found = set()
    for side in _PLACES:
        wanted = given.get(side)
        if (_guess(CABLE[side], names) if wanted is None else _named(wanted, names)) is not None:
            found.add(side)
    return found


def only_angle(names: Sequence[str]) -> str | None:
    """The one column beside the times, or the one of them in a unit of angles; None where there is no such one."""
    others = [one for one in names if one.strip() and split_name(one)[0] not in TIMES]
    angles = [one for one in others if split_name(one)[1] in ANGLES]
    return next((found[0] for found in (others, angles) if len(found) == 1), None)


def _by_words(names: Sequence[str], units: Sequence[str | None]) -> dict[str, int]:
    """The columns of motor and joint, where words in the names of one column each say which it is; else nothing.

    Where a word says it of one side, the other is the one other column that is in a unit of angles.
    """
    of_motor = _with_word("motor", names)
    of_joint = [k for k in _with_word("joint", names) if k not in of_motor]
    angles = [k for k in _angles(names) if k not in (*of_motor, *of_joint) and units[k] in ANGLES]
    if of_motor or of_joint:
        of_motor, of_joint = of_motor or angles, of_joint or angles
    return {"motor": of_motor[0], "joint": of_joint[0]} if len(of_motor) == len(of_joint) == 1 else {}


def _with_word(side: str, names: Sequence[str]) -> list[int]:
    *words, last = _PLACES[side]
    plain, angles = [name.lower() for name in names], _angles(names)
    at = [k for k in angles if any(word in plain[k] for word in words)]
    return at or [k for k in angles if last in plain[k]]


def _angles(names: Sequence[str]) -> list[int]:
    """The columns whose names have no word of what is no angle."""
    return [k for k, name in enumerate(names) if not any(word in name.lower() for word in _NO_ANGLE)]


def _named(wanted: str, names: Sequence[str]) -> int | None:
    """A column by its name, by the end of a name within others, or by its number."""
    plain = [name.strip().strip('"').lower() for name in names]
    exact = [k for k, name in enumerate(names) if name.strip().strip('"') == wanted]
    text = wanted.lower()
    ends = [k for k, name in enumerate(plain) if re.split(r"[./]", name)[-1] == text]
    for found in (exact, [k for k, name in enumerate(plain) if name == text], ends):
        if len(found) == 1 or (found is exact and found):
            return found[0]
    return int(text) - 1 if text.isdecimal() and 1 <= int(text) <= len(names) else None


def _guess(known: Sequence[str], names: Sequence[str]) -> int | None:
    """A column of a common name; else one whose name ends so within others: motor.angle_deg, header.stamp."""
    plain = [[split_name(name)[0]] for name in names]
    within = [
        [split_name(name.strip()[at.end() :])[0] for at in re.finditer(r"[./]", name.strip())]
        if k in _angles(names)
        else []
        for k, name in enumerate(names)
    ]
    for ends in (plain, within):
        for one in known:
            if (place := next((k for k, end in enumerate(ends) if one in end), None)) is not None:
                return place
    return None
