"""A dataclass of figures whose texts under its fields are their descriptions in a JSON schema."""

from typing import Any, ClassVar


class Documented:
    """Base of such a class: nothing but what is in it stands in the JSON."""

    __pydantic_config__: ClassVar[dict[str, Any]] = {"extra": "forbid", "use_attribute_docstrings": True}
