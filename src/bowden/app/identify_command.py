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
from bowden.core.files import output_folder, whole_files

if TYPE_CHECKING:
    from bowden.identify.cable.fit import Fit
    from bowden.report.identify_page import Blank


def identify(
    log: Annotated[Path, typer.Argument(help="CSV, gzipped CSV, MATLAB or Parquet file: time, motor, joint.")],
    time: Annotated[str | None, typer.Option(help="Name of the time column; guessed by default.")] = None,
    motor: Annotated[str | None, typer.Option(help="Name of the motor-side angle's column.")] = None,
    joint: Annotated[str | None, typer.Option(help="Name of the joint-side angle's column.")] = None,
    unit: Annotated[
        str | None,
        typer.Option(
            metavar="UNIT[,UNIT]",
            help="deg, rad or counts, of both angles or of motor and joint; by default as the columns' names end.",
        ),
    ] = None,
    counts_per_turn: Annotated[
        str | None, typer.Option(metavar="N[,N]", help="Counts in a turn of both encoders, or of motor and joint.")
    ] = None,
    rate: Annotated[float | None, typer.Option(metavar="HZ", help="Rows a second, of a log without times.")] = None,
    out: Annotated[
        Path, typer.Option(parser=folder_argument, metavar="FOLDER", help="Folder for model.toml and identify.html.")
    ] = Path("out/identify"),
    json: Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")] = False,
) -> None:
    """Fit cable models to a log's first half, judge them on the second, and say which one to use and why.

    Six models are fitted: a straight line, the play operator, Bouc-Wen, Bouc-Wen with a static nonlinearity, a
    Prandtl-Ishlinskii stack, and a generalised play between free branches. The folder gets model.toml, with every
    parameter and its uncertainty, and a page.
    """
    with beside(_ready_to_draw, _drawn) as drawn:
        from bowden.identify.cable.fit import identify_log
        from bowden.identify.cable.model_file import write_model
        from bowden.identify.log.read import read_log

        checked = read_log(
            log, time=time, motor=motor, joint=joint, unit=unit, counts_per_turn=counts_per_turn, rate=rate
        )
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
                write_model(folder / "model.toml", fit, checked.name)
    if json:
        print_json(document(fit) | {"seconds": seconds()})
    else:
        print(f"\nModel: {out / 'model.toml'}\nPage: {out / 'identify.html'}  ({seconds():.1f} s)")


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
    from bowden.core.metrics import finite
    from bowden.core.units import DEGREES

    models = {
        name: {
            "parameters": dict(fitted.parameters),
            "uncertainty": {key: finite(value) for key, value in fitted.uncertainty.items()},
            "train_rms_deg": finite(fitted.train_rms * DEGREES),
            "test_rms_deg": finite(fitted.test_rms * DEGREES),
        }
        for name, fitted in fit.models.items()
    }
    return {"best": fit.best.name, "models": models, "warnings": list(fit.warnings), "samples": fit.samples}


def _print_table(fit: "Fit") -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table

    from bowden.core.units import DEGREES

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("model", no_wrap=True)
    for title in ("parameters", "first half\n° RMS", "second half\n° RMS"):
        table.add_column(title, justify="right", no_wrap=True)
    for name, fitted in fit.models.items():
        errors = (f"{value * DEGREES:.3f}" for value in (fitted.train_rms, fitted.test_rms))
        count = sum(not math.isnan(value) for value in fitted.uncertainty.values())
        table.add_row(f"{name} *" if name == fit.best.name else name, str(count), *errors)
    Console(width=None if sys.stdout.isatty() else 100).print(table)
    print("* recommended: the simplest whose error on left-out stretches is not clearly larger than the best's")
    for warning in fit.warnings:
        print(f"- {warning}")


COMMANDS = (
    Command(
        "identify",
        identify,
        "Identify a cable from a log of its motion.",
        (
            "bowden identify log.csv",
            "bowden identify log.csv.gz --out out/cable",
            "bowden identify raw.csv --unit counts --counts-per-turn 8192,4000 --rate 1000",
            "bowden identify log.csv --json",
        ),
        place=20,
    ),
)
