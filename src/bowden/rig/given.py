"""The fields of a rig that may be given in several forms, in the one in which a rig holds them."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

from bowden.control.recorded_motion import held
from bowden.control.reference import Recorded, Trajectory
from bowden.core.errors import ParameterError
from bowden.core.quantity import Quantity
from bowden.core.registry import resolve
from bowden.models.cable.bouc_wen import BoucWen
from bowden.plants.bends import Bend, ConstantBend, RandomBend, ScriptedBend
from bowden.rig.checked import Gains, checked, checked_number, shown
from bowden.rig.sections import REFERENCES, WIDTH

if TYPE_CHECKING:
    from bowden.control.law import Law
    from bowden.control.law_file import LawFile
    from bowden.plants.identified import CableModel, IdentifiedCable
    from bowden.plants.plant_file import PlantFile
    from bowden.plants.user_plant import UserPlant


class IdentifiedModel(Protocol):
    """What an identification gives."""

    @property
    def best(self) -> "CableModel":
        """The recommended model."""
        ...


CableLike: TypeAlias = "BoucWen | IdentifiedCable | CableModel | IdentifiedModel"
GivenPlant: TypeAlias = "str | UserPlant | PlantFile | None"
GivenLaw: TypeAlias = "str | Law | LawFile"


def in_one_form(rig: Any) -> dict[str, Any]:
    """Name → value of those fields.

    Raises:
        ParameterError: one that is none of its forms.
    """
    cable = _cable(rig.cable)
    width = checked_number(rig.width, float, WIDTH, "width")
    return {
        "cable": cable,
        "plant": None if rig.plant is None else resolve("plants.plant_file:held")(rig.plant),
        "width": width if isinstance(cable, BoucWen) else 1.0,
        "reference": _reference(rig.reference),
        "bend": _bend(rig.bend),
        "law": resolve("control.law_file:held")(rig.law),
        "gains": _gains(rig.gains),
        "preset": checked_number(rig.preset, str | None, Quantity("a named set of gains"), "preset"),
    }


def _cable(given: Any) -> "BoucWen | IdentifiedCable":
    if not isinstance(given, BoucWen):
        found: IdentifiedCable = resolve("plants.identified:held")(given)
        return found
    if given.slope == 0.0:
        raise ParameterError("Rig: cable.slope is 0", expected="a number above or below 0", do="correct it")
    return checked(given, BoucWen, "cable")


def _reference(given: Any) -> Trajectory:
    if isinstance(given, Recorded):
        return held(given)
    if not (hasattr(given, "sample") and hasattr(given, "describe")) or isinstance(given, type):
        raise ParameterError(
            f"Rig: reference is {shown(given)}",
            expected="a reference such as PeriodicMinimumJerk(0.0, 1.2, 10.0)",
            do="make one: bowden.MinimumJerk.periodic(low, high, period)",
        )
    if any(type(given) is part.kind for part in REFERENCES.values()):
        checked(given, type(given), "reference")
    found: Trajectory = given
    return found


def _bend(given: Any) -> Bend:
    if isinstance(given, int | float) and not isinstance(given, bool):
        given = ConstantBend(float(given))
    if not isinstance(given, ConstantBend | ScriptedBend | RandomBend):
        raise ParameterError(
            f"Rig: bend is {shown(given)}",
            expected="an angle, or a ConstantBend(…), ScriptedBend(…) or RandomBend(…)",
            do="give the sheath's total bend in rad",
        )
    found: Bend = checked(given, type(given), "bend")
    if isinstance(found, RandomBend) and not found.low < found.high:
        raise ParameterError(
            f"Rig: bend goes from {found.low:g} to {found.high:g}", expected="low below high", do="swap them"
        )
    return found


def _gains(given: Any) -> Gains:
    if not isinstance(given, Mapping):
        raise ParameterError(
            f"Rig: gains is {shown(given)}", expected="gains by name", do="for example {'error_gain': 0.05}"
        )
    rule = Quantity("a gain", ge=-1e6, le=1e6)
    return Gains({str(name): checked_number(one, float, rule, f"gains[{name!r}]") for name, one in given.items()})
