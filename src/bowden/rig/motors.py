"""Several motors in one rig.toml: sections that are common, and those that each ``[[motor]]`` has in their place."""

import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from typing import Any, NamedTuple

from bowden.core.errors import ParameterError, near
from bowden.core.toml_text import quoted
from bowden.rig.families import family_of, shortest_cycles
from bowden.rig.joints import JointSettings
from bowden.rig.load_cell import collision, devices
from bowden.rig.sections import DEFAULT_FAMILY, Control, RigFile

MOTOR, INDEPENDENT, JOINT = "motor", "independent", "joint"
"""Keys of a rig.toml with several motors, beside its sections; with one motor [motor] is a section."""
MEANINGS: Mapping[str, str] = {
    MOTOR: "two to four motors in one loop: each has a name, the joint that it shares with others, the keys of "
    "[motor], and sections of its own, which replace the common ones key by key",
    INDEPENDENT: "whether a fault stops its own motor only; by default it stops all",
}
FEWEST, MOST = 2, 4
"""Motors of a rig with several."""
COMMON: Mapping[str, str] = {"sample_time": "bench.sample_time_ms", "duration": "scenario.duration_s", "live": "[live]"}
"""Field of a rig → its key, of what is the same for all motors: there is one loop."""
RESERVED = frozenset({*("cycle", "event", "law", "supervisor", "conditioned", "emg", "push"), *("gain", "asked")} | {
    "admittance", "motor", "all"
})  # fmt: skip
"""Beginnings of columns of a log, with which a motor's columns would be mixed up."""
_NAME = re.compile(r"(?!.{25})[a-z][a-z0-9]*(_[a-z0-9]+)*")
"""What stays as it is where it becomes a log's topic: no _ at its end, and no two in a row (`live.mcap_log`)."""
_KINDS: Mapping[str, Any] = {"family": DEFAULT_FAMILY, "law": Control().law, "model": None, "plant": None}
"""Keys of which another value makes another section of it → what stands for one that is left out."""
_FIRST_KINDS: Mapping[str, str] = {"reference": "periodic_minimum_jerk", "bend": "constant"}


class MotorTree(NamedTuple):
    """One motor of a rig.toml."""

    name: str
    tree: Mapping[str, Any]
    """Its sections, with what is common."""
    joint: str
    """The joint that it shares with others; empty of one of its own."""


def has_several(tree: Mapping[str, Any]) -> bool:
    """True if a rig.toml is of several motors, or has what only such a one may have."""
    return isinstance(tree.get(MOTOR), list) or INDEPENDENT in tree or JOINT in tree


def split(tree: Mapping[str, Any], where: str) -> tuple[dict[str, Any], list[MotorTree], bool]:
    """What is common in a rig.toml, its motors, and whether they are independent; [[joint]] is neither.

    Args:
        tree: sections as they stand in the file.
        where: for messages.

    Raises:
        ParameterError: motors that are none, or too many; what is of several motors, in a rig with one.
    """
    common = {key: value for key, value in tree.items() if key not in (MOTOR, INDEPENDENT, JOINT)}
    given, independent = tree.get(MOTOR), tree.get(INDEPENDENT, False)
    if not isinstance(independent, bool):
        raise ParameterError(f"{where}: independent is {independent!r}", expected="true or false", do=_CORRECT)
    if not isinstance(given, list):
        said = f"independent is {str(independent).lower()}" if INDEPENDENT in tree else "[[joint]] stands"
        expected = f"{FEWEST} to {MOST} motors, [[motor]] for each"
        raise ParameterError(
            f"{where}: {said} in a rig with one motor", expected=expected, do="write them, or delete it"
        )
    if not given or not all(isinstance(one, Mapping) for one in given):
        raise ParameterError(f"{where}: motor is no list of sections", expected="[[motor]] for each", do=_CORRECT)
    first = {key: value for key, value in given[0].items() if key in _OF_MOTOR}
    return common, [_motor({**common, MOTOR: first}, one, where) for one in given], independent


def _motor(common: Mapping[str, Any], given: Mapping[str, Any], where: str) -> MotorTree:
    name, joint = given.get("name"), given.get(JOINT, "")
    if not isinstance(name, str):
        said = "without a name" if name is None else f"whose name is {name!r}"
        raise ParameterError(f"{where}: a [[motor]] {said}", expected='a name in quotation marks, such as "knee"')
    if not isinstance(joint, str):
        expected = 'the name of a [[joint]] in quotation marks, such as "elbow"'
        raise ParameterError(f"{where}: motor {quoted(name)}: joint is {joint!r}", expected=expected, do=_CORRECT)
    own: dict[str, Any] = {}
    for key, value in given.items():
        if key in _OF_MOTOR and not isinstance(value, Mapping):
            own.setdefault(MOTOR, {})[key] = value
        elif key in RigFile.model_fields and key != MOTOR:
            own[key] = value
        elif key not in ("name", JOINT):
            near_by = near(key, [*RigFile.model_fields, *_OF_MOTOR, JOINT])
            raise ParameterError(
                f"{where}: motor {quoted(name)} has an unknown {'section' if isinstance(value, Mapping) else 'key'} "
                f"{key!r}",
                expected=near_by,
                do="correct it; a section of one motor is [motor.drive], below its [[motor]]",
            )
    return MotorTree(name, merged(common, own), joint)


