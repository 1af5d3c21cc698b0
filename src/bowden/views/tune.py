"""Tuned gains: the evidence in a terminal, and in the rig that they are written into."""

import re
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from bowden.core.errors import OutputError
from bowden.core.toml_text import quoted, with_keys
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

    path: Path = call["rig"]
    if dry_run or path.suffix == ".mcap" or not found.gains:
        return []
    text = path.read_text(encoding="utf-8")
    said = (found.gains, _evidence(found), path, found.preset)
    for motor in found.motors:
        text = with_gains(text, *said) if motor is None else with_motor_gains(text, motor, *said)
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
    else:
        say_next("check", rig, why="judges both motors together" if found.alone else "looks at the swing at rest too")


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


_HEADER = re.compile(r"^\s*\[")
_MARK = "bowden tune: "


def with_gains(
    text: str, gains: Mapping[str, float], evidence: Sequence[str], path: Path, preset: str | None = None
) -> str:
    """The text with these gains in [control.gains], and the evidence as comments below its head.

    Keys that are there are changed in place with their comments, others are added, and an earlier evidence is replaced.

    Args:
        text: of the file.
        gains: name → value.
        evidence: one comment a line.
        path: of the file, for messages.
        preset: on which the gains stand, for [control] where it is not there.

    Raises:
        OutputError: the gains are written there in a form that cannot be changed line by line.
    """
    if preset is not None:
        text = with_keys(text, "control", {"preset": quoted(preset)}, str(path))
    values = {name: repr(value) for name, value in gains.items()}
    return with_keys(text, "control.gains", values, str(path), [_MARK + line for line in evidence])


_MOTOR = re.compile(r"^\s*\[\[\s*motor\s*\]\]\s*(#.*)?$")
_OF_MOTOR = re.compile(r"^(\s*\[\s*)motor\s*\.\s*")


def with_motor_gains(
    text: str, motor: str, gains: Mapping[str, float], evidence: Sequence[str], path: Path, preset: str | None = None
) -> str:
    """`with_gains` for one motor of a rig with several: into [motor.control.gains] below its [[motor]].

    Args:
        text: of the file.
        motor: its name.
        gains: see `with_gains`.
        evidence: likewise.
        path: likewise.
        preset: likewise.

    Raises:
        OutputError: see `with_gains`; or the motors are written in another form.
    """
    lines = text.splitlines()
    heads = [i for i, line in enumerate(lines) if _MOTOR.match(line)]
    names = [one.get("name") for one in tomllib.loads(text).get("motor", ())]
    if len(heads) != len(names) or motor not in names:
        raise OutputError(f"{path}: its motors are not [[motor]] sections", do="write each below a line [[motor]]")
    begin = heads[names.index(motor)] + 1
    others = (i for i in range(begin, len(lines)) if _HEADER.match(lines[i]) and not _OF_MOTOR.match(lines[i]))
    end = next(others, len(lines))
    alone = "\n".join(_OF_MOTOR.sub(r"\1", line) for line in lines[begin:end])
    made = with_gains(alone, gains, evidence, path, preset).splitlines()
    own = [re.sub(r"^(\s*\[\s*)", r"\1motor.", line) if _HEADER.match(line) else line for line in made]
    return "\n".join([*lines[:begin], *own, *([""] * (end < len(lines) and own[-1:] != [""])), *lines[end:]]) + "\n"
