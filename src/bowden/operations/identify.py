"""`identify`, `identify_together`, `recalibrate`: from logs of a cable to its model."""

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from bowden.operations.support.operation import GivenProgress, Operation, Switch
from bowden.operations.support.results import Result, ResultPart, degrees, json_of, made

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from bowden.identify.cable.cycles import Cycles
    from bowden.identify.cable.fit import Fit
    from bowden.identify.cable.joint_fit import JointFit
    from bowden.identify.cable.recalibrate import Recalibration
    from bowden.identify.log.read import Log
    from bowden.plants.identified import CableModel, IdentifiedCable
    from bowden.records.trace import Trace

    AnyLog = str | Path | Log | Trace
    AnyModel = str | Path | Fit | JointFit | Recalibration | CableModel | IdentifiedCable


@dataclass(frozen=True)
class IdentifyTrust(ResultPart):
    """Whether to trust a model."""

    level: Literal["yes", "with care", "no"]
    reasons: tuple[str, ...]
    """The gravest first."""


@dataclass(frozen=True)
class LogCycles(ResultPart):
    """Whole cycles of motion in a log."""

    whole: int
    more: int
    """To record; 0 from five cycles on."""
    advice: str | None
    """What to record and what it may be expected to give; with two and three cycles also how far the stated errors of
    logs as short have been exceeded. Null where nothing is to be recorded."""


@dataclass(frozen=True)
class FittedModel(ResultPart):
    """A family of models, fitted."""

    parameters: dict[str, float]
    """By name, slope and offset among them; SI and radians. model.toml says what each is and in which unit."""
    uncertainty: dict[str, float | None]
    """One standard deviation of each parameter; null where the log does not show it, where it ended at the bound of its
    search, or where none is stated: of a setting that was not fitted, and of generalised_play, whose parameters trade
    with one another."""
    train_rms_deg: float | None
    """Error of the joint on the first half, of the family fitted to it [deg]; the parameters are fitted to the whole
    log."""
    test_rms_deg: float | None
    """Error of the joint on the second half, of the family fitted to the first [deg]."""


@dataclass(frozen=True)
class LoopOfModel(ResultPart):
    """The hysteresis loop of a model."""

    slope: float
    """Of the middle half of the stroke [rad/rad]."""
    slope_error: float | None
    offset: float
    """Joint angle at motor angle 0 of the line through the middle half [rad]."""
    offset_error: float | None
    height: float
    """How far apart both ways are there, at the joint; below zero where the joint leads [rad]."""
    height_error: float | None
    rising_place: tuple[float | None, ...]
    """Motor angles along the stroke while it rises; null where it did not pass [rad]."""
    rising: tuple[float | None, ...]
    """Joint angles there [rad]."""
    rising_error: tuple[float | None, ...]
    falling_place: tuple[float | None, ...]
    """Motor angles while it falls [rad]."""
    falling: tuple[float | None, ...]
    """Joint angles there [rad]."""
    falling_error: tuple[float | None, ...]
    curve_error: float | None
    """Root mean square of rising_error and falling_error [rad]."""


@dataclass(frozen=True)
class ForecastOfModel(ResultPart):
    """What a compensation by the model would leave."""

    compensated_rms_deg: float | None
    """With the inverse of the recommended model commanded exactly: its error on the second half, weighted by the time
    that the inverse spends at each place [deg]."""
    uncompensated_rms_deg: float | None
    """With the inverse of the straight line [deg]."""
    resolution_rms_deg: float
    """Of both encoders' counts, at the joint; 0 where the log shows no counts [deg]."""


@dataclass(frozen=True)
class _Identified(ResultPart):
    """What is said of any identification."""

    best: str
    """The recommended model; chosen on stretches of the first half that were left out of the fit (of the whole log
    where the first half has fewer than four strokes), never by test_rms_deg."""
    warnings: tuple[str, ...]
    """What the log cannot show, what was mended in it, and what to record instead."""
    samples: int
    """Samples in the log."""