_OF_MOTOR = frozenset(RigFile.model_fields[MOTOR].annotation.model_fields)  # type: ignore[union-attr]
"""Keys of [motor], which a [[motor]] has itself."""


def merged(common: Mapping[str, Any], own: Mapping[str, Any], title: str = "") -> dict[str, Any]:
    """Sections with those of one motor in their place, key by key; one of another kind begins anew.

    >>> merged({"servo": {"damping": 1.0}}, {"servo": {"delay": 2}})
    {'servo': {'damping': 1.0, 'delay': 2}}
    >>> merged({"reference": {"low_deg": 0.0}}, {"reference": {"kind": "chirp"}})
    {'reference': {'kind': 'chirp'}}
    """
    kinds = {**_KINDS, "kind": _FIRST_KINDS.get(title)}
    if any(key in own and own[key] != common.get(key, usual) for key, usual in kinds.items()):
        return dict(own)
    found = dict(common)
    for key, value in own.items():
        before = found.get(key)
        inside = isinstance(before, Mapping) and isinstance(value, Mapping)
        found[key] = merged(before, value, key) if inside else value  # type: ignore[arg-type]
    return found


def shared(trees: Sequence[MotorTree]) -> dict[str, Any]:
    """A rig.toml of several motors: the sections that are the same in all of them, and each motor with its others.

    Args:
        trees: of each motor, whole.
    """
    first = trees[0].tree
    same = {key for key in first if key != MOTOR and all(one.tree.get(key) == first[key] for one in trees)}
    motors = []
    for name, tree, joint in trees:
        own = {key: value for key, value in tree.items() if key not in same and key != MOTOR}
        motors.append({"name": name} | ({JOINT: joint} if joint else {}) | tree.get(MOTOR, {}) | own)
    return {key: first[key] for key in first if key in same} | {MOTOR: motors}


def check(motors: Sequence[Any], joints: Sequence[JointSettings], where: str) -> None:
    """Refuse motors that cannot be in one loop.

    Args:
        motors: a `RigMotor` each.
        joints: those that several of them move.
        where: for messages.

    Raises:
        ParameterError: too few or many, names that are none or the same, one drive twice, or another loop for each.
    """
    if not FEWEST <= len(motors) <= MOST:
        do = "name one drive in [drive], without [[motor]]" if len(motors) < FEWEST else "take some out"
        raise ParameterError(
            f"{where}: [[motor]] is there {_times(len(motors))}", expected=f"{FEWEST} to {MOST}", do=do
        )
    names = [one.name for one in motors]
    for kind, name in (*(("motor", name) for name in names), *(("joint", one.name) for one in joints)):
        if not _NAME.fullmatch(name) or name in RESERVED:
            raise ParameterError(
                f"{where}: a {kind} has the name {quoted(name)}",
                expected=(
                    f"small letters, digits and _ between them, 24 at most, and none of {', '.join(sorted(RESERVED))}"
                ),
                do="rename it",
            )
        if kind == "joint" and name in names:
            raise ParameterError(f"{where}: a joint and a motor have the name {quoted(name)}", do="rename one")
    for name, rig, _ in motors:
        if rig.motors:
            raise ParameterError(f"{where}: motor {quoted(name)} has motors of its own", expected="none", do=_CORRECT)
    for problem in (*_twice(motors), *_apart(motors), *_too_slow(motors)):
        raise ParameterError(f"{where}: {problem}", do=_CORRECT)


def _twice(motors: Sequence[Any]) -> Iterator[str]:
    for number, (name, rig, _) in enumerate(motors):
        for other, another, _ in motors[:number]:
            if other == name:
                yield f"two motors have the name {quoted(name)}"
            family, place = family_of(rig.drive), family_of(rig.drive).address(rig.drive)
            if place == family_of(another.drive).address(another.drive):
                said = ", ".join(f"{key} {value}" for key, value in place.items())
                yield f"motors {quoted(other)} and {quoted(name)} have one drive ({family.name}, {said})"
            both = product(devices(another.drive, another.load_cell), devices(rig.drive, rig.load_cell))
            for problem in filter(None, (collision(*two) for two in both)):
                yield f"motors {quoted(other)} and {quoted(name)} {problem}"


def _too_slow(motors: Sequence[Any]) -> Iterator[str]:
    """Buses that do not carry a cycle."""
    cycle = motors[0][1].sample_time
    for channel, (count, shortest) in shortest_cycles(rig.drive for _, rig, _ in motors).items():
        if cycle < shortest:
            yield (
                f"{count} drives on {channel} need {1e3 * shortest:.3g} ms a cycle, and bench.sample_time_ms is "
                f"{1e3 * cycle:g}"
            )


def _apart(motors: Sequence[Any]) -> Iterator[str]:
    first = motors[0][1]
    for name, rig, _ in motors[1:]:
        for field, key in COMMON.items():
            if getattr(rig, field) != getattr(first, field):
                yield f"{key} of motor {quoted(name)} is another one than that of {quoted(motors[0][0])}: it is common"


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"


_CORRECT = "correct it there"
