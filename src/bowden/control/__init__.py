"""Control laws, one file each; `LAWS` names them."""

from bowden.control.law import Law
from bowden.control.registry import LAWS

__all__ = ["LAWS", "Law"]
