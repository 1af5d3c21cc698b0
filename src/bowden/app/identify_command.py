"""``bowden identify``: from a log to a model of its cable."""

import math
import sys
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bowden.app.beside import beside, both
from bowden.app.command import Command
from bowden.app.console import folder_argument, print_json, progress_bar, seconds
from bowden.app.next_step import after_model
from bowden.core.files import output_folder, whole_files

if TYPE_CHECKING:
    from bowden.identify.cable.fit import Fit
    from bowden.identify.cable.loop import HysteresisLoop
    from bowden.report.identify_page import Blank

TimeColumn = Annotated[str | None, typer.Option(help="Name of the time column; guessed by default.")]
MotorColumn = Annotated[str | None, typer.Option(help="Name of the motor-side angle's column.")]
JointColumn = Annotated[str | None, typer.Option(help="Name of the joint-side angle's column.")]
Unit = Annotated[
    str | None,
    typer.Option(
        metavar="UNIT[,UNIT]",
        help="deg, rad or counts, of both angles or of motor and joint; by default as the columns' names end.",
    ),
]
Counts = Annotated[
    str | None,
    typer.Option(
        metavar="N[,N]",
        help="Counts in a turn of both encoders, or of motor and joint, whatever the log's unit: a rig gets them.",
    ),
]
Rate = Annotated[float | None, typer.Option(metavar="HZ", help="Rows a second, of a log without times.")]


def identify(
    logs: Annotated[
        list[Path],
        typer.Argument(
            metavar="LOG...", help="CSV, gzipped CSV, MATLAB, NPZ or Parquet: time, motor, joint; one file or more."
        ),
    ],
    time: TimeColumn = None,
    motor: MotorColumn = None,
    joint: JointColumn = None,
    unit: Unit = None,
    counts_per_turn: Counts = None,
    rate: Rate = None,
    load: Annotated[
        str | None,
        typer.Option(
            metavar="VALUES|COLUMN|none",
            help="Load of several logs: 0.1,0.2 (one for each, in their order), or the column whose mean it is; by "
            "default a column of a common name (joint_torque_nm, tension_n, …).",
        ),
    ] = None,
    bend: Annotated[
        str | None,
        typer.Option(
            metavar="VALUES|COLUMN|none", help="Bend of several logs [deg], likewise (a column bend_deg, bend_angle…)."
        ),
    ] = None,
    model: Annotated[
        Path | None,
        typer.Option(help="model.toml of this cable: fit its gain and offset to the log, and say whether it changed."),
    ] = None,
    out: Annotated[
        Path, typer.Option(parser=folder_argument, metavar="FOLDER", help="Folder for model.toml and identify.html.")
    ] = Path("out/identify"),
    json: Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")] = False,
) -> None:
    """Fit cable models to a log's first half, judge them on the second, and say which one to use and why.

    Six models are fitted: a straight line, the play operator, Bouc-Wen, Bouc-Wen with a static nonlinearity, a
    Prandtl-Ishlinskii stack, and a generalised play between free branches. The folder gets model.toml, with every
    parameter and its uncertainty, and a page.

    Several logs are fitted together: one loop whose offset, slope, width and shape follow the logs' load, their bend or
    both. With --model nothing is identified but gain and offset of a known cable, from seconds of motion.
    """
    named: dict[str, Any] = {"time": time, "motor": motor, "joint": joint, "unit": unit}
    named |= {"counts_per_turn": counts_per_turn, "rate": rate}
    if len(logs) > 1 or model is not None:
        _several(logs, named, load, bend, model, out, json)
        return
    if load is not None or bend is not None:
        from bowden.core.errors import ParameterError

        what = "load" if load is not None else "bend"
        raise ParameterError(
            f"--{what} with one log, which cannot tell what the {what} changes",
            expected="several logs, or --model with a model that is scheduled by it",
            do=f"give the other logs too, or leave out --{what}",
        )
    with beside(_ready_to_draw, _drawn) as drawn:
        from bowden.identify.cable.fit import identify_log
        from bowden.identify.log.read import read_log

        checked = read_log(logs[0], **named)
        output_folder(out)
        with progress_bar(quiet=json) as progress:
            fit = identify_log(checked, progress=progress)
        if not json:
            _print_table(fit)  # drawing takes as long as all that was before
        with progress_bar(quiet=json) as progress:
            progress("drawing the page", 0.9)
            page = drawn(fit)
            with whole_files(out) as folder:
                (folder / "identify.html").write_text(page, encoding="utf-8")
                fit.write(folder / "model.toml")
    if json:
        print_json(document(fit) | {"seconds": seconds()})
    else:
        print(f"\nModel: {out / 'model.toml'}\nPage: {out / 'identify.html'}  ({seconds():.1f} s)")
        after_model(out / "model.toml", fit.trust)


