"""Trust in the cable's model, as each operation on a rig says it, in a terminal and in Python."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from bowden.operations.support.results import Result

if TYPE_CHECKING:
    from bowden.rig.rig import Rig

Found = TypeVar("Found", bound=Result[Any])


def trusted(found: Found, rigs: "Sequence[Rig]") -> Found:
    """A result with the trust in the cables of the rigs that it was made of, where it does not have it already."""
    known = [one for rig in rigs if (one := rig.cable_trust) is not None]
    if found.cable_trust is not None or not known:
        return found
    from bowden.plants.trust import least

    return dataclasses.replace(found, cable_trust=least(known))


def doubt(found: Any, rigs: "Sequence[Rig]") -> str:
    """A line where the trust is not *yes*: with all reasons where a rig is made, with the gravest where one is used.

    Args:
        found: what an operation gave, with ``cable_trust``; or anything else.
        rigs: that it was made of; none where it made one.
    """
    trust = getattr(found, "cable_trust", None)
    if trust is None or trust.level == "yes":
        return ""
    first, *others = trust.reasons or ("",)
    cables = [motor.rig.cable for rig in rigs if Path(rig.origin).suffix for motor in rig.parts]
    files = " and ".join(dict.fromkeys(filter(None, (getattr(one, "file", "") for one in cables))))
    where = f"[trust] of {files}" if files else "rig.cable_trust"  # of a rig that a program made
    short = first.partition(";")[0]
    more = f" (more: {where})" if others or short != first else ""
    return f"Trust in the cable's model: {f'{trust.level}: {short}{more}' if rigs else trust}"
