"""The page of `bowden reproduce`: what is reproduced, what is not determined, what differs; then how, and every "
"figure."""

import math
from collections.abc import Sequence
from pathlib import Path

from bowden.paper import sensitivity
from bowden.paper.calibration import parameters
from bowden.paper.claims import JudgedClaim, number, plausible_sets, span
from bowden.paper.plots import loops
from bowden.paper.reproduce import Reproduction
from bowden.report.page import Page

VERDICTS = {
    "reproduced": "Predicted; the published figure, with its printed deviation, lies in the interval, or is within "
    "10 % of ours.",
    "better": "Predicted, and better than published in every plausible calibration.",
    "not determined": "What the paper prints does not fix this figure: the interval holds the published one, and "
    "is wider than ±25 % of it. The reason names what is missing, or the reading that gives the figure.",
    "differs": "The published figure lies outside for every plausible calibration and every reading that we found.",
    "misprint": "One corrected value or word mends the figure, and others with it.",
    "fitted": "The calibration used this figure. It proves nothing.",
}
"""What each verdict says, in the order of the page."""

HEADINGS = {
    "reproduced": "What is reproduced",
    "better": "What comes out better than published",
    "not determined": "What the printed text does not determine",
    "differs": "What differs",
    "misprint": "Misprints, each with what mends it",
    "fitted": "What was fitted",
}
"""Heading of each verdict's table."""

SYSTEMS = {
    "geometry of the suit’s cables": ("fig4.", "erratum.spools."),
    "bench without compensation": ("fig9.", "erratum.units", "erratum.gap"),
    "bench, backlash observer": ("table1.observer.", "fig15.", "fig16.observer."),
    "bench, adaptive law": ("table1.adaptive.", "erratum.gains.static", "fig16.adaptive."),
    "estimates of the adaptive law": ("fig14.", "erratum.convergence."),
    "reference and units of the bandwidth test": ("erratum.chirp", "erratum.bandwidth"),
    "suit without compensation": ("fig6.", "fig17.uncompensated."),
    "suit, adaptive law": ("fig17.adaptive.",),
    "suit, started by the wearer’s muscle": ("fig19.",),
}
"""System of the paper → beginnings of its claims."""

SYMBOLS = {
    "φd, φout": "desired and measured angle of the joint",
    "φ̄": "what the adaptive law multiplies by β̂ for its command: the reference less the hysteresis (Eq. 13)",
    "αφ": "slope of the cable: motion of the joint for one of the motor, outside the dead zone",
    "αh, h": "gain and state of the cable’s hysteresis, which adds αh·h to the angle of the joint",
    "β̂": "estimate of 1/αφ by the adaptive law",
    "D̂m": "its estimate of the height of the hysteresis",
    "λ, κ": "gains of the adaptive law on the error",
    "δ1, δ2, ε": "its rates of adaptation, and the width of its tanh",
    "α̂h": "αh as the observer has it",
    "a, b, R": "half the arm’s width, distance of the anchors from the elbow, radius of the elbow",
    "ω, Ts": "natural frequency of the motor’s servo, and the time of one control cycle",
    "Pm, Pe": "mechanical and electrical power of the motor",
}
"""Symbols of the paper that the page uses."""

_PAPER = "Dinh 2017"


def write_report(outcome: Reproduction, path: Path) -> None:
    """One HTML page: the claims by verdict, how they were come by, and every figure.

    Raises:
        OutputError: the page cannot be written.
    """
    page = Page(
        "The paper's bench and suit, reproduced",
        "Published and computed figures of Dinh et al., Adaptive backlash compensation in upper limb soft wearable "
        "exoskeletons, Robotics and Autonomous Systems 92 (2017).",
    )
    claims = [result for result in outcome.results if not result.remark]
    remarks = [result for result in outcome.results if result.remark]
    page.heading("Summary")
    _summary(page, claims)
    for verdict, title in HEADINGS.items():
        chosen = [result for result in claims if result.verdict == verdict]
        if chosen:
            page.heading(title)
            page.text("{said}", said=VERDICTS[verdict])
            _table(page, chosen)
    if outcome.bench:
        page.figure(
            loops(outcome.bench),
            "The bench at constant bend: joint over desired angle in a minute from rest. A perfect law draws the "
            "dotted diagonal.",
        )
    page.heading("How to read this page")
    page.text(
        f"“{_PAPER}, Fig. 16” is a figure of the paper; “Figure 1” and so on are the figures of this page. Sections, "
        "equations and Table 1 are the paper’s. Symbols, as in the paper:"
    )
    _definitions(page, SYMBOLS)
    _calibration(page)
    if outcome.earlier:
        main = {r.id: (r.published, r.computed) for r in claims}
        shown = sensitivity.table(outcome.earlier, main)
        page.heading("Sensitivity: two earlier calibrations")
        page.table(shown.header, shown.rows, caption=shown.caption)
    if remarks:
        page.heading("Remarks on the equations")
        page.text("Figures of ours on what is printed, without a published one beside them. They are no charge.")
        _table(page, remarks)
    for finding in outcome.findings:
        page.heading(finding.title)
        if finding.text:
            page.text(finding.text)
        for table in finding.tables:
            page.table(table.header, table.rows, caption=table.caption)
        for figure, caption in finding.figures:
            page.figure(figure, caption)
    page.write(path)


