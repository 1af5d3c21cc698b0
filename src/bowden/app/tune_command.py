"""``bowden tune``: gains with margins for a rig.toml, written back into it with their evidence."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bowden.app.command import Command
from bowden.app.console import InterruptedPartway, print_json, progress_bar, say_note, seconds
from bowden.app.given_rig import read_given
from bowden.app.next_step import next_line, say_next
from bowden.core.errors import counted

if TYPE_CHECKING:
    from bowden.design.tune import NoGainsError, Tuning


def tune(
    rig: Annotated[Path, typer.Argument(help="The rig, whose [control.gains] are rewritten; of a run's log, nothing.")],
    study: Annotated[
        Path | None,
        typer.Option(help="Tune against the plants of this study, and judge by others of them (docs/campaign.md)."),
    ] = None,
    axis: Annotated[str | None, typer.Option(help="The axis, of a rig with several.")] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Leave the file as it is.")] = False,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the search.")] = 0,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")] = False,
) -> None:
    """Find gains of the rig's law that keep 6 dB and 45° and follow best in the worst case, and write them back.

    Of two motors on one joint (docs/pair.md) both get the same, which are judged on the joint.

    Interrupted, the command writes the best gains that it has, if they are better than those before.
    """
    from bowden.core.units import DEGREES
    from bowden.design.objections import refusals
    from bowden.design.tune import BrokenOff, NoGainsError
    from bowden.face.tune import tuned, tuned_pair

    whole = read_given(rig, several=True)
    both = whole.pair.there and axis is None
    given = whole if both else whole.axis(axis)
    of_axis = ["--axis", axis] if axis else []
    interrupted = False
    with progress_bar(quiet=json) as report:
        try:
            found = (tuned_pair if both else tuned)(given, study, seed=seed, progress=report)
        except BrokenOff as broken:
            found, interrupted = broken.tuning, True
        except NoGainsError as error:
            if not json:
                error.add_note(_next_without(rig, of_axis, error))
            raise
    paired = axis in whole.pair.names
    alone = [f"axis {axis} was tuned as if its motor were alone on the joint; check both together"] if paired else []
    for note in (*given.notes, *refusals(given), *alone):
        say_note(note)
    evidence = _evidence(found, interrupted=interrupted)
    recorded = rig.suffix == ".mcap"
    places = [*whole.pair.names] if both else [axis]
    files = [] if dry_run or recorded or not found.gains else [str(_written(rig, found, evidence, places))]
    if interrupted:
        where = f"written to {files[0]}" if files else "not written"
        raise InterruptedPartway(f"the best gains after {found.generations} generations are {where}")
    before = {name: found.stood[name] for name in found.gains}
    if json:
        document: dict[str, Any] = {
            "law": found.law.name,
            "rig": given.hash,
            "preset": _preset(found),
            "gains": dict(found.gains),
            "before": before,
            "verdict": found.found.verdict,
            "verdict_before": found.before.verdict,
            "gain_margin_db": found.found.gain_margin_db,
            "phase_margin_deg": found.found.phase_margin_deg,
            "delay_margin_s": found.found.delay_margin_s,
            "worst_rmse_deg": found.worst_rmse * DEGREES,
            "worst_rmse_before_deg": None if found.worst_before is None else found.worst_before * DEGREES,
            "short": found.short,
            "study": found.study,
        }
        print_json(document | {"files": files, "seconds": seconds()})
        return
    for line in evidence:
        print(line)
    for name, value in found.gains.items():
        print(f"  {name} = {value:g}  (was {before[name]:g})")
    nothing = "Nothing written: a log stays as it is" if recorded else "Nothing written"
    print(f"{'Wrote ' + str(rig) if files else nothing}  ({seconds():.1f} s)")
    if dry_run and found.gains and not recorded:
        say_next("tune", rig, *of_axis, why="writes these gains")
    elif paired:
        say_next("check", rig, why="judges both motors together")
    else:
        say_next("run", rig, "--twin", "--auto")


def _next_without(rig: Path, options: list[str], error: "NoGainsError") -> str:
    """What comes next where no gains were found: a law that holds, the rig's own with other gains, or why neither."""
    if error.instead:
        return next_line("simulate", rig, *options, "--law", error.instead)
    if error.gains:
        return next_line("simulate", rig, *options, why="once these gains are in it")
    return next_line("check", rig, *options, why="says what the loop lacks")


def _evidence(found: "Tuning", *, interrupted: bool) -> list[str]:
    """Margins and the largest error, for the file and for who looks on."""
    from bowden.core.units import DEGREES, HERTZ
    from bowden.design.findings import no_margins, study_text

    low, high = found.bends
    rig = found.rig.parts[0].rig
    late = f"commands {counted(rig.delay, 'cycle')} of {1e3 * rig.sample_time:g} ms late"
    before = "unstable" if found.worst_before is None else f"{found.worst_before * DEGREES:.3g}°"
    before += f", {found.before.verdict}"
    margins = [
        f"{value:.1f} {unit}"
        for value, unit in ((found.found.gain_margin_db, "dB"), (found.found.phase_margin_deg, "°"))
        if value is not None
    ]
    early = f", interrupted after {found.generations} generations," if interrupted else ""
    return [
        f"found{early} for a servo of {rig.servo.natural_frequency / HERTZ:.3g} Hz and {late}",
        f"margins over bends of {low * DEGREES:.0f} to {high * DEGREES:.0f}°: "
        f"{' and '.join(margins) or no_margins(found.found)}",
        f"largest RMSE over {found.runs}: {found.worst_rmse * DEGREES:.3g}° (before: {before})",
        *([found.short] if found.short else []),
        *([] if found.study is None else [study_text(found.study, when) for when in ("after", "before")]),
    ]


def _preset(found: "Tuning") -> str | None:
    """On which the gains stand; of a pair, whose axes keep their own, none."""
    return None if found.rig.axes else found.rig.preset


def _written(rig: Path, found: "Tuning", evidence: list[str], axes: Sequence[str | None]) -> Path:
    """The rig with the gains in it: in each of these axes, or in that of one motor."""
    from bowden.core.files import write_text
    from bowden.design import gains_text

    text = rig.read_text(encoding="utf-8")
    said = (found.gains, evidence, rig, _preset(found))
    for axis in axes:
        text = gains_text.with_gains(text, *said) if axis is None else gains_text.with_axis_gains(text, axis, *said)
    write_text(rig, text)
    return rig


COMMANDS = (
    Command(
        "tune",
        tune,
        "Find gains for a rig, with margins, and write them into it.",
        (
            "bowden tune rig.toml",
            "bowden tune rig.toml --dry-run --json",
            "bowden tune rig.toml --study study.toml",
        ),
        place=110,
    ),
)
