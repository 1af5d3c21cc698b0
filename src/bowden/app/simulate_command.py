"""``bowden simulate``: one law, or several side by side, on the bench of a rig.toml."""

import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bowden.app.command import Command
from bowden.app.console import InterruptedPartway, folder_argument, print_json, progress_bar, say_note, seconds
from bowden.app.given_rig import read_given, shortened
from bowden.app.next_step import say_next
from bowden.app.simulate_pair import say_next_of_pair, simulate_pair
from bowden.core.files import output_folder, whole_files

if TYPE_CHECKING:
    from collections.abc import Mapping

    from bowden.records.metrics import Metrics
    from bowden.records.trace import Trace
    from bowden.rig.rig import Rig


def simulate(
    rig: Annotated[Path, typer.Argument(help="The bench, reference and scenario; bowden init writes one.")],
    law: Annotated[
        list[str] | None,
        typer.Option(help="A law's name, or FILE.py:NAME of your own; may be repeated. The rig's law by default."),
    ] = None,
    preset: Annotated[str | None, typer.Option(help="A named set of gains, for every law of this run.")] = None,
    duration: Annotated[float | None, typer.Option(help="Length of the run in seconds.")] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of the encoders' noise and of a random bend.")] = None,
    axis: Annotated[str | None, typer.Option(help="One axis alone, of a rig with several.")] = None,
    emg: Annotated[
        str | None, typer.Option(help="EMG moves the joint: file:PATH of a recording, in place of the rig's.")
    ] = None,
    out: Annotated[
        Path, typer.Option(parser=folder_argument, metavar="FOLDER", help="Folder for the traces and the page.")
    ] = Path("out/simulate"),
    csv: Annotated[bool, typer.Option("--csv", help="Write the traces as CSV too.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Run laws that fail the check on the rig, too.")] = False,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")] = False,
) -> None:
    """Simulate laws on a rig: figures of merit, traces as NPZ, and a page with every plot.

    Before anything runs, every law is checked as bowden check does it; one that fails is refused. Interrupted
    between two laws, the command writes the traces and the page of those that are done. Of a rig with several axes each
    is simulated by itself, into a folder of its name; two motors on one joint (docs/pair.md) as one, into the folder
    pair.
    """
    whole = shortened(read_given(rig, axis, several=True), duration, seed)
    whole = whole if emg is None else whole.with_emg(emg)
    options = {"csv": csv, "force": force, "quiet": json, "whole": duration is not None}
    documents = []
    singles = [one for one in whole.parts if not (whole.axes and one.name in whole.pair.names)]
    for one in singles:
        folder = out / one.name if one.name else out
        if one.name and not json:
            print(f"axis {one.name}")
        next_options = ["--axis", one.name] if one.name else ["--axis", axis] if axis else []
        documents.append(_of_axis(one.rig, rig, law or [], preset, folder, next_options, **options))
    pair = {}
    if whole.axes and whole.pair.there:
        folder = out / "pair"

        def written(traces: "Mapping[str, Trace]") -> list[Path]:
            return _write(traces, folder, f"Simulation of {rig.name}: two motors on one joint", csv=csv)

        entire = duration is not None
        pair["pair"] = simulate_pair(
            whole, rig.name, law or [], preset, folder, written, force=force, quiet=json, entire=entire
        )
        if not json:
            asked = ["--law", law[0]] if law and not law[1:] else []
            say_next_of_pair(whole, rig, *asked, *([] if preset is None else ["--preset", preset]))
    if not json:
        return
    if not whole.axes:
        print_json(documents[0] | {"seconds": seconds()})
        return
    axes = [{"axis": one.name} | found for one, found in zip(singles, documents, strict=True)]
    print_json({"rig": whole.hash, "axes": axes} | pair | {"seconds": seconds()})


