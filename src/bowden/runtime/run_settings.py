"""What a log must know of its run so that it can be read and replayed years later, as JSON values."""

from collections.abc import Mapping
from typing import Any

from bowden.control.law import Law
from bowden.core.errors import LogError
from bowden.models.thermal import Thermal
from bowden.runtime.cycle import Filters, Source
from bowden.runtime.ports import Power
from bowden.runtime.preflight import Reason
from bowden.safety.faults import Fault
from bowden.safety.limits import Limits
from bowden.safety.supervisor import Mode

NAMES: Mapping[str, list[str]] = {
    "mode": [mode.name.lower() for mode in Mode],
    "reaction": ["none", "R1", "R2", "R3"],
    "power": [power.name.lower() for power in Power],
    "source": [source.name.lower() for source in Source],
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


def limits_of(settings: Mapping[str, Any]) -> Limits:
    """The limits of a recorded run.

    Raises:
        LogError: they are not there, or of another version of bowden.
    """
    return _again(Limits, settings, "limits", {"thermal": Thermal})


def filters_of(settings: Mapping[str, Any]) -> Filters:
    """The filters of a recorded run.

    Raises:
        LogError: they are not there, or of another version of bowden.
    """
    return _again(Filters, settings, "filters", {})


def _again(kind: Any, settings: Mapping[str, Any], name: str, inner: Mapping[str, Any]) -> Any:
    try:
        values = {**(_SINCE if kind is Limits else {}), **settings[name]}
        values |= {key: _number_fields(part, values[key]) for key, part in inner.items()}
        return _number_fields(kind, values)
    except (KeyError, TypeError, ValueError) as error:
        do = "replay it with the version of bowden that wrote it (bowden log info tells which)"
        raise LogError(f"the log's settings have no {name} that this version knows: {error}", do=do) from error


_SINCE = {name: Limits._field_defaults[name] for name in ("uses_emg", "emg_age")}
"""Limits that older logs do not have, as they were in force then: not at all."""


def _number_fields(kind: Any, values: Mapping[str, Any]) -> Any:
    if set(kind._fields) != set(values):
        raise ValueError(f"they differ in {', '.join(sorted(set(kind._fields) ^ set(values)))}")
    return kind(**{key: part if isinstance(part, tuple) else float(part) for key, part in values.items()})
