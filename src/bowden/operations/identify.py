"""`identify`: from logs of a cable to its model."""

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from inspect import Parameter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from bowden.core.documented import Documented
from bowden.identify.cable.hysteresis_loop import HysteresisLoop
from bowden.operations.support.operation import GivenProgress, Operation, Role, Switch
from bowden.operations.support.results import Result, TrustLevel, degrees, filled

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from bowden.identify.cable.fit import Fit
    from bowden.identify.cable.fitted import FittedLog
    from bowden.identify.log.read import Log
    from bowden.plants.identified import CableModel, IdentifiedCable
    from bowden.records.trace import Trace

    AnyLog = str | Path | Log | Trace
    AnyModel = str | Path | Fit | CableModel | IdentifiedCable


EMPTY = Parameter.empty
"""A log is no option of the command line: it has to be given."""


@dataclass(frozen=True)
class LogCycles(Documented):
    """Whole cycles of motion in a log."""

    whole: int
    more: int
    """To record; 0 from five cycles on."""
    advice: str | None
    """What to record and, of a log alone, what it may be expected to give; with two and three cycles also how far the
    stated errors of logs as short have been exceeded. Null where nothing is to be recorded."""


@dataclass(frozen=True)
class FittedModel(Documented):
    """A family of models, fitted."""

    parameters: dict[str, float]
    """By name, slope and offset among them; SI and radians. model.toml says what each is and in which unit."""
    uncertainty: dict[str, float | None]
    """One standard deviation of each parameter; null where the log does not show it, where it ended at the bound of its
    search, or where none is stated: of a setting that was not fitted, and of generalised_play, whose parameters trade
    with one another. Empty of a model that load or bend schedules, and of a known one."""
    train_rms_deg: float | None
    """Error of the joint on the first half, of the family fitted to it [deg]; the parameters are fitted to the whole
    log."""
    test_rms_deg: float | None
    """Error of the joint on the second half, of the family fitted to the first [deg]."""


@dataclass(frozen=True)
class ForecastOfModel(Documented):
    """Error that a compensation by the model would leave."""

    compensated_rms_deg: float | None
    """With the inverse of the recommended model commanded exactly: its error on the second half, weighted by the time
    that the inverse spends at each place [deg]."""
    uncompensated_rms_deg: float | None
    """With the inverse of the straight line [deg]."""
    resolution_rms_deg: float
    """Of both encoders' counts, at the joint; 0 where the log shows no counts [deg]."""


@dataclass(frozen=True)
class ScheduleVariables(Documented):
    """Variables that schedule a model."""

    load: str | None
    """Unit of the load, empty where nothing says it; null where the model does not follow a load."""
    bend: Literal["rad"] | None
    """The same of the bend."""


@dataclass(frozen=True)
class LogOfFit(Documented):
    """One of the logs."""

    name: str
    samples: int
    cycles: LogCycles
    """Whole cycles in the log: as often the motor passed each place in the middle half of its range both ways."""
    load: float | None
    """Its mean, in the log's unit."""
    bend: float | None
    """Its mean [rad]."""
    train_rms_deg: float | None
    """Error of what was fitted to its first half, on that; of several logs of the model, which was fitted to this log
    too [deg]."""
    test_rms_deg: float | None
    """On its second half, of a model of first halves [deg]."""
    same_rms_deg: float | None
    """Of a model of all other logs; null where none has its load [deg]."""
    same_offset_rms_deg: float | None
    """The same on its second half, the offset fitted to the first [deg]."""
    unseen_rms_deg: float | None
    """Of a model of the logs of other loads, with load and bend of all logs but those with both the same; null where
    fewer than two values of either are left [deg]."""
    unseen_offset_rms_deg: float | None
    """The same on its second half, the offset fitted to the first [deg]."""


@dataclass(frozen=True)
class GainAndOffset(Documented):
    """Of a known model, fitted again."""

    gain: float
    """Over the old model's."""
    gain_error: float | None
    """Its standard error; null where it is not known."""
    offset_deg: float
    """Added to gain · the old model's joint [deg]."""
    before_rms_deg: float | None
    """Error of the old model on this log [deg]."""
    after_rms_deg: float | None
    """The same with gain and offset fitted again [deg]."""
    judged_rms_deg: float | None
    """Error of the old model on data that it had not seen, as its file says [deg]."""
    changed: bool | None
    """True if the cable has changed; null where the file does not say how good the model was, and where the motor goes
    outside the identified stroke."""


