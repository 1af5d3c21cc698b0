"""Control laws, one file each; `LAWS` names them."""

from collections.abc import Mapping

from bowden.control.adaptive import ADAPTIVE
from bowden.control.law import Law
from bowden.control.observer import OBSERVER
from bowden.control.uncompensated import UNCOMPENSATED

LAWS: Mapping[str, Law] = {law.name: law for law in (UNCOMPENSATED, OBSERVER, ADAPTIVE)}
"""Every law by its name, with default gains for the paper's bench."""

__all__ = ["LAWS", "Law"]
