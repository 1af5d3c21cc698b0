"""Reading rig.toml: every mistake becomes one line that names the key, its section and what to write instead."""

import itertools
import math
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, get_args

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from bowden.core import bounded
from bowden.core.errors import ParameterError, near
from bowden.core.units import DEGREES
from bowden.plants.counting import Counting
from bowden.rig import motors
from bowden.rig.declaration import Section, items_of, value_of
from bowden.rig.families import names as families
from bowden.rig.sections import (
    BEND_KINDS,
    DEFAULT_FAMILY,
    REFERENCE_KINDS,
    RigFile,
    drive_part,
)


def one_motor(path: Path) -> ParameterError:
    """That a file has several motors, for whoever takes those of one motor alone."""
    return ParameterError(
        f"{path} has several motors", expected="the rig of one motor", do="write one without [[motor]] for this"
    )


def checked_file(tree: Mapping[str, Any], path: Path) -> Any:
    """What stands in a rig.toml, as pydantic's classes of `bowden.rig.sections`.

    Raises:
        ParameterError: an unknown key, a value of the wrong kind or out of its range, or some that do not fit.
    """
    if motors.has_several(tree):
        raise one_motor(path)
    control = tree.get("control")
    if isinstance(control, Mapping) and isinstance(control.get("gains"), Mapping):
        tree = {**tree, "control": {**control, "gains": dotted(control["gains"], f"{path}: control.gains")}}
    try:
        file: Any = RigFile.model_validate(tree)
    except ValidationError as error:
        raise explained(error, path, inner={"drive": _drive_section(tree)}) from None
    if file.cable.parameters and file.cable.plant is None and file.cable.model is None:
        raise ParameterError(
            f"{path}: [cable] has parameters and neither plant nor model",
            expected="a plant of your own, or the model of a cable",
            do="name it, or delete them",
        )
    of_model = {"model_hash", *(item.key for item in items_of(Counting))}
    if file.cable.model is None and (
        file.cable.model_hash or not value_of(Counting, file.cable.model_dump()).as_recorded
    ):
        unnamed = ", ".join(sorted(of_model & file.cable.model_fields_set))
        raise ParameterError(
            f"{path}: [cable] has {unnamed}, and names no model",
            expected="the model of a cable",
            do="name it, or delete them",
        )
    for name in ("model", "plant"):
        given = sorted(file.cable.model_fields_set - {name, "parameters"} - of_model)
        if getattr(file.cable, name) is not None and given:
            raise ParameterError(
                f"{path}: [cable] has a {name} and its own {', '.join(given)}",
                expected="one or the other",
                do="delete one",
            )
    if file.cable.slope == 0.0:
        raise ParameterError(f"{path}: cable.slope is 0", expected="a number above or below 0", do=_CORRECT)
    check_points(file, path)
    return file


def dotted(
    section: Mapping[str, Any], where: str, is_section: Callable[[Mapping[str, Any]], bool] = lambda table: True
) -> dict[str, Any]:
    """A section with all its keys dotted; one without quotation marks, ``servo.damping``, is a table to TOML.

    Args:
        section: as TOML has it.
        where: it stands, for messages.
        is_section: whether a table in it is a section too, and not a value.

    Raises:
        ParameterError: a key that is there twice.
    """
    found: dict[str, Any] = {}
    for key, value in section.items():
        parts = {key: value}
        if isinstance(value, Mapping) and value and is_section(value):
            parts = dotted({f"{key}.{name}": one for name, one in value.items()}, where, is_section)
        if twice := found.keys() & parts.keys():
            raise ParameterError(f"{where} has {min(twice)!r} twice", expected="one value for each", do=_CORRECT)
        found |= parts
    return found


