"""What was identified: tables in a terminal, model.toml, and a page."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bowden.operations.identify import Identification, JointIdentification, Recalibrated
from bowden.operations.support.operation import Folder
from bowden.views.text import Call, free_name, rows, say_next, table

if TYPE_CHECKING:
    from bowden.operations.identify import IdentifyTrust

Found = Identification | JointIdentification | Recalibrated


def write_identify_logs(found: Found, call: Call, *, out: Folder = Path("out/identify")) -> list[Path]:
    """Write the model and the page.

    Args:
        found: from one log, several, or one and a known cable.
        call: of the command.
        out: folder for model.toml and identify.html.
    """
    from bowden.core.files import whole_files

    with whole_files(out) as folder:
        page, model = folder / "identify.html", folder / "model.toml"
        if isinstance(found, Recalibrated):
            from bowden.identify.cable.recalibrate import recalibrated_text
            from bowden.report.joint_page import recalibration_page

            recalibration_page(found.found, str(call["model"])).write(page)
            model.write_text(recalibrated_text(found.found, str(call["model"])), encoding="utf-8")
        elif isinstance(found, JointIdentification):
            from bowden.report.joint_page import joint_page

            joint_page(found.fit).write(page)
            found.fit.write(model)
        else:
            from bowden.report.identify_page import identify_page

            identify_page(found.fit).write(page)
            found.fit.write(model)
    return [out / "model.toml", out / "identify.html"]


def show_identify_logs(found: Found, call: Call) -> int:
    """A row for each model or log, how far to trust it, and what comes next; 1 where it is not to be trusted."""
    if isinstance(found, Recalibrated):
        from bowden.identify.cable.recalibrate import verdict

        said = verdict(found.found)
        print(found.found)
        print(f"\n{said[0].upper()}{said[1:]}.")
        _written(call, "")
        if found.changed:
            columns = ("time", "motor", "joint", "unit", "counts_per_turn", "rate")
            out = free_name(Path("out/identify"))
            say_next("identify", call["logs"][0], *call.repeated(*columns), "--out", out)
            return 0
        return _after_model(call, found.trust)
    if isinstance(found, JointIdentification):
        _show_logs(found)
    else:
        _show_models(found)
    print(f"Trust it? {found.trust.level.capitalize()}: {'; '.join(found.trust.reasons)}")
    if isinstance(found, Identification):
        print(f"The log has {found.fit.cycles}; {found.fit.motion}")
    _written(call, "\n")
    return _after_model(call, found.trust)


def _written(call: Call, before: str) -> None:
    model, page = call.files
    print(f"{before}Model: {model}\nPage: {page}  ({call.seconds:.1f} s)")


def _after_model(call: Call, trust: "IdentifyTrust | None") -> int:
    """A rig of the model; of one that is not to be trusted, a new log."""
    if trust is not None and trust.level == "no":
        print(f"Next: correct the log, or record another, and identify it: {trust.reasons[0]}")
        return 1
    rig = free_name(Path("rig.toml"))
    say_next("init", *([] if rig == Path("rig.toml") else [rig]), "--model", call.files[0])
    return 0


def _show_models(found: Identification) -> None:
    from bowden.identify.cable.loop import loop_lines
    from bowden.plants.cable_parameters import parameter_lines

    fit = found.fit
    lines = (
        [f"{name} *" if name == found.best else name, str(fit.models[name].fitted_count), *_errors(one)]
        for name, one in found.models.items()
    )
    table(("model", "parameters", "first half\n° RMS", "second half\n° RMS"), lines, width=100)
    print("* the simplest whose error on left-out stretches is not clearly larger than the best's")
    ahead = found.forecast
    counts = ahead.resolution_rms_deg
    bound = f"; the encoders' rounding alone makes {counts:.2g}° RMS" if counts else ""
    both = (ahead.compensated_rms_deg, ahead.uncompensated_rms_deg)
    left, without = (math.nan if one is None else one for one in both)
    print(f"Forecast: {left:.2g}° RMS at the joint with this model as feed-forward, {without:.2g}° without{bound}")
    print(f"\n{found.best}, with one standard deviation:")
    loop = loop_lines(fit.chosen.loop) if fit.chosen.loop else []
    rows([(f" {name} ", text) for name, text in parameter_lines(fit.best.parameters, fit.chosen.uncertainty) + loop])
    if all(math.isnan(one) for one in fit.chosen.uncertainty.values()):
        print(
            "  one parameter can make up for another, so no deviation of a single one is given: take those of the loop"
        )
    for warning in found.warnings:
        print(f"- {warning}")


def _errors(one: Any) -> Iterator[str]:
    for value in (one.train_rms_deg, one.test_rms_deg):
        yield "nan" if value is None else f"{value:.3f}"


def _show_logs(found: JointIdentification) -> None:
    from bowden.identify.cable.joint_fit import cycle_lines
    from bowden.plants.cable_parameters import in_degrees

    fit = found.fit
    units = list(zip(fit.variables, fit.units, strict=True))
    titles = [f"{name}\n{in_degrees(name, 0.0, unit)[1]}" for name, unit in units]
    lines = []
    for one, of in zip(found.logs, fit.logs, strict=True):
        errors = (one.test_rms_deg, one.same_rms_deg, one.unseen_rms_deg, one.unseen_offset_rms_deg)
        cells = [None if value is None else f"{value:.3f}" for value in errors]
        values = [f"{in_degrees(*pair)[0]:.4g}" for pair in zip(fit.variables, of.values, strict=True)]
        lines.append([one.name, str(one.cycles.whole), *values, *cells])
    judged = ("second half\n° RMS", "left out\n° RMS", "load left out\n° RMS", "and offset\n° RMS")
    table(("log", "whole\ncycles", *titles, *judged), lines, width=100)
    pair = " (of other pairs of load and bend)" if len(fit.variables) > 1 else ""
    said = f"load left out: of other loads{pair}; and offset: offset fitted to a half"
    print(f"left out: a model of the other logs; {said}")
    for line in (*found.warnings, *cycle_lines(fit.logs)):
        print(f"- {line}")
