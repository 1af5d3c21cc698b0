"""``bowden emg score``: how well contractions are found in a recording."""

from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bowden.app.command import Command
from bowden.app.console import folder_argument, print_json, seconds
from bowden.core.files import output_folder

if TYPE_CHECKING:
    from bowden.identify.emg.log import EmgLog
    from bowden.identify.emg.score import Findings, Score

ChannelOption = Annotated[str | None, typer.Option(help="Column of the signal; the first one by default.")]
DetectorOption = Annotated[str, typer.Option(help="What finds contractions in the signal.")]
RateOption = Annotated[
    float | None, typer.Option(help="Samples a second, where the recording has no times, or to check those it has.")
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")]


def score(
    recording: Annotated[Path, typer.Argument(help="CSV, csv.gz or Parquet with time_s and one or more channels.")],
    labels: Annotated[
        Path | None, typer.Option(help="CSV of contractions: onset_s, offset_s, or start, end; also in ms.")
    ] = None,
    wearer: Annotated[Path | None, typer.Option(help="Of bowden emg calibrate: rest and MVC.")] = None,
    channel: ChannelOption = None,
    rate: RateOption = None,
    detector: DetectorOption = "onset",
    shortest_ms: Annotated[
        float, typer.Option(help="Do not tell contractions shorter than this; all others are told so much later.")
    ] = 0.0,
    out: Annotated[Path, typer.Option(parser=folder_argument, metavar="FOLDER", help="Folder for emg.html.")] = Path(
        "out/emg"
    ),
    json: JsonOption = False,
) -> None:
    """Find contractions in a recording, as live, and say how well: misses, false activations, latency.

    Beside our detector stands the paper's plain threshold: the envelope above 20 % of MVC, which is the largest
    envelope of the recording where no --wearer is given.
    """
    from bowden.core.errors import ParameterError
    from bowden.core.files import whole_files
    from bowden.identify.emg.log import read_emg, read_labels
    from bowden.identify.emg.score import find
    from bowden.report.emg_page import emg_page
    from bowden.rig import wearer_file
    from bowden.sensing.detectors import detector_named

    if not 0.0 <= shortest_ms <= 5000.0:
        raise ParameterError(f"--shortest-ms is {shortest_ms:g}", expected="a number from 0 to 5000")
    kind = detector_named(detector)
    log = read_emg(recording, channel, checked_rate(rate))
    known = None if labels is None else read_labels(labels)
    _check_labels(known, log, labels)
    of = None if wearer is None else wearer_file.read(wearer)
    if of is not None and of.channel != log.channel:
        said = (
            f"{wearer} was measured on {of.channel!r}, and this is {log.channel!r}: is its MVC of this muscle and unit?"
        )
        log = replace(log, warnings=(*log.warnings, said))
    if of is not None and not of.sigma:
        log = replace(log, warnings=(*log.warnings, f"{wearer} was {wearer_file.EARLIER}"))
    output_folder(out)
    moved = None if known is None else [(on - log.start, off - log.start) for on, off in known]
    by = kind.settings if of is None or of.channel != log.channel else kind.of_wearer(of.sigma)
    by = by._replace(shortest=1e-3 * shortest_ms)
    mvc, mains = (None, 0.0) if of is None else (of.mvc, of.mains)
    found = find(log.values, log.rate, moved, mvc, by, mains, kind)
    page = emg_page(recording.name, log, known, found)
    with whole_files(out) as folder:
        page.write(folder / "emg.html")
    source = "the largest contraction of this recording" if wearer is None else str(wearer)
    document = _document(log, found, shortest_ms, source) | {"files": [str(out / "emg.html")], "seconds": seconds()}
    if json:
        print_json(document)
        return
    warn(log)
    _print(found, shortest_ms, source)
    if document["trouble_s"] >= 0.05:
        print(f"nothing can be detected in {document['trouble_s']:.1f} s of movement, mains or a dead electrode")
    print(f"\nPage: {out / 'emg.html'}  ({seconds():.1f} s)")


def _check_labels(labels: "list[tuple[float, float]] | None", log: "EmgLog", path: Path | None) -> None:
    from bowden.core.errors import LogError

    end = log.start + len(log.values) / log.rate
    if labels and (labels[0][0] < log.start or labels[-1][1] > end):
        raise LogError(
            f"{path}: labels from {labels[0][0]:g} to {labels[-1][1]:g} s, the recording lasts from {log.start:g} to "
            f"{end:g} s",
            do="give the labels of this recording, in its own time",
        )


def _document(log: "EmgLog", found: "Findings", shortest_ms: float, source: str) -> dict[str, Any]:
    return asdict(found.score) | {
        "plain_threshold": asdict(found.plain_score),
        "contractions_s": [[log.start + on, log.start + off] for on, off in found.found],
        "duration_s": len(log.values) / log.rate,
        "rate_hz": log.rate,
        "channel": log.channel,
        "mvc": found.mvc,
        "mvc_from": source,
        "shortest_ms": shortest_ms,
        "trouble_s": float((found.detected.trouble > 0.5).sum()) / log.rate,
        "warnings": list(log.warnings),
    }


def checked_rate(rate: float | None) -> float | None:
    """The value of ``--rate``.

    Raises:
        ParameterError: it is no rate.
    """
    from bowden.core.errors import ParameterError

    if rate is not None and not 0.0 < rate < 1e6:
        raise ParameterError(f"--rate is {rate:g}", expected="samples a second, such as 1000")
    return rate


def warn(log: "EmgLog") -> None:
    """Say on standard error what is odd about a recording."""
    import sys

    for warning in log.warnings:
        print(f"note: {warning}", file=sys.stderr)


def _print(found: "Findings", shortest_ms: float, source: str) -> None:
    print(f"{'':18}{'detections':>11}{'misses':>8}{'false':>7}{'a minute':>10}{'latency, median':>17}{'worst':>9}")
    for name, one in (("our detector", found.score), ("plain threshold", found.plain_score)):
        print(f"{name:18}{one.detections:11}{_text(one.misses, 8)}{_text(one.false_activations, 7)}{_rest(one)}")
    print(f"plain threshold: 20 % of MVC, an envelope of {found.mvc:.4g}, from {source}")
    if shortest_ms:
        rejected = found.score.rejected
        said = f"; {rejected} labelled ones are, and count neither as missed nor as found" if rejected else ""
        print(f"contractions shorter than {shortest_ms:g} ms are not told{said}")
        print(f"that costs {shortest_ms:g} ms of latency")


def _text(value: float | None, width: int) -> str:
    return f"{'–' if value is None else value:>{width}}"


def _rest(one: "Score") -> str:
    def milliseconds(value: float | None, width: int) -> str:
        return f"{'–' if value is None else f'{1e3 * value:.0f} ms':>{width}}"

    minute = "–" if one.false_per_minute is None else f"{one.false_per_minute:.2f}"
    return f"{minute:>10}{milliseconds(one.latency_median_s, 17)}{milliseconds(one.latency_max_s, 9)}"


GROUP = "Contractions of a muscle in its EMG."

COMMANDS = (
    Command(
        "emg score",
        score,
        "Say how well contractions are found in a recording.",
        (
            "bowden emg score biceps.csv",
            "bowden emg score biceps.csv --labels biceps.labels.csv --json",
        ),
        place=20,
    ),
)
