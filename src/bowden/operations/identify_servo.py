"""`identify-servo`: natural frequency, damping, delay and limits from a log of command and motor."""

from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from bowden.identify.servo.figures import ServoFigures
from bowden.operations.support.operation import GivenProgress, Operation, Switch
from bowden.operations.support.results import Result

if TYPE_CHECKING:
    from bowden.identify.servo.fit import ServoFit
    from bowden.plants.counting import Encoders


@dataclass(frozen=True)
class ServoIdentification(ServoFigures, Result["ServoFit"]):
    """A servo, as a rig.toml has it."""

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
    from bowden.identify.servo.fit import identify_servo as fit
    from bowden.identify.servo.keys import figures_of
    from bowden.identify.servo.log import read_servo_log
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
    return ServoIdentification(**vars(figures_of(found, cycle, encoders)), warnings=tuple(notes), fit=found)


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


OPERATIONS = (
    Operation(
        "identify-servo",
        identify_servo,
        (
            "bowden identify-servo step.csv",
            "bowden identify-servo step.csv --into rig.toml",
            "bowden identify-servo chirp.csv --command target --unit deg --json",
        ),
        place=40,
    ),
)