@dataclass(frozen=True)
class Identification(Result["Fit"]):
    """Of one log, of several, or of one log and a known model."""

    best: str
    """The recommended model; chosen on stretches of the first half that were left out of the fit (of the whole log
    where the first half has fewer than four strokes), never by test_rms_deg."""
    warnings: tuple[str, ...]
    """What the logs cannot show, what was mended in them, and what to record instead."""
    samples: int
    """Samples in all logs."""
    models: dict[str, FittedModel]
    """Of one log line, play, bouc_wen, bouc_wen_static, prandtl_ishlinskii and generalised_play; of several scheduled
    and bouc_wen; of a known model those that it had."""
    judged_rms_deg: float | None
    """Error to expect of motion that was not seen: on the second half; of several logs on unseen loads, their offset
    known; of a known model as its file says [deg]."""
    loop: HysteresisLoop | None
    """Of the recommended model, as it runs along the log; an error is one standard deviation, null where nothing tells
    it. Null of several logs and of a known model, and where the motor has not gone both ways through the middle of its
    stroke."""
    forecast: ForecastOfModel | None
    """Root mean square error of the joint on a motion like the log's second half; the servo is taken to follow at
    once. Null of several logs and of a known model."""
    trust: TrustLevel
    """Whether to trust the recommended model for motions like the logs'."""
    variables: ScheduleVariables
    """Variables that schedule the model."""
    logs: tuple[LogOfFit, ...]
    """In the order in which they were given."""
    recalibration: GainAndOffset | None
    """Null where no known model was given."""
    _: KW_ONLY
    fit: "Fit"

    @property
    def value(self) -> "Fit":
        """The fit."""
        return self.fit


