"""Which column of a log is the time, the motor, the joint or whatever is looked for, and in which unit."""

import math
import re
import shlex
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from bowden.core.errors import LogError
from bowden.core.files import printable
from bowden.core.units import RADIANS
from bowden.records.units import UNITS

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
_ANGLES = ("deg", "rad", "turns", "counts")
_NO_ANGLE = ("torque", "force", "current", "volt", "temp", "vel", "speed", "emg", "target", "command", "cmd", "ref")

FACTORS = {"deg": RADIANS, "rad": 1.0, "turns": math.tau, "s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
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
) -> dict[str, LogColumn]:
    """Time, motor and joint, or other roles, among a log's columns.

    Args:
        names: the columns as written.
        given: role → name that the user gave, or None to guess.
        where: the log, for messages.
        known: role → its common names.
        optional: roles that a log need not have, unless the user names a column for them.

    Raises:
        LogError: a column is not there, and the message lists those that are; or is there twice.
    """
    found: dict[str, LogColumn] = {}
    missing: list[str] = []
    for role in known:
        wanted = given.get(role)
        index = _guess(known[role], names) if wanted is None else _named(wanted, names)
        if index is None and role in optional and wanted is None:
            continue
        if index is None:
            missing.append(f"a column {wanted!r} for the {role}" if wanted is not None else f"a {role} column")
        else:
            found[role] = LogColumn(index, printable(names[index].strip()), split_name(names[index])[1])
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
            do=f"name the columns: {options}, or {keywords} in Python{rate}"
            + (_suggested(names) if {*_PLACES} <= {*known} - {role for role in given if given[role]} else ""),
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


def _suggested(names: Sequence[str]) -> str:
    """The options for both sides, where words in the names of one column each say which it is; else nothing."""
    of_motor = _with_word("motor", names)
    of_joint = [k for k in _with_word("joint", names) if k not in of_motor]
    if not of_motor and len(of_joint) == 1:  # the one other column of angles
        of_motor = [k for k in _angles(names) if k not in of_joint and split_name(names[k])[1] in _ANGLES]
    if len(of_motor) != 1 or len(of_joint) != 1:
        return ""
    motor, joint = (names[one[0]].strip() for one in (of_motor, of_joint))
    units = all(split_name(one)[1] in _ANGLES for one in (motor, joint))
    unit = "" if units else ", with --unit deg or --unit rad"
    return f"; perhaps --motor {shlex.quote(motor)} --joint {shlex.quote(joint)}{unit}"


def _with_word(side: str, names: Sequence[str]) -> list[int]:
    *words, last = _PLACES[side]
    plain, angles = [name.lower() for name in names], _angles(names)
    at = [k for k in angles if any(word in plain[k] for word in words)]
    return at or [k for k in angles if last in plain[k]]


def _angles(names: Sequence[str]) -> list[int]:
    """The columns whose names have no word of what is no angle."""
    return [k for k, name in enumerate(names) if not any(word in name.lower() for word in _NO_ANGLE)]


def _named(wanted: str, names: Sequence[str]) -> int | None:
    plain = [name.strip().strip('"') for name in names]
    if wanted in plain:
        return plain.index(wanted)
    lower = [name.lower() for name in plain]
    if lower.count(wanted.lower()) == 1:
        return lower.index(wanted.lower())
    return int(wanted) - 1 if wanted.isdecimal() and 1 <= int(wanted) <= len(names) else None


def _guess(known: Sequence[str], names: Sequence[str]) -> int | None:
    plain = [split_name(name)[0] for name in names]
    return next((plain.index(name) for name in known if name in plain), None)