@dataclass(frozen=True)
class Identification(_Identified, Result["Fit"]):
    """Of one log."""

    models: dict[str, FittedModel]
    """line, play, bouc_wen, bouc_wen_static, prandtl_ishlinskii and generalised_play."""
    loop: LoopOfModel | None
    """Of the recommended model, as it runs along the log; an error is one standard deviation, null where nothing tells
    it. Null where the motor has not gone both ways through the middle of its stroke."""
    forecast: ForecastOfModel
    """Root mean square error of the joint on a motion like the log's second half; the servo is taken to follow at
    once."""
    trust: IdentifyTrust
    """Whether to trust the recommended model for motions like the log's."""
    cycles: LogCycles
    """Whole cycles in the log: as often the motor passed each place in the middle half of its range both ways."""
    _: KW_ONLY
    fit: "Fit"

    @property
    def value(self) -> "Fit":
        """The fit."""
        return self.fit


@dataclass(frozen=True)
class ScheduleVariables(ResultPart):
    """What a model is scheduled by."""

    load: str | None
    """Unit of the load, empty where nothing says it; null where the model does not follow a load."""
    bend: Literal["rad"] | None
    """The same of the bend."""


@dataclass(frozen=True)
class ModelParameters(ResultPart):
    """The parameters of a model."""

    parameters: dict[str, float]
    """By name; SI and radians. model.toml says what each is and in which unit."""


@dataclass(frozen=True)
class LogOfSeveral(ResultPart):
    """One of several logs."""

    name: str
    samples: int
    cycles: LogCycles
    load: float | None
    """Its mean, in the log's unit."""
    bend: float | None
    """Its mean [rad]."""
    train_rms_deg: float | None
    """Error of the model, which was fitted to this log too [deg]."""
    test_rms_deg: float | None
    """On its second half, of a model of all first halves [deg]."""
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
class JointIdentification(_Identified, Result["JointFit"]):
    """Of several logs fitted together."""

    variables: ScheduleVariables
    """What the model is scheduled by."""
    models: dict[str, ModelParameters]
    logs: tuple[LogOfSeveral, ...]
    judged_rms_deg: float | None
    """What to expect of another log of this cable once its offset is known [deg]."""
    trust: IdentifyTrust
    """Whether to trust the model for motions like the logs'."""
    _: KW_ONLY
    fit: "JointFit"

    @property
    def value(self) -> "JointFit":
        """The fit."""
        return self.fit


@dataclass(frozen=True)
class Recalibrated(_Identified, Result["Recalibration"]):
    """Of a log and the model of another."""

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
    """Whether the cable has changed; null where the file does not say how good the model was, and where the motor goes
    outside the identified stroke."""
    models: dict[str, ModelParameters]
    trust: IdentifyTrust | None
    """Null where neither the old model's file nor the new log says anything."""
    cycles: LogCycles
    """Whole cycles in the log, and how many more to record, to identify the cable from it."""
    _: KW_ONLY
    found: "Recalibration"

    @property
    def value(self) -> "Recalibration":
        """What was found."""
        return self.found


