"""The page of ``bowden emg score``: the signal, what was found in it, and by which threshold."""

from bowden.design.contractions import signal_figure, with_unit
from bowden.identify.emg.detector_score import DetectorScore
from bowden.identify.emg.log import EmgRecording
from bowden.identify.emg.score import Findings, Spans
from bowden.report.page import Page
from bowden.sensing.envelope import PLAIN_THRESHOLD


def emg_page(name: str, log: EmgRecording, labels: Spans | None, found: Findings) -> Page:
    """The page.

    Args:
        name: of the recording.
        log: it.
        labels: contractions as they are known; None without labels.
        found: what was found.
    """
    page = Page(
        f"Contractions in {name}",
        f"Channel {log.channel}, {len(log.values) / log.rate:.4g} s at {log.rate:.4g} Hz. Both detectors use only what "
        "came before, as in a live run.",
    )
    page.warnings(log.warnings)
    page.heading("What was found")
    page.table(
        list(TITLES),
        [score_row("ours", found.score), score_row("plain threshold", found.plain_score)],
        "Counts, where no unit is given. A detection belongs to a label if its contraction begins within the label or "
        "up to 0.3 s before it; each further detection is false. A labelled contraction that is shorter than "
        "--shortest-ms and not detected is rejected, not missed."
        + ("" if labels is not None else " Without labels (--labels) only detections are counted."),
    )
    page.figure(
        signal_figure(log, labels, found),
        "Above: the signal. Middle: its envelope (8 Hz) and the plain threshold. Below: when each detector saw a "
        "contraction"
        + (", and the labels" if labels is not None else "")
        + ". Trouble is movement, mains hum or a dead electrode; nothing is detected in it.",
    )
    page.text(
        "The plain threshold is {share} % of an envelope of {mvc}, which is taken for the maximum voluntary "
        "contraction "
        "(MVC).",
        share=f"{100 * PLAIN_THRESHOLD:g}",
        mvc=f"{found.mvc:.4g} {with_unit(log.channel)[1].strip(' []')}".strip(),
    )
    return page


TITLES = (
    *("detector", "detections", "misses", "rejected as too short", "false activations", "false activations [1/min]"),
    *("latency, median [ms]", "latency, worst [ms]"),
)


def score_row(name: str, score: DetectorScore) -> list[str]:
    """How well a detector did, in the columns of `TITLES`: its `DetectorScore`, or that of a result."""

    def milliseconds(value: float | None) -> str:
        return "–" if value is None else f"{1e3 * value:.0f}"

    counts = (score.detections, score.misses, score.rejected, score.false_activations)
    return [
        name,
        *("–" if count is None else str(count) for count in counts),
        "–" if score.false_per_minute is None else f"{score.false_per_minute:.2f}",
        milliseconds(score.latency_median_s),
        milliseconds(score.latency_max_s),
    ]
