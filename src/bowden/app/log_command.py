"""``bowden log``: what is in the log of a run, and what can be made of it."""

import shlex
import sys
from dataclasses import replace
from glob import escape
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bowden.app.command import Command
from bowden.app.console import print_json, seconds
from bowden.app.given_rig import trusting
from bowden.core.errors import OutputError

if TYPE_CHECKING:
    from bowden.live.mcap_read import Recording
    from bowden.live.mcap_reader import LogReader
    from bowden.live.replay import Replay

FileArgument = Annotated[Path, typer.Argument(help="A log, as bowden run writes it: NAME.mcap.", metavar="FILE")]
AxisOption = Annotated[str | None, typer.Option("--axis", help="One axis alone, of a run with several.")]
JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")]


def info(file: FileArgument, axis: AxisOption = None, json: JsonOption = False) -> None:
    """Say what a log holds: duration, cycles, what is missing, lateness, events, settings."""
    from bowden.live.log_facts import facts, needed
    from bowden.live.mcap_read import read

    found = read(file, needed(file))
    document = facts(found if axis is None else found.axis(axis))
    if json:
        print_json({"file": str(file), **document, "seconds": seconds()})
        return
    _print_facts(file, document)
    _warn(found, file)


def recover(
    file: FileArgument,
    more: Annotated[
        list[Path] | None,
        typer.Argument(help="Others of the same run, to be joined: NAME-again1.mcap.", metavar="MORE"),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="The new file; NAME.recovered.mcap by default.")] = None,
    json: JsonOption = False,
) -> None:
    """Write a whole log from what a kill or a full disk left of one, and join the files of one run.

    A run whose recorder was ended has another file for each recorder that was started again. FILE and MORE stay as they
    are.
    """
    from bowden.live.mcap_recover import recover as save

    target = out or file.with_name(f"{file.stem}.recovered.mcap")
    saved = save(file, target, more or ())
    if json:
        document = saved._replace(damage=None)._asdict()  # type: ignore[arg-type]
        document |= {"missing_seconds": round(saved.missing_seconds, 6), "damage": saved.damage._asdict()}
        print_json({"files": [str(target)], **document, "seconds": seconds()})
        return
    print(f"{target}: {saved.rows} cycles")
    if saved.missing:
        print(f"missing before the last of them: {saved.missing} cycles, {saved.missing_seconds:.3f} s")
    if saved.damage.chunks or saved.damage.skipped:
        print(f"left out: {saved.damage.chunks} damaged chunks, {saved.damage.skipped} bytes that are no record")
    if saved.tail_seconds:
        print(
            f"{file} has no proper end: after its last cycle up to {saved.tail_seconds:g} s of the run may be missing, "
            "more where the disk was slow or full or the power went"
        )
    elif not (saved.missing or saved.damage.chunks or saved.damage.skipped):
        print("nothing was missing")


def export(
    file: FileArgument,
    out: Annotated[Path | None, typer.Option(help="The new file, .csv, .npz or .parquet; NAME.csv by default.")] = None,
    axis: AxisOption = None,
    json: JsonOption = False,
) -> None:
    """Write a log as a trace, with units and settings: bowden identify takes it, and so does pandas.

    Of a run with several axes the first axis' columns have plain names, those of another begin with its name.
    """
    from bowden.live.mcap_read import columns_of, traces
    from bowden.live.mcap_reader import LogReader
    from bowden.records.trace import write_traces

    target = out or file.with_suffix(".csv")
    if target.absolute() == file.absolute():
        raise OutputError(f"{target} is the log itself", do="choose another name with --out")
    log = LogReader(file)
    columns = log.columns if axis is None else columns_of(log, axis)
    write_traces(traces(log, axis), target)
    if json:
        files = [str(target)]
        print_json({"files": files, "cycles": log.count, "columns": list(columns), "seconds": seconds()})
        return
    print(f"{target}: {log.count} cycles of {len(columns)} columns")
    _warn(log, file)


def plot(
    file: FileArgument,
    out: Annotated[Path | None, typer.Option(help="The page; NAME.html by default.")] = None,
    axis: AxisOption = None,
    json: JsonOption = False,
) -> None:
    """Draw a log as a page: motion, error, command, modes and faults, lateness, settings.

    Of a run with several axes one page for each, NAME-AXIS.html.
    """
    from bowden.live.mcap_read import read

    target = out or file.with_suffix(".html")
    if target.absolute() == file.absolute():
        raise OutputError(f"{target} is the log itself", do="choose another name with --out")
    found = read(file)
    parts = found.parts if axis is None else {"": found.axis(axis)}
    files = [target.with_stem(f"{target.stem}-{name}") if name else target for name in parts]
    for page, (name, part) in zip(files, parts.items(), strict=True):
        _draw(part, page, f"Run {file.name}{f', {name or axis}' if name or axis else ''}")
    if json:
        print_json({"files": [str(page) for page in files], "seconds": seconds()})
        return
    for page in files:
        print(f"Page: {page}  ({seconds():.1f} s)")
    _warn(found, file)


def _draw(found: "Recording", target: Path, title: str) -> None:
    """The page of one axis."""
    from bowden.live.log_facts import facts
    from bowden.report.log_page import write_log

    said, trace = facts(found), found.trace()
    begin = said["begin_s"] or 0.0  # the column time begins with the command, which compiles first
    trace = replace(trace, columns={**trace.columns, "time": trace.columns["time"] - begin})
    events = [(event.time - begin, event.text) for event in found.events]
    write_log(target, trace, events, said, title)