def identify(
    log: "str | Path | Log | Trace | ArrayLike | None" = None,
    motor: "str | ArrayLike | None" = None,
    joint: "str | ArrayLike | None" = None,
    *,
    time: "str | ArrayLike | None" = None,
    unit: str | None = None,
    counts_per_turn: float | Sequence[float] | None = None,
    rate: float | None = None,
    name: str = "log",
    seed: Annotated[int, Switch(least=0)] = 0,
    progress: GivenProgress = None,
) -> Identification:
    """Fit six families of cable models to the first half of a log, and judge them on the second half.

    Args:
        log: the path of a CSV, gzipped CSV, MATLAB, NPZ or Parquet file; a `Log` of `read_log`; a `Trace`; or time (n,)
            [s].
        motor: motor-side angle (n,); of a file, the name of its column.
        joint: joint-side angle (n,); of a file, the name of its column.
        time: the same for time, where it does not come first.
        unit: of the angles, ``rad``, ``deg`` or ``counts``, or one each (``"counts,deg"``); radians where it is not
            given, or as a file's columns say.
        counts_per_turn: of the encoders, where they count: one number, or one for the motor and one for the joint.
        rate: samples a second, of a log without times [Hz].
        name: of the log, for messages.
        seed: of the global search; the same seed gives the same result.
        progress: True for a line that says how far it is, or a function of what is being done and the share done.

    Returns:
        The fit: ``best``, the recommended model, for ``Rig(cable=…)``; ``models``, all models with their errors and
        uncertainties; ``forecast``; ``warnings``, what the log cannot show.

    Raises:
        LogError: a file that cannot be read, or signals that nothing can be fitted to.
        ParameterError: arguments of the wrong kind.

    >>> import bowden
    >>> import numpy as np
    >>> time = np.arange(0.0, 20.0, 0.01)
    >>> motor = 0.5 * np.sin(2.0 * time)
    >>> fit = bowden.identify(time, motor, 0.9 * motor + 0.1)
    >>> fit.best.name, round(fit.best.parameters["slope"], 6)
    ('line', 0.9)
    """
    from bowden.identify.given_log import identified
    from bowden.operations.support.progress import reported

    with reported(progress, "identify") as report:
        given = (log, motor, joint, time, unit, counts_per_turn, rate)
        fit = identified(*given, name=name, seed=seed, progress=report)
    models = {
        family: FittedModel(dict(one.parameters), dict(one.uncertainty), degrees(one.train_rms), degrees(one.test_rms))
        for family, one in fit.models.items()
    }
    loop = fit.chosen.loop
    return Identification(
        fit.best.name,
        tuple(fit.warnings),
        fit.samples,
        models=models,
        loop=None if loop is None else made(LoopOfModel, json_of(loop), curve_error=loop.curve_error),
        forecast=ForecastOfModel(*map(degrees, fit.forecast)),
        trust=IdentifyTrust(*fit.trust),
        cycles=_cycles(fit.cycles, fit.cycles.advice),
        fit=fit,
    )


def identify_together(
    logs: "Sequence[AnyLog]",
    *,
    load: "str | Sequence[float] | None" = None,
    bend: "str | Sequence[float] | None" = None,
    seed: Annotated[int, Switch(least=0)] = 0,
    progress: GivenProgress = None,
    **columns: Any,
) -> JointIdentification:
    """Fit one model to several logs of a cable; the model depends on the load, the bend, or both.

    Args:
        logs: two or more paths, `Log`s of `read_log` or traces.
        load: one value for each log, in any unit; or the name of a column, of which the mean is used. If left out, a
            column with a common name is looked for in files. ``"none"`` for no load.
        bend: the same [rad].
        seed: of the search for the plain Bouc–Wen cable.
        progress: True for a line that says how far it is, or a function of what is being done and the share done.
        **columns: ``time``, ``motor``, ``joint``, ``unit``, ``counts_per_turn`` and ``rate`` of files; see `read_log`.

    Returns:
        The fit: ``best``, the model, for ``Rig(cable=…)``; ``at(load=…)``, the model at a load; and how well the other
        logs predict each log.

    Raises:
        LogError: files that cannot be read, or logs that do not go together.
        ParameterError: arguments of the wrong kind.

    >>> import bowden
    >>> import numpy as np
    >>> time = np.arange(0.0, 20.0, 0.01)
    >>> motor = 0.5 * np.sin(2.0 * time)
    >>> units = {"time": "s", "motor": "rad", "joint": "rad"}
    >>> joints = [0.9 * motor - 0.5 * load for load in (0.0, 0.1, 0.3)]
    >>> logs = [bowden.Trace({"time": time, "motor": motor, "joint": joint}, units) for joint in joints]
    >>> fit = bowden.identify_together(logs, load=[0.0, 0.1, 0.3])
    >>> round(float(fit.at(load=0.2).joint_angle(np.zeros(1))[0]), 3)
    -0.1
    """
    from bowden.core import arguments
    from bowden.core.errors import ParameterError
    from bowden.identify.cable.loads import identify_loads
    from bowden.identify.given_log import log_of, variable_of
    from bowden.identify.log.read import Log
    from bowden.operations.support.progress import reported
    from bowden.records.trace import Trace

    if isinstance(logs, str | Path | Log | Trace) or not isinstance(logs, Sequence):
        raise ParameterError(
            f"identify_together: logs is {arguments.said(logs)}",
            expected="a list of two logs or more",
            do="for a single log use bowden.identify",
        )
    read = [log_of(one, f"identify_together: logs[{i}]", columns) for i, one in enumerate(logs)]
    by = [variable_of(name, given, logs, read) for name, given in (("load", load), ("bend", bend))]
    values = (one.values if one else None for one in by)
    units = [one.unit if one else "" for one in by]
    with reported(progress, "identify_together") as report:
        fit = identify_loads(read, *values, units=units, seed=seed, progress=report)
    fit = replace(fit, warnings=(*fit.warnings, *(one.said for one in by if one and one.said)))
    units_of: dict[str, Any] = {"load": None, "bend": None} | dict(zip(fit.variables, fit.units, strict=True))
    errors = ("train_rms", "test_rms", "same_rms", "same_offset_rms", "unseen_rms", "unseen_offset_rms")
    found = tuple(
        LogOfSeveral(
            one.name,
            one.samples,
            _cycles(one.cycles, one.cycles.to_record),
            **{"load": None, "bend": None} | dict(zip(fit.variables, one.values, strict=True)),
            **{f"{error}_deg": degrees(getattr(one, error)) for error in errors},
        )
        for one in fit.logs
    )
    return JointIdentification(
        fit.best.name,
        tuple(fit.warnings),
        fit.samples,
        variables=ScheduleVariables(**units_of),
        models=_models(fit.best),
        logs=found,
        judged_rms_deg=degrees(fit.judged),
        trust=IdentifyTrust(*fit.trust),
        fit=fit,
    )


