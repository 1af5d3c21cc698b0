"""Reading rig.toml: every mistake becomes one line that names the key, its section and what to write instead."""

import itertools
import tomllib
from pathlib import Path
from typing import Any, get_args

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from bowden.core.errors import ParameterError, near
from bowden.rig import schema as schema
from bowden.rig.schema import BENDS, REFERENCES, Rig


def read_rig(path: Path) -> Rig:
    """The rig that a file describes; what the file leaves out is as on the paper's bench.

    Raises:
        ParameterError: no such file, not TOML, an unknown key, a value of the wrong kind or out of its range.
    """
    try:
        rig = Rig.model_validate(read_toml(path))
    except ValidationError as error:
        raise explained(error, path) from error
    given = sorted(rig.cable.model_fields_set - {"model"})
    if rig.cable.model is not None and given:
        raise ParameterError(
            f"{path}: [cable] has a model and its own {', '.join(given)}", expected="one or the other", do="delete one"
        )
    if rig.cable.slope == 0.0:
        raise ParameterError(f"{path}: cable.slope is 0", expected="a number above or below 0", do=_CORRECT)
    check_points(rig, path)
    return rig


def check_points(rig: Rig, path: Path) -> None:
    """Refuse lists, and ends of a range, that do not fit one another.

    Raises:
        ParameterError: some of these.
    """
    reference, bend = rig.reference, rig.scenario.bend
    if isinstance(reference, schema.PointToPointSection):
        _check_course(path, "reference", "positions_deg", reference.times_s, reference.positions_deg)
    if isinstance(bend, schema.ScriptedBendSection):
        _check_course(path, "scenario.bend", "bends_deg", bend.times_s, bend.bends_deg)
    if isinstance(reference, schema.MultisineSection):
        names = ("frequencies_hz", "amplitudes_deg", "phases_deg")
        lengths = [len(getattr(reference, name)) for name in names]
        if len(set(lengths)) > 1:
            given = ", ".join(f"{name} has {n}" for name, n in zip(names, lengths, strict=True))
            raise ParameterError(
                f"{path}: reference (multisine): {given} numbers",
                expected="as many in each",
                do="give all three in [reference]; one left out is as bowden init writes it",
            )
    if isinstance(bend, schema.RandomBendSection) and not bend.low_deg < bend.high_deg:
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
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        do = do if isinstance(error, FileNotFoundError) else "give the path of a TOML file"
        raise ParameterError(f"cannot read {path}: {(error.strerror or str(error)).lower()}", do=do) from error
    except UnicodeDecodeError as error:
        raise ParameterError(f"{path} is not text", expected="a TOML file in UTF-8", do="save it as that") from error
    except ValueError as error:  # also a null byte in the path
        raise ParameterError(f"{path} is not TOML: {error}", do="correct it there") from error


_CORRECT = "correct it there"

_TYPES = {"float", "int", "str"}
_KINDS = {"reference": REFERENCES, "scenario.bend": BENDS}

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


def explained(error: ValidationError, path: Path, root: type[BaseModel] = Rig) -> ParameterError:
    """One line for the first thing that pydantic found wrong in a file whose keys are those of `root`."""
    return _explain(error.errors()[0], path, root)


def _explain(error: ErrorDetails, path: Path, root: type[BaseModel]) -> ParameterError:
    kind, context, location = error["type"], error.get("ctx", {}), error["loc"]
    if kind != "extra_forbidden" and location[-1] in _TYPES:  # which type was tried, of a value that may have several
        location = location[:-1]
    keys, section = _place(location, root)
    name, last = _dotted(keys), keys[-1]
    if kind == "extra_forbidden":
        where = f"key {last!r} in [{_dotted(keys[:-1])}]" if keys[1:] else f"key or section {last!r}"
        return ParameterError(
            f"{path}: unknown {where}", expected=near(last, section.model_fields), do="rename or delete it"
        )
    if kind == "union_tag_invalid":
        tag = str(context["tag"])
        return ParameterError(f"{path}: {name}.kind is {tag!r}", expected=near(tag, _KINDS[name]), do=_CORRECT)
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
