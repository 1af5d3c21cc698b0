"""``bowden schema``: JSON schemas of what commands print with ``--json``, of rig.toml, of a study."""

from typing import Annotated, Any

import typer

from bowden.app.command import Command, found
from bowden.app.console import print_json, seconds
from bowden.core.errors import ParameterError

_DRAFT = "https://json-schema.org/draft/2020-12/schema"


def names() -> dict[str, str]:
    """What there is a schema of → one line about it."""
    files = {"rig": "rig.toml, as every command takes it.", "study": "A study for bowden campaign."}
    return files | {one.words: one.summary for one in found().commands}


def json_schema(name: str) -> dict[str, Any]:
    """The JSON schema of that name, of the draft 2020-12.

    Raises:
        ParameterError: there is none of that name.
    """
    from bowden.app.documents import DOCUMENTS

    if name in DOCUMENTS:
        return {"$schema": _DRAFT} | _document(DOCUMENTS[name]) | {"title": f"bowden {name} --json"}
    if name not in ("rig", "study"):
        raise ParameterError(f"there is no schema of {name!r}", expected="a name that bowden schema lists")
    return {"$schema": _DRAFT} | (_rig() if name == "rig" else _study())


def _document(kind: Any) -> dict[str, Any]:
    """Of what a command prints."""
    from pydantic import TypeAdapter

    return _plain(TypeAdapter(kind).json_schema())


def _plain(schema: Any) -> Any:
    """Without the titles that pydantic makes of names, and with each description on one line."""
    if isinstance(schema, list):
        return [_plain(part) for part in schema]
    if not isinstance(schema, dict):
        return schema
    kept = {key: _plain(part) for key, part in schema.items() if not (key == "title" and isinstance(part, str))}
    if isinstance(text := kept.get("description"), str):
        kept["description"] = " ".join(text.split())
    return kept


def _rig() -> dict[str, Any]:
    """Of rig.toml, with the drives of every family."""
    from bowden.rig.axes import AXIS, FEWEST, INDEPENDENT, MEANINGS, MOST
    from bowden.rig.families import names as families
    from bowden.rig.sections import PAIR, RigFile, drive_part

    schema = RigFile.model_json_schema()
    schema["properties"] |= {
        AXIS: {
            "description": MEANINGS[AXIS],
            "type": "array",
            "minItems": FEWEST,
            "maxItems": MOST,
            "items": {
                "type": "object",
                "additionalProperties": False,
                "required": ["name"],
                "properties": {
                    "name": {"type": "string"},
                    **{name: {"type": "object"} for name in RigFile.model_fields},
                },
            },
        },
        INDEPENDENT: {"description": MEANINGS[INDEPENDENT], "type": "boolean", "default": False},
        "pair": PAIR.section.model_json_schema(),
    }
    drives = [drive_part(family).section for family in families()]
    schema["properties"]["drive"] = {"anyOf": [{"$ref": f"#/$defs/{section.__name__}"} for section in drives]}
    schema["$defs"] |= {section.__name__: section.model_json_schema() for section in drives}
    return schema


def _study() -> dict[str, Any]:
    """Of a study, with a plain number or word wherever a distribution may be."""
    from bowden.study.schema import StudyFile

    return _shortened(StudyFile.model_json_schema())


def _shortened(schema: Any) -> Any:
    if isinstance(schema, list):
        return [_shortened(part) for part in schema]
    if not isinstance(schema, dict):
        return schema
    if schema.get("$ref") == "#/$defs/DistributionSection":
        return {"anyOf": [schema, {"type": ["number", "string"]}]}
    return {key: _shortened(part) for key, part in schema.items()}


def schema(
    words: Annotated[list[str] | None, typer.Argument(metavar="[NAME]", help="As the list without it has it.")] = None,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")] = False,
) -> None:
    """Print the JSON schema of what a command prints with --json, of rig.toml or of a study; with no NAME, list all."""
    if words:
        print_json(json_schema(" ".join(words)))
    elif json:
        print_json({"schemas": names(), "seconds": seconds()})
    else:
        for name, line in names().items():
            print(f"{name:16}{line}")


COMMANDS = (
    Command(
        "schema",
        schema,
        "Print the JSON schema of rig.toml, or of what a command prints with --json.",
        ("bowden schema", "bowden schema rig", "bowden schema log info"),
        place=75,
    ),
)
