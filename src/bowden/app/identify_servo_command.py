"""``bowden identify-servo``: natural frequency, damping, delay and limits from a log of command and motor."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bowden.app.command import Command
from bowden.app.console import folder_argument, print_json, progress_bar, seconds
from bowden.core.files import output_folder

if TYPE_CHECKING:
    from bowden.identify.servo.fit import ServoEstimate, ServoFit

_NO_CYCLE = 0.05
"""Share of a cycle by which a measured delay may be beyond whole ones before it is rounded up [–]."""


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
    from bowden.identify.servo.log import read_servo_log

    if not 0.01 <= sample_time_ms <= 100.0:
        raise ParameterError(f"--sample-time-ms is {sample_time_ms:g}", expected="a number from 0.01 to 100")
    columns, notes = read_servo_log(log, {"time": time, "command": command, "motor": motor}, unit, rate)
    output_folder(out)
    with progress_bar() as report:
        report("fitting the servo", 0.0)
        found = fit(*columns)
    document = _document(found, sample_time_ms)
    text = _toml(document, log.name)
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


def _document(found: "ServoFit", sample_time_ms: float) -> dict[str, Any]:
    from bowden.core.units import HERTZ, RADIANS

    delay_ms = found.delay.value * 1e3
    return {
        "natural_frequency_hz": _in(found.natural_frequency, HERTZ),
        "damping": _in(found.damping, 1.0),
        "delay_s": _in(found.delay, 1.0),
        "delay_cycles": max(0, math.ceil(delay_ms / sample_time_ms - _NO_CYCLE)),
        "sample_time_ms": sample_time_ms,
        "speed_limit_deg_per_s": _in(found.speed_limit, RADIANS),
        "acceleration_limit_deg_per_s2": _in(found.acceleration_limit, RADIANS),
        "residual_deg": found.residual / RADIANS,
        "unexplained": found.share,
    }


def _in(estimate: "ServoEstimate | None", unit: float) -> dict[str, float] | None:
    if estimate is None:
        return None
    return {"value": estimate.value / unit, "uncertainty": estimate.uncertainty / unit}


def _toml(document: dict[str, Any], name: str) -> str:
    frequency, damping, delay = (document[key] for key in ("natural_frequency_hz", "damping", "delay_s"))
    speed, acceleration = document["speed_limit_deg_per_s"], document["acceleration_limit_deg_per_s2"]
    lines = [
        f"# Identified from {name}; {document['residual_deg']:.3g}° of the motor's motion are left, root mean square.",
        "",
        "[bench]",
        f"delay_cycles = {document['delay_cycles']}  # {1e3 * delay['value']:.3g} ± {1e3 * delay['uncertainty']:.1g} ms"
        f" rounded up at {document['sample_time_ms']:g} ms a cycle",
        "",
        "[servo]",
        f"natural_frequency_hz = {frequency['value']:.5g}  # ± {frequency['uncertainty']:.1g}",
        f"damping = {damping['value']:.4g}  # ± {damping['uncertainty']:.1g}",
    ]
    if speed:
        lines.append(f"speed_limit_deg_per_s = {speed['value']:.5g}  # ± {speed['uncertainty']:.1g}")
    if acceleration:
        said = f"{acceleration['value']:.4g} ± {acceleration['uncertainty']:.1g}"
        lines.append(
            f"# largest acceleration {said} °/s²; rig.toml has it by [motor] current_limit_a and inertia_kg_m2"
        )
    return "\n".join(lines) + "\n"


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
