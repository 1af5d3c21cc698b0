"""What ``bowden simulate`` makes of two motors on one joint."""

import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bowden.app.console import InterruptedPartway, progress_bar, say_note, seconds
from bowden.app.next_step import say_next
from bowden.core.files import output_folder

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from bowden.records.trace import Trace
    from bowden.records.traces import Traces
    from bowden.rig.rig import Rig

    Written = Callable[[Mapping[str, Trace]], list[Path]]


def simulate_pair(
    whole: "Rig",
    name: str,
    laws: list[str],
    preset: str | None,
    out: Path,
    written: "Written",
    *,
    force: bool,
    quiet: bool,
    entire: bool,
) -> dict[str, Any]:
    """Simulate laws on the joint of a rig's pair; what ``--json`` says of it.

    Args:
        whole: with a pair.
        name: of the rig's file.
        laws: to simulate; the rig's own of none.
        preset: for all of them.
        out: folder of what is written.
        written: writes the traces and their page into it.
        force: run laws that do not hold, too.
        quiet: print nothing.
        entire: run for the whole duration, though a recording of EMG ends before.

    Raises:
        InterruptedPartway: after some of the laws.
    """
    from bowden.core.units import DEGREES
    from bowden.face.pair import simulated_pair

    axes, contraction = whole.pair.names, whole.pair.co_contraction * DEGREES
    output_folder(out)
    with progress_bar(quiet=quiet) as progress:
        rigs = [whole.with_law(law, preset) for law in laws or (None,)]
        found = simulated_pair(rigs, name, force=force, whole=entire, progress=progress)
    runs = [
        {"law": law, "check": verdict.name} | _figures(run)
        for (law, run), verdict in zip(found.runs.items(), found.checked, strict=False)
    ]
    if not (quiet or found.interrupted):
        print(f"pair {axes[0]} and {axes[1]}, co-contraction {contraction:g}°")
        _print_table(runs)
    with progress_bar(quiet=quiet) as progress:
        progress("writing traces, drawing the page", 0.8)
        files = written(found.together)
    if found.interrupted:
        raise InterruptedPartway(f"{', '.join(found.runs)} (of {len(rigs)} laws) done and written to {out}")
    for note in found.notes:
        say_note(note)
    if not quiet:
        print(f"\nPage: {files[-1]}  ({seconds():.1f} s)")
    return {
        "axes": list(axes),
        "co_contraction_deg": contraction,
        "runs": runs,
        "files": [str(file) for file in files],
    }


def say_next_of_pair(whole: "Rig", file: Path, *options: str) -> None:
    """Print what comes next: the check of both, or why there is none of what was simulated."""
    from bowden.core.errors import ParameterError
    from bowden.rig.axes import refuse_sources

    try:
        refuse_sources(whole)
    except ParameterError as error:
        print(f"Next: nothing yet, neither check nor run take this rig: {error}")
    else:
        say_next("check", file, *options)


def _figures(run: "Traces") -> dict[str, Any]:
    """Figures of the joint, which both traces have, and of each motor."""
    first = next(iter(run.values()))
    of_motor = ("mechanical_energy_j", "electrical_energy_j")
    joint = {name: value for name, value in asdict(first.metrics()).items() if name not in of_motor}
    return {"stable": first.stable} | joint | {"motors": [_motor(axis, trace) for axis, trace in run.items()]}


def _motor(axis: str, trace: "Trace") -> dict[str, Any]:
    """Figures of one motor and its cable; None of a run that ran away."""
    import numpy as np

    metrics, pull, current = trace.metrics(), trace["pull"], trace["current"]
    ended = trace.ended
    return {
        "axis": axis,
        "largest_pull_nm": float(np.max(pull)) if ended else None,
        "slack_share": float(np.mean(pull <= 0.0)) if ended else None,
        "rms_current_a": float(np.sqrt(np.mean(current**2))) if ended else None,
        "mechanical_energy_j": metrics.mechanical_energy_j,
        "electrical_energy_j": metrics.electrical_energy_j,
    }


def _print_table(runs: list[dict[str, Any]]) -> None:
    """A row for each law and motor; the joint's figures stand in the first of both."""
    from rich import box
    from rich.console import Console
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("law", overflow="fold")
    of_motor = ("motor", "pull\nN·m", "slack\n%", "current\nA", "Pe energy\nJ")
    for title in ("RMSE\n°", "after 10 s\n°", "peak\n°", *of_motor):
        table.add_column(title, justify="left" if title == "motor" else "right", no_wrap=True)
    for run in runs:
        joint = [_shown(run[name]) for name in ("rmse_deg", "rmse_after_10s_deg", "peak_deg")]
        if run["rmse_deg"] is None:
            joint = ["unstable", "–", "–"]
        for i, motor in enumerate(run["motors"]):
            slack = motor["slack_share"]
            own = [
                _shown(motor["largest_pull_nm"]),
                _shown(None if slack is None else 100.0 * slack),
                _shown(motor["rms_current_a"]),
                _shown(motor["electrical_energy_j"]),
            ]
            head = ["", "", "", ""] if i else [run["law"], *joint]
            table.add_row(*head, motor["axis"], *own)
    Console(width=None if sys.stdout.isatty() else 120).print(table)


def _shown(value: float | None) -> str:
    return "–" if value is None else f"{value:.3g}"
