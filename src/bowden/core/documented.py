"""A dataclass of figures whose texts under its fields are their descriptions in a JSON schema."""

from typing import Annotated, Any, ClassVar


class Documented:
    """Base of such a class: nothing but what is in it stands in the JSON."""

    __pydantic_config__: ClassVar[dict[str, Any]] = {"extra": "forbid", "use_attribute_docstrings": True}


class _Nullable:
    """Metadata of a number that does not always exist: JSON has null in place of infinities and NaN."""

    def __get_pydantic_json_schema__(self, schema: Any, handler: Any) -> dict[str, Any]:
        return {"anyOf": [handler(schema), {"type": "null"}]}


OrNull = Annotated[float, _Nullable()]
