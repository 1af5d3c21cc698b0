"""What was identified: tables in a terminal, model.toml, and a page."""

import math
from pathlib import Path

from bowden.operations.identify import Identification
from bowden.operations.support.operation import Folder
from bowden.views.text import Call, free_name, rows, say_next, table


def write_identify(found: Identification, call: Call, *, out: Folder = Path("out/identify")) -> list[Path]:
    """Write the model and the page.

    Args:
        found: from one log, several, or one and a known cable.
        call: of the command.
        out: folder for model.toml and identify.html.
    """
    from bowden.core.files import whole_files
    from bowden.report.identify_page import identify_page

    with whole_files(out) as folder:
        identify_page(found.fit).write(folder / "identify.html")
        found.fit.write(folder / "model.toml")
    return [out / "model.toml", out / "identify.html"]


def show_identify(found: Identification, call: Call) -> int:
    """A row for each model or log, how far to trust it, and what comes next; 1 where it is not to be trusted."""
    fit = found.fit
    if fit.recalibration:
        rows(fit.recalibration.lines)
        print(f"{fit.recalibration.verdict[0].upper()}{fit.recalibration.verdict[1:]}.")
    elif len(found.logs) > 1:
        _show_logs(found)
    else:
        _show_models(found)
    from bowden.identify.cable.fit import to_record

    for line in (*found.warnings, *to_record(fit)):
        print(f"- {line}")
    print(f"Trust it? {found.trust.level.capitalize()}: {'; '.join(found.trust.reasons)}")
    if len(found.logs) == 1:
        print(f"The log has {fit.cycles.counted if fit.recalibration else fit.cycles}; {fit.logs[0].motion}")
    model, page = call.files
    print(f"\nModel: {model}\nPage: {page}  ({call.seconds:.1f} s)")
    if fit.recalibration and fit.recalibration.changed:
        columns = ("time", "motor", "joint", "unit", "counts_per_turn", "rate")
        out = free_name(Path("out/identify"))
        say_next("identify", call["log"][0], *call.repeated(*columns), "--out", out)
        return 0
    if found.trust.level == "no":
        print(f"Next: correct the log, or record another, and identify it: {found.trust.reasons[0]}")
        return 1
    rig = free_name(Path("rig.toml"))
    say_next("init", *([] if rig == Path("rig.toml") else [rig]), "--model", model)
    return 0


def _show_models(found: Identification) -> None:
    from bowden.identify.cable.hysteresis_loop import loop_lines
    from bowden.plants.cable_parameters import parameter_lines

    fit = found.fit
    lines = (
        [f"{name} *" if name == found.best else name, str(fit.models[name].fitted_count)]
        + ["nan" if value is None else f"{value:.3f}" for value in (one.train_rms_deg, one.test_rms_deg)]
        for name, one in found.models.items()
    )
    table(("model", "parameters", "first half\n° RMS", "second half\n° RMS"), lines, width=100)
    print("* the simplest whose error on left-out stretches is not clearly larger than the best's")
    if ahead := found.forecast:
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


def _show_logs(found: Identification) -> None:
    from bowden.plants.cable_parameters import in_degrees

    fit = found.fit
    titles = [f"{name}\n{in_degrees(name, 0.0, unit)[1]}" for name, unit in fit.units.items()]
    lines = []
    for one, of in zip(found.logs, fit.logs, strict=True):
        errors = (one.test_rms_deg, one.same_rms_deg, one.unseen_rms_deg, one.unseen_offset_rms_deg)
        cells = [None if value is None else f"{value:.3f}" for value in errors]
        values = [f"{in_degrees(*pair)[0]:.4g}" for pair in zip(fit.units, of.values, strict=True)]
        lines.append([one.name, str(one.cycles.whole), *values, *cells])
    judged = ("second half\n° RMS", "left out\n° RMS", "load left out\n° RMS", "and offset\n° RMS")
    table(("log", "whole\ncycles", *titles, *judged), lines, width=100)
    pair = " (of other pairs of load and bend)" if len(fit.units) > 1 else ""
    said = f"load left out: of other loads{pair}; and offset: offset fitted to a half"
    print(f"left out: a model of the other logs; {said}")
