"""A rig as the sections of a rig.toml, and their text."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from bowden.control import Law
from bowden.control.law_file import LawFile, packable
from bowden.control.recorded_motion import RecordedMotion
from bowden.core.errors import ParameterError, article
from bowden.core.quantity import declared
from bowden.core.toml_text import key_of, quoted
from bowden.plants.counting import Counting
from bowden.plants.identified import IdentifiedCable
from bowden.plants.model_file import cable_text
from bowden.plants.plant_file import PlantFile, as_file
from bowden.rig.declaration import in_file, items_of
from bowden.rig.declaration import tree_of as section_tree
from bowden.rig.sections import BENDS, MODEL_FILE, PARTS, REFERENCES, TITLES, Clock, RigFile, Scenario
from bowden.sensing import wearer_file


def tree_of(values: Mapping[str, Any]) -> dict[str, Any]:
    """The fields of a rig as nested dictionaries: section → key → value, in the file's units.

    Raises:
        ParameterError: a reference, law or value that a file has no words for.
    """
    found: dict[str, Any] = {name: {} for name in RigFile.model_fields}
    for name, part in PARTS.items():
        section, *side = TITLES.get(name, (name,))
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


def _refuse_unnamed(value: Any, default: Any, name: str) -> None:
    """Refuse numbers without a key in a file that differ from the default's, since a file could not say them."""
    named = {item.path[0] for item in items_of(type(value))}
    for field, given in value._asdict().items():
        if field not in named and isinstance(given, float) and given != getattr(default, field):
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
    """The text of nested dictionaries and lists of them, as TOML."""
    return "\n\n".join(_sections(tree, "")) + "\n"


def _sections(tree: Mapping[str, Any], title: str, brackets: str = "[{}]") -> Iterator[str]:
    several = {key: value for key, value in tree.items() if isinstance(value, list) and _of_sections(value)}
    plain = {key: value for key, value in tree.items() if not isinstance(value, Mapping) and key not in several}
    if plain:
        lines = [brackets.format(title)] if title else []
        yield "\n".join([*lines, *(f"{key_of(key)} = {_value(value)}" for key, value in plain.items())])
    for key, value in tree.items():
        if isinstance(value, Mapping) and value:
            yield from _sections(value, f"{title}.{key}".strip("."))
    for key, values in several.items():
        for value in values:
            yield from _sections(value, f"{title}.{key}".strip("."), "[[{}]]")


def _of_sections(values: list[Any]) -> bool:
    return bool(values) and all(isinstance(one, Mapping) for one in values)


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str | Path):
        return quoted(str(value))
    if isinstance(value, list):
        return f"[{', '.join(map(_value, value))}]"
    return repr(value)
