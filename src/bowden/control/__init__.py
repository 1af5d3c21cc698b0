"""Control laws, one file each; `LAWS` names them."""

from typing import TYPE_CHECKING, Any

from bowden.core.registry import resolve

if TYPE_CHECKING:
    from bowden.control.law import Law
    from bowden.control.registry import LAWS

__all__ = ["LAWS", "Law"]

_HOMES = {"LAWS": "control.registry:LAWS", "Law": "control.law:Law"}


def __getattr__(name: str) -> Any:
    """One of `__all__`, loaded when it is first asked for (PEP 562)."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    found = globals()[name] = resolve(_HOMES[name])
    return found
