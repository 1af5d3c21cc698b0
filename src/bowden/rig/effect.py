"""Keys of a rig that cannot have an effect in it: refused where their value is another than the default.

A key has none where another one took its place (`idle`: in a suit the flex sensor, that of the joint's encoder), or
where its section is switched off (`refuse_switched_off`). A section whose switch stands in the file, ``enabled =
false``, may wait for it: who reads the file sees it. What is only not in use for now is not refused: [reference] beside
EMG, [limits] beside a simulation.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from bowden.core.errors import ParameterError
from bowden.core.toml_text import quoted
from bowden.rig.declaration import Section, at, items_of
from bowden.rig.sections import DEFAULT_CABLE, DEFAULT_WIDTH, PARTS, TITLES

SWITCHES: Mapping[str, tuple[str, str, Any, str]] = {
    "suit": ("suit", "worn", False, "suit.worn = true"),
    "wearer": ("suit", "worn", False, "suit.worn = true"),
    "admittance": ("admittance", "enabled", False, "admittance.enabled = true"),
    "brake": ("brake", "holding_torque_nm", 0.0, "brake.holding_torque_nm above 0"),
    "joint_sensor": ("joint_sensor", "source", "encoder", 'a source, such as joint_sensor.source = "imu"'),
    "load_cell": ("load_cell", "source", "none", 'a source, such as load_cell.source = "cia404"'),
}
"""Section → section and key of its switch, its value when off, and what switches it on."""


class Idle(NamedTuple):
    """A key without effect."""

    key: str
    """Dotted, as in rig.toml."""
    given: bool
    """True if its value is another than the default."""
    why: str
    do: str


def idle(rig: Any) -> Iterator[Idle]:
    """Keys of a rig without motors whose place another one took."""
    if rig.worn is None:
        return
    kind = rig.suit.cable
    for fields, part, why, do in (
        (None, "joint_encoder", "a suit has a flex sensor", "write suit.sensor_noise_deg or suit.sensor_step_deg"),
        (("inertia",), "motor", "a suit has a rotor of its own", "write suit.rotor_inertia_kg_m2"),
        (("spring", "pretension"), "motor", "a suit has an arm in place of the spring", "delete it"),
    ):
        yield from _part(rig, part, fields, why, do)
    yield Idle(
        "cable.width", not rig.identified and rig.width != DEFAULT_WIDTH, "it is the bench's", "write sheath.gap"
    )
    of_kind = f"suit.cable is {quoted(kind)}"
    if rig.identified:
        yield Idle("cable.model", kind == "capstan", of_kind, 'write suit.cable = "play", or delete it')
    elif kind != "bouc_wen":
        do = 'write suit.cable = "bouc_wen", or name the model of an identified cable in their place'
        for item in items_of(type(DEFAULT_CABLE)):
            differs = at(rig.cable, item.path) != at(DEFAULT_CABLE, item.path)
            yield Idle(f"cable.{item.key}", differs, of_kind, do)
    if kind != "play":
        yield from _part(rig, "suit", ("play",), of_kind, 'write suit.cable = "play", or delete it')
    elif rig.identified:
        yield from _part(rig, "suit", ("play",), "cable.model says what the cables lose", "delete one of them")
    if kind != "capstan":
        yield from _part(rig, "suit", ("capstan_friction",), of_kind, 'write suit.cable = "capstan", or delete it')
    else:
        yield from _part(rig, "sheath", ("loss",), "a capstan computes what its sheath loses", "delete it")


def _part(rig: Any, name: str, fields: tuple[str, ...] | None, why: str, do: str) -> Iterator[Idle]:
    """Keys of a part of the rig; all of them where no fields are named."""
    title = ".".join(TITLES.get(name, (name,)))
    for item in items_of(PARTS[name].kind):
        if fields is None or item.path[0] in fields:
            differs = at(getattr(rig, name), item.path) != at(PARTS[name].default, item.path)
            yield Idle(f"{title}.{item.key}", differs, why, do)


def refuse_idle(rig: Any) -> None:
    """Refuse a value that another one took the place of.

    Raises:
        ParameterError: the first of them, why it has no effect, and what to write.
    """
    for one in idle(rig):
        if one.given:
            raise ParameterError(f"{rig.origin}: {one.key} has no effect here: {one.why}", do=one.do)


def refuse_switched_off(file: Any, path: Path) -> None:
    """Refuse values of a section that is off, where the file does not say that it is.

    Args:
        file: as pydantic read it.
        path: for messages.

    Raises:
        ParameterError: the first of them, and what switches its section on.
    """
    for title, (section, key, off, on) in SWITCHES.items():
        switch: Section = getattr(file, section)
        if key in switch.model_fields_set or getattr(switch, key) != off:
            continue
        given: Section = getattr(file, title)
        for name in given.model_fields_set:
            if getattr(given, name) != type(given).model_fields[name].default:
                raise ParameterError(
                    f"{path}: {title}.{name} has no effect here, since its section is off",
                    expected=on,
                    do="write that too, or delete the key",
                )
