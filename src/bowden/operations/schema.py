"""`schema`: JSON schemas of what commands print with ``--json``, of rig.toml, of a study."""

from dataclasses import KW_ONLY, dataclass
from typing import Annotated, Any

from bowden.operations.support.operation import Operation, Switch, declared
from bowden.operations.support.results import Result, schema_of

_DRAFT = "https://json-schema.org/draft/2020-12/schema"


@dataclass(frozen=True)
class Schemas(Result["Schemas"]):
    """What there is a schema of."""

    schemas: dict[str, str]
    """What there is a schema of, and one line about it."""


@dataclass(frozen=True)
class JsonSchema(Result["JsonSchema"]):
    """One schema, which is printed as it is."""

    _: KW_ONLY
    schema: dict[str, Any]

    @property
    def whole_document(self) -> dict[str, Any]:
        """The schema."""
        return self.schema


def names() -> dict[str, str]:
    """What there is a schema of → one line about it."""
    files = {"rig": "rig.toml, as every command takes it.", "study": "A study for bowden campaign."}
    return files | {one.words: one.summary for one in declared().operations}


def json_schema(name: str) -> dict[str, Any]:
    """The JSON schema of that name, of the draft 2020-12.

    Raises:
        ParameterError: there is none of that name.
    """
    from bowden.core.errors import ParameterError

    if name in ("rig", "study"):
        return {"$schema": _DRAFT} | (_rig() if name == "rig" else _study())
    operations = {one.words: one for one in declared(name.partition(" ")[0]).operations}
    if name not in operations:
        raise ParameterError(f"there is no schema of {name!r}", expected="a name that bowden schema lists")
    return {"$schema": _DRAFT} | schema_of(operations[name])


def _rig() -> dict[str, Any]:
    """Of rig.toml, with the drives of every family."""
    from bowden.rig.families import names as families
    from bowden.rig.motors import FEWEST, INDEPENDENT, JOINT, MEANINGS, MOST, MOTOR
    from bowden.rig.sections import JOINT as JOINTS
    from bowden.rig.sections import RigFile, drive_part

    schema = RigFile.model_json_schema()
    one = schema["properties"][MOTOR]
    keys = RigFile.model_fields[MOTOR].annotation.model_json_schema()["properties"]  # type: ignore[union-attr]
    sections = {name: {"type": "object"} for name in RigFile.model_fields if name != MOTOR}
    several = {
        "description": MEANINGS[MOTOR],
        "type": "array",
        "minItems": FEWEST,
        "maxItems": MOST,
        "items": {
            "type": "object",
            "additionalProperties": False,
            "required": ["name"],
            "properties": {"name": {"type": "string"}, JOINT: {"type": "string"}, **keys, **sections},
        },
    }
    joint = JOINTS.section.model_json_schema()
    schema["properties"] |= {
        MOTOR: {"anyOf": [one, several]},
        JOINT: {"anyOf": [joint, {"type": "array", "items": joint}]},
        INDEPENDENT: {"description": MEANINGS[INDEPENDENT], "type": "boolean", "default": False},
    }
    drives = [drive_part(family).section for family in families()]
    schema["properties"]["drive"] = {"anyOf": [{"$ref": f"#/$defs/{section.__name__}"} for section in drives]}
    schema["$defs"] |= {section.__name__: section.model_json_schema() for section in drives}
    return schema


def _study() -> dict[str, Any]:
    """Of a study, with a plain number or word wherever a distribution may be."""
    from bowden.study.file import StudyFile

    return _shortened(StudyFile.model_json_schema())


def _shortened(schema: Any) -> Any:
    if isinstance(schema, list):
        return [_shortened(part) for part in schema]
    if not isinstance(schema, dict):
        return schema
    if schema.get("$ref") == "#/$defs/DistributionSection":
        return {"anyOf": [schema, {"type": ["number", "string"]}]}
    return {key: _shortened(part) for key, part in schema.items()}


def schema(words: Annotated[list[str] | None, Switch(metavar="[NAME]", place=True)] = None) -> Schemas | JsonSchema:
    """Print the JSON schema of rig.toml, or of what a command prints with --json.

    Without a name, list all.

    Args:
        words: a name from that list.

    Raises:
        ParameterError: there is no schema of that name.

    Examples:
        bowden schema
        bowden schema rig
        bowden schema log info
    """
    return JsonSchema(schema=json_schema(" ".join(words))) if words else Schemas(names())


OPERATIONS = (Operation("schema", schema, 75),)
