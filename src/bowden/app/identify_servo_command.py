"""``bowden identify-servo``: natural frequency, damping, delay and limits from a log of command and motor."""

from pathlib import Path
from typing import Annotated

import typer

from bowden.app.command import Command
from bowden.app.console import folder_argument, print_json, progress_bar, seconds
from bowden.app.next_step import say_next
from bowden.core.files import output_folder


def identify_servo(
    log: Annotated[
        Path, typer.Argument(help="CSV, csv.gz, .mat, NPZ or Parquet: time, command, motor of a step or chirp.")
    ],
    time: Annotated[str | None, typer.Option(help="Column of times; guessed where it is not given.")] = None,
    command: Annotated[str | None, typer.Option(help="Column of the motor's target angle.")] = None,
    motor: Annotated[str | None, typer.Option(help="Column of the motor's measured angle.")] = None,
    unit: Annotated[
        str | None, typer.Option(help="deg or rad, of both angles; from the columns' names where it is not given.")
    ] = None,
    rate: Annotated[float | None, typer.Option(metavar="HZ", help="Rows a second, of a log without times.")] = None,
    sample_time_ms: Annotated[
        float | None, typer.Option(help="Control cycle of the rig, for delay_cycles; the one of --into, or 1.")
    ] = None,
    out: Annotated[Path, typer.Option(parser=folder_argument, metavar="FOLDER", help="Folder for servo.toml.")] = Path(
        "out/servo"
    ),
    into: Annotated[
        Path | None, typer.Option(metavar="RIG.TOML", help="Write the values into this rig, in place of servo.toml.")
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")] = False,
) -> None:
    """Identify a servo from a log of a step or a chirp, and write the keys of rig.toml for it.

    With --into they take the place of those in a rig; its comments and all other keys stay as they are.
    """
    from bowden.core.errors import ParameterError
    from bowden.core.files import whole_files, write_text
    from bowden.identify.servo import keys
    from bowden.identify.servo.fit import identify_servo as fit
    from bowden.identify.servo.log import read_servo_log

    cycle = 1.0 if sample_time_ms is None else sample_time_ms
    if not 0.01 <= cycle <= 100.0:
        raise ParameterError(f"--sample-time-ms is {cycle:g}", expected="a number from 0.01 to 100")
    if into is not None:
        cycle = _cycle_of(into, sample_time_ms)
    columns, notes = read_servo_log(log, {"time": time, "command": command, "motor": motor}, unit, rate)
    if into is None:
        output_folder(out)
    with progress_bar() as report:
        report("fitting the servo", 0.0)
        found = fit(*columns)
    document = keys.document_of(found, cycle)
    written = into or out / "servo.toml"
    text = keys.keys_of(document, log.name)
    if into is None:
        with whole_files(out) as folder:
            (folder / "servo.toml").write_text(text, encoding="utf-8")
    else:
        write_text(into, keys.into(into.read_text(encoding="utf-8"), document, log.name, str(into)))
    if json:
        print_json(document | {"warnings": notes, "files": [str(written)], "seconds": seconds()})
        return
    print(text)
    for note in notes:
        print(f"- {note}")
    print(f"Wrote {written}  ({seconds():.1f} s)")
    if into is None:
        print("Put these keys into rig.toml (--into rig.toml does it), then: bowden check rig.toml")
    else:
        say_next("check", into)


def _cycle_of(path: Path, given: float | None) -> float:
    """Control cycle of the rig that is written into [ms].

    Raises:
        ParameterError: no rig.toml of one motor, or one of another cycle than the given one.
    """
    from bowden.core.errors import ParameterError
    from bowden.rig.config import one_motor
    from bowden.rig.rig import Rig

    rig = Rig.read(path)
    if rig.axes:
        raise one_motor(path)
    own = 1e3 * rig.sample_time
    if given is not None and abs(given - own) > 1e-9 * own:
        raise ParameterError(
            f"--sample-time-ms is {given:g}", expected=f"{own:g}, as {path} has it", do="leave the option out"
        )
    return own


COMMANDS = (
    Command(
        "identify-servo",
        identify_servo,
        "Identify a servo from a log of a step or a chirp.",
        (
            "bowden identify-servo step.csv",
            "bowden identify-servo step.csv --into rig.toml",
            "bowden identify-servo chirp.csv --command target --unit deg --json",
        ),
        place=40,
    ),
)
