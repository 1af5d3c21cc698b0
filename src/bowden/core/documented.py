"""A dataclass of figures whose texts under its fields are their descriptions in a JSON schema."""

import math
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar


def finite(value: Any) -> Any:
    """A value for JSON: None in place of a number that JSON does not have."""
    if isinstance(value, Mapping):
        return {key: finite(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [finite(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


class Documented:
    """Base of such a class: nothing but what is in it stands in the JSON."""

    __pydantic_config__: ClassVar[dict[str, Any]] = {"extra": "forbid", "use_attribute_docstrings": True}


class _Nullable:
    """Metadata of a number that does not always exist: JSON has null in place of infinities and NaN."""

    def __get_pydantic_json_schema__(self, schema: Any, handler: Any) -> dict[str, Any]:
        return {"anyOf": [handler(schema), {"type": "null"}]}


OrNull = Annotated[float, _Nullable()]
