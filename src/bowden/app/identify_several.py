"""What ``bowden identify`` does with several logs, and with a log and the model of another."""

import dataclasses
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bowden.app.console import print_json, progress_bar, seconds
from bowden.app.next_step import after_model, free_name, say_next
from bowden.core.files import output_folder, whole_files

if TYPE_CHECKING:
    from bowden.identify.cable.cycles import Cycles
    from bowden.identify.cable.loads import JointFit
    from bowden.identify.cable.recalibrate import Recalibration
    from bowden.identify.log.read import Log


def several(
    files: Sequence[Path], logs: "Sequence[Log]", load: str | None, bend: str | None, out: Path, json: bool
) -> None:
    """Fit all logs together, and write model.toml and the page.

    Args:
        files: of the logs.
        logs: read and checked.
        load: as the command line has it; see `bowden.identify.log.variables.scheduled_by`.
        bend: likewise.
        out: folder.
        json: print one document and nothing else.
    """
    from bowden.identify.cable.loads import identify_loads
    from bowden.identify.log.variables import scheduled_by
    from bowden.report.joint_page import joint_page

    by = {name: scheduled_by(name, files, given) for name, given in (("load", load), ("bend", bend))}
    output_folder(out)
    with progress_bar(quiet=json) as progress:
        fit = identify_loads(
            logs,
            *(one.values if one else None for one in by.values()),
            units=[one.unit if one else "" for one in by.values()],
            progress=progress,
        )
        said = tuple(one.said for one in by.values() if one and one.said)
        fit = dataclasses.replace(fit, warnings=(*fit.warnings, *said))
    if not json:
        _print_logs(fit)
    with whole_files(out) as folder:
        (folder / "identify.html").write_text(joint_page(fit).html(), encoding="utf-8")
        fit.write(folder / "model.toml")
    if json:
        print_json(joint_document(fit) | {"seconds": seconds()})
    else:
        print(f"Trust it? {fit.trust.level.capitalize()}: {'; '.join(fit.trust.reasons)}")
        print(f"\nModel: {out / 'model.toml'}\nPage: {out / 'identify.html'}  ({seconds():.1f} s)")
        after_model(out / "model.toml", fit.trust)


def again(
    file: Path,
    log: "Log",
    model: Path,
    load: str | None,
    bend: str | None,
    out: Path,
    json: bool,
    options: Sequence[str] = (),
) -> None:
    """Fit gain and offset of a model to a log, say whether the cable has changed, and write model.toml and the page.

    Args:
        file: of the log.
        log: read and checked.
        model: the model.toml of another log.
        load: as the command line has it, for a scheduled model.
        bend: likewise.
        out: folder.
        json: print one document and nothing else.
        options: with which the log was read, for a command that reads it again.
    """
    from bowden.identify.cable.joint_file import recalibrated_text
    from bowden.identify.cable.model_file import load_judged
    from bowden.identify.cable.recalibrate import recalibrate, verdict
    from bowden.identify.log.variables import scheduled_by
    from bowden.report.joint_page import recalibration_page

    cable, judged = load_judged(model)
    scheduled = cable.model().parameters
    values: dict[str, float] = {}
    units: dict[str, str] = {}
    for name, given in (("load", load), ("bend", bend)):
        if given is not None or f"{name}_low" in scheduled:
            found = scheduled_by(name, [file], given)
            values |= {name: found.values[0]} if found else {}
            units |= {name: found.unit} if found else {}
    result = recalibrate(log, cable, judged, values, units)
    output_folder(out)
    with whole_files(out) as folder:
        (folder / "identify.html").write_text(recalibration_page(result, str(model)).html(), encoding="utf-8")
        (folder / "model.toml").write_text(recalibrated_text(result, str(model)), encoding="utf-8")
    if json:
        print_json(recalibration_document(result) | {"seconds": seconds()})
        return
    print(result)
    print(f"\n{verdict(result)[0].upper()}{verdict(result)[1:]}.")
    print(f"Model: {out / 'model.toml'}\nPage: {out / 'identify.html'}  ({seconds():.1f} s)")
    if result.changed:
        say_next("identify", file, *options, "--out", free_name(Path("out/identify")))
    else:
        after_model(out / "model.toml", result.best.trust)


