"""``bowden identify-servo``: natural frequency, damping, delay and limits from a log of command and motor."""

from pathlib import Path
from typing import Annotated

import typer

from bowden.app.command import Command
from bowden.app.console import folder_argument, print_json, progress_bar, seconds
from bowden.core.files import output_folder


def identify_servo(
    log: Annotated[Path, typer.Argument(help="CSV, csv.gz, .mat or Parquet: time, command, motor of a step or chirp.")],
    time: Annotated[str | None, typer.Option(help="Column of times; guessed where it is not given.")] = None,
    command: Annotated[str | None, typer.Option(help="Column of the motor's target angle.")] = None,
    motor: Annotated[str | None, typer.Option(help="Column of the motor's measured angle.")] = None,
    unit: Annotated[
        str | None, typer.Option(help="deg or rad, of both angles; from the columns' names where it is not given.")
    ] = None,
    rate: Annotated[float | None, typer.Option(metavar="HZ", help="Rows a second, of a log without times.")] = None,
    sample_time_ms: Annotated[float, typer.Option(help="Control cycle of the rig, for delay_cycles.")] = 1.0,
    out: Annotated[Path, typer.Option(parser=folder_argument, metavar="FOLDER", help="Folder for servo.toml.")] = Path(
        "out/servo"
    ),
    json: Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")] = False,
) -> None:
    """Identify a servo from a log of a step or a chirp, and write the keys of rig.toml for it."""
    from bowden.core.errors import ParameterError
    from bowden.core.files import whole_files
    from bowden.identify.servo.fit import identify_servo as fit
    from bowden.identify.servo.keys import document_of, keys_of
    from bowden.identify.servo.log import read_servo_log

    if not 0.01 <= sample_time_ms <= 100.0:
        raise ParameterError(f"--sample-time-ms is {sample_time_ms:g}", expected="a number from 0.01 to 100")
    columns, notes = read_servo_log(log, {"time": time, "command": command, "motor": motor}, unit, rate)
    output_folder(out)
    with progress_bar() as report:
        report("fitting the servo", 0.0)
        found = fit(*columns)
    document = document_of(found, sample_time_ms)
    text = keys_of(document, log.name)
    with whole_files(out) as folder:
        (folder / "servo.toml").write_text(text, encoding="utf-8")
    if json:
        print_json(document | {"warnings": notes, "files": [str(out / "servo.toml")], "seconds": seconds()})
    else:
        print(text)
        for note in notes:
            print(f"- {note}")
        print(f"Wrote {out / 'servo.toml'}  ({seconds():.1f} s)")
        print("Put these keys into rig.toml, then: bowden check rig.toml")


COMMANDS = (
    Command(
        "identify-servo",
        identify_servo,
        "Identify a servo from a log of a step or a chirp.",
        (
            "bowden identify-servo step.csv",
            "bowden identify-servo chirp.csv --command target --unit deg --json",
        ),
        place=40,
    ),
)
