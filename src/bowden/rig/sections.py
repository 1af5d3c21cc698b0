"""The sections of rig.toml: which value of a rig each stands for, and the defaults, those of the paper's bench.

Everything else about the file (the commented default, ``docs/rig.md``, the JSON schema, the error messages) is made
from the values' own declarations (`bowden.core.quantity`).
"""

import math
from collections.abc import Callable, Mapping
from functools import cache
from typing import Annotated, Any, NamedTuple

from pydantic import BeforeValidator, Field, create_model
from pydantic_core import PydanticCustomError

from bowden.control.recorded_motion import RecordedFile
from bowden.control.reference import Multisine, PointToPoint
from bowden.core.errors import ParameterError
from bowden.core.quantity import Quantity, declared
from bowden.core.units import RADIANS
from bowden.models.cable.bouc_wen import BoucWen
from bowden.models.drive.holding_brake import HoldingBrake
from bowden.plants.bends import ConstantBend, RandomBend, ScriptedBend
from bowden.plants.counting import MODEL_FILE, Counting
from bowden.plants.presets.paper import chirp, document, minimum_jerk, parts
from bowden.plants.push_settings import AdmittanceSettings
from bowden.plants.suit_settings import SuitSettings, WearerSettings
from bowden.rig import families as drive_families
from bowden.rig.declaration import Section, at, items_of, key_of, rounded, section_of
from bowden.rig.joints import JointSettings
from bowden.rig.load_cell import LoadCellParameters
from bowden.rig.settings import EmgSettings, JointSensor, LiveSettings
from bowden.safety.limits import Limits

_BENCH, _CHOSEN = parts(), document()["chosen"]

USUAL = rounded(Limits(), 4)
"""Of the paper's bench, as a file has them."""
FOLLOWING = frozenset(one.name for one in declared(Limits) if one.quantity.follows)
"""Names of those that follow where they are not written."""
UNWRITTEN = USUAL._replace(**dict.fromkeys(FOLLOWING, math.nan))  # type: ignore[arg-type]
"""Of a rig that writes none of them."""


class Clock(NamedTuple):
    """The control loop's clock."""

    sample_time: Annotated[float, Quantity("one control cycle", "s", shown="ms", symbol="Ts", ge=0.01, le=100.0)] = (
        _BENCH.sample_time
    )
    delay: Annotated[
        int,
        Quantity(
            "cycles between a sample and the moment its command reaches the servo", key="delay_cycles", ge=0, le=1000
        ),
    ] = _BENCH.delay
    substeps: Annotated[int, Quantity("plant sub-steps in a cycle in which the servo meets a limit", ge=1, le=1000)] = (
        _BENCH.substeps
    )


class Scenario(NamedTuple):
    """How long the run lasts, its random numbers, and how the sheath is bent meanwhile."""

    duration: Annotated[float, Quantity("length of the run", "s", gt=0.0, le=1e5)] = _CHOSEN["duration_s"]
    seed: Annotated[int, Quantity("seed of the encoders' noise and of a random bend", ge=0, lt=2**63)] = _CHOSEN["seed"]
    initial_motor: Annotated[
        float | None,
        Quantity(
            "motor angle before the start; left out, the joint is where the reference starts",
            "rad",
            ge=-720.0,
            le=720.0,
            example=0.0,
        ),
    ] = None


class Control(NamedTuple):
    """The law; `bowden simulate --law` puts others in its place."""

    law: Annotated[str, Quantity('name of a law, or your own as "file.py:NAME", found from this file')] = "adaptive"
    preset: Annotated[str | None, Quantity("a named set of gains of that law", example="paper")] = None


class Part(NamedTuple):
    """A section, or one of its kinds, and the value that it stands for."""

    kind: type
    default: Any
    """In SI; ``None`` where keys must be given."""
    section: type[Section]


def _part(default: Any, text: str = "", tag: str = "") -> Part:
    """The part of a default; its section says what its type does, where there is no other text."""
    kind = type(default)
    return Part(kind, default, section_of(f"{kind.__name__}Section", text or _sentence(kind), kind, default, tag=tag))


def _sentence(kind: type) -> str:
    return (kind.__doc__ or "").partition(">>>")[0]