def _of_axis(
    changed: "Rig",
    rig: Path,
    law: list[str],
    preset: str | None,
    out: Path,
    of_axis: list[str],
    *,
    csv: bool,
    force: bool,
    quiet: bool,
    whole: bool,
) -> dict[str, Any]:
    """Simulate laws on one axis, or on a rig with one motor; what `--json` says of it."""
    from bowden.face.simulate import simulated

    setup = changed.offline(whole=whole)
    laws = [changed.with_law(name, preset).fitted() for name in law or (None,)]
    output_folder(out)
    with progress_bar(quiet=quiet) as progress:
        found = simulated(setup, laws, rig.name, force=force, progress=progress)
    traces, interrupted = found.traces, found.interrupted
    metrics = {name: trace.metrics() for name, trace in traces.items()}
    if not (quiet or interrupted):
        _print_table(metrics)  # drawing takes longer than all that was before
    with progress_bar(quiet=quiet) as progress:
        progress("writing traces, drawing the page", 0.8)
        cable = getattr(setup.cable, "file", "") if setup.worn is not None else ""
        whose = f", with the cable of {cable}" if cable else ""
        files = _write(traces, out, f"Simulation of {rig.name}{whose}", csv=csv)
    if interrupted:
        raise InterruptedPartway(f"{', '.join(traces)} (of {len(laws)} laws) done and written to {out}")
    for note in (*found.notes, *_of_suit(setup)):
        say_note(note)
    if not quiet:
        for name, trace in traces.items():
            if found_torque := _interaction(setup, trace):
                print(f"{name}: the wearer feels {found_torque['rms_nm']:.2f} N·m RMS of the suit")
        print(f"\nPage: {files[-1]}  ({seconds():.1f} s)")
        _say_next(rig, metrics, law, changed.law_name, preset, out, of_axis, csv=csv)
    runs = [
        {"law": name, "check": verdict.name, "stable": traces[name].stable}
        | asdict(figures)
        | {"interaction": _interaction(setup, traces[name])}
        for (name, figures), verdict in zip(metrics.items(), found.checked, strict=True)
    ]
    return {"rig": changed.hash, "runs": runs, "files": [str(file) for file in files]}


def _say_next(
    rig: Path,
    metrics: dict[str, "Metrics"],
    laws: list[str],
    own: str,
    preset: str | None,
    out: Path,
    of_axis: list[str],
    *,
    csv: bool,
) -> None:
    """The check of the rig, under the law that followed best; of a run that nothing compensated, its identification."""
    if list(metrics) == ["uncompensated"]:
        say_next("identify", out / f"uncompensated.{'csv' if csv else 'npz'}")
        return
    given = dict(zip(metrics, laws, strict=False))
    errors = {name: one.rmse_deg for name, one in metrics.items() if one.rmse_deg is not None and name in given}
    best = min(errors, key=lambda name: errors[name]) if errors else next(iter(given), None)
    options = [] if best is None or given[best] == own else ["--law", given[best]]
    say_next("check", rig, *options, *([] if preset is None else ["--preset", preset]), *of_axis)


def _of_suit(rig: "Rig") -> list[str]:
    """What is said of a suit whose drive does not follow its target in gears with friction."""
    if rig.worn is None or rig.worn.motor.integral > 0.0 or rig.pushing is not None:
        return []
    less = "friction in the gears then leaves any law degrees of error; bowden init --suit has 40"
    return [f"suit.drive_integral_per_s is 0: {less}"]


def _interaction(rig: "Rig", trace: "Trace") -> dict[str, float | None] | None:
    """What the wearer felt of a suit that follows their push; None of any other run, and of one that ran away."""
    if rig.pushing is None or not trace.ended:
        return None
    from bowden.design.felt import felt

    found = felt(trace, rig.pushing.suit.arm, rig.pushing.section.carried)
    return {"rms_nm": found.rms, "peak_nm": found.peak, "estimate_error_nm": found.estimate}


def _write(traces: "Mapping[str, Trace]", folder: Path, title: str, *, csv: bool) -> list[Path]:
    """Write every trace and, last, the page: all or nothing."""
    from bowden.app.quick_figures import import_figures

    import_figures()
    from bowden.report.simulate_page import write_simulation

    names = []
    with whole_files(folder) as stage:
        for name, trace in traces.items():
            for kind in ("npz", "csv") if csv else ("npz",):
                names.append(f"{name}.{kind}")
                trace.write(stage / names[-1])
        names.append("simulate.html")
        write_simulation(stage / names[-1], traces, title)
    return [folder / name for name in names]


def _print_table(metrics: dict[str, "Metrics"]) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("law", overflow="fold")  # a long name is folded before a figure is cut
    titles = ("RMSE\n°", "after 10 s\n°", "peak\n°", "delay\nms", "width\n°", "Pm energy\nJ", "Pe energy\nJ")
    for title in titles:
        table.add_column(title, justify="right", no_wrap=True)
    for name, found in metrics.items():
        values = list(asdict(found).values())
        if found.rmse_deg is None:
            table.add_row(name, *["unstable", *["–"] * (len(values) - 1)])
            continue
        values[3] = None if values[3] is None else 1e3 * values[3]
        table.add_row(name, *("–" if value is None else f"{value:.3g}" for value in values))
    Console(width=None if sys.stdout.isatty() else 120).print(table)


COMMANDS = (
    Command(
        "simulate",
        simulate,
        "Simulate one law or several on a rig.",
        (
            "bowden simulate rig.toml",
            "bowden simulate rig.toml --law uncompensated --law observer --law adaptive",
            "bowden simulate rig.toml --law my_law.py --duration 30 --csv",
            "bowden simulate rig.toml --law adaptive --preset paper --force --json",
        ),
        place=30,
    ),
)