def identify(
    log: Annotated[
        "AnyLog | Sequence[AnyLog] | ArrayLike | None", Switch(list[Path], metavar="LOG...", place=True, default=EMPTY)
    ] = None,
    motor: Annotated["str | ArrayLike | None", Switch(str)] = None,
    joint: Annotated["str | ArrayLike | None", Switch(str)] = None,
    *,
    time: Annotated["str | ArrayLike | None", Switch(str)] = None,
    unit: Annotated[str | None, Switch(metavar="UNIT[,UNIT]")] = None,
    counts_per_turn: Annotated["float | Sequence[float] | str | None", Switch(str, metavar="N[,N]")] = None,
    spool_radius_mm: Annotated[float | None, Switch(metavar="MM")] = None,
    rate: Annotated[float | None, Switch(metavar="HZ")] = None,
    load: Annotated["str | float | Sequence[float] | None", Switch(str, metavar="VALUES|COLUMN|none")] = None,
    bend: Annotated["str | float | Sequence[float] | None", Switch(str, metavar="VALUES|COLUMN|none")] = None,
    model: Annotated["AnyModel | None", Switch(Path)] = None,
    name: Annotated[str, Switch(Role.PYTHON)] = "log",
    seed: Annotated[int, Switch(Role.PYTHON, least=0)] = 0,
    progress: GivenProgress = None,
) -> Identification:
    """Identify a cable from logs of its motion: which model to use, and why.

    Six models are fitted to the log's first half and judged on the second: a straight line, the play operator,
    Bouc-Wen, Bouc-Wen with a static nonlinearity, a Prandtl-Ishlinskii stack, and a generalised play between free
    branches. The command's folder gets model.toml, with every parameter and its uncertainty, and a page.

    Several logs are fitted together: one loop whose offset, slope, width and shape follow the logs' load, their bend or
    both. With `model` only gain and offset of a known cable are fitted, to some seconds of motion, and it is said
    whether the cable has changed.

    Args:
        log: CSV, gzipped CSV, MATLAB, NumPy, Parquet, Excel, TDMS, a bag of ROS 2: time, motor, joint; one file or
            more, or one with the motor and one with the joint, whose clocks are aligned by the motion. In Python also
            a `Log` of `read_log`, a `Trace`, a list of these, or time (n,) [s].
        motor: name or number of the motor-side angle's column; guessed by default. In Python also the angle (n,).
        joint: the same of the joint-side angle.
        time: the same of time; in Python where it does not come first.
        unit: deg, mdeg, rad, mrad, turns, counts, mm or cm, of both angles or of motor and joint; by default as the
            columns' names end, and of arrays radians.
        counts_per_turn: counts in a turn of both encoders, or of motor and joint, whatever the log's unit: a rig gets
            them.
        spool_radius_mm: radius of the motor's spool, where its column is a length of cable in mm.
        rate: rows a second, of a log without times [Hz].
        load: load of several logs: 0.1,0.2 (one for each, in their order, in any unit), or the column whose mean it is;
            by default a column of a common name (joint_torque_nm, tension_n, …). Of one log, where `model` depends on
            it.
        bend: bend of several logs, likewise (a column bend_deg, bend_angle…) [deg; rad in Python].
        model: a known one, the model.toml of this cable, or what `identify` returned: fit its gain and offset to the
            log, and tell whether it changed.
        name: of the log, for messages.
        seed: of the global search; the same seed gives the same result.
        progress: True for a line that says how far it is, or a function of what is being done and the share done.

    Returns:
        The fit: ``best``, the recommended model, for ``Rig(cable=…)``; ``models``, all models with their errors and
        uncertainties; ``logs``, how each is predicted; ``at(load=…)``, the model at a load; ``forecast``;
        ``recalibration``, gain, offset and ``changed``; ``warnings``, what the logs cannot show.

    Raises:
        LogError: a file that cannot be read, signals that nothing can be fitted to, or logs that do not go together.
        ParameterError: arguments of the wrong kind, or that do not go together.

    Examples:
        bowden identify log.csv
        bowden identify log.csv.gz --out out/cable
        bowden identify raw.csv --unit counts --counts-per-turn 8192,4000 --rate 1000
        bowden identify low.csv mid.csv high.csv --load 0.02,0.06,0.12
        bowden identify low.csv mid.csv high.csv --load joint_torque_nm
        bowden identify new.csv --model out/identify/model.toml --out out/new
        bowden identify log.csv --json

    >>> import bowden
    >>> import numpy as np
    >>> time = np.arange(0.0, 20.0, 0.01)
    >>> motor = 0.5 * np.sin(2.0 * time)
    >>> fit = bowden.identify(time, motor, 0.9 * motor + 0.1)
    >>> fit.best.name, round(fit.best.parameters["slope"], 6)
    ('line', 0.9)
    >>> units = {"time": "s", "motor": "rad", "joint": "rad"}
    >>> traces = [bowden.Trace({"time": time, "motor": motor, "joint": 0.9 * motor - k}, units) for k in (0.0, 0.1)]
    >>> together = bowden.identify(traces, load=[0.0, 0.2])
    >>> round(float(together.at(load=0.1).joint_angle(np.zeros(1))[0]), 3)
    -0.05
    >>> found = bowden.identify(traces[1], model=fit)
    >>> round(found.recalibration.gain, 3), round(found.best.parameters["offset"], 3)
    (1.0, -0.1)
    """
    from bowden.identify.cable.identification import identify as identify_cable
    from bowden.identify.given_log import known_cable, logs_of
    from bowden.identify.log.read import Layout
    from bowden.identify.log.variables import variables_of
    from bowden.operations.support.progress import reported

    logs = logs_of(log, Layout(time, motor, joint, unit, counts_per_turn, spool_radius_mm, rate), name)
    known = known_cable(model, len(logs))
    by = variables_of({"load": load, "bend": bend}, log, logs, known)
    with reported(progress, "identify") as report:
        fit = identify_cable(logs, by, known, seed=seed, progress=report)
    ahead, found = fit.forecast, fit.recalibration
    return Identification(
        fit.best.name,
        tuple(fit.warnings),
        fit.samples,
        {family: filled(FittedModel, one) for family, one in fit.models.items()},
        degrees(fit.judged_rms),
        fit.chosen.loop,
        ForecastOfModel(*map(degrees, ahead)) if ahead else None,
        TrustLevel(*fit.trust),
        ScheduleVariables(fit.units.get("load"), "rad" if "bend" in fit.units else None),
        tuple(_log_of(fit, one) for one in fit.logs),
        filled(GainAndOffset, found) if found else None,
        fit=fit,
    )


def _log_of(fit: "Fit", one: "FittedLog") -> LogOfFit:
    cycles = one.cycles
    advice = cycles.advice if len(fit.logs) == 1 and not fit.recalibration else cycles.to_record
    at = {"load": None, "bend": None} | dict(zip(fit.units, one.values, strict=True))
    return filled(LogOfFit, one, cycles=LogCycles(*cycles, advice or None), **at)


OPERATIONS = (Operation("identify", identify, 20),)
