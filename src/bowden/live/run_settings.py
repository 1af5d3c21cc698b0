"""What a log must know of its run so that it can be read and replayed years later, as JSON values."""

from collections.abc import Mapping
from typing import Any, get_type_hints

from bowden.control import source as references
from bowden.control.admittance.push import Push, push_source
from bowden.control.law import Law
from bowden.core.errors import LogError
from bowden.cycle.one_cycle import Filters, TargetSource
from bowden.hardware.ports import Power
from bowden.live.preflight import Reason
from bowden.models.suit.suit_angle import SpoolMap
from bowden.safety.faults import Fault
from bowden.safety.limits import Limits
from bowden.safety.state import Mode

NAMES: Mapping[str, list[str]] = {
    "mode": [mode.name.lower() for mode in Mode],
    "reaction": ["none", "R1", "R2", "R3"],
    "power": [power.name.lower() for power in Power],
    "source": [source.name.lower() for source in TargetSource],
    "preflight_reason": [reason.name.lower() for reason in Reason],
    "faults": [fault.name.lower() for fault in Fault],
}
"""Column → the name of each of its numbers, or of each bit of `faults`."""


def run_settings(law: Law, limits: Limits, filters: Filters, period: float) -> dict[str, Any]:
    """Law, gains, limits, filters, period and names, for the settings in the ring's description; a run adds its own.

    The name of a user's law is not enough to find it again: the caller says where it came from, in ``law_file``.
    """
    return {
        "law": law.name,
        "gains": plain(law.gains),
        "limits": plain(limits),
        "filters": plain(filters),
        "sample_time": period,
        "names": {column: list(names) for column, names in NAMES.items()},
    }


def plain(value: Any) -> Any:
    """Nested NamedTuples as nested dictionaries."""
    return {name: plain(part) for name, part in value._asdict().items()} if hasattr(value, "_asdict") else value


def push_of(settings: Mapping[str, Any]) -> tuple[float, int, SpoolMap] | None:
    """Torque offset of a recorded run [N·m], its sub-steps and the map to its spool; None of a run without one.

    Raises:
        LogError: they are of another version of bowden.
    """
    if "push" not in settings:
        return None
    given = settings["push"]
    return float(given["torque"]), int(given["substeps"]), recorded(SpoolMap, given, "spool")


def source_of(settings: Mapping[str, Any]) -> references.Source:
    """What made the reference of a recorded run: the wearer's push where the log has it, or else its table.

    Raises:
        LogError: its settings are of another version of bowden.
    """
    if "admittance" not in settings:
        return references.TABLE
    return push_source(recorded(Push, settings, "admittance"))


def recorded(kind: Any, settings: Mapping[str, Any], name: str) -> Any:
    """A part of a recorded run's settings as the NamedTuple that `plain` had: its limits, its filters.

    Raises:
        LogError: it is not there, or of another version of bowden.
    """
    try:
        return _made(kind, settings[name])
    except (KeyError, TypeError, ValueError) as error:
        do = "replay it with the version of bowden that wrote it (bowden log info says which)"
        raise LogError(f"the log's settings have no {name} that this version knows: {error}", do=do) from error


def _made(kind: Any, values: Mapping[str, Any]) -> Any:
    """A NamedTuple of numbers, and of others of its kind, from what `plain` made of it."""
    if set(kind._fields) != set(values):
        raise ValueError(f"they differ in {', '.join(sorted(set(kind._fields) ^ set(values)))}")
    kinds = get_type_hints(kind)
    nested = {name for name, part in kinds.items() if hasattr(part, "_fields")}
    return kind(**{name: _made(kinds[name], part) if name in nested else float(part) for name, part in values.items()})
