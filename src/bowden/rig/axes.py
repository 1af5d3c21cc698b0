"""Several axes in one rig.toml: sections that are common, and those that each ``[[axis]]`` has in their place."""

import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from typing import Any, NamedTuple

from bowden.core.errors import ParameterError, near
from bowden.core.toml_text import quoted
from bowden.rig.drive import collision, devices
from bowden.rig.families import family_of
from bowden.rig.sections import DEFAULT_FAMILY, Control, RigFile

AXIS, INDEPENDENT, PAIR = "axis", "independent", "pair"
"""Keys of a rig.toml beside its sections."""
MEANINGS: Mapping[str, str] = {
    AXIS: "two to four motors in one loop: each has a name, and sections of which each key takes the place of the "
    "common one; a section of another kind, family, model, plant or law begins anew",
    INDEPENDENT: "whether an axis that is stopped by a fault leaves the others running; by default the worst reaction "
    "of any axis is that of all",
}
FEWEST, MOST = 2, 4
"""Axes of a rig."""
COMMON: Mapping[str, str] = {"sample_time": "bench.sample_time_ms", "duration": "scenario.duration_s", "live": "[live]"}
"""Field of a rig → its key, of what is the same for all axes: there is one loop."""
RESERVED = frozenset({*("cycle", "event", "law", "supervisor", "conditioned", "emg", "push"), *("gain", "asked")} | {
    "admittance", "axis", "all", "pair"
})  # fmt: skip
"""Beginnings of columns of a log, with which an axis' columns would be mixed up; and folders of what is simulated."""
_NAME = re.compile(r"(?!.{25})[a-z][a-z0-9]*(_[a-z0-9]+)*")
"""What stays as it is where it becomes a log's topic: no _ at its end, and no two in a row (`live.mcap_layout`)."""
_KINDS: Mapping[str, Any] = {"family": DEFAULT_FAMILY, "law": Control().law, "model": None, "plant": None}
"""Keys of which another value makes another section of it → what stands for one that is left out."""
_FIRST_KINDS: Mapping[str, str] = {"reference": "periodic_minimum_jerk", "bend": "constant"}


class AxisTree(NamedTuple):
    """One axis of a rig.toml."""

    name: str
    tree: Mapping[str, Any]
    """Its sections, with what is common."""


def split(tree: Mapping[str, Any], where: str) -> tuple[dict[str, Any], list[AxisTree], bool]:
    """What is common in a rig.toml, its axes, and whether they are independent; [pair] is neither.

    Args:
        tree: sections as they stand in the file.
        where: for messages.

    Raises:
        ParameterError: axes that are none, or too many; what is of axes, in a rig without them.
    """
    common = {key: value for key, value in tree.items() if key not in (AXIS, INDEPENDENT, PAIR)}
    given, independent = tree.get(AXIS, []), tree.get(INDEPENDENT, False)
    if not isinstance(independent, bool):
        raise ParameterError(f"{where}: independent is {independent!r}", expected="true or false", do=_CORRECT)
    if not isinstance(given, list) or not all(isinstance(one, Mapping) for one in given):
        raise ParameterError(f"{where}: axis is no list of sections", expected="[[axis]] for each", do=_CORRECT)
    if AXIS in tree and not given:
        raise ParameterError(f"{where}: axis is an empty list", expected=f"{FEWEST} to {MOST} axes", do="delete it")
    for key, said in ((INDEPENDENT, f"independent is {str(independent).lower()}"), (PAIR, "[pair] stands")):
        if key in tree and AXIS not in tree:
            raise ParameterError(
                f"{where}: {said} in a rig without [[axis]]",
                expected=f"{FEWEST} to {MOST} axes",
                do="write them, or delete it",
            )
    return common, [_axis(common, one, where) for one in given], independent


def _axis(common: Mapping[str, Any], given: Mapping[str, Any], where: str) -> AxisTree:
    name = given.get("name")
    if not isinstance(name, str):
        said = "without a name" if name is None else f"whose name is {name!r}"
        raise ParameterError(f"{where}: an [[axis]] {said}", expected='a name in quotation marks, such as "knee"')
    own = {key: value for key, value in given.items() if key != "name"}
    for key in own:
        if key not in RigFile.model_fields:
            what = "key or section" if not isinstance(own[key], Mapping) else "section"
            raise ParameterError(
                f"{where}: axis {quoted(name)} has an unknown {what} {key!r}",
                expected=near(key, RigFile.model_fields),
                do=f"correct it, such as [axis.{near(key, RigFile.model_fields).split()[0].rstrip(',')}]",
            )
    return AxisTree(name, merged(common, own))


def merged(common: Mapping[str, Any], own: Mapping[str, Any], title: str = "") -> dict[str, Any]:
    """Sections with those of one axis in their place, key by key; one of another kind begins anew.

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


def shared(trees: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """A rig.toml of axes: the sections that are the same in all of them, and each axis with its others.

    Args:
        trees: name → sections of each axis, whole.
    """
    first = next(iter(trees.values()))
    common = {key: value for key, value in first.items() if all(one.get(key) == value for one in trees.values())}
    axes = [{"name": name, **{key: one[key] for key in one if key not in common}} for name, one in trees.items()]
    return {**common, AXIS: axes}


def check(axes: Sequence[tuple[str, Any]], where: str) -> None:
    """Refuse axes that cannot be in one loop.

    Args:
        axes: name and rig of each.
        where: for messages.

    Raises:
        ParameterError: too few or many, names that are none or the same, one drive twice, or another loop for each.
    """
    if not FEWEST <= len(axes) <= MOST:
        do = "name one drive in [drive], without [[axis]]" if len(axes) < FEWEST else "take some out"
        raise ParameterError(f"{where}: [[axis]] is there {_times(len(axes))}", expected=f"{FEWEST} to {MOST}", do=do)
    for name, rig in axes:
        if not _NAME.fullmatch(name) or name in RESERVED:
            raise ParameterError(
                f"{where}: an axis has the name {quoted(name)}",
                expected=(
                    f"small letters, digits and _ between them, 24 at most, and none of {', '.join(sorted(RESERVED))}"
                ),
                do="rename it",
            )
        if rig.axes:
            raise ParameterError(f"{where}: axis {quoted(name)} has axes of its own", expected="none", do=_CORRECT)
    for problem in (*_twice(axes), *_apart(axes)):
        raise ParameterError(f"{where}: {problem}", do=_CORRECT)


def _twice(axes: Sequence[tuple[str, Any]]) -> Iterator[str]:
    for number, (name, rig) in enumerate(axes):
        for other, another in axes[:number]:
            if other == name:
                yield f"two axes have the name {quoted(name)}"
            family, place = family_of(rig.drive), family_of(rig.drive).address(rig.drive)
            if place == family_of(another.drive).address(another.drive):
                said = ", ".join(f"{key} {value}" for key, value in place.items())
                yield f"axes {quoted(other)} and {quoted(name)} have one drive ({family.name}, {said})"
            pairs = product(devices(another.drive, another.load_cell), devices(rig.drive, rig.load_cell))
            for problem in filter(None, (collision(*pair) for pair in pairs)):
                yield f"axes {quoted(other)} and {quoted(name)} {problem}"


def _apart(axes: Sequence[tuple[str, Any]]) -> Iterator[str]:
    first = axes[0][1]
    for name, rig in axes[1:]:
        for field, key in COMMON.items():
            if getattr(rig, field) != getattr(first, field):
                yield f"{key} of axis {quoted(name)} is another one than that of {quoted(axes[0][0])}: it is common"


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"


_CORRECT = "correct it there"
