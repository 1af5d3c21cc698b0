"""`log`: what is in the log of a run, and what can be made of it."""

from dataclasses import KW_ONLY, asdict, dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from bowden.live.figures import LogFacts, Recovery, Replay
from bowden.operations.support.operation import Operation, Switch
from bowden.operations.support.results import Result

if TYPE_CHECKING:
    from bowden.live.mcap_read import LogReader, Recording

File = Annotated[Path, Switch(metavar="FILE")]


@dataclass(frozen=True)
class LogInfo(LogFacts, Result["LogInfo"]):
    """Content of a log."""

    file: Path
    """The log."""


@dataclass(frozen=True)
class LogRecovered(Recovery, Result["LogRecovered"]):
    """A whole log of what was left of one."""

    files: tuple[Path, ...]
    """The new log."""


@dataclass(frozen=True)
class LogExported(Result["LogExported"]):
    """A log as a trace."""

    files: tuple[Path, ...]
    """The trace."""
    cycles: int
    """Its rows."""
    columns: tuple[str, ...]
    """Its columns."""


@dataclass(frozen=True)
class LogDrawn(Result["LogDrawn"]):
    """A log that was read."""

    _: KW_ONLY
    recording: "Recording"


@dataclass(frozen=True)
class ReplayFigures(Replay):
    """Comparison of a replay of one motor with its record."""

    law: str
    """The law that was fed with it."""
    same_law: bool
    """True if it is the law of the record, with the gains it had."""
    rig: str | None
    """Hash of the rig: equal rigs have the same, whether they come from a file, Python or a log. null in a log without
    one."""
    motor: str
    """Name of the one that these figures are of; empty of a run with one motor."""


@dataclass(frozen=True)
class LogReplay(ReplayFigures, Result["LogReplay"]):
    """How a run, fed through a law and the supervisor again, compares with its record.

    Of a run with several motors the figures are those of the one that differs most.
    """

    file: Path
    """The log."""
    motors: tuple[ReplayFigures, ...]
    """The same for each motor of a run with several; else empty."""
    differs: bool
    """True if the law that ran gives other numbers than were recorded."""

    @property
    def exit_code(self) -> int:
        """1 where they differ."""
        return 1 if self.differs else 0


def log_info(file: File, *, motor: str | None = None) -> LogInfo:
    """Summarise a log: end of the run, duration, missing cycles, lateness, events, settings.

    Args:
        file: a log, as ``bowden run`` writes it: NAME.mcap.
        motor: one motor alone, of a run with several.

    Raises:
        LogError: it cannot be read.

    Examples:
        bowden log info run.mcap
        bowden log info run.mcap --json
    """
    from bowden.live.log_facts import facts, needed
    from bowden.live.mcap_read import read

    found = read(file, needed(file))
    shown = facts(found if motor is None else found.only(motor))
    return LogInfo(**vars(shown), file=file, **_doubts(found, file))


def log_recover(
    file: File,
    more: Annotated[list[Path] | None, Switch(metavar="MORE", place=True)] = None,
    *,
    out: Path | None = None,
) -> LogRecovered:
    """Recover what a killed process or a full disk left of a log, and join the files of one run.

    A run whose recorder was ended has another file for each recorder that was started again. They stay as they are.

    Args:
        file: a log, as ``bowden run`` writes it: NAME.mcap.
        more: others of the same run, to be joined: NAME-again1.mcap.
        out: the new file; NAME.recovered.mcap by default.

    Raises:
        LogError: nothing of it can be read.
        OutputError: the new file is there, or cannot be written.

    Examples:
        bowden log recover run.mcap
        bowden log recover run.mcap --out saved.mcap
        bowden log recover run.mcap run-again1.mcap
    """
    from bowden.live.mcap_read import recover as save

    target = out or file.with_name(f"{file.stem}.recovered.mcap")
    saved = save(file, target, more or ())
    return LogRecovered(**vars(saved), files=(target,))


def log_export(file: File, *, out: Path | None = None, motor: str | None = None) -> LogExported:
    """Write a log as CSV, NPZ or Parquet, with units and settings: bowden identify takes it, and so does pandas.

    Of a run with several motors the first motor's columns have plain names, those of another begin with its name.

    Args:
        file: a log, as ``bowden run`` writes it: NAME.mcap.
        out: the new file, .csv, .npz or .parquet; NAME.csv by default.
        motor: one motor alone, of a run with several.

    Raises:
        LogError: it cannot be read.
        OutputError: the new file cannot be written.

    Examples:
        bowden log export run.mcap
        bowden log export run.mcap --out run.parquet
    """
    from itertools import chain

    from bowden.live.mcap_read import LogReader, traces
    from bowden.records.trace import write_traces

    target = _other(out or file.with_suffix(".csv"), file)
    log = LogReader(file)
    pieces = traces(log, motor)
    first = next(pieces)
    write_traces(chain([first], pieces), target)
    return LogExported((target,), log.count, tuple(first.columns), **_doubts(log, file))


