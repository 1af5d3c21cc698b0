"""`identify-servo`: natural frequency, damping, delay and limits from a log of command and motor."""

import math
from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from bowden.core.documented import Documented
from bowden.operations.support.operation import GivenProgress, Operation, Switch
from bowden.operations.support.results import Result

if TYPE_CHECKING:
    from bowden.identify.servo import ServoEstimate, ServoFit
    from bowden.plants.counting import Encoders

_NO_CYCLE = 0.05
"""Share of a cycle by which a measured delay may be beyond whole ones before it is rounded up [–]."""


@dataclass(frozen=True)
class FittedValue(Documented):
    """A value and its uncertainty."""

    value: float
    uncertainty: float
    """Standard uncertainty."""


@dataclass(frozen=True)
class ServoIdentification(Result["ServoFit"]):
    """A servo, as a rig.toml has it."""

    natural_frequency_hz: FittedValue
    """Natural frequency under the position loop [Hz]."""
    damping: FittedValue
    """Damping ratio."""
    delay_s: FittedValue
    """Between the logged command and the moment it acts, fractions of a sample included [s]."""
    delay_cycles: int
    """The same in cycles of the rig, rounded up, with those of the joint's sensor."""
    joint_late_s: float
    """How late the rig's joint sensor is, by the log of its cable; 0 without `into` [s]."""
    sample_time_ms: float
    """One cycle of the rig [ms]."""
    speed_limit_deg_per_s: FittedValue | None
    """Largest speed; null where the log does not reach it [deg/s]."""
    acceleration_limit_deg_per_s2: FittedValue | None
    """Largest acceleration; null where the log does not reach it [deg/s²]."""
    residual_deg: float
    """Root mean square of motor - model [deg]."""
    unexplained: float
    """The same as a share of the motor's motion."""
    warnings: tuple[str, ...]
    """What was mended in the log: repeated or uneven time stamps."""
    _: KW_ONLY
    fit: "ServoFit"

    @property
    def value(self) -> "ServoFit":
        """The fit, in SI and radians."""
        return self.fit


def identify_servo(
    log: Path,
    *,
    time: str | None = None,
    command: str | None = None,
    motor: str | None = None,
    unit: str | None = None,
    rate: Annotated[float | None, Switch(metavar="HZ")] = None,
    sample_time_ms: float | None = None,
    into: Annotated[Path | None, Switch(metavar="RIG.TOML")] = None,
    progress: GivenProgress = None,
) -> ServoIdentification:
    """Identify a servo from a log of a step or a chirp, and write the keys of rig.toml for it.

    With `into` they take the place of those in a rig; its comments and all other keys stay as they are.

    Args:
        log: CSV, csv.gz, .mat, NPZ or Parquet: time, command, motor of a step or chirp.
        time: column of times; guessed where it is not given.
        command: column of the motor's target angle.
        motor: column of the motor's measured angle.
        unit: unit of both angles, deg or rad; by default as the columns' names end.
        rate: rows a second, of a log without times.
        sample_time_ms: control cycle of the rig, for delay_cycles; by default that of `into`, or 1.
        into: write the values into this rig, in place of servo.toml.

    Raises:
        LogError: a log that cannot be used.
        ParameterError: a cycle that is not the rig's, or a rig that has several motors.

    Examples:
        bowden identify-servo step.csv
        bowden identify-servo step.csv --into rig.toml
        bowden identify-servo chirp.csv --command target --unit deg --json

    >>> import pathlib, tempfile
    >>> import numpy as np
    >>> from bowden import identify_servo
    >>> time = np.arange(2000) / 1000.0
    >>> turned = 40.0 * np.maximum(time - 0.2, 0.0)
    >>> log = np.stack([time, 0.3 * (time >= 0.2), 0.3 - 0.3 * (1.0 + turned) * np.exp(-turned)], axis=1)
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "step.csv"
    >>> np.savetxt(path, log, delimiter=",", header="time_s,command_rad,motor_rad", comments="")
    >>> round(identify_servo(path).natural_frequency.value)
    40
    """
    from bowden.core.units import HERTZ, RADIANS
    from bowden.identify.servo import identify_servo as fit
    from bowden.identify.servo import read_servo_log
    from bowden.operations.support.given import check_number
    from bowden.operations.support.progress import reported
    from bowden.plants.counting import NOT_SAID

    encoders = NOT_SAID
    cycle = check_number("sample_time_ms", 1.0 if sample_time_ms is None else sample_time_ms, 0.01, 100.0)
    if into is not None:
        cycle, encoders = _cycle_of(into, sample_time_ms)
    columns, notes = read_servo_log(log, {"time": time, "command": command, "motor": motor}, unit, rate)
    with reported(progress, "identify-servo") as report:
        report("fitting the servo", 0.0)
        found = fit(*columns)
    own_cycles = math.ceil(found.delay.value * 1e3 / cycle - _NO_CYCLE)
    return ServoIdentification(
        natural_frequency_hz=_in(found.natural_frequency, HERTZ),
        damping=_in(found.damping, 1.0),
        delay_s=_in(found.delay, 1.0),
        delay_cycles=max(0, own_cycles) + encoders.late_cycles(1e-3 * cycle),
        joint_late_s=encoders.joint_late,
        sample_time_ms=cycle,
        speed_limit_deg_per_s=found.speed_limit and _in(found.speed_limit, RADIANS),
        acceleration_limit_deg_per_s2=found.acceleration_limit and _in(found.acceleration_limit, RADIANS),
        residual_deg=found.residual / RADIANS,
        unexplained=found.share,
        warnings=tuple(notes),
        fit=found,
    )


def _in(estimate: "ServoEstimate", unit: float) -> FittedValue:
    return FittedValue(estimate.value / unit, estimate.uncertainty / unit)


def _cycle_of(path: Path, given: float | None) -> "tuple[float, Encoders]":
    """Control cycle of the rig that is written into [ms], and its encoders.

    Raises:
        ParameterError: no rig.toml of one motor, or one of another cycle than the given one.
    """
    from bowden.core.caller import argument
    from bowden.core.errors import ParameterError
    from bowden.rig.config import one_motor
    from bowden.rig.rig import Rig

    rig = Rig.read(path)
    if rig.motors:
        raise one_motor(path)
    own = 1e3 * rig.sample_time
    if given is not None and abs(given - own) > 1e-9 * own:
        what = f"{argument('sample_time_ms')} is {given:g}"
        raise ParameterError(what, expected=f"{own:g}, as {path} has it", do="leave the option out")
    return own, rig.encoders


OPERATIONS = (Operation("identify-servo", identify_servo, 40),)
