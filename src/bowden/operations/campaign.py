"""`campaign`: thousands of closed loops on plants drawn at random, and what comes of them."""

import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from bowden.operations.support.operation import GivenProgress, GivenRig, Operation, Switch
from bowden.operations.support.results import Result
from bowden.records.run_figures import Metrics
from bowden.study.results import LawCampaign

if TYPE_CHECKING:
    from bowden.study.study import Study


@dataclass(frozen=True)
class CampaignResult(Result[Any]):
    """What all runs show together."""

    rig: str
    """Hash of the rig whose plants are drawn, with what [set] changes."""
    study: str
    """A hash of all that the rows depend on."""
    rows_sha256: str
    """SHA-256 of the rows, sorted by number and law; it depends neither on the workers nor on how runs are cut into
    chunks."""
    runs: int
    """Plants drawn; each law has run on all of them."""
    laws: tuple[LawCampaign, ...]
    """One entry for each law, in the order of the study."""
    chunks_computed: int
    """By this call."""
    chunks_kept: int
    """That were there before."""
    chunks_set_aside: int
    """That were there and damaged; they were computed again."""
    files: tuple[Path, ...]
    """The folder of the Parquet files, and the page."""


@dataclass(frozen=True)
class CampaignRunOfLaw(Metrics):
    """What one law did in one run."""

    law: str
    ended: bool
    """True if it reached its end; if not, every figure is null."""


@dataclass(frozen=True)
class CampaignRun(Result[Any]):
    """One run alone."""

    run: int
    """Its number."""
    rig: str
    """Hash of the rig: equal rigs have the same, whether they come from a file, Python or a log."""
    drawn: dict[str, float | str]
    """Parameter -> its value in the unit of its name."""
    runs: tuple[CampaignRunOfLaw, ...]
    """One entry for each law."""
    files: tuple[Path, ...]
    """One Parquet file a law, and the page last."""


def campaign(
    study: Path,
    out: Annotated[Path | None, Switch(name="--out", metavar="FOLDER")] = None,
    *,
    rig: GivenRig | None = None,
    workers: Annotated[int | None, Switch(least=1)] = None,
    cluster: str | None = None,
    run: Annotated[int | None, Switch(least=0)] = None,
    progress: GivenProgress = None,
) -> CampaignResult | CampaignRun:
    """Run thousands of closed loops with random plants, gains and faults: figures as Parquet, and a page.

    Each run depends only on its number, so that the number of workers and their order do not matter. After an
    interruption the same call continues where it stopped. If only ``runs`` was raised since,
    only the new ones are computed.

    Args:
        study: a TOML file (docs/campaign.md).
        out: folder for the results; out/campaign/STUDY by default.
        rig: the rig, for a study that names none.
        workers: processes on this machine; one for each core.
        cluster: a dask scheduler's address, or local:N for N processes, in place of these.
        run: only this run, with traces and a page.
        progress: True for a line that says how far it is, or a function of what is being done and the share done.

    Raises:
        ParameterError: a study that cannot be run.
        OutputError: a folder that cannot be written.
        MissingExtraError: PyArrow is not installed: ``pip install "bowden[parquet]"``.

    Examples:
        bowden campaign study.toml
        bowden campaign study.toml --out out/study --workers 2 --json
        bowden campaign study.toml --cluster tcp://127.0.0.1:8786
        bowden campaign study.toml --run 17

    >>> import bowden, pathlib, tempfile
    >>> folder = pathlib.Path(tempfile.mkdtemp())
    >>> _ = (folder / "study.toml").write_text('''
    ... runs = 4
    ... duration_s = 5.0
    ... laws = ["uncompensated"]
    ... [vary]
    ... "cable.rate_per_rad" = { uniform = [7.0, 12.0] }
    ... ''')
    >>> found = bowden.campaign(folder / "study.toml", folder / "out", workers=1)
    >>> found.summary.laws[0].unstable, found.table().num_rows
    (0, 4)
    """
    from bowden.core.caller import argument
    from bowden.core.files import output_folder, whole_files
    from bowden.operations.support.given import rig_of
    from bowden.operations.support.progress import reported
    from bowden.report.campaign_page import campaign_page
    from bowden.study.computed import computed, require_parquet
    from bowden.study.load import load

    folder = Path("out/campaign") / study.stem if out is None else out
    given = None if rig is None else rig_of(rig)
    if given is not None and given.motors:
        from bowden.rig.config import one_motor

        raise one_motor(Path(given.origin))
    loaded = load(study, given)
    if run is None:
        require_parquet()
    output_folder(folder, argument("out"))
    if run is not None:
        return _alone(loaded, run, folder / f"run-{run}")
    origin = "" if given is None else given.origin
    more = [*(["--rig", origin] if Path(origin).suffix else []), *(["--out", str(out)] if out else [])]
    again = "" if given is not None and not Path(origin).suffix else ["bowden", "campaign", str(study), *more, "--run"]
    with reported(progress, "campaign") as report:
        found = computed(loaded, folder, workers=workers, cluster=cluster, progress=report)
    columns = [(column.name, column.unit, column.spread) for column in loaded.columns]
    page = campaign_page(found.summary, f"Campaign {study.stem}", columns, shlex.join(again), loaded.duration)
    with whole_files(folder) as stage:
        page.write(stage / "campaign.html")
    summary = found.summary
    return CampaignResult(
        rig=loaded.rig.hash,
        **{name: getattr(summary, name) for name in ("study", "rows_sha256", "runs", "laws")},
        chunks_computed=found.computed,
        chunks_kept=found.kept,
        chunks_set_aside=len(found.notes),
        files=found.files,
        made=found,
        notes=tuple(filter(None, (found.enlarged, *found.notes))),
    )


def _alone(study: "Study", number: int, folder: Path) -> CampaignRun:
    """All laws of a study on the plant of one number, written as `simulate` writes them."""
    from dataclasses import asdict

    from bowden.core.files import whole_files
    from bowden.report.simulate_page import simulation_page
    from bowden.study.computed import run_alone

    traces = run_alone(study, number)
    with whole_files(folder) as stage:
        for name, trace in traces.items():
            trace.write(stage / f"{name}.npz")
        simulation_page(traces, f"Run {number} of {study.path.name}").write(stage / "simulate.html")
    rig, drawn = study.run(number)[0], study.drawn(number)
    values: dict[str, Any] = {"seed": drawn.seed} | drawn.values
    figures = tuple(
        CampaignRunOfLaw(law=name, ended=one.ended, **asdict(one.metrics())) for name, one in traces.items()
    )
    files = (*(folder / f"{name}.npz" for name in traces), folder / "simulate.html")
    return CampaignRun(number, rig.hash, values, figures, files, made=traces, notes=tuple(rig.notes))


OPERATIONS = (Operation("campaign", campaign, 100),)
