"""States of kernels, as tests hand them from one cycle to the next."""

from typing import Any

from bowden.core.nested import rebuilt


def floated(value: Any) -> Any:
    """The same state with every number a float: compiled code takes whole numbers for another type."""
    return rebuilt(value, lambda _, leaf: float(leaf))