def recalibrate(
    log: "AnyLog",
    model: "AnyModel",
    *,
    load: "str | float | None" = None,
    bend: "str | float | None" = None,
    **columns: Any,
) -> Recalibrated:
    """Fit gain and offset of a known model to a few seconds of new motion, and say whether the cable has changed.

    Args:
        log: a path, a `Log` of `read_log` or a trace, with at least one reversal.
        model: a model.toml, or what `identify`, `identify_together` or `recalibrate` returned.
        load: of the log, if the model depends on it; a number, or the name of a column.
        bend: the same [rad].
        **columns: ``time``, ``motor``, ``joint``, ``unit``, ``counts_per_turn`` and ``rate`` of a file.

    Returns:
        Gain, offset, the errors before and after, ``changed``, and ``best``, the new model, for ``Rig(cable=…)``.

    Raises:
        LogError: a file that cannot be read, no reversal, or a joint that moves the other way.
        ParameterError: arguments of the wrong kind.

    >>> import bowden
    >>> import numpy as np
    >>> time = np.arange(0.0, 20.0, 0.01)
    >>> motor = 0.5 * np.sin(2.0 * time)
    >>> fit = bowden.identify(time, motor, 0.9 * motor)
    >>> signals = {"time": time[:500], "motor": motor[:500], "joint": 0.88 * motor[:500] + 0.1}
    >>> new = bowden.Trace(signals, {"time": "s", "motor": "rad", "joint": "rad"})
    >>> found = bowden.recalibrate(new, fit)
    >>> round(found.best.parameters["slope"], 4), round(found.best.parameters["offset"], 4)
    (0.88, 0.1)
    """
    from bowden.core import arguments
    from bowden.identify.cable.recalibrate import recalibrate as recalibrate_log
    from bowden.identify.cable.recalibrate import to_identify
    from bowden.identify.given_log import known_cable, log_of, variable_of

    cable, judged = known_cable(model)
    read = log_of(log, "recalibrate: log", columns)
    values: dict[str, float] = {}
    units: dict[str, str] = {}
    for name, given in (("load", load), ("bend", bend)):
        if isinstance(given, str) or (given is None and f"{name}_low" in cable.model().parameters):
            found = variable_of(name, given, [log], [read])
            values |= {name: found.values[0]} if found else {}
            units |= {name: found.unit} if found else {}
        elif given is not None:
            values[name] = arguments.number(given, f"recalibrate: {name}")
    result = recalibrate_log(read, cable, judged, values, units)
    return Recalibrated(
        result.best.name,
        tuple(result.warnings),
        result.samples,
        **{name: getattr(result, name) for name in ("gain", "gain_error", "changed")},
        offset_deg=degrees(result.offset),
        before_rms_deg=degrees(result.before_rms),
        after_rms_deg=degrees(result.after_rms),
        judged_rms_deg=degrees(result.judged_rms),
        models=_models(result.best),
        trust=None if result.best.trust is None else IdentifyTrust(*result.best.trust),
        cycles=_cycles(result.cycles, to_identify(result.cycles)),
        found=result,
    )


