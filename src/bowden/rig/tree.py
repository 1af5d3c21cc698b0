"""A rig as the sections of a rig.toml, both ways: its fields from them, and they from its fields."""

from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import tomlkit
from pydantic import ValidationError

from bowden.control.recorded_motion import RecordedFile, RecordedMotion
from bowden.control.reference import Trajectory
from bowden.core.errors import ParameterError, article, error_context
from bowden.core.quantity import declared
from bowden.core.registry import resolve
from bowden.core.toml_text import quoted
from bowden.models.cable.bouc_wen import BoucWen
from bowden.plants.counting import MODEL_FILE, Counting
from bowden.rig import motors
from bowden.rig.checked import Gains
from bowden.rig.config import checked_file, explained, read_toml
from bowden.rig.declaration import Section, in_file, items_of, value_of
from bowden.rig.declaration import tree_of as section_tree
from bowden.rig.effect import refuse_switched_off
from bowden.rig.joints import JointSettings
from bowden.rig.sections import (
    BENDS,
    JOINT,
    PARTS,
    REFERENCES,
    TITLES,
    Clock,
    Control,
    RigFile,
    Scenario,
    drive_part,
)
from bowden.rig.settings import EmgSettings, found_emg


def read_values(path: Path) -> dict[str, Any]:
    """The fields of the rig that a file describes; what the file leaves out is as on the paper's bench.

    What the file names (model, motion, wearer, law) is read too.

    Raises:
        ParameterError: no such file, not TOML, an unknown key, a value of the wrong kind or out of its range.
        LogError: a recorded motion that cannot be used.
    """
    return values_of(read_toml(path), path)


def values_of(
    tree: Mapping[str, Any], path: Path, keep: Mapping[str, Any] | None = None, *, whole: bool = True
) -> dict[str, Any]:
    """`read_values` for a file that is parsed already.

    Args:
        tree: sections as they stand in a rig.toml.
        path: for messages, and to find the files that it names.
        keep: fields of a rig whose contents of files serve where these name the same files.
        whole: whether it is a whole rig, and not what several motors have in common.

    Raises:
        ParameterError: see `read_values`.
        LogError: likewise.
    """
    if motors.has_several(tree):
        return _values_of_motors(tree, path, keep or {})
    file = checked_file(tree, path)
    if whole:
        refuse_switched_off(file, path)
    kept = keep or {}
    values: dict[str, Any] = {name: _part(file, name) for name in PARTS}
    drive = drive_part(file.drive.family)
    values["drive"] = value_of(drive.kind, file.drive.model_dump(), drive.default)
    flat: tuple[tuple[str, Any], ...] = (("bench", Clock), ("scenario", Scenario), ("control", Control))
    for title, kind in flat:
        values |= value_of(kind, getattr(file, title).model_dump())._asdict()
    values["gains"] = Gains(file.control.gains)
    values["width"] = file.cable.width
    values["cable"] = _cable(file.cable, path, kept.get("cable"))
    values["plant"] = _plant(file.cable, path, kept.get("plant"))
    values["reference"] = _reference(file.reference, path, kept.get("reference"))
    bend = file.scenario.bend
    values["bend"] = value_of(BENDS[bend.kind].kind, bend.model_dump())
    values["emg"] = _emg(values["emg"], path, kept.get("emg"))
    if resolve("control.user_law:is_file")(values["law"]):
        values["law"] = resolve("control.law_file:LawFile").again(values["law"], path.parent, kept.get("law"))
    return values | {"origin": str(path)}


def _values_of_motors(tree: Mapping[str, Any], path: Path, keep: Mapping[str, Any]) -> dict[str, Any]:
    """The common values, and among them those of each motor with its name and its joint's."""
    common, each, independent = motors.split(tree, str(path))
    known = {one.name: one.rig.fields for one in keep.get("motors", ())}
    found = []
    for name, whole, joint in each:
        with error_context(f"motor {quoted(name)}"):
            found.append((name, values_of(whole, path, known.get(name)), joint))
    joints = _joints(tree, path)
    return values_of(common, path, keep, whole=False) | {
        "motors": tuple(found),
        "independent": independent,
        "joints": joints,
    }


class _JointFile(Section):
    """The one section of a rig.toml that speaks of several motors."""

    joint: JOINT.section  # type: ignore[name-defined]


def _joints(tree: Mapping[str, Any], path: Path) -> tuple[JointSettings, ...]:
    """What [[joint]], or [joint] of one, says."""
    given, found = tree.get(motors.JOINT, []), []
    for one in given if isinstance(given, list) else [given]:
        try:
            section = _JointFile.model_validate({motors.JOINT: one}).joint
        except ValidationError as error:
            raise explained(error, path, _JointFile) from None
        found.append(value_of(JointSettings, section.model_dump(), JOINT.default))
    return tuple(found)


def _part(file: Any, name: str) -> Any:
    side = name.removesuffix("_encoder")
    section = getattr(file, name) if side == name else getattr(file.encoder, side)
    listed = any(isinstance(one, list) for one in vars(section).values())  # which nothing is kept by
    return (_value.__wrapped__ if listed else _value)(name, section)


@lru_cache(512)
def _value(name: str, section: Section) -> Any:
    """The value of a section; in a study most are those of the run before."""
    return value_of(PARTS[name].kind, section.model_dump(), PARTS[name].default)


def _cable(section: Any, path: Path, before: Any) -> Any:
    """The cable, by hand or from the file of its model."""
    if section.model is None:
        return value_of(BoucWen, section.model_dump())
    counting = value_of(Counting, section.model_dump())
    return resolve("plants.identified:named")(
        section.model, section.model_hash, counting, section.parameters, path, before
    )