def check_points(file: Any, path: Path) -> None:
    """Refuse lists, and ends of a range, that do not fit one another.

    Raises:
        ParameterError: some of these.
    """
    reference, bend = file.reference, file.scenario.bend
    if reference.kind == "periodic_minimum_jerk" and reference.low_deg > reference.high_deg:
        high = reference.high_deg
        meant = f"; radians? {high:g} rad would be {high * DEGREES:.3g}°" if 0.0 < high <= math.pi else ""
        raise ParameterError(
            f"{path}: reference.low_deg is {reference.low_deg:g} and high_deg {high:g}{meant}",
            expected="low_deg below high_deg",
            do=_CORRECT,
        )
    if reference.kind == "point_to_point":
        _check_course(path, "reference", "positions_deg", reference.times_s, reference.positions_deg)
    if bend.kind == "scripted":
        _check_course(path, "scenario.bend", "bends_deg", bend.times_s, bend.bends_deg)
    if reference.kind == "multisine":
        names = ("frequencies_hz", "amplitudes_deg", "phases_deg")
        lengths = [len(getattr(reference, name)) for name in names]
        if len(set(lengths)) > 1:
            given = ", ".join(f"{name} has {n}" for name, n in zip(names, lengths, strict=True))
            raise ParameterError(
                f"{path}: reference (multisine): {given} numbers",
                expected="as many in each",
                do="give all three in [reference]; one left out is as bowden init writes it",
            )
    if bend.kind == "random" and not bend.low_deg < bend.high_deg:
        raise ParameterError(
            f"{path}: scenario.bend.low_deg is {bend.low_deg:g} and high_deg {bend.high_deg:g}",
            expected="low_deg below high_deg",
            do=_CORRECT,
        )


def _check_course(path: Path, section: str, name: str, times: list[float], values: list[float]) -> None:
    """Refuse way points without one value for each time, fewer than two, or times that do not increase."""
    rising = all(a < b for a, b in itertools.pairwise(times))
    if len(times) != len(values) or len(times) < 2 or not rising:
        raise ParameterError(
            f"{path}: {section}.times_s is {_as_written(times)} and {section}.{name} {_as_written(values)}",
            expected="two lists of one length (two points or more), times_s increasing",
            do=f"correct them in [{section}]",
        )


def read_toml(path: Path, do: str = "write one with: bowden init") -> dict[str, Any]:
    """A TOML file as it stands; `do` is what to do where there is none.

    Raises:
        ParameterError: no such file, or not TOML.
    """
    try:
        return bounded.read_toml(path)
    except OSError as error:
        do = do if isinstance(error, FileNotFoundError) else "give the path of a TOML file"
        raise ParameterError(f"cannot read {path}: {bounded.reason(error)}", do=do) from None
    except UnicodeDecodeError:
        raise ParameterError(f"{path} is not text", expected="a TOML file in UTF-8", do="save it as that") from None
    except ValueError as error:  # also a null byte in the path
        if said := _twice(path, str(error)):
            raise ParameterError(f"{path}: {said}", do=_ONCE) from None
        raise ParameterError(f"{path} is not TOML: {error}", do=_CORRECT) from None


def _twice(path: Path, error: str) -> str:
    """What is written a second time, and where, by what tomllib says of it; empty where that is another thing."""
    found = re.match(r"Cannot (?:overwrite|declare|redefine|mutate).*\(at (?:line (\d+)|end of document)", error)
    if found is None:
        return ""
    lines = bounded.read_text(path).rstrip().splitlines()
    number = int(found[1] or len(lines))
    line = lines[number - 1]
    return f"line {number} writes {line.partition('=')[0].partition('#')[0].strip()} a second time"


_ONCE = (
    "delete one of the two; a section stands once, and of several motors the keys of [motor] stand below the first "
    "[[motor]]"
)


_CORRECT = "correct it there"

_TYPES = {"float", "int", "str"}
_KINDS = {"reference": REFERENCE_KINDS, "scenario.bend": BEND_KINDS}

_WANTED = {
    "greater_than": "a number above {gt:g}",
    "greater_than_equal": "a number not below {ge:g}",
    "less_than": "a number below {lt:g}",
    "less_than_equal": "a number not above {le:g}",
    "literal_error": "{expected}",
    "float_type": "a number",
    "int_type": "a whole number",
    "bool_type": "true or false",
    "finite_number": "a finite number",
    "string_type": "text in quotation marks",
    "list_type": "a list in square brackets",
    "dict_type": "a section",
    "model_type": "a section",
    "model_attributes_type": "a section",
    "too_short": "at least {min_length} in the list",
}
"""Kind of pydantic's error → what would have been right."""