WIDTH = Quantity("factor on the play, fitted to the paper's dead zone; laws do not know it", gt=0.0, le=100.0)
GAINS = Quantity("gains of that law that differ from its own, in SI units and radians")
_MODEL = Quantity("file of an identified cable, in place of all keys below the next four", example=MODEL_FILE)
_MODEL_HASH = Quantity("of that model: another one in its file is refused", example="1f0c9a52b6d3e874")
_PLANT = Quantity(
    'your own plant as "file.py:NAME", found from this file, in place of all other keys here', example="my_plant.py"
)
_PARAMETERS = Quantity(
    "parameters that differ from the file of that plant, in its own units, or of that model (SI and radians)"
)
GAIN = Quantity("a gain", ge=-1e6, le=1e6)
_GAIN = Annotated[float, Field(**GAIN.rules)]

DEFAULT_CABLE = _BENCH.cable
"""Of the paper's bench, by hand."""
DEFAULT_WIDTH = _BENCH.sheath.gap
"""Of the paper's bench [–]."""

_encoder = _part(_BENCH.joint_encoder, "One encoder.")

PARTS: Mapping[str, Part] = {
    "servo": _part(_BENCH.servo, "The motor under its PD position loop, second order."),
    "sheath": _part(
        _BENCH.sheath._replace(gap=1.0), "How the sheath's bend sets the width and the slope of the cable's hysteresis."
    ),
    "motor": _part(_BENCH.motor, "The geared motor and its load, for currents and energies (Eq. 18)."),
    "joint_encoder": _encoder,
    "motor_encoder": _encoder,
    "suit": _part(rounded(SuitSettings(), 10)),
    "wearer": _part(WearerSettings()),
    "admittance": _part(rounded(AdmittanceSettings(), 10)),
    "limits": _part(USUAL, "What the supervisor allows, and the motor's thermal model; see docs/safety.md.")._replace(
        default=UNWRITTEN
    ),
    "load_cell": _part(LoadCellParameters()),
    "joint_sensor": _part(rounded(JointSensor(), 6)),
    "brake": _part(rounded(HoldingBrake(), 10)),
    "live": _part(LiveSettings())._replace(default=LiveSettings(approach=math.nan)),
    "emg": _part(rounded(EmgSettings(), 4)),
}
"""Field of a rig → the part that stands for it, of those whose section holds nothing else."""
TITLES: Mapping[str, tuple[str, ...]] = {"joint_encoder": ("encoder", "joint"), "motor_encoder": ("encoder", "motor")}
"""Field of a rig → its section, where that has another name."""

JOINT = _part(JointSettings())
"""[[joint]], which stands beside [[motor]]."""

REFERENCES: Mapping[str, Part] = {
    tag: _part(default, "A sine whose frequency rises linearly (Fig. 16)." if tag == "chirp" else "", tag)
    for tag, default in {
        "periodic_minimum_jerk": minimum_jerk(),
        "point_to_point": PointToPoint((0.0, 2.0, 3.0, 5.0), tuple(RADIANS * x for x in (0.0, 70.0, 70.0, 0.0))),
        "chirp": chirp(),
        "multisine": Multisine(
            (0.05, 0.13, 0.31),
            tuple(RADIANS * x for x in (25.0, 12.0, 6.0)),
            tuple(RADIANS * x for x in (0.0, 90.0, 200.0)),
            35.0 * RADIANS,
            2.0,
        ),
    }.items()
} | {
    "recorded": Part(
        RecordedFile, None, section_of("RecordedSection", RecordedFile.__doc__ or "", RecordedFile, tag="recorded")
    )
}
"""What [reference] may be, by its kind."""

BENDS: Mapping[str, Part] = {
    tag: _part(default, tag=tag)
    for tag, default in {"constant": ConstantBend(), "scripted": ScriptedBend(), "random": RandomBend()}.items()
}
"""What [scenario.bend] may be, by its kind."""

REFERENCE_KINDS = {name: part.section for name, part in REFERENCES.items()}
BEND_KINDS = {name: part.section for name, part in BENDS.items()}


DEFAULT_FAMILY = drive_families.DEFAULT


@cache
def drive_part(name: str) -> Part:
    """What [drive] is of a family.

    Raises:
        ParameterError: there is no such family.
    """
    family = drive_families.family_named(name)
    part = _part(family.parameters, family.title)
    follow = {one.name: math.nan for one in declared(part.kind) if one.quantity.follows}
    return part._replace(default=part.default._replace(**follow))