def _plant(section: Any, path: Path, before: Any) -> Any:
    if section.plant is None:
        return None
    with error_context(f"{path}: cable.plant"):
        found = resolve("plants.plant_file:PlantFile").again(section.plant, path.parent, before)
    with error_context(f"{path}: cable.parameters"):
        return found.with_parameters(section.parameters)


def _reference(section: Any, path: Path, before: Any) -> Trajectory:
    part = REFERENCES[section.kind]
    with error_context(f"{path}: reference"):
        said: Any = value_of(part.kind, section.model_dump())
        if not isinstance(said, RecordedFile):
            found: Trajectory = before if said == before else said
            return found
        if isinstance(before, RecordedMotion) and before.said == said:
            return before
        return resolve("control.motion_file:read_motion")(said, path.parent)


def _emg(given: EmgSettings, path: Path, before: Any) -> EmgSettings:
    if isinstance(before, EmgSettings) and (before.source, before.wearer) == (given.source, given.wearer):
        return given._replace(levels=before.levels, place=before.place, recording=before.recording)
    return found_emg(given, path.parent)


def tree_of(values: Mapping[str, Any], *, of_process: bool = False) -> dict[str, Any]:
    """The fields of a rig as nested dictionaries: section → key → value, in the file's units.

    Args:
        values: the fields.
        of_process: whether numbers that a file has no key for are left out; else they are refused.

    Raises:
        ParameterError: a reference, law or value that a file has no words for.
    """
    found: dict[str, Any] = {name: {} for name in RigFile.model_fields}
    for name, part in PARTS.items():
        section, *side = TITLES.get(name, (name,))
        if not of_process:
            _refuse_unnamed(values[name], part.default, name)
        target = found[section].setdefault(side[0], {}) if side else found[section]
        target |= section_tree(values[name])
    found["drive"] = section_tree(values["drive"])
    for title, kind in (("bench", Clock), ("scenario", Scenario)):
        for one in declared(kind):
            if values[one.name] is not None:
                found[title][one.quantity.named(one.name)] = in_file(values[one.name], one.quantity)
    found["scenario"]["bend"] = _tagged(values["bend"], BENDS)
    found["reference"] = _tagged(values["reference"], REFERENCES)
    cable = values["cable"]
    if values["plant"] is not None:
        plant = resolve("plants.plant_file:as_file")(values["plant"])
        found["cable"] = {"plant": plant.name} | _parameters(plant)
    elif not isinstance(cable, BoucWen):
        found["cable"] = (
            {"model": cable.file or MODEL_FILE, "model_hash": cable.digest} | _counting(cable) | _parameters(cable)
        )
    else:
        found["cable"] = section_tree(cable) | {"width": values["width"]}
    found["control"] = _control(values)
    return found


def unnamed(value: Any, default: Any) -> Iterator[tuple[str, float]]:
    """Name and value of each number without a key in a file that differs from the default's."""
    named = {item.path[0] for item in items_of(type(value))}
    for field, given in value._asdict().items():
        if field not in named and isinstance(given, float) and given != getattr(default, field):
            yield field, given


def _refuse_unnamed(value: Any, default: Any, name: str) -> None:
    for field, given in unnamed(value, default):
        raise ParameterError(
            f"{name}.{field} is {given:g}, which has no key in rig.toml",
            expected=f"{getattr(default, field):g}, as it is without a file",
            do="pass the rig on with pack()",
        )


def _tagged(value: Any, kinds: Mapping[str, Any]) -> dict[str, Any]:
    """A section that may be one of several kinds."""
    value = value.said if isinstance(value, RecordedMotion) else value
    return {"kind": kind_of(value, kinds)} | section_tree(value)


def kind_of(value: Any, kinds: Mapping[str, Any]) -> str:
    """Name of a value's kind.

    Raises:
        ParameterError: a rig.toml has none for it.
    """
    for tag, part in kinds.items():
        if type(value) is part.kind:
            return tag
    raise ParameterError(
        f"a rig.toml cannot express {article(type(value).__name__)}",
        expected=f"one of {', '.join(part.kind.__name__ for part in kinds.values())}",
    )


def _counting(cable: Any) -> dict[str, Any]:
    """The keys that say how the rig counts a log's angles; none where it counts as the log does."""
    given, default = section_tree(cable.counting), section_tree(Counting())
    return {key: value for key, value in given.items() if value != default[key]}


def _parameters(given: Any) -> dict[str, Any]:
    return {"parameters": dict(given.changed)} if given.changed else {}


def _control(values: Mapping[str, Any]) -> dict[str, Any]:
    law, differing = resolve("control.law_file:packable")(values["law"])
    own = differing | dict(values["gains"])
    name = law if isinstance(law, str) else law.name
    preset = {} if values["preset"] is None else {"preset": values["preset"]}
    return {"law": name} | preset | ({"gains": own} if own else {})


def of_rig(rig: Any) -> dict[str, Any]:
    """A rig as the sections of a rig.toml; of several motors what is common, and each with its own.

    Raises:
        ParameterError: see `tree_of`.
    """
    if not rig.motors:
        return tree_of(rig.fields)
    return of_motors(rig, [motors.MotorTree(name, of_rig(one), joint) for name, one, joint in rig.motors])


def of_motors(rig: Any, trees: Sequence[motors.MotorTree]) -> dict[str, Any]:
    """The sections of a rig with several motors, of those of each."""
    joints = {motors.JOINT: [section_tree(one) for one in rig.joints]} if rig.joints else {}
    return ({motors.INDEPENDENT: True} if rig.independent else {}) | motors.shared(trees) | joints


def written(tree: Mapping[str, Any]) -> str:
    """The text of sections, as TOML."""
    return tomlkit.dumps({name: value for name, value in tree.items() if value != {}})