def replay(
    file: FileArgument,
    law: Annotated[
        str | None, typer.Option(help="A law's name, or FILE.py:NAME of your own; by default the one that ran.")
    ] = None,
    trust_law: Annotated[
        bool,
        typer.Option(
            "--trust-law", help="Run the law and the plant in the log although you never ran them on this computer."
        ),
    ] = False,
    axis: AxisOption = None,
    json: JsonOption = False,
) -> None:
    """Feed a recorded run through a law and the supervisor, and compare with what was commanded then.

    Of a run with several axes each is, one after the other. Exit code 1 where the law that ran gives other numbers than
    were recorded.
    """
    from bowden.live.log_rig import hash_of
    from bowden.live.mcap_read import read

    found = read(file)
    parts = found.parts if axis is None else {axis: found.axis(axis)}
    replayed = {name: _replayed(part, law, trust_law=trust_law) for name, part in parts.items()}
    if json:
        documents = [
            {**({"axis": name} if name else {}), "rig": hash_of(parts[name].settings), "law": chosen}
            | {"same_law": same, **result._asdict()}
            for name, (chosen, same, result) in replayed.items()
        ]
        whole = documents[0] if len(documents) == 1 else {"rig": hash_of(found.settings), "axes": documents}
        print_json({"file": str(file), **whole, "seconds": seconds()})
    else:
        for name, (chosen, same, result) in replayed.items():
            if name:
                print(f"axis {name}")
            _print_replay(result, chosen, same)
        _warn(found, file)
    if any(same and result.differs for _, same, result in replayed.values()):
        raise typer.Exit(1)


def _replayed(found: "Recording", law: str | None, *, trust_law: bool) -> "tuple[str, bool, Replay]":
    """Name of the law, whether it is the one that ran, and how the replay of one axis compares."""
    from bowden.control import user_law
    from bowden.live.log_replay import law_of, source_for
    from bowden.live.replay import replay as run
    from bowden.live.run_settings import filters_of, limits_of

    chosen, same = trusting(lambda: law_of(found, law), unasked=trust_law)
    limits, filters = limits_of(found.settings), filters_of(found.settings)
    period, source = float(found.settings["sample_time"]), source_for(found, chosen)
    with user_law.explained(chosen):
        return chosen.name, same, run(found, chosen, limits, filters, period, same=same, source=source)


def _print_replay(result: "Replay", law: str, same: bool) -> None:
    whose = "with the record's gains" if same else "with its default gains, in place of the record's law"
    print(f"{law}, {whose}: {result.cycles} cycles, the law had the motor in {result.law_cycles}")
    if result.wish_largest is not None:
        print(f"wish: differs by {result.wish_largest:.3g} rad at most, {result.wish_rms:.3g} rad RMS")
    print(
        f"verdict: differs in {result.verdicts_differing} cycles"
        + ("" if result.first_other_verdict is None else f", first at {result.first_other_verdict:.3f} s")
        + f"; target by {result.command_largest:.3g} rad at most"
    )
    if result.torque_largest is not None:
        print(f"torque offset: differs by {result.torque_largest:.3g} N·m at most")


def _warn(found: "Recording | LogReader", file: Path) -> None:
    """Say on standard error where a log is not what a run that ended well leaves."""
    if not found.whole:
        how = "was not closed properly" if found.closing is None else "is damaged"
        print(f"bowden: note: {file} {how}; see: {_recovering(file)}", file=sys.stderr)
    if found.missing:
        others = sorted(file.parent.glob(f"{escape(file.stem)}-again*.mcap"))
        join = f"; join it with its others: {_recovering(file, *others)}" if others else ""
        print(f"bowden: note: {found.missing} cycles of this run are not in {file}{join}", file=sys.stderr)


def _recovering(*files: Path) -> str:
    """The command, to be copied into a shell."""
    return shlex.join(["bowden", "log", "recover", *map(str, files)])


def _print_facts(file: Path, document: dict[str, Any]) -> None:
    from bowden.live.log_facts import lines

    print(f"{file}")
    for name, value in lines(document):
        print(f"  {name:<16} {value}")


GROUP = "What is in the log of a run, and what can be made of it."

COMMANDS = (
    Command(
        "log info",
        info,
        "Say what a log holds.",
        (
            "bowden log info run.mcap",
            "bowden log info run.mcap --json",
        ),
        place=10,
    ),
    Command(
        "log recover",
        recover,
        "Recover what a killed process or a full disk left of a log.",
        (
            "bowden log recover run.mcap",
            "bowden log recover run.mcap --out saved.mcap",
            "bowden log recover run.mcap run-again1.mcap",
        ),
        place=20,
    ),
    Command(
        "log export",
        export,
        "Write a log as CSV, NPZ or Parquet.",
        (
            "bowden log export run.mcap",
            "bowden log export run.mcap --out run.parquet",
        ),
        place=30,
    ),
    Command(
        "log plot",
        plot,
        "Draw a log as a page.",
        (
            "bowden log plot run.mcap",
            "bowden log plot run.mcap --out page.html",
        ),
        place=40,
    ),
    Command(
        "log replay",
        replay,
        "Feed a run through a law and the supervisor again.",
        (
            "bowden log replay run.mcap",
            "bowden log replay run.mcap --law my_law.py:MINE --json",
        ),
        place=50,
    ),
)