def log_plot(file: File, *, motor: str | None = None) -> LogDrawn:
    """Draw a log as a page: motion, error, command, modes and faults, lateness, settings.

    Of a run with several motors one page for each, NAME-MOTOR.html.

    Args:
        file: a log, as ``bowden run`` writes it: NAME.mcap.
        motor: one motor alone, of a run with several.

    Raises:
        LogError: it cannot be read.

    Examples:
        bowden log plot run.mcap
        bowden log plot run.mcap --out page.html
    """
    from bowden.live.mcap_read import read

    found = read(file)
    return LogDrawn(recording=found if motor is None else found.only(motor), **_doubts(found, file))


def log_replay(file: File, *, law: str | None = None, trust_law: bool = False, motor: str | None = None) -> LogReplay:
    """Run law and supervisor again on a run's recorded readings, and compare the commands.

    Several motors are replayed one after the other. The command's exit code is 1 where the law that ran gives
    other numbers than were recorded.

    Args:
        file: a log, as ``bowden run`` writes it: NAME.mcap.
        law: a law's name, or FILE.py:NAME of your own; by default the one that ran.
        trust_law: run the law and the plant in the log although you never ran them on this computer.
        motor: one motor alone, of a run with several.

    Raises:
        LogError: it cannot be read, or has a program that was never run here.

    Examples:
        bowden log replay run.mcap
        bowden log replay run.mcap --law my_law.py:MINE --json
    """
    from bowden.live.log_rig import hash_of
    from bowden.live.mcap_read import read

    found = read(file)
    parts = found.parts if motor is None else {motor: found.only(motor)}
    figures, differs = [], False
    for name, part in parts.items():
        one, other = _replayed(part, law, name)
        figures.append(one)
        differs = differs or other
    most = max(figures, key=lambda one: (one.verdicts_differing, one.command_largest))
    whole = {one.name: getattr(most, one.name) for one in fields(most)} | {"rig": hash_of(found.settings)}
    several = tuple(figures) if len(figures) > 1 else ()
    return LogReplay(**whole, file=file, motors=several, differs=differs, **_doubts(found, file))


def _replayed(found: "Recording", law: str | None, motor: str) -> tuple[ReplayFigures, bool]:
    """How the replay of one motor compares, and whether it differs though the law is the one that ran."""
    from bowden.control import user_law
    from bowden.cycle.one_cycle import Filters
    from bowden.live.log_rig import hash_of, law_of, source_for
    from bowden.live.replay import replay as run
    from bowden.live.run_settings import recorded
    from bowden.safety.limits import Limits

    chosen, same = law_of(found, law)
    limits, filters = recorded(Limits, found.settings, "limits"), recorded(Filters, found.settings, "filters")
    period, source = float(found.settings["sample_time"]), source_for(found, chosen)
    with user_law.explained(chosen):
        result = run(found, chosen, limits, filters, period, same=same, source=source)
    whose: dict[str, Any] = {"law": chosen.name, "same_law": same, "rig": hash_of(found.settings), "motor": motor}
    return ReplayFigures(**whose, **asdict(result)), same and result.deviates


def _other(target: Path, file: Path) -> Path:
    """A file to write, which is not the log.

    Raises:
        OutputError: it is.
    """
    from bowden.core.caller import argument
    from bowden.core.errors import OutputError

    if target.absolute() == file.absolute():
        raise OutputError(f"{target} is the log itself", do=f"choose another name with {argument('out')}")
    return target


def _doubts(found: "Recording | LogReader", file: Path) -> dict[str, Any]:
    """Notes on where a log is not what a run that ended well leaves; `log_info` has the figures."""
    import shlex
    from glob import escape

    def recovering(*files: Path) -> str:
        return shlex.join(["bowden", "log", "recover", *map(str, files)])

    notes = []
    if not found.whole:
        how = "was not closed properly" if found.closing is None else "is damaged"
        notes.append(f"{file} {how}; see: {recovering(file)}")
    if found.missing:
        others = sorted(file.parent.glob(f"{escape(file.stem)}-again*.mcap"))
        join = f"; join it with its others: {recovering(file, *others)}" if others else ""
        notes.append(f"{found.missing} cycles of this run are not in {file}{join}")
    return {"notes": tuple(notes), "needless": tuple(notes)}


GROUP = "Read, plot, export, repair and replay the log of a run."
OPERATIONS = (
    Operation("log info", log_info, 10),
    Operation("log recover", log_recover, 20),
    Operation("log export", log_export, 30),
    Operation("log plot", log_plot, 40),
    Operation("log replay", log_replay, 50),
)