def explained(
    error: ValidationError,
    path: Path,
    root: type[BaseModel] = RigFile,
    inner: Mapping[str, type[BaseModel]] = MappingProxyType({}),
) -> ParameterError:
    """One line for the first thing that pydantic found wrong in a file whose keys are those of `root`.

    Args:
        error: pydantic's.
        path: of the file.
        root: the file's class.
        inner: sections whose class is another one than the file's class says.
    """
    return _explain(error.errors()[0], path, root, inner)


def _drive_section(tree: Mapping[str, Any]) -> type[Section]:
    """The class of [drive], of the family that it names if there is one."""
    given = tree.get("drive")
    family = given.get("family", DEFAULT_FAMILY) if isinstance(given, Mapping) else DEFAULT_FAMILY
    try:
        return drive_part(family).section
    except (ParameterError, TypeError):
        return drive_part(DEFAULT_FAMILY).section


def _explain(
    error: ErrorDetails, path: Path, root: type[BaseModel], inner: Mapping[str, type[BaseModel]]
) -> ParameterError:
    kind, context, location = error["type"], error.get("ctx", {}), error["loc"]
    if kind != "extra_forbidden" and location[-1] in _TYPES:  # which type was tried, of a value that may have several
        location = location[:-1]
    keys, section = _place(location, root)
    section = inner.get(keys[0], section)
    name, last = _dotted(keys), keys[-1]
    if kind == "extra_forbidden" and keys in (["best"], ["models"]):
        return ParameterError(
            f"{path} is the model of a cable, not a rig",
            expected="a rig.toml",
            do=f"make one round it: bowden init --model {path}",
        )
    if kind == "extra_forbidden":
        where = f"key {last!r} in [{_dotted(keys[:-1])}]" if keys[1:] else f"key or section {last!r}"
        return ParameterError(
            f"{path}: unknown {where}", expected=near(last, section.model_fields), do="rename or delete it"
        )
    if kind == "union_tag_invalid":
        tag = str(context["tag"])
        return ParameterError(f"{path}: {name}.kind is {tag!r}", expected=near(tag, _KINDS[name]), do=_CORRECT)
    if kind == "drive_family":
        family = str(context["family"])
        return ParameterError(f"{path}: drive.family is {family!r}", expected=near(family, families()), do=_CORRECT)
    if kind == "union_tag_not_found":
        return ParameterError(f"{path}: {name}.kind is missing", expected=near("", _KINDS[name]), do="add it")
    if kind == "missing":
        return ParameterError(f"{path}: {name} is missing", do="add it")
    wanted = _WANTED.get(kind, error["msg"]).format(**context)
    return ParameterError(f"{path}: {name} is {_as_written(error['input'])}", expected=wanted, do=_CORRECT)


def _dotted(keys: list[str]) -> str:
    """Keys as TOML has them: one with a dot in it stands in quotation marks."""
    return ".".join(f'"{key}"' if "." in key else key for key in keys)


def _place(location: tuple[int | str, ...], root: type[BaseModel]) -> tuple[list[str], type[BaseModel]]:
    """Where an error is, as the keys of the file, and the class of the section that it is in.

    In pydantic's location the kind of a reference or a bend stands between the keys.
    """
    keys: list[str] = []
    section = root
    for key in map(str, location):
        if (kinds := _KINDS.get(".".join(keys), {})) and key in kinds:
            section = kinds[key]
            continue
        field = section.model_fields.get(keys[-1]) if keys else None
        inner = _section_in(field.annotation) if field is not None else None
        section = inner or section
        keys.append(key)
    return keys, section


def _section_in(annotation: Any) -> type[BaseModel] | None:
    """The section that a key may hold: itself, or one that may be left out."""
    kinds = [kind for kind in (annotation, *get_args(annotation)) if isinstance(kind, type)]
    return next((kind for kind in kinds if issubclass(kind, BaseModel)), None)


def _as_written(value: Any) -> str:
    """A value as it would stand in the file, cut short."""
    text = str(value).lower() if isinstance(value, bool) else repr(value)
    return text if len(text) <= 40 else text[:37] + "..."
