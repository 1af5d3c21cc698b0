"""What is recorded of every cycle: the columns of the ring and of the log, and their units."""

from collections.abc import Mapping

from bowden.control.conditioning import COLUMNS as CONDITIONED
from bowden.control.law import Law
from bowden.control.source import TABLE, Source
from bowden.core import nested
from bowden.core.nested import from_columns
from bowden.core.signals import DriveReading
from bowden.cycle.torque_offset import COLUMNS as PUSH
from bowden.hardware.emg.course import COLUMNS
from bowden.live import gain_ramp
from bowden.live.brake_hold import COLUMNS as BRAKE
from bowden.live.ring import Description
from bowden.live.together import SHARED, TOGETHER
from bowden.models.drive.thermal import Thermal, ThermalState, cold
from bowden.safety.limits import Limits
from bowden.safety.supervisor import begin

CYCLE: Mapping[str, str] = {
    "time": "s",
    "reference": "rad",
    "reference_velocity": "rad/s",
    "reference_acceleration": "rad/s²",
    "motor": "rad",
    "joint": "rad",
    "current": "A",
    "tension": "N",
    "temperature": "°C",
    "motor_age": "1",
    "joint_age": "1",
    "heartbeat_age": "s",
    "drive_state": "1",
    "emergency": "1",
    "bus_errors": "1",
    "foreign": "1",
    "sample_age": "s",
    "joint_torque": "N·m",
    "joint_sensor_age": "s",
    "joint_std": "rad",
    "joint_sensor": "rad",
    "joint_seen": "rad",
    "motor_seen": "rad",
    "requested_target": "rad",
    "command": "rad",
    "power": "1",
    "mode": "1",
    "reaction": "1",
    "faults": "1",
    "source": "1",
    "lateness": "s",
    "elapsed": "s",
    "overruns": "1",
    "request": "1",
    "operator_age": "s",
    "recorder": "1",
    "preflight": "1",
    "preflight_reason": "1",
    "play": "rad",
    "run_time": "s",
}
"""Column → unit of what every run has; the law's state follows, what it was shown of the reference with what the
conditioner remembers, the supervisor's state, what EMG said in a run by
it, the torque offset in a run with one, the state of what makes the reference where the wearer's push does, and the
law's live gains (`live.gain_ramp`).

``joint`` and ``motor`` are as measured, at the same instant as the reference, which is what the source gave;
``joint_seen`` and ``motor_seen`` are behind the filters. ``requested_target`` is from before the supervisor and
``command`` from after it; ``overruns`` are the deadlines that were skipped before this cycle.
"""

AT: Mapping[str, int] = {name: i for i, name in enumerate(CYCLE)}
"""Column → its place in a row."""

NOTHING_READ = DriveReading(*(float("nan"),) * 5, *(0.0,) * 8, *(float("nan"),) * 4)
"""A reading before the first."""

STOPPED = begin(Limits(), NOTHING_READ, cold(Thermal()))
"""A supervisor that has seen nothing yet."""

SUPERVISOR: Mapping[str, str] = nested.columns(STOPPED, "supervisor")
"""Column → unit of its state."""


def columns(
    law: Law,
    *,
    emg: bool = False,
    pushed: bool = False,
    braked: bool = False,
    source: Source = TABLE,
    together: bool = False,
    shared: bool = False,
) -> dict[str, str]:
    """Column → unit of a run under this law, by EMG, with a torque offset, with a holding brake, by another source than
    the table, of a motor among others, and of one that shares its joint."""
    return {
        **CYCLE,
        **law.columns(),
        **CONDITIONED,
        **SUPERVISOR,
        **(COLUMNS if emg else {}),
        **(PUSH if pushed else {}),
        **(BRAKE if braked else {}),
        **({} if source is TABLE else source.columns()),
        **gain_ramp.columns(law),
        **(TOGETHER if together else {}),
        **(SHARED if shared else {}),
    }


def description(
    named: Mapping[str, str], settings: Mapping[str, object], utc_ns: int, monotonic_ns: int
) -> Description:
    """What the ring's header says of a run with these columns and units, whose column ``time`` is zero at these two
    clocks [ns]."""
    return Description(tuple(named), tuple(named.values()), settings, utc_ns, monotonic_ns)


def thermal_of(row: Mapping[str, float]) -> ThermalState:
    """Temperatures of the motor, from a row's columns."""
    heat: ThermalState = from_columns(STOPPED.heat, row, "supervisor.heat")
    return heat
