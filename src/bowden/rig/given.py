"""What a rig is given: its fields in the form in which it holds them, and whether they go together."""

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

from bowden.control.recorded_motion import held
from bowden.control.reference import Recorded, Trajectory
from bowden.core import arguments
from bowden.core.errors import ParameterError, error_context
from bowden.core.registry import resolve
from bowden.models.cable.bouc_wen import BoucWen
from bowden.plants.bends import Bend, ConstantBend, RandomBend, ScriptedBend
from bowden.rig import motors
from bowden.rig.checked import Gains, checked, checked_value, shown
from bowden.rig.effect import refuse_idle
from bowden.rig.joints import JointSettings, check_joints
from bowden.rig.sections import DEFAULT_FAMILY, GAIN, PARTS, REFERENCES, WIDTH, Clock, Control, Scenario, drive_part

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

MOST_CYCLES = 10_000_000
"""A longer run is refused: its record would not fit into the memory of a common computer."""


def settle(rig: Any, motor: Any) -> None:
    """Check each field of a rig that is being made, and put it into the form in which a rig holds it.

    Args:
        rig: with its fields as they were given.
        motor: the class `RigMotor`.

    Raises:
        ParameterError: a field that is none of its forms, out of its range, or does not fit the others.
    """
    put = partial(object.__setattr__, rig)
    arguments.text(rig.origin, "Rig: origin", "the name of a file")
    if not isinstance(rig.remarks, tuple) or not all(isinstance(one, str) for one in rig.remarks):
        raise ParameterError(f"Rig: remarks is {shown(rig.remarks)}", expected="a tuple of texts", do="leave it out")
    _check_form_of_motors(rig)
    put("motors", tuple(motor(*one) for one in rig.motors))
    default = JointSettings()
    put("joints", tuple(checked(one, JointSettings, "joint", default) for one in rig.joints))
    if rig.motors:
        motors.check(rig.motors, rig.joints, rig.origin)
    if rig.motors or rig.joints:
        check_joints(rig.each_joint, rig.independent, rig.origin)
    _check_clock(rig)
    flat: tuple[Any, ...] = (Clock, Scenario)
    for kind in flat:
        given = kind(*(getattr(rig, name) for name in kind._fields))
        for name, value in checked(given, kind, "")._asdict().items():
            put(name, value)
    drive = drive_part(getattr(rig.drive, "family", DEFAULT_FAMILY))
    if rig.drive is None:
        put("drive", drive.default)
    for name, part in {**PARTS, "drive": drive}.items():
        put(name, checked(getattr(rig, name), part.kind, name, part.default))
    put("cable", _cable(rig.cable))
    width = checked_value(rig.width, float, WIDTH, "width")
    put("plant", None if rig.plant is None else resolve("plants.plant_file:held")(rig.plant))
    put("width", width if isinstance(rig.cable, BoucWen) else 1.0)
    put("reference", _reference(rig.reference))
    put("bend", _bend(rig.bend))
    put("law", resolve("control.law_file:held")(rig.law))
    put("gains", _gains(rig.gains))
    put("preset", checked(Control(preset=rig.preset), Control, "").preset)
    if rig.plant is not None:
        for name, value in _of_plant(rig).items():
            put(name, value)


def _check_form_of_motors(rig: Any) -> None:
    """Refuse motors that cannot be in one loop."""
    fine = isinstance(rig.motors, tuple | list) and all(
        isinstance(one, tuple)
        and len(one) in (2, 3)
        and isinstance(one[1], type(rig))
        and all(isinstance(text, str) for text in (one[0], *one[2:]))
        for one in rig.motors
    )
    if not fine or not isinstance(rig.independent, bool) or not isinstance(rig.joints, tuple | list):
        raise ParameterError(
            f"Rig: motors is {shown(rig.motors)}, independent {shown(rig.independent)}, joints {shown(rig.joints)}",
            expected="a name and a rig for each motor, with the name of its joint where others move that too; True "
            "or False; and joints",
            do='make them: motors=(("hip", rig), ("knee", rig.replace(…)))',
        )


def _check_clock(rig: Any) -> None:
    """What the length of a run depends on, with the messages that the command line knows."""
    numbers = [isinstance(one, int | float) and not isinstance(one, bool) for one in (rig.duration, rig.seed)]
    if numbers[1] and not 0 <= rig.seed < 2**63:
        raise ParameterError(
            f"the seed is {rig.seed}", expected="a whole number from 0 to 2⁶³ − 1", do="give another seed"
        )
    step = rig.sample_time
    if numbers[0] and isinstance(step, int | float) and step > 0.0:
        cycles = rig.duration / step
        if not (rig.duration > 0.0 and 2.0 <= cycles <= MOST_CYCLES):
            raise ParameterError(
                f"a run of {rig.duration:g} s has {max(cycles, 0.0):g} cycles",
                expected=f"a duration that makes 2 to {MOST_CYCLES} of them",
                do="change the duration, scenario.duration_s of a rig.toml",
            )


def _of_plant(rig: Any) -> dict[str, Any]:
    """The rig's parts that its plant says of itself."""
    fields = type(rig).__dataclass_fields__
    if rig.cable != fields["cable"].default or rig.width != fields["width"].default or rig.suit.worn:
        other = "a suit" if rig.suit.worn else "a cable"
        raise ParameterError(
            f"{rig.origin}: the rig has both a plant of its own and {other}",
            expected="one of them",
            do="leave one out",
        )
    plant_file = resolve("plants.plant_file")
    default = {name: fields[name].default for name in plant_file.PARTS}
    with error_context(f"{rig.origin}: the plant"):
        own = {name: getattr(rig, name) for name in plant_file.PARTS}
        taken = plant_file.agreed(rig.own_plant, own, default)
    found: dict[str, Any] = taken
    return found


def check_whole(rig: Any) -> None:
    """Refuse parts that do not fit one another."""
    if rig.preset is not None:
        rig.loaded_law.preset(rig.preset)
    if rig.gains:
        with error_context(f"{rig.origin}: control.gains" if Path(rig.origin).suffix else "Rig: gains"):
            resolve("rig.laws:check_gains")(rig)
    if rig.emg.source is not None:
        _ = rig.emg_run
    if rig.suit.worn:
        with error_context(f"{rig.origin}: [suit] or [wearer]"):
            _ = rig.worn
    if rig.admittance.enabled:
        with error_context(f"{rig.origin}: [admittance]"):
            _ = rig.pushing
    if not rig.motors:
        refuse_idle(rig)
    if rig.joint_sensor.estimated:
        with error_context(f"{rig.origin}: [joint_sensor]"):
            resolve("rig.joint_sensor:check")(rig.joint_sensor, rig.sample_time, rig.limits.joint_std)
    if not rig.motors and rig.brake.enabled:
        with error_context(f"{rig.origin}: [brake]"):
            resolve("rig.drive:check_brake")(rig)


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
    return Gains({str(name): checked_value(one, float, GAIN, f"gains[{name!r}]") for name, one in given.items()})
