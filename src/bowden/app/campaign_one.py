"""One run of a campaign alone, with its traces and a page."""

from dataclasses import asdict
from pathlib import Path

from bowden.app.console import print_json, say_note, seconds
from bowden.core.errors import ParameterError
from bowden.core.files import whole_files
from bowden.study.study import Study


def run_alone(study: Study, number: int, folder: Path, *, json: bool) -> None:
    """Run all laws of a study on the plant of one number, and write what `bowden simulate` writes.

    Args:
        study: the study.
        number: of the run.
        folder: for the traces and the page.
        json: print one JSON document, and else what was drawn and the figures.

    Raises:
        ParameterError: there is no such run.
    """
    from bowden.control import user_law
    from bowden.report.simulate_page import write_simulation
    from bowden.sim.one_run import run_of

    if number >= study.file.runs:
        raise ParameterError(
            f"--run is {number}, and {study.path} has {study.file.runs} runs",
            expected=f"a number from 0 to {study.file.runs - 1}",
        )
    rig, laws, fault = study.run(number)
    drawn = study.drawn(number)
    traces = {}
    for law in laws:
        with user_law.explained(law):
            traces[law.name] = run_of(rig, law, fault)
    with whole_files(folder) as stage:
        for name, trace in traces.items():
            trace.to_parquet(stage / f"{name}.parquet")
        write_simulation(stage / "simulate.html", traces, f"Run {number} of {study.path.name}")
    files = [str(folder / f"{name}.parquet") for name in traces] + [str(folder / "simulate.html")]
    for note in rig.notes:
        say_note(note)
    metrics = {name: trace.metrics() for name, trace in traces.items()}
    if json:
        runs = [{"law": name, "ended": traces[name].ended} | asdict(found) for name, found in metrics.items()]
        drawn_values = {"seed": drawn.seed} | drawn.values
        print_json(
            {"run": number, "rig": rig.hash, "drawn": drawn_values, "runs": runs, "files": files, "seconds": seconds()}
        )
        return
    for name, value in drawn.values.items():
        print(f"  {name} = {value if isinstance(value, str) else format(value, '.6g')}")
    for name, found in metrics.items():
        if found.rmse_deg is None or found.peak_deg is None:
            print(f"{name}: ran away")
        else:
            print(f"{name}: RMSE {found.rmse_deg:.3g}°, peak {found.peak_deg:.3g}°")
    print(f"\nPage: {files[-1]}  ({seconds():.1f} s)")
