"""``bowden emg``: a wearer's rest and MVC, and how well contractions are found in a recording."""

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bowden.app.console import folder_argument, output_folder, print_json, seconds

if TYPE_CHECKING:
    from bowden.identify.emg_log import EmgLog
    from bowden.identify.emg_score import Findings, Score

ChannelOption = Annotated[str | None, typer.Option(help="Column of the signal; the first one by default.")]
JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")]


def calibrate(
    recording: Annotated[Path, typer.Argument(help="CSV, csv.gz or Parquet: rest, and at least one contraction.")],
    rest: Annotated[
        Path | None, typer.Option(help="Recording of rest; by default the calmest tenth of RECORDING.")
    ] = None,
    channel: ChannelOption = None,
    out: Annotated[Path, typer.Option(help="File to write.")] = Path("wearer.toml"),
    json: JsonOption = False,
) -> None:
    """Measure a wearer's rest and maximum voluntary contraction (MVC), and save both.

    MVC is the largest envelope in RECORDING. A recording without a maximum contraction gives its largest one, which
    stands in for MVC.
    """
    from bowden.app import wearer_file
    from bowden.identify.emg_log import read_emg
    from bowden.identify.emg_score import envelope_levels

    logs = [read_emg(path, channel) for path in (recording, rest or recording)]
    levels = [envelope_levels(log.values, log.rate) for log in logs]
    source = recording.name if rest is None else f"{recording.name} and {rest.name}"
    level = levels[1].low if rest is None else levels[1].middle
    wearer = wearer_file.check(wearer_file.Wearer(level, levels[0].high, logs[0].channel, source), source)
    wearer_file.write(out, wearer)
    if json:
        print_json({"rest": wearer.rest, "mvc": wearer.mvc, "channel": wearer.channel, "files": [str(out)]})
        return
    _warn(logs[0])
    print(f"rest {wearer.rest:.4g}, MVC {wearer.mvc:.4g} (envelopes, in the unit of {wearer.channel}) → {out}")


def score(
    recording: Annotated[Path, typer.Argument(help="CSV, csv.gz or Parquet with time_s and one or more channels.")],
    labels: Annotated[Path | None, typer.Option(help="CSV of contractions: onset_s, offset_s.")] = None,
    wearer: Annotated[Path | None, typer.Option(help="Of bowden emg calibrate, for the plain threshold's MVC.")] = None,
    channel: ChannelOption = None,
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
    from bowden.app import wearer_file
    from bowden.core.errors import ParameterError
    from bowden.core.files import whole_files
    from bowden.identify.emg_log import read_emg, read_labels
    from bowden.identify.emg_score import find
    from bowden.report.emg_page import emg_page
    from bowden.sensing.onset import DEFAULTS

    if not 0.0 <= shortest_ms <= 5000.0:
        raise ParameterError(f"--shortest-ms is {shortest_ms:g}", expected="a number from 0 to 5000")
    log = read_emg(recording, channel)
    known = None if labels is None else read_labels(labels)
    _check_labels(known, log, labels)
    mvc = None if wearer is None else wearer_file.read(wearer).mvc
    output_folder(out)
    moved = None if known is None else [(on - log.start, off - log.start) for on, off in known]
    found = find(log.values, log.rate, moved, mvc, DEFAULTS._replace(shortest=1e-3 * shortest_ms))
    page = emg_page(recording.name, log, known, found)
    with whole_files(out) as folder:
        page.write(folder / "emg.html")
    source = "the largest contraction of this recording" if wearer is None else str(wearer)
    document = _document(log, found, shortest_ms, source) | {"files": [str(out / "emg.html")], "seconds": seconds()}
    if json:
        print_json(document)
        return
    _warn(log)
    _print(found, shortest_ms, source)
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


def _warn(log: "EmgLog") -> None:
    import sys

    for warning in log.warnings:
        print(f"note: {warning}", file=sys.stderr)


def _print(found: "Findings", shortest_ms: float, source: str) -> None:
    print(f"{'':18}{'detections':>11}{'misses':>8}{'false':>7}{'a minute':>10}{'latency, median':>17}{'worst':>9}")
    for name, one in (("our detector", found.score), ("plain threshold", found.plain_score)):
        print(f"{name:18}{one.detections:11}{_text(one.misses, 8)}{_text(one.false_activations, 7)}{_rest(one)}")
    print(f"plain threshold: 20 % of MVC, an envelope of {found.mvc:.4g}, from {source}")
    if shortest_ms:
        print(f"contractions shorter than {shortest_ms:g} ms are not told: that costs {shortest_ms:g} ms of latency")


def _text(value: float | None, width: int) -> str:
    return f"{'–' if value is None else value:>{width}}"


def _rest(one: "Score") -> str:
    def milliseconds(value: float | None, width: int) -> str:
        return f"{'–' if value is None else f'{1e3 * value:.0f} ms':>{width}}"

    minute = "–" if one.false_per_minute is None else f"{one.false_per_minute:.2f}"
    return f"{minute:>10}{milliseconds(one.latency_median_s, 17)}{milliseconds(one.latency_max_s, 9)}"
