"""A campaign computed: the chunks that are missing, and all of them summed up."""

import contextlib
import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bowden.core.caller import argument
from bowden.core.clock import unix_seconds
from bowden.core.errors import BowdenError, ParameterError
from bowden.core.extras import extra_module
from bowden.core.units import DEGREES
from bowden.drawing import shown
from bowden.records.trace import Trace
from bowden.study.figures import Summary, summarise
from bowden.study.rows import SUIT_FIGURES, chunks
from bowden.study.store import Store
from bowden.study.study import Study

if TYPE_CHECKING:
    import pyarrow as pa

Progress = Callable[[str, float], None]


class Partway(KeyboardInterrupt):
    """A campaign was interrupted when some of it was computed, which is kept: the same call goes on from there."""


@dataclass(frozen=True, repr=False)
class Campaign(shown.Shown):
    """A study that was run."""

    study: Study
    summary: Summary
    """Of each law: how its figures are spread, shares, worst runs, and what they depend on."""
    files: tuple[Path, ...]
    """The rows (Parquet) and the page."""
    computed: int
    """Chunks that were computed now."""
    kept: int
    """Chunks that were there from before."""
    notes: tuple[str, ...]
    """What was set aside."""
    enlarged: str = ""
    """What was kept of the same study with fewer runs, where it has been enlarged since."""

    def table(self) -> "pa.Table":
        """A row for each run and law: what was drawn, and its figures; ``.to_pandas()`` makes a frame of it."""
        import pyarrow.dataset as ds

        return ds.dataset(self.files[0], format="parquet").to_table()

    def trace(self, number: int) -> dict[str, Trace]:
        """Run one of its plants again: name of the law → its trace.

        Raises:
            ParameterError: there is no such run.
        """
        return run_alone(self.study, number)

    def _title(self) -> str:
        return f"Campaign {self.study.path.stem}: {self.study.file.runs} plants, {len(self.study.laws)} laws"

    def _rows(self) -> list[tuple[str, str]]:
        rows = []
        for one in self.summary.laws:
            found = one.figures.get("rmse_deg")
            spread = ""
            if found:
                shares = (("median", found.median), ("90 %", found.q90), ("99 %", found.q99), ("worst", found.most))
                spread = "RMSE " + ", ".join(f"{name} {value:.3g}°" for name, value in shares)
            rows.append((one.law, shown.listed((spread, f"{one.unstable} unstable"))))
        return [*rows, ("rig", self.study.rig.hash), ("page", str(self.files[-1]))]


def run_alone(study: Study, number: int) -> dict[str, Trace]:
    """Run all laws of a study on the plant of one number.

    Raises:
        ParameterError: there is no such run.
    """
    from bowden.control import user_law
    from bowden.sim.rig_runs import run_of

    runs = study.file.runs
    if not (isinstance(number, int) and 0 <= number < runs):
        raise ParameterError(
            f"{argument('run').rstrip('=')} is {number}, and {study.path} has {runs} runs",
            expected=f"a number from 0 to {runs - 1}",
        )
    rig, laws, fault = study.run(number)
    traces = {}
    for law in laws:
        with user_law.explained(law):
            traces[law.name] = run_of(rig, law, fault)
    return traces


def require_parquet() -> None:
    """Refuse a campaign whose results could not be written, before it begins.

    Raises:
        MissingExtraError: PyArrow is not installed.
    """
    extra_module("pyarrow.parquet", "parquet", "a campaign")


def computed(study: Study, folder: Path, *, workers: int | None, cluster: str | None, progress: Progress) -> Campaign:
    """Compute the chunks of a study that are missing, and sum all of them up.

    Args:
        study: as it was read.
        folder: of the results.
        workers: processes on this machine; None for one for each core.
        cluster: a dask scheduler's address, or ``local:N``, in place of these.
        progress: called with what is being done and the share that is behind.

    Raises:
        Partway: Ctrl-C; what is computed is kept.
        MissingExtraError: PyArrow is not installed, which the results are written with.
    """
    require_parquet()
    cut = chunks(study)
    store = Store(folder, study.identity, [len(numbers) * len(study.laws) for numbers in cut])
    progress("looking at what is there", 0.0)
    notes = store.open()
    missing = store.missing()
    try:
        _fill(study, store, [(chunk, cut[chunk]) for chunk in missing], workers, cluster, progress)
    except KeyboardInterrupt:
        if len(store.missing()) == len(cut):
            raise  # nothing is there that could be spoken of
        raise Partway(_standing(store, len(cut))) from None
    except BowdenError as error:
        do = shown.listed((error.do, _standing(store, len(cut))), "; ")
        raise type(error)(error.what, expected=error.expected, do=do) from None
    progress("summing up", 0.99)
    summary = _summed_up(study, store)
    files = (store.folder / "runs", store.folder / "campaign.html")
    return Campaign(study, summary, files, len(missing), len(cut) - len(missing), tuple(notes), store.enlarged)


def _standing(store: Store, chunks: int) -> str:
    """What is kept, if anything is."""
    there = chunks - len(store.missing())
    if not there:
        return ""
    return f"{there} of {chunks} chunks are kept in {store.folder}, and the same command goes on from there"


def _fill(
    study: Study,
    store: Store,
    work: list[tuple[int, range]],
    workers: int | None,
    cluster: str | None,
    progress: Progress,
) -> None:
    from bowden.study import workers as campaign_workers

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
        campaign_workers.warm(study)
        in_one = count == 1
        results = (
            campaign_workers.in_this_process(study, work)
            if in_one
            else campaign_workers.in_processes(study, work, count)
        )
    begin = time.perf_counter()
    with contextlib.closing(results):  # whatever interrupts this, whoever computes ends at once
        for chunk, table in results:
            store.write(chunk, table)
            done += len(runs[chunk])
            left = (time.perf_counter() - begin) / (done - before) * (total - done)
            progress(f"{done} of {total} runs, ends {_clock_in(left)}", done / total)


def _clock_in(wait: float) -> str:
    """What a clock on the wall shows after this many seconds, for a person who waits."""
    there = time.localtime(unix_seconds() + wait)
    return time.strftime("%H:%M:%S" if wait < 600.0 else "%H:%M" if wait < 43_200.0 else "on %d %b, %H:%M", there)


_STEP = 0.02
"""Between the angles from which the reference's travel is summed [s]."""


def _reference_travel(study: Study) -> float | None:
    """Total variation of the reference [deg]; None where runs differ in it, or a motor's command is not its like."""
    rig = study.rig
    if study.worn or rig.pushing is not None or any(one.name.startswith("reference.") for one in study.columns):
        return None
    seconds = np.arange(0.0, study.duration, max(rig.sample_time, _STEP))
    return float(np.abs(np.diff(rig.trajectory.sample(seconds)[:, 0])).sum()) * DEGREES


def _summed_up(study: Study, store: Store) -> Summary:
    """The figures of all chunks."""
    drawn_names, more = [column.name for column in study.columns], list(SUIT_FIGURES) if study.worn else []
    gains = {name: name.removeprefix("control.gains.") for name in drawn_names if name.startswith("control.gains.")}
    lacking = {law.name: [name for name, gain in gains.items() if gain not in law.numbers] for law in study.laws}
    return summarise(
        store,
        [law.name for law in study.laws],
        drawn_names,
        more,
        lacking=lacking,
        reference_travel=_reference_travel(study),
    )
