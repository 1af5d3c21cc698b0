"""A rig as the sections of a rig.toml, both ways: its fields from them, and they from its fields."""

from collections.abc import Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import tomlkit
from pydantic import ValidationError

from bowden.control import Law, user_law
from bowden.control.law_file import LawFile, packable
from bowden.control.recorded_motion import RecordedFile, RecordedMotion, read_motion
from bowden.control.reference import Trajectory
from bowden.core.errors import ParameterError, article, error_context
from bowden.core.quantity import declared
from bowden.core.toml_text import quoted
from bowden.models.cable.bouc_wen import BoucWen
from bowden.plants.counting import Counting
from bowden.plants.identified import IdentifiedCable, cable_text, load_cable
from bowden.plants.plant_file import PlantFile, as_file
from bowden.rig import emg_setup, motors
from bowden.rig.checked import Gains
from bowden.rig.config import checked_file, explained, read_toml
from bowden.rig.declaration import Section, in_file, items_of, value_of
from bowden.rig.declaration import tree_of as section_tree
from bowden.rig.effect import refuse_switched_off
from bowden.rig.joints import JointSettings
from bowden.rig.sections import (
    BENDS,
    JOINT,
    MODEL_FILE,
    PARTS,
    REFERENCES,
    TITLES,
    Clock,
    Control,
    RigFile,
    Scenario,
    drive_part,
)
from bowden.rig.settings import EmgSettings
from bowden.sensing import wearer_file


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
    if user_law.is_file(values["law"]):
        before = kept.get("law")
        same = isinstance(before, LawFile) and before.name == values["law"]
        values["law"] = before if same else LawFile.found(values["law"], path.parent)
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
    return _value(name, section)


@lru_cache(512)
def _value(name: str, section: Section) -> Any:
    """The value of a section; in a study most are those of the run before."""
    return value_of(PARTS[name].kind, section.model_dump(), PARTS[name].default)


def _cable(section: Any, path: Path, before: Any) -> BoucWen | IdentifiedCable:
    if section.model is None:
        return value_of(BoucWen, section.model_dump())
    counting = value_of(Counting, section.model_dump())
    same = isinstance(before, IdentifiedCable) and (before.file or MODEL_FILE) == section.model
    same = same and before.counting == counting and section.model_hash in (None, before.digest)
    if same and before.changed.keys() <= section.parameters.keys():
        found: IdentifiedCable = before
    else:
        with error_context(f"{path}: cable.model"):
            found = load_cable(path.parent / section.model, section.model).counted(counting)
        if section.model_hash not in (None, found.digest):
            raise ParameterError(
                f"{path}: {section.model} is not the model that this rig was made from, it has been written again",
                expected=f"the model {section.model_hash}, not {found.digest}",
                do=f"make a new rig: bowden init NEW.toml --model {path.parent / section.model}; or, if reference, "
                f'limits and law suit the new model too, write model_hash = "{found.digest}"',
            )
    with error_context(f"{path}: cable.parameters"):
        return found.with_parameters(section.parameters)


def _plant(section: Any, path: Path, before: Any) -> PlantFile | None:
    name = section.plant
    if name is None:
        return None
    if isinstance(before, PlantFile) and before.name == name:
        found = before
    else:
        with error_context(f"{path}: cable.plant"):
            found = PlantFile.found(name, path.parent)
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
        return read_motion(said, path.parent)


def _emg(given: EmgSettings, path: Path, before: Any) -> EmgSettings:
    if isinstance(before, EmgSettings) and (before.source, before.wearer) == (given.source, given.wearer):
        return given._replace(levels=before.levels, place=before.place, recording=before.recording)
    return emg_setup.found(given, path.parent)


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
        plant = as_file(values["plant"])
        found["cable"] = {"plant": plant.name} | _parameters(plant)
    elif isinstance(cable, IdentifiedCable):
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
    if isinstance(value, RecordedMotion):
        value = value.said
    for tag, part in kinds.items():
        if type(value) is part.kind:
            return {"kind": tag} | section_tree(value)
    raise ParameterError(
        f"a rig.toml cannot express {article(type(value).__name__)}",
        expected=f"one of {', '.join(part.kind.__name__ for part in kinds.values())}",
    )


