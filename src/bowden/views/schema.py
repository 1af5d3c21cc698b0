"""Schemas, in a terminal."""

import json

from bowden.operations.schema import JsonSchema, Schemas
from bowden.views.text import Call


def show_schema(found: Schemas | JsonSchema, call: Call) -> None:
    """One schema, or what there is one of."""
    if isinstance(found, JsonSchema):
        print(json.dumps(found.schema, ensure_ascii=False, indent=2))
        return
    for name, line in found.schemas.items():
        print(f"{name:16}{line}")
