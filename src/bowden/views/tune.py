"""Tuned gains: the evidence in a terminal, and in the rig that they are written into."""

from pathlib import Path
from typing import Any

from bowden.operations.tune import TuneResult
from bowden.views.text import Call, next_line, say_next


def write_tune(found: TuneResult, call: Call, *, dry_run: bool = False) -> list[Path]:
    """Write the gains into the rig, with what speaks for them; nothing into a log.

    Args:
        found: the gains.
        call: of the command.
        dry_run: leave the file as it is.
    """
    from bowden.core.files import write_text
    from bowden.design import gains_text

    path: Path = call["rig"]
    if dry_run or path.suffix == ".mcap" or not found.gains:
        return []
    text = path.read_text(encoding="utf-8")
    said = (found.gains, _evidence(found), path, found.preset)
    for motor in found.motors:
        text = gains_text.with_gains(text, *said) if motor is None else gains_text.with_motor_gains(text, motor, *said)
    write_text(path, text)
    return [path]


def show_tune(found: TuneResult, call: Call) -> None:
    """Margins, the largest error and the gains, and what comes next."""
    rig = call["rig"]
    recorded, motor = rig.suffix == ".mcap", [*call.repeated("motor")]
    for line in _evidence(found):
        print(line)
    for name, value in found.gains.items():
        print(f"  {name} = {value:g}  (was {found.before[name]:g})")
    nothing = "Nothing written: a log stays as it is" if recorded else "Nothing written"
    print(f"{f'Wrote {rig}' if call.files else nothing}  ({call.seconds:.1f} s)")
    if call["dry_run"] and found.gains and not recorded:
        say_next("tune", rig, *motor, why="writes these gains")
    elif found.alone:
        say_next("check", rig, why="judges both motors together")
    else:
        say_next("run", rig, "--twin", "--auto")


def failed_tune(error: Any, call: Call) -> None:
    """What comes next where no gains were found: a law that holds, the rig's own with other gains, or why neither."""
    from bowden.design.tune import NoGainsError

    if not isinstance(error, NoGainsError):
        return
    rig, motor = call["rig"], [*call.repeated("motor")]
    if error.of_rig:
        error.add_note(next_line("check", rig, *motor, why="once that is in it"))
    elif error.instead:
        error.add_note(next_line("simulate", rig, *motor, "--law", error.instead))
    elif error.gains:
        error.add_note(next_line("simulate", rig, *motor, why="once these gains are in it"))
    else:
        error.add_note(next_line("check", rig, *motor, why="says what the loop lacks"))


def _evidence(found: TuneResult) -> list[str]:
    """Margins and the largest error, for the file and for who looks on."""
    from bowden.core.units import DEGREES
    from bowden.design.check_result import no_margins
    from bowden.design.tune_result import study_text

    tuning = found.value
    low, high = tuning.bends
    rig = tuning.rig.parts[0].rig
    before = "unstable" if tuning.worst_before is None else f"{tuning.worst_before * DEGREES:.3g}°"
    before += f", {found.verdict_before}"
    margins = [
        f"{value:.1f} {unit}"
        for value, unit in ((found.gain_margin_db, "dB"), (found.phase_margin_deg, "°"))
        if value is not None
    ]
    early = f", interrupted after {tuning.generations} generations," if found.interrupted else ""
    return [
        f"found{early} for {rig.servo_text}",
        f"margins over bends of {low * DEGREES:.0f} to {high * DEGREES:.0f}°: "
        f"{' and '.join(margins) or no_margins(tuning.found)}",
        f"largest RMSE over {tuning.runs}: {found.worst_rmse_deg:.3g}° (before: {before})",
        *([found.short] if found.short else []),
        *found.at_bounds,
        *([] if tuning.study is None else [study_text(tuning.study, when) for when in ("after", "before")]),
    ]