def joint_document(fit: "JointFit") -> dict[str, Any]:
    """The figures of a joint fit for JSON, without the seconds; what does not exist is None."""
    errors = ("train_rms", "test_rms", "same_rms", "same_offset_rms", "unseen_rms", "unseen_offset_rms")
    logs = [
        {
            "name": one.name,
            "samples": one.samples,
            "cycles": _cycles(one.cycles, one.cycles.to_record),
            **dict(zip(fit.variables, one.values, strict=True)),
        }
        | {f"{error}_deg": _degrees(getattr(one, error)) for error in errors}
        for one in fit.logs
    ]
    return {
        "best": fit.best.name,
        "variables": dict(zip(fit.variables, fit.units, strict=True)),
        "models": {
            name: {"parameters": dict(parameters)}
            for name, parameters in ((fit.best.name, fit.best.parameters), *fit.best.others.items())
        },
        "logs": logs,
        "judged_rms_deg": _degrees(fit.judged),
        "trust": fit.trust._asdict(),
        "warnings": list(fit.warnings),
        "samples": fit.samples,
    }


def recalibration_document(found: "Recalibration") -> dict[str, Any]:
    """The figures of a recalibration for JSON, without the seconds; what does not exist is None."""
    from bowden.identify.cable.recalibrate import to_identify

    models = ((found.best.name, found.best.parameters), *found.best.others.items())
    return {
        "best": found.best.name,
        "gain": found.gain,
        "gain_error": found.gain_error if math.isfinite(found.gain_error) else None,
        "offset_deg": _degrees(found.offset),
        "before_rms_deg": _degrees(found.before_rms),
        "after_rms_deg": _degrees(found.after_rms),
        "judged_rms_deg": _degrees(found.judged_rms),
        "changed": found.changed,
        "models": {name: {"parameters": dict(parameters)} for name, parameters in models},
        "trust": None if found.best.trust is None else found.best.trust._asdict(),
        "warnings": list(found.warnings),
        "samples": found.samples,
        "cycles": _cycles(found.cycles, to_identify(found.cycles)),
    }


def _cycles(cycles: "Cycles", advice: str) -> dict[str, Any]:
    return cycles._asdict() | {"advice": advice or None}


def _degrees(value: float) -> float | None:
    from bowden.core.units import DEGREES
    from bowden.records.metrics import finite

    return finite(value * DEGREES)


def _print_logs(fit: "JointFit") -> None:
    import sys

    from rich import box
    from rich.console import Console
    from rich.table import Table

    from bowden.identify.cable.loads import cycle_lines
    from bowden.identify.log.variables import in_degrees

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("log", no_wrap=True)
    table.add_column("whole\ncycles", justify="right", no_wrap=True)
    for name, unit in zip(fit.variables, fit.units, strict=True):
        table.add_column(f"{name}\n{in_degrees(name, 0.0, unit)[1]}", justify="right", no_wrap=True)
    for title in ("second half\n° RMS", "left out\n° RMS", "load left out\n° RMS", "and offset\n° RMS"):
        table.add_column(title, justify="right", no_wrap=True)
    for one in fit.logs:
        errors = [_degrees(v) for v in (one.test_rms, one.same_rms, one.unseen_rms, one.unseen_offset_rms)]
        cells = [f"{value:.3f}" if value is not None else "–" for value in errors]
        values = [f"{in_degrees(*pair)[0]:.4g}" for pair in zip(fit.variables, one.values, strict=True)]
        table.add_row(one.name, str(one.cycles.whole), *values, *cells)
    Console(width=None if sys.stdout.isatty() else 100).print(table)
    pair = " (of other pairs of load and bend)" if len(fit.variables) > 1 else ""
    said = f"load left out: of other loads{pair}; and offset: offset fitted to a half"
    print(f"left out: a model of the other logs; {said}")
    for line in (*fit.warnings, *cycle_lines(fit.logs)):
        print(f"- {line}")