def _summary(page: Page, results: Sequence[JudgedClaim]) -> None:
    """What the paper did, what was done here, and the verdicts system by system."""
    unstable = sum(not math.isfinite(one["fig17.adaptive.error"]) for one in plausible_sets())
    page.text(
        "The paper moves an elbow with a motor worn on the back: two cables run in bent sheaths from the motor’s "
        "spool to the arm. A cable in a sheath has play: when the motor turns round, the joint first stays where it "
        "is. The paper compares three ways to command the motor (no compensation, an observer with a fixed model of "
        "the play, and a law that adapts) on a test bench and on a suit, which a wearer’s muscle (EMG) also started."
    )
    page.text(
        "Here the bench and the suit are simulated. What the paper does not print was fitted to its rows without the "
        f"adaptive law and then frozen; the rows of that law are predicted. {len(plausible_sets())} other sets of "
        f"plausible values that meet the fitted rows within 5 % give each prediction its interval; {unstable} of "
        "them, in which the suit’s loop runs away under gains chosen for the main values, are left out of its rows. "
        "Under each quantity stand its place in the paper and its name for --only and --json; symbols are explained "
        "further down."
    )
    rows = []
    for system, beginnings in SYSTEMS.items():
        found = [r.verdict for r in results if r.id.startswith(beginnings)]
        if found:
            rows.append([system, *(str(sum(one == verdict for one in found) or "") for verdict in VERDICTS)])
    total = [str(sum(r.verdict == verdict for r in results) or "") for verdict in VERDICTS]
    page.table(
        ["system", *VERDICTS], [*rows, ["all", *total]], caption="Number of figures by verdict, system by system."
    )


def _calibration(page: Page) -> None:
    """The one set of physical parameters, with ranges and sources."""
    page.heading("One set of physical parameters")
    page.text(
        "Bench and suit have one motor, one gear and one servo. Every value that the paper does not print has a range "
        "in which it is plausible; the sets are drawn evenly from these ranges, and the fitted ones fitted again."
    )
    page.table(
        ["parameter", "value", "plausible", "unit", "fitted to", "what it is, and source"],
        [
            [
                _breakable(name),
                f"{one.value:.4g}",
                span((one.low, one.high)),
                one.unit,
                _breakable(one.fitted_to),
                one.source,
            ]
            for name, one in parameters().items()
        ],
    )


def _definitions(page: Page, terms: dict[str, str]) -> None:
    html = "".join(f"<dt>{{t{i}}}</dt><dd>{{d{i}}}</dd>" for i in range(len(terms)))
    values = {f"t{i}": term for i, term in enumerate(terms)} | {f"d{i}": text for i, text in enumerate(terms.values())}
    page.text(f"<dl>{html}</dl>", **values)


def _table(page: Page, results: Sequence[JudgedClaim]) -> None:
    remarks = all(result.remark for result in results)
    page.table(
        ["quantity", *([] if remarks else ["published"]), "ours", *([] if remarks else ["interval"]), "unit", "why"],
        [
            [
                f"{result.quantity}\n{_PAPER}, {result.source}\n{_breakable(result.id)}",
                *([] if remarks else [number(result.published)]),
                number(result.computed),
                *([] if remarks else [span(result.interval)]),
                _UNITS.get(result.unit, result.unit),
                result.why,
            ]
            for result in results
        ],
        classes=["" if remarks else result.verdict.replace(" ", "-") for result in results],
    )


_UNITS = {"deg": "°", "1": "–"}


def _breakable(identity: str) -> str:
    """An id that may be broken at its dots and underscores (zero-width spaces)."""
    return identity.replace(".", ".\u200b").replace("_", "_\u200b")
