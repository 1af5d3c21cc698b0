"""``bowden tune``: gains with margins for a rig.toml, written back into it with their evidence."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bowden.app.console import InterruptedPartway, print_json, progress_bar, seconds

if TYPE_CHECKING:
    from bowden.control.law import Law
    from bowden.design.processes import Mapper
    from bowden.design.tune import Report, Tuning
    from bowden.study.study import Study


def tune(
    rig: Annotated[Path, typer.Argument(help="The bench, law and scenario; its [control.gains] are rewritten.")],
    study: Annotated[
        Path | None,
        typer.Option(help="Tune against the plants of this study, and judge by others of them (docs/campaign.md)."),
    ] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Leave the file as it is.")] = False,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the search.")] = 0,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")] = False,
) -> None:
    """Find gains of the rig's law that keep 6 dB and 45° and follow best in the worst case, and write them back.

    Interrupted, the command writes the best gains that it has, if they are better than those before.
    """
    from bowden.core.units import DEGREES
    from bowden.design.tune import BrokenOff
    from bowden.face.tune import bends_of, tuned, workers_for
    from bowden.rig.rig import Rig
    from bowden.study.tune_study import runs_of

    plants = None if study is None else _plants(study, rig)
    if plants is None:
        given = Rig.read(rig)
        law = given.fitted()
    else:
        given, law = plants.rig, plants.nominal[0]
    judges, fixed = (None, ()) if plants is None else (runs_of(plants), plants.gains_varied)
    interrupted, others = False, None
    with (
        progress_bar(quiet=json) as report,
        workers_for(given) as workers,
    ):
        try:
            found = tuned(given, law, seed=seed, workers=workers, runs=judges, fixed=fixed, progress=report)
        except BrokenOff as broken:
            found, interrupted = broken.tuning, True
        try:
            if plants is not None and not interrupted:
                others = _judged(plants, law, found.law, workers, report)
        except KeyboardInterrupt:
            interrupted = True
    for note in given.notes:
        print(f"bowden: note: {note}", file=sys.stderr)
    runs = "nine runs of 20 s" if plants is None else f"{_count(plants)} plants of {plants.path.name}"
    evidence = _evidence(found, bends_of(given), runs, interrupted=interrupted)
    evidence += [] if others is None else _said_of(others)
    files = [] if dry_run or not found.gains else [str(_written(rig, found, evidence))]
    if interrupted:
        where = f"written to {files[0]}" if files else "not written"
        raise InterruptedPartway(f"the best gains after {found.generations} generations are {where}")
    if json:
        document: dict[str, Any] = {
            "law": law.name,
            "rig": given.hash,
            "gains": dict(found.gains),
            "before": {name: getattr(law.gains, name) for name in found.gains},
            "verdict": found.found.verdict,
            "verdict_before": found.before.verdict,
            "gain_margin_db": found.found.gain_margin_db,
            "phase_margin_deg": found.found.phase_margin_deg,
            "delay_margin_s": found.found.delay_margin_s,
            "worst_rmse_deg": found.worst_rmse * DEGREES,
            "worst_rmse_before_deg": None if found.worst_before is None else found.worst_before * DEGREES,
            "study": others,
        }
        print_json(document | {"files": files, "seconds": seconds()})
        return
    for line in evidence:
        print(line)
    for name, value in found.gains.items():
        print(f"  {name} = {value:g}  (was {getattr(law.gains, name):g})")
    print(f"{'Wrote ' + str(rig) if files else 'Nothing written'}  ({seconds():.1f} s)")


def _plants(path: Path, rig: Path) -> "Study":
    from bowden.study.load import load
    from bowden.study.tune_study import check_study

    found = load(path, rig)
    check_study(found)
    return found


def _count(plants: "Study") -> int:
    from bowden.study.tune_study import runs_of

    return runs_of(plants).count


def _judged(plants: "Study", before: "Law", after: "Law", workers: "Mapper", report: "Report") -> dict[str, Any]:
    """What gains before and after make of plants that they were not tuned against."""
    from bowden.study.tune_study import judged, parts, runs_of, spread

    work, found = parts(runs_of(plants), before, after), []
    for done, outcomes in enumerate(workers(judged, work)):
        found += outcomes
        report("judging by other plants", 0.9 + 0.1 * done / len(work))
    spreads = {"before": spread([one for one, _ in found]), "after": spread([one for _, one in found])}
    return {"name": plants.path.stem, "tuned_on": _count(plants)} | spreads


def _evidence(found: "Tuning", bends: tuple[float, float], runs: str, *, interrupted: bool) -> list[str]:
    """Margins and the largest error, for the file and for who looks on."""
    from bowden.core.units import DEGREES

    before = "unstable" if found.worst_before is None else f"{found.worst_before * DEGREES:.3g}°"
    before += f", {found.before.verdict}"
    margins = [
        f"{value:.1f} {unit}"
        for value, unit in ((found.found.gain_margin_db, "dB"), (found.found.phase_margin_deg, "°"))
        if value is not None
    ]
    early = f", interrupted after {found.generations} generations" if interrupted else ""
    return [
        f"found by bowden tune{early}; margins over bends of {bends[0] * DEGREES:.0f} to {bends[1] * DEGREES:.0f}°: "
        f"{' and '.join(margins) or 'no feedback'}",
        f"largest RMSE over {runs}: {found.worst_rmse * DEGREES:.3g}° (before: {before})",
    ]


def _said_of(others: dict[str, Any]) -> list[str]:
    """The other plants in a line for the gains before and after."""
    lines = []
    for when in ("after", "before"):
        one = others[when]
        figures = [one[f"rmse_{name}_deg"] for name in ("median", "90", "worst")]
        median, most, worst = ("none" if value is None else f"{value:.3g}°" for value in figures)
        lines.append(
            f"{one['runs']} other plants, {'' if when == 'after' else 'before: '}{one['unstable']} unstable; "
            f"RMSE median {median}, 90 % {most}, worst {worst}"
        )
    return lines


def _written(rig: Path, found: "Tuning", evidence: list[str]) -> Path:
    """The rig with the gains in it."""
    from bowden.core.files import whole_file
    from bowden.design import gains_text

    text = gains_text.with_gains(rig.read_text(encoding="utf-8"), found.gains, evidence, rig)
    with whole_file(rig) as part:
        part.write_text(text, encoding="utf-8")
    return rig