def identify_logs(
    logs: Annotated[list[Path], Switch(metavar="LOG...")],
    *,
    time: str | None = None,
    motor: str | None = None,
    joint: str | None = None,
    unit: Annotated[str | None, Switch(metavar="UNIT[,UNIT]")] = None,
    counts_per_turn: Annotated[str | None, Switch(metavar="N[,N]")] = None,
    rate: Annotated[float | None, Switch(metavar="HZ")] = None,
    load: Annotated[str | None, Switch(metavar="VALUES|COLUMN|none")] = None,
    bend: Annotated[str | None, Switch(metavar="VALUES|COLUMN|none")] = None,
    model: Path | None = None,
    progress: GivenProgress = None,
) -> Identification | JointIdentification | Recalibrated:
    """Identify a cable from a log of its motion: which model to use, and why.

    Cable models are fitted to the log's first half and judged on the second. Six models are fitted: a straight line,
    the play operator, Bouc-Wen, Bouc-Wen with a static nonlinearity, a Prandtl-Ishlinskii stack, and a generalised play
    between free branches. The folder gets model.toml, with every parameter and its uncertainty, and a page.

    Several logs are fitted together: one loop whose offset, slope, width and shape follow the logs' load, their bend or
    both. With `model` nothing is identified but gain and offset of a known cable, from seconds of motion.

    Args:
        logs: CSV, gzipped CSV, MATLAB, NPZ or Parquet: time, motor, joint; one file or more.
        time: name of the time column; guessed by default.
        motor: name of the motor-side angle's column.
        joint: name of the joint-side angle's column.
        unit: unit of both angles, or of motor and joint: deg, rad or counts; by default as the columns' names end.
        counts_per_turn: counts in a turn of both encoders, or of motor and joint, whatever the log's unit: a rig gets
            them.
        rate: rows a second, of a log without times.
        load: load of several logs: 0.1,0.2 (one for each, in their order), or the column whose mean it is; by default a
            column of a common name (joint_torque_nm, tension_n, …).
        bend: bend of several logs [deg], likewise (a column bend_deg, bend_angle…).
        model: the model.toml of this cable: fit its gain and offset to the log, and tell whether it changed.

    Raises:
        LogError: files that cannot be read, or logs that do not go together.
        ParameterError: options that do not go together.
    """
    from bowden.core.caller import argument
    from bowden.core.errors import ParameterError

    columns: dict[str, Any] = {"time": time, "motor": motor, "joint": joint, "unit": unit}
    columns |= {"counts_per_turn": counts_per_turn, "rate": rate}
    if model is not None:
        if len(logs) > 1:
            what = f"{argument('model')} with {len(logs)} logs"
            raise ParameterError(what, expected="one log, whose gain and offset are fitted", do="give one log")
        return recalibrate(logs[0], model, load=load, bend=bend, **columns)
    if len(logs) > 1:
        return identify_together(logs, load=load, bend=bend, progress=progress, **columns)
    for name, value in (("load", load), ("bend", bend)):
        if value is not None:
            raise ParameterError(
                f"{argument(name)} with one log, which cannot tell what the {name} changes",
                expected=f"several logs, or {argument('model')} with a model that is scheduled by it",
                do=f"give the other logs too, or leave out {argument(name)}",
            )
    return identify(logs[0], progress=progress, **columns)


def _cycles(cycles: "Cycles", advice: str) -> LogCycles:
    return LogCycles(**cycles._asdict(), advice=advice or None)


def _models(best: "CableModel") -> dict[str, ModelParameters]:
    every = ((best.name, best.parameters), *best.others.items())
    return {name: ModelParameters(dict(parameters)) for name, parameters in every}


OPERATIONS = (
    Operation(
        "identify",
        identify_logs,
        (
            "bowden identify log.csv",
            "bowden identify log.csv.gz --out out/cable",
            "bowden identify raw.csv --unit counts --counts-per-turn 8192,4000 --rate 1000",
            "bowden identify low.csv mid.csv high.csv --load 0.02,0.06,0.12",
            "bowden identify low.csv mid.csv high.csv --load joint_torque_nm",
            "bowden identify new.csv --model out/identify/model.toml --out out/new",
            "bowden identify log.csv --json",
        ),
        place=20,
    ),
)
