"""``bowden emg score``: how well contractions are found in a recording."""

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bowden.app.command import Command
from bowden.app.console import folder_argument, print_json, seconds
from bowden.core.files import output_folder

if TYPE_CHECKING:
    from bowden.face.emg import Contractions
    from bowden.identify.emg.log import EmgLog
    from bowden.identify.emg.score import Score

ChannelOption = Annotated[str | None, typer.Option(help="Column of the signal; the first one by default.")]
DetectorOption = Annotated[str, typer.Option(help="What finds contractions in the signal.")]
RateOption = Annotated[
    float | None, typer.Option(help="Samples a second, where the recording has no times, or to check those it has.")
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")]


def score(
    recording: Annotated[
        Path, typer.Argument(help="CSV, csv.gz, NPZ or Parquet with time_s and one or more channels.")
    ],
    labels: Annotated[
        Path | None, typer.Option(help="CSV of contractions: onset_s, offset_s, or start, end; also in ms.")
    ] = None,
    wearer: Annotated[Path | None, typer.Option(help="Of bowden emg calibrate: rest and MVC.")] = None,
    channel: ChannelOption = None,
    rate: RateOption = None,
    detector: DetectorOption = "onset",
    shortest_ms: Annotated[
        float, typer.Option(help="Leave out contractions shorter than this; all others are reported this much later.")
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
    from bowden.face.emg import LONGEST, scored
    from bowden.identify.emg.log import read_emg
    from bowden.report.emg_page import emg_page
    from bowden.sensing.detectors import detector_named

    if not 0.0 <= shortest_ms <= 1e3 * LONGEST:
        raise ParameterError(f"--shortest-ms is {shortest_ms:g}", expected=f"a number from 0 to {1e3 * LONGEST:g}")
    kind = detector_named(detector)
    log = read_emg(recording, channel, checked_rate(rate))
    output_folder(out)
    whole = scored(log, labels=labels, wearer=wearer, kind=kind, shortest=1e-3 * shortest_ms)
    log, found = whole.log, whole.findings
    page = emg_page(recording.name, log, whole.labels, found)
    with whole_files(out) as folder:
        page.write(folder / "emg.html")
    source = "the largest contraction of this recording" if wearer is None else str(wearer)
    document = _document(whole, shortest_ms, source) | {"files": [str(out / "emg.html")], "seconds": seconds()}
    if json:
        print_json(document)
        return
    warn(log)
    _print(whole, shortest_ms, source)
    if document["trouble_s"] >= 0.05:
        print(f"nothing can be detected in {document['trouble_s']:.1f} s of movement, mains or a dead electrode")
    print(f"\nPage: {out / 'emg.html'}  ({seconds():.1f} s)")


def _document(whole: "Contractions", shortest_ms: float, source: str) -> dict[str, Any]:
    log = whole.log
    return asdict(whole.score) | {
        "plain_threshold": asdict(whole.plain_score),
        "contractions_s": [list(one) for one in whole.spans],
        "duration_s": len(log.values) / log.rate,
        "rate_hz": log.rate,
        "channel": log.channel,
        "mvc": whole.findings.mvc,
        "mvc_from": source,
        "shortest_ms": shortest_ms,
        "trouble_s": whole.trouble,
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


def _print(whole: "Contractions", shortest_ms: float, source: str) -> None:
    from bowden.identify.emg.log import channel_unit
    from bowden.sensing.envelope import PLAIN_THRESHOLD

    found, unit = whole.findings, channel_unit(whole.log.channel) or "(no unit in the channel's name)"
    print(f"{'':18}{'detections':>11}{'misses':>8}{'false':>7}{'a minute':>10}{'latency, median':>17}{'worst':>9}")
    for name, one in (("our detector", found.score), ("plain threshold", found.plain_score)):
        print(f"{name:18}{one.detections:11}{_text(one.misses, 8)}{_text(one.false_activations, 7)}{_rest(one)}")
    share, level = f"{100.0 * PLAIN_THRESHOLD:g} %", PLAIN_THRESHOLD * found.mvc
    print(f"plain threshold: {level:.3g} {unit} = {share} of MVC {found.mvc:.3g} {unit}, from {source}")
    if whole.units_differ:
        print(whole.units_differ)
    if shortest_ms:
        rejected = found.score.rejected
        said = f"; {rejected} labelled ones are, and count neither as missed nor as found" if rejected else ""
        print(f"contractions shorter than {shortest_ms:g} ms are left out{said}")
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