def _several(
    files: list[Path],
    named: dict[str, Any],
    load: str | None,
    bend: str | None,
    model: Path | None,
    out: Path,
    json: bool,
) -> None:
    """Several logs, or one and the model of another."""
    from bowden.app.identify_several import again, several
    from bowden.core.errors import ParameterError
    from bowden.identify.log.read import read_log

    if model is not None and len(files) > 1:
        raise ParameterError(
            f"--model with {len(files)} logs", expected="one log, whose gain and offset are fitted", do="give one log"
        )
    read = [read_log(file, **named) for file in files]
    if model is not None:
        options = [(f"--{name.replace('_', '-')}", str(value)) for name, value in named.items() if value is not None]
        again(files[0], read[0], model, load, bend, out, json, [word for pair in options for word in pair])
    else:
        several(files, read, load, bend, out, json)


def _ready_to_draw() -> "Blank":
    """Import what draws and what a fit is made of, and make all of the figures that needs no fit."""
    from bowden.app.quick_figures import import_figures

    import_figures()
    for name in ("matplotlib.backends.backend_svg", "jinja2"):
        import_module(name)
    from bowden.report.identify_page import blank

    return blank()


def _drawn(empty: "Blank", fit: "Fit") -> str:
    """The page of an identification."""
    from bowden.report.identify_page import identify_page, pictures

    loop, others = both(lambda: pictures(fit, empty, [1]), lambda: pictures(fit, empty, [2, 3]))
    return identify_page(fit, loop + others).html()


def document(fit: "Fit") -> dict[str, Any]:
    """The figures of a fit for JSON, without the seconds; what does not exist is None."""
    from bowden.core.units import DEGREES
    from bowden.records.metrics import finite

    models = {
        name: {
            "parameters": dict(fitted.parameters),
            "uncertainty": {key: finite(value) for key, value in fitted.uncertainty.items()},
            "train_rms_deg": finite(fitted.train_rms * DEGREES),
            "test_rms_deg": finite(fitted.test_rms * DEGREES),
        }
        for name, fitted in fit.models.items()
    }
    ahead = {
        "compensated_rms_deg": finite(fit.forecast.compensated * DEGREES),
        "uncompensated_rms_deg": finite(fit.forecast.uncompensated * DEGREES),
        "resolution_rms_deg": fit.forecast.resolution * DEGREES,
    }
    return {
        "best": fit.best.name,
        "models": models,
        "loop": None if fit.chosen.loop is None else _loop(fit.chosen.loop),
        "forecast": ahead,
        "trust": fit.trust._asdict(),
        "warnings": list(fit.warnings),
        "samples": fit.samples,
        "cycles": fit.cycles._asdict() | {"advice": fit.cycles.advice or None},
    }


def _loop(loop: "HysteresisLoop") -> dict[str, Any]:
    """The recommended model's loop for JSON; what does not exist is None."""
    from bowden.records.metrics import finite

    said = {
        name: finite(value) if isinstance(value, float) else [finite(one) for one in value]
        for name, value in loop._asdict().items()
    }
    return said | {"curve_error": finite(loop.curve_error)}


def _print_table(fit: "Fit") -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table

    from bowden.core.units import DEGREES
    from bowden.identify.cable.loop import loop_lines
    from bowden.identify.cable.trust import parameter_lines

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("model", no_wrap=True)
    for title in ("parameters", "first half\n° RMS", "second half\n° RMS"):
        table.add_column(title, justify="right", no_wrap=True)
    for name, fitted in fit.models.items():
        errors = (f"{value * DEGREES:.3f}" for value in (fitted.train_rms, fitted.test_rms))
        table.add_row(f"{name} *" if name == fit.best.name else name, str(fitted.fitted_count), *errors)
    Console(width=None if sys.stdout.isatty() else 100).print(table)
    print("* the simplest whose error on left-out stretches is not clearly larger than the best's")
    left, without, counts = (value * DEGREES for value in fit.forecast)
    bound = f"; the encoders' rounding alone makes {counts:.2g}° RMS" if counts else ""
    print(f"Forecast: {left:.2g}° RMS at the joint with this model as feed-forward, {without:.2g}° without{bound}")
    print(f"\n{fit.best.name}, with one standard deviation:")
    loop = loop_lines(fit.chosen.loop) if fit.chosen.loop else []
    lines = parameter_lines(fit.best.parameters, fit.chosen.uncertainty) + loop
    room = max(len(name) for name, _ in lines)
    for name, text in lines:
        print(f"  {name:<{room}}  {text}")
    if all(math.isnan(one) for one in fit.chosen.uncertainty.values()):
        print(
            "  one parameter can make up for another, so no deviation of a single one is given: take those of the loop"
        )
    for warning in fit.warnings:
        print(f"- {warning}")
    print(f"Trust it? {fit.trust.level.capitalize()}: {'; '.join(fit.trust.reasons)}")
    print(f"The log has {fit.cycles}; {fit.motion}")


COMMANDS = (
    Command(
        "identify",
        identify,
        "Identify a cable from a log of its motion.",
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