def _counting(cable: IdentifiedCable) -> dict[str, Any]:
    """The keys that say how the rig counts a log's angles; none where it counts as the log does."""
    given, default = section_tree(cable.counting), section_tree(Counting())
    return {key: value for key, value in given.items() if value != default[key]}


def _parameters(given: PlantFile | IdentifiedCable) -> dict[str, Any]:
    return {"parameters": dict(given.changed)} if given.changed else {}


def _control(values: Mapping[str, Any]) -> dict[str, Any]:
    law, own = values["law"], dict(values["gains"])
    if isinstance(law, Law):
        law, differing = packable(law)
        own = differing | own
    name = law.name if isinstance(law, LawFile) else law
    preset = {} if values["preset"] is None else {"preset": values["preset"]}
    return {"law": name} | preset | ({"gains": own} if own else {})


def files_of(values: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, bytes]]:
    """The sections of a rig, with the names of files that lie beside it, and what stands in these.

    A recording of EMG is not among them: it stays where it is.

    Raises:
        ParameterError: see `tree_of`; or two of the files have one name.
    """
    tree, files = tree_of(values), Files()
    add = files.add
    cable, reference, law, emg = (values[name] for name in ("cable", "reference", "law", "emg"))
    if values["plant"] is not None:
        plant = as_file(values["plant"])
        name = Path(plant.path).name
        tree["cable"] |= {"plant": name + plant.name.rpartition(".py")[2]}
        for file, source in ((name, plant.source), *((one.file, one.source) for one in plant.modules)):
            add(file, source)
    elif isinstance(cable, IdentifiedCable):
        tree["cable"] = {"model": Path(tree["cable"]["model"]).name}
        add(tree["cable"]["model"], cable_text(cable).encode())
    if isinstance(reference, RecordedMotion):
        name = f"{Path(reference.said.file).name.partition('.')[0]}.csv"
        columns = {"time_column": "time_s", "position_column": "joint_rad", "unit": "rad"}
        tree["reference"] |= {"file": name} | columns
        pairs = zip(reference.time.tolist(), reference.position.tolist(), strict=True)
        add(name, "\n".join(["time_s,joint_rad", *(f"{t!r},{x!r}" for t, x in pairs), ""]).encode())
    if isinstance(law, Law):
        law, _ = packable(law)
    if isinstance(law, LawFile):
        name = Path(law.path).name
        tree["control"]["law"] = name + law.name.rpartition(".py")[2]
        for file, source in ((name, law.source), *((one.file, one.source) for one in law.modules)):
            add(file, source)
    if emg.levels is not None:
        tree["emg"]["wearer"] = Path(emg.wearer or "wearer.toml").name
        add(tree["emg"]["wearer"], wearer_file.text_of(emg.levels).encode())
    if emg.place:
        kind, _, place = emg.place.partition(":")
        tree["emg"]["source"] = f"{kind}:{Path(place).absolute()}"
    return tree, files.contents


class Files:
    """Files that lie beside a rig.toml."""

    def __init__(self) -> None:
        self.contents: dict[str, bytes] = {}
        """Name → what is in it."""

    def add(self, name: str, content: bytes) -> None:
        """Add one.

        Raises:
            ParameterError: another file has its name.
        """
        if self.contents.setdefault(name, content) != content:
            raise ParameterError(
                f"two files of the rig have the name {name}",
                expected="files of different names",
                do="rename one, or pass the rig on with pack()",
            )


def written(tree: Mapping[str, Any]) -> str:
    """The text of sections, as TOML."""
    return tomlkit.dumps({name: value for name, value in tree.items() if value != {}})
