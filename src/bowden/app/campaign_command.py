"""``bowden campaign``: thousands of closed loops, and what comes of them."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bowden.app.console import (
    InterruptedPartway,
    clock_in,
    folder_argument,
    output_folder,
    print_json,
    progress_bar,
    seconds,
)

if TYPE_CHECKING:
    from bowden.study.figures import Summary
    from bowden.study.store import Store
    from bowden.study.study import Study

_Report = Callable[[str, float], None]


def campaign(
    study: Annotated[Path, typer.Argument(help="The study, a TOML file (docs/campaign.md).")],
    out: Annotated[
        Path | None,
        typer.Option(parser=folder_argument, metavar="FOLDER", help="Folder for the results; out/campaign/STUDY."),
    ] = None,
    workers: Annotated[int | None, typer.Option(min=1, help="Processes on this machine; one for each core.")] = None,
    cluster: Annotated[
        str | None, typer.Option(help="A dask scheduler's address, or local:N for N processes, in place of these.")
    ] = None,
    run: Annotated[int | None, typer.Option(min=0, help="Only this run, with traces and a page.")] = None,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")] = False,
) -> None:
    """Run laws on plants drawn at random, thousands of them: figures as Parquet, and a page with what they show.

    Every run is made of its number alone, so that neither the number of workers nor their order matters. Interrupted
    or killed, the same command goes on where it was.
    """
    from bowden.study.load import load

    loaded = load(study)
    folder = out or Path("out/campaign") / study.stem
    output_folder(folder)
    if run is not None:
        from bowden.app.campaign_one import run_alone

        run_alone(loaded, run, folder / f"run-{run}", json=json)
        return
    with progress_bar(quiet=json) as progress:
        store, counts, notes = _computed(loaded, folder, workers, cluster, progress)
        progress("drawing the page", 1.0)
        summary, files = _summed_up(loaded, store, study, out)
    for note in notes:
        print(f"bowden: note: {note}", file=sys.stderr)
    if json:
        print_json(summary.document() | counts | {"files": [str(file) for file in files], "seconds": seconds()})
        return
    _print_table(summary)
    print(f"\nRows: {loaded.file.runs * len(loaded.laws)} in {store.folder / 'runs'}, SHA-256 {summary.digest}")
    print(f"Page: {files[-1]}  ({seconds():.1f} s)")


def _computed(
    study: "Study", folder: Path, workers: int | None, cluster: str | None, progress: _Report
) -> tuple["Store", dict[str, int], list[str]]:
    """Compute the chunks that are missing; the store, how many there are, and notes.

    Raises:
        InterruptedPartway: Ctrl-C; what is computed is kept.
    """
    from bowden.core.errors import BowdenError
    from bowden.study.rows import chunks
    from bowden.study.store import Store

    cut = chunks(study)
    store = Store(folder, study.identity, [len(numbers) * len(study.laws) for numbers in cut])
    progress("looking at what is there", 0.0)
    notes = store.open()
    missing = store.missing()
    kept = len(cut) - len(missing)
    try:
        _fill(study, store, [(chunk, cut[chunk]) for chunk in missing], workers, cluster, progress)
    except KeyboardInterrupt:
        if len(store.missing()) == len(cut):
            raise  # nothing is there that could be spoken of
        raise InterruptedPartway(_standing(store, len(cut))) from None
    except BowdenError as error:
        raise type(error)(
            error.what,
            expected=error.expected,
            do="; ".join(part for part in (error.do, _standing(store, len(cut))) if part),
        ) from error
    return store, {"chunks_computed": len(missing), "chunks_kept": kept, "chunks_set_aside": len(notes)}, notes


def _standing(store: "Store", chunks: int) -> str:
    """What is kept, if anything is."""
    there = chunks - len(store.missing())
    if not there:
        return ""
    return f"{there} of {chunks} chunks are kept in {store.folder}, and the same command goes on from there"


def _fill(
    study: "Study",
    store: "Store",
    work: list[tuple[int, range]],
    workers: int | None,
    cluster: str | None,
    progress: _Report,
) -> None:
    import os

    from bowden.study import workers as campaign_workers
    from bowden.study.pack import warm

    if not work:
        return
    total = study.file.runs
    done = before = total - sum(len(numbers) for _, numbers in work)
    runs = dict(work)
    count = min(workers or os.cpu_count() or 1, len(work))
    if cluster is not None:
        from bowden.study.cluster import on_cluster

        progress(f"asking {cluster}", done / total)
        results = on_cluster(study, work, cluster)
    else:
        progress("compiling", done / total)
        warm(study)
        in_one = count == 1
        results = (
            campaign_workers.in_this_process(study, work)
            if in_one
            else campaign_workers.in_processes(study, work, count)
        )
    begin = seconds()
    for chunk, table in results:
        store.write(chunk, table)
        done += len(runs[chunk])
        left = (seconds() - begin) / (done - before) * (total - done)
        progress(f"{done} of {total} runs, ends {clock_in(left)}", done / total)


def _summed_up(study: "Study", store: "Store", path: Path, out: Path | None) -> tuple["Summary", list[Path]]:
    """The figures, and the page that shows them."""
    from bowden.core.files import whole_files
    from bowden.report.campaign_page import campaign_page
    from bowden.study.figures import summarise
    from bowden.study.rows import SUIT_FIGURES

    again = f"bowden campaign {path}" + (f" --out {out}" if out else "") + " --run"
    drawn_names, more = [column.name for column in study.columns], list(SUIT_FIGURES) if study.worn else []
    summary = summarise(store, [law.name for law in study.laws], drawn_names, more)
    drawn = [(column.name, column.unit, column.spread) for column in study.columns]
    page = campaign_page(summary, f"Campaign {path.stem}", drawn, again, study.duration)
    with whole_files(store.folder) as stage:
        page.write(stage / "campaign.html")
    return summary, [store.folder / "runs", store.folder / "campaign.html"]


def _print_table(summary: "Summary") -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("law", no_wrap=True)
    for title in ("unstable\n%", "RMSE\nmedian °", "\n90 % °", "\n99 % °", "\nworst °", "peak\nworst °", "worst\nrun"):
        table.add_column(title, justify="right", no_wrap=True)
    for one in summary.laws:
        found, peak = one.figures.get("rmse_deg"), one.figures.get("peak_deg")
        values: list[Any] = [100.0 * one.unstable / one.runs]
        values += [found.median, found.q90, found.q99, found.most] if found else [None] * 4
        values.append(peak.most if peak else None)
        shown = ("–" if value is None else f"{value:.3g}" for value in values)
        table.add_row(one.law, *shown, str(one.worst[0].number) if one.worst else "–")
    Console(width=None if sys.stdout.isatty() else 100).print(table)
