"""The page of `bowden reproduce`: verdicts and loops, how to read them, then every claim and every experiment."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from bowden.paper import suit_second
from bowden.paper.claims import Result, number
from bowden.paper.plots import loops
from bowden.paper.reproduce import Reproduction
from bowden.report.page import Page
from bowden.rig.presets import bench as paper

VERDICTS = {
    "fitted": "The calibration of the bench used this figure. It says nothing about the models.",
    "reproduced": "Predicted, and within the tolerance of the claim (10 % where nothing else is said).",
    "better": "Predicted, and better than published (a smaller error, for instance).",
    "differs": "Predicted, and outside the tolerance. The table says why.",
    "erratum": "The printed figure cannot be right as it stands. The table says why.",
}
"""What each verdict says."""

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
    """One HTML page: verdicts and loops, the table of claims, the errata, both calibrations, and every figure.

    Raises:
        OutputError: the page cannot be written.
    """
    page = Page(
        "The paper's bench and suit, reproduced",
        "Published and computed figures of Dinh et al., Adaptive backlash compensation in upper limb soft wearable "
        "exoskeletons, Robotics and Autonomous Systems 92 (2017).",
    )
    page.heading("Summary")
    _summary(page, outcome.results)
    if outcome.bench:
        page.figure(
            loops(outcome.bench),
            "The bench at constant bend: joint over desired angle in a minute from rest. A perfect law draws the "
            "dotted "
            "diagonal.",
        )
    page.heading("How to read this page")
    page.text(
        f"“{_PAPER}, Fig. 16” is a figure of the paper; “Figure 1” and so on are the figures of this page. Sections, "
        "equations and Table 1 are the paper’s. The errata have the numbers of docs/background/theory.md. Verdicts:"
    )
    _definitions(page, VERDICTS)
    page.text("Symbols, as in the paper:")
    _definitions(page, SYMBOLS)
    claims = [result for result in outcome.results if not result.claim.id.startswith("erratum.")]
    errata = [result for result in outcome.results if result.claim.id.startswith("erratum.")]
    if claims:
        page.heading("Claims")
        _table(page, claims)
    if errata:
        page.heading("Errata")
        _table(page, errata)
    if outcome.second:
        _calibrations(page, outcome.second)
    if outcome.suit_second:
        suit_second.section(page, outcome.suit_second)
    for finding in outcome.findings:
        page.heading(finding.title)
        if finding.text:
            page.text(finding.text)
        for figure, caption in finding.figures:
            page.figure(figure, caption)
    page.write(path)


def _summary(page: Page, results: Sequence[Result]) -> None:
    """How many claims have which verdict, those that differ by name, and Table 1."""
    count = Counter(result.verdict for result in results)
    predicted = [name for name in ("reproduced", "better", "differs") if count[name]]
    said = f"{len(results)} figures were computed. {count['fitted']} were fitted and prove nothing. "
    if predicted:
        said += f"Of the predicted ones: {', '.join(f'{count[name]} {name}' for name in predicted)}. "
    said += f"{count['erratum']} belong to what cannot be right as printed."
    page.text("{said}", said=said)
    differs = [result.claim for result in results if result.verdict == "differs"]
    if differs:
        named = "; ".join(f"{claim.quantity} ({claim.id})" for claim in differs)
        page.text("Different: {named}.", named=named)
    first = [result for result in results if result.claim.id.startswith("table1.")]
    if first:
        page.table(
            [f"{_PAPER}, Table 1", "published [°]", "computed [°]", "verdict"],
            [
                [result.claim.quantity, number(result.claim.published), number(result.computed), result.verdict]
                for result in first
            ],
            caption="RMSE over a minute from rest.",
            classes=[result.verdict for result in first],
        )


def _definitions(page: Page, terms: dict[str, str]) -> None:
    html = "".join(f"<dt>{{t{i}}}</dt><dd>{{d{i}}}</dd>" for i in range(len(terms)))
    values = {f"t{i}": term for i, term in enumerate(terms)} | {f"d{i}": text for i, text in enumerate(terms.values())}
    page.text(f"<dl>{html}</dl>", **values)


def _table(page: Page, results: Sequence[Result]) -> None:
    with_verdict = any(result.verdict != "erratum" for result in results)
    page.table(
        ["quantity", "published", "computed", "unit", *(["verdict"] if with_verdict else []), "why"],
        [
            [
                f"{claim.quantity}\n{_PAPER}, {claim.source}\n{_breakable(claim.id)}",
                number(claim.published),
                number(result.computed),
                _UNITS.get(claim.unit, claim.unit),
                *([result.verdict] if with_verdict else []),
                result.why,
            ]
            for result in results
            for claim in (result.claim,)
        ],
        caption="Under each quantity: where the paper has it, and its name for --only and --json.",
        classes=[result.verdict for result in results],
    )


_UNITS = {"deg": "°", "1": "–"}


def _breakable(identity: str) -> str:
    """An id that may be broken at its dots and underscores (zero-width spaces)."""
    return identity.replace(".", ".\u200b").replace("_", "_\u200b")


def _calibrations(page: Page, rows: list[dict[str, object]]) -> None:
    page.heading("Two calibrations fit the published rows")
    main, other = paper.calibration("main"), paper.calibration("second")
    page.text(
        "What the paper does not say was fitted to the rows without the adaptive law, and not changed afterwards. The "
        f"main calibration takes a period of {main.period:g} s and an observer whose α̂h is "
        f"{main.observer_share:.2f} of "
        f"the true one. The second lets the observer know the cable exactly and finds a period of "
        f"{other.period:.2f} s. "
        "Both agree with the fitted rows; the published figures cannot tell them apart. The rows of the adaptive law "
        "are predictions of each."
    )
    page.table(
        ["quantity", "published", "main", "second", "use"],
        [
            [
                _in_degrees(str(row["quantity"])),
                number(row["published"]),
                number(row["main"]),
                number(row["second"]),
                "fitted" if row["fitted"] else "predicted",
            ]
            for row in rows
        ],
    )
    page.table(
        ["calibration", "servo ω [rad/s]", "gap [–]", "observer's share of αh [–]", "loss of slope [–]", "period [s]"],
        [
            [name, *(f"{value:.4g}" for value in vars(fit).values())]
            for name, fit in (("main", main), ("second", other))
        ],
        caption="The fitted values, as rig/presets/paper.toml has them.",
    )


def _in_degrees(quantity: str) -> str:
    return quantity.replace("[deg]", "[°]")
