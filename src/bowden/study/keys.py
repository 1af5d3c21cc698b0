"""Keys of rig.toml by their dotted names: which of them are numbers that a simulation feels, and how to set them."""

import difflib
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from pydantic import BaseModel

from bowden.plants.cable_parameters import meaning
from bowden.plants.identified import IdentifiedCable
from bowden.plants.plant_file import PlantFile
from bowden.rig.effect import SWITCHES, idle
from bowden.rig.rig import Rig
from bowden.rig.sections import RigFile

LIVE = ("drive", "limits", "live", "emg")
"""Sections that a study does not look at."""
_GAINS = "control.gains."
_OWN = ("scenario.duration_s", "scenario.seed")
"""What a study says itself."""


def numeric_keys(tree: Mapping[str, Any]) -> dict[str, str]:
    """Dotted key → unit, of every number in a rig that a simulation depends on; numbers of a list by their place.

    Args:
        tree: the rig's sections (`Rig.tree`).
    """
    file: Any = RigFile.model_validate(tree)
    found: dict[str, str] = {}
    for name, section in file:
        if name not in LIVE:
            found |= dict(_numbers(name, section))
    if file.cable.model is not None or file.cable.plant is not None:
        found = {name: unit for name, unit in found.items() if not name.startswith("cable.")}
    return {name: unit for name, unit in found.items() if name not in _OWN}


def plant_keys(rig: Rig) -> dict[str, str]:
    """Dotted key → unit of what may be changed of a rig's own plant, in the units of its file, or of its cable's model.

    None where it has neither, or where a suit is worn that does not take the model.
    """
    if isinstance(rig.plant, PlantFile):
        return {f"cable.parameters.{name}": "–" for name in rig.plant.parameters}
    cable = rig.cable
    if rig.plant is not None or not isinstance(cable, IdentifiedCable):
        return {}
    if rig.suit.worn and rig.suit.cable != "play" and (rig.suit.cable, cable.simulated) != ("bouc_wen", "bouc_wen"):
        return {}
    units = {f"cable.parameters.{name}": meaning(name)[0] for name in cable.parameters}
    return {name: "–" if unit == "1" else unit for name, unit in units.items()}


def _numbers(path: str, section: Any) -> Iterator[tuple[str, str]]:
    for name, field in type(section).model_fields.items():
        key, value = f"{path}.{name}", getattr(section, name)
        extra = field.json_schema_extra if isinstance(field.json_schema_extra, dict) else {}
        unit = str(extra.get("unit", "–"))
        if isinstance(value, BaseModel):
            yield from _numbers(key, value)
        elif isinstance(value, list):
            yield from ((f"{key}.{i}", unit) for i, one in enumerate(value) if _is_number(one))
        elif _is_number(value) or (value is None and "float" in str(field.annotation)):
            yield key, unit


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def simulated(rig: Rig) -> dict[str, Any]:
    """The sections of a rig as its file would give them, without those that a study does not look at."""
    return {name: section for name, section in rig.tree().items() if name not in LIVE}


def with_values(tree: dict[str, Any], values: Iterable[tuple[str, Any]]) -> dict[str, Any]:
    """Nested dictionaries and lists with values at dotted keys, sections that are not there being made.

    What is given stays as it is; what does not change is shared with it.

    Raises:
        KeyError: something that is no section stands in the way of a key, or a list has no such place.
    """
    changed = dict(tree)
    for key, value in values:
        *path, last = _parts(key)
        here: Any = changed
        for part in path:
            place = _place(here, part, key)
            inner = here.get(place, {}) if isinstance(here, dict) else here[place]
            here[place] = list(inner) if isinstance(inner, list) else dict(inner) if isinstance(inner, dict) else inner
            here = here[place]
        here[_place(here, last, key)] = value
    return changed


def _parts(key: str) -> list[str]:
    """The sections of a dotted key and its last part; a gain of a law's nested part has a dot itself."""
    return ["control", "gains", key.removeprefix(_GAINS)] if key.startswith(_GAINS) else key.split(".")


def _place(here: Any, part: str, key: str) -> Any:
    if isinstance(here, dict):
        return part
    if isinstance(here, list) and part.isdigit() and int(part) < len(here):
        return int(part)
    raise KeyError(key)


def nearest(key: str, known: Iterable[str]) -> str:
    """The known keys that look most like one that is not, for a message.

    >>> nearest("servo.frequency", ["servo.natural_frequency_hz", "servo.damping"])
    'servo.natural_frequency_hz (did you mean this?)'
    """
    names = list(known)
    last = key.rpartition(".")[2]
    alike = difflib.get_close_matches(key, names, 3, 0.5) or [
        name for name in names if difflib.SequenceMatcher(None, last, name.rpartition(".")[2]).ratio() > 0.5
    ]
    return f"{alike[0]} (did you mean this?)" if alike else "a numeric key of rig.toml (docs/rig.md)"


def missing_for(key: str, rig: Rig) -> str | None:
    """What the rig would need for a simulation to feel one of its numeric keys; None where it does feel it.

    >>> from bowden.rig.rig import Rig
    >>> missing_for("wearer.share", Rig()), missing_for("cable.slope", Rig())
    ('suit.worn = true', None)
    """
    section = key.partition(".")[0]
    if section in ("suit", "wearer") and not rig.suit.worn:
        return SWITCHES[section][3]
    if section == "admittance" and not rig.admittance.enabled:
        return SWITCHES[section][3]
    if section == "brake" and not rig.brake.enabled:
        return SWITCHES[section][3]
    return next((f"another rig: {one.why}" for one in idle(rig) if one.key == key), None)