def _drive_section(given: Any) -> Any:
    """[drive] of the family that it names."""
    if isinstance(given, Section):
        return given
    named = given.get("family", DEFAULT_FAMILY) if isinstance(given, Mapping) else DEFAULT_FAMILY
    try:
        return drive_part(named if isinstance(named, str) else DEFAULT_FAMILY).section.model_validate(given)
    except ParameterError as error:
        raise PydanticCustomError("drive_family", "there is no such family", {"family": named}) from error


def _one_of(kinds: Mapping[str, type[Section]]) -> Any:
    first, *others = kinds.values()
    union: Any = first
    for other in others:
        union = union | other
    return Annotated[union, Field(discriminator="kind"), BeforeValidator(_of_first_kind(kinds))]


def _of_first_kind(kinds: Mapping[str, type[Section]]) -> Callable[[Any], Any]:
    """Takes a section without a kind as one of the first, where all of its keys are keys of that."""
    name, section = next(iter(kinds.items()))

    def named(given: Any) -> Any:
        plain = isinstance(given, Mapping) and "kind" not in given and given.keys() <= section.model_fields.keys()
        return {"kind": name, **given} if plain else given

    return named


_CableSection = section_of(
    "CableSection",
    "The cable, joint = αφ·motor + αh·h + offset (Eqs 6-7), the model of `bowden identify`, or a plant of your own.",
    BoucWen,
    _BENCH.cable,
    before={
        "model": key_of(str | None, _MODEL, None),
        "model_hash": key_of(str | None, _MODEL_HASH, None),
        **{one.key: key_of(one.kind, one.quantity, at(Counting(), one.path)) for one in items_of(Counting)},
        "plant": key_of(str | None, _PLANT, None),
    },
    after={
        "width": key_of(float, WIDTH, DEFAULT_WIDTH),
        "parameters": (
            dict[str, float],
            Field({}, description=_PARAMETERS.meaning, json_schema_extra={"unit": "–"}),
        ),
    },
)
EncodersSection: type[Section] = create_model(
    "EncodersSection",
    __base__=Section,
    __doc__="The two encoders.",
    joint=(_encoder.section, _encoder.section()),
    motor=(_encoder.section, _encoder.section()),
)
_ClockSection = section_of("BenchSection", Clock.__doc__ or "", Clock, Clock())
_ControlSection = section_of(
    "ControlSection",
    Control.__doc__ or "",
    Control,
    Control(),
    after={"gains": (dict[str, _GAIN], Field({}, description=GAINS.meaning, json_schema_extra={"unit": "–"}))},
)
_ScenarioSection = section_of(
    "ScenarioSection",
    Scenario.__doc__ or "",
    Scenario,
    Scenario(),
    after={"bend": (_one_of(BEND_KINDS), BEND_KINDS["constant"]())},
)


def _section(kind: type[Section]) -> tuple[Any, Section]:
    return kind, kind()


_OWN: dict[str, Any] = {
    "bench": _section(_ClockSection),
    "cable": _section(_CableSection),
    "encoder": _section(EncodersSection),
    "control": _section(_ControlSection),
    "reference": (_one_of(REFERENCE_KINDS), REFERENCE_KINDS["periodic_minimum_jerk"]()),
    "scenario": _section(_ScenarioSection),
    "drive": (
        Annotated[Any, BeforeValidator(_drive_section)],
        Field(default_factory=lambda: drive_part(DEFAULT_FAMILY).section()),
    ),
}
"""Sections that hold more than one part, or one of several kinds."""
_ORDER = (
    *("bench", "servo", "cable", "sheath", "motor", "encoder", "suit", "wearer", "admittance", "control", "reference"),
    *("scenario", "drive", "joint_sensor", "load_cell", "brake", "limits", "live", "emg"),
)
_FIELDS: dict[str, Any] = {name: _OWN.get(name) or _section(PARTS[name].section) for name in _ORDER}
RigFile: type[Section] = create_model(
    "Rig",
    __base__=Section,
    __doc__="A rig.toml: a bench or a suit, its law, its reference, the scenario, and what the live loop needs.",
    **_FIELDS,
)
"""A whole rig.toml, as pydantic checks it."""
