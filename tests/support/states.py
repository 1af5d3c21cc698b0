"""States of kernels, as tests hand them from one cycle to the next."""

from enum import IntEnum
from typing import Any

from bowden.core.nested import map_leaves


def floated(value: Any) -> Any:
    """The same state with every number a float: compiled code takes whole numbers for another type.

    Bools and members of enums stay what they are.
    """
    return map_leaves(value, lambda _, leaf: leaf if isinstance(leaf, bool | IntEnum) else float(leaf))
