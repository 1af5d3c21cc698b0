"""Reproduce the paper's bench: run the experiments, judge the claims, write the report."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bowden.paper import (
    errata_cable,
    errata_chirp,
    errata_law,
    fig04_spools,
    fig06_suit,
    fig09_uncompensated,
    fig12_observer,
    fig13_adaptive,
    fig15_moved,
    fig16_bandwidth,
    fig17_energy,
    fig18_clinic,
    second,
    stability_map,
    suit_second,
)
from bowden.paper.claims import Claim, Result, number, select
from bowden.paper.experiment import Experiment, Finding, Runs
from bowden.report.page import Page
from bowden.rig.presets import bench as paper

EXPERIMENTS: dict[str, tuple[Experiment, tuple[str, ...]]] = {
    "fig4": (fig04_spools.run, ("fig4.", "erratum.spools.")),
    "fig9": (fig09_uncompensated.run, ("fig9.",)),
    "fig12": (fig12_observer.run, ("table1.observer.constant",)),
    "fig13": (fig13_adaptive.run, ("table1.adaptive.constant", "fig14.", "erratum.convergence.")),
    "fig15": (fig15_moved.run, ("table1.observer.varying", "table1.adaptive.varying", "fig15.")),
    "fig16": (fig16_bandwidth.run, ("fig16.", "erratum.bandwidth")),
    "fig6": (fig06_suit.run, ("fig6.",)),
    "fig17": (fig17_energy.run, ("fig17.",)),
    "fig19": (fig18_clinic.run, ("fig19.",)),
    "errata_cable": (errata_cable.run, ("erratum.units", "erratum.monotone.", "erratum.gap")),
    "errata_law": (errata_law.run, ("erratum.eq14.", "erratum.gains.", "erratum.lyapunov", "erratum.rmse")),
    "errata_chirp": (errata_chirp.run, ("erratum.chirp",)),
}
"""Name → experiment, and the beginnings of the claims that it computes, in the order of the report."""

VERDICTS = {
    "fitted": "used by the calibration",
    "reproduced": "predicted, within the tolerance",
    "better": "predicted, and better than published",
    "differs": "predicted, and outside the tolerance",
    "erratum": "cannot be taken as printed",
}
"""What each verdict says."""


@dataclass(frozen=True)
class Reproduction:
    """The judged claims, and what is needed to report them."""

    results: list[Result]
    findings: list[Finding]
    second: list[dict[str, object]]
    """What both calibrations of the bench give; empty where only a part was asked for."""
    suit_second: list[dict[str, object]]
    """The same of the suit's."""

    def json(self) -> dict[str, Any]:
        """The claims, and the second calibration, as the command line prints them."""
        return {"claims": [result.json() for result in self.results], "calibrations": self.second + self.suit_second}


def reproduce(only: Sequence[str] = (), progress: Callable[[str, float], None] | None = None) -> Reproduction:
    """Run what the wanted claims need.

    Args:
        only: ids of claims or their beginnings (``fig16``, ``table1.adaptive``); all where empty.
        progress: called with what runs now, and the share that is done.

    Raises:
        ParameterError: an id that no claim has.
    """
    wanted = select(claims_of(only))
    needed = {
        name: experiment
        for name, (experiment, beginnings) in EXPERIMENTS.items()
        if any(claim.id.startswith(beginnings) for claim in wanted)
    }
    steps = len(needed) + (0 if only else 3)
    runs, findings = Runs(), []
    for done, (name, experiment) in enumerate(needed.items()):
        if progress is not None:
            progress(name, done / steps)
        findings.append(experiment(runs))
    comparison: list[dict[str, object]] = []
    of_suit: list[dict[str, object]] = []
    if not only:
        if progress is not None:
            progress("stability map", (steps - 3) / steps)
        findings.append(stability_map.run(runs))
        if progress is not None:
            progress("second calibration", (steps - 2) / steps)
        comparison = second.table()
        if progress is not None:
            progress("the suit's second calibration", (steps - 1) / steps)
        of_suit = suit_second.table()
    if progress is not None:
        progress("done", 1.0)
    return Reproduction([_judge(claim, findings) for claim in wanted], findings, comparison, of_suit)


def claims_of(only: Sequence[str]) -> list[str]:
    """Figures without a claim of their own stand for the claims that they show."""
    shown = {"fig12": ["table1.observer.constant"], "fig13": ["table1.adaptive.constant"]}
    shown["fig18"] = ["fig19"]  # the EMG of the motions, and the motions
    shown["fig15"] = ["fig15", "table1.observer.varying", "table1.adaptive.varying"]
    return [claim for name in only for claim in shown.get(name, [name])]


def _judge(claim: Claim, findings: list[Finding]) -> Result:
    for finding in findings:
        if claim.id in finding.values:
            radii = {
                f"radius_for_{x}": finding.values.get(f"erratum.spools.radius_for_{x}") for x in ("ratio", "mismatch")
            }
            return Result(claim, finding.values[claim.id], claim.why.format(**finding.details, **radii))
    raise LookupError(f"no experiment computes {claim.id}")


def write_report(outcome: Reproduction, path: Path) -> None:
    """One HTML page: the table of claims, every figure, the errata, and both calibrations.

    Raises:
        OutputError: the page cannot be written.
    """
    page = Page(
        "The paper's bench and suit, reproduced",
        "Dinh et al. 2017, Adaptive backlash compensation in upper limb soft wearable exoskeletons: published figures "
        "beside computed ones.",
    )
    claims = [result for result in outcome.results if not result.claim.id.startswith("erratum.")]
    errata = [result for result in outcome.results if result.claim.id.startswith("erratum.")]
    if claims:
        page.heading("Claims")
        _table(page, claims)
        page.text(
            "Only what was not fitted can count as reproduced. "
            + "; ".join(f"<em>{name}</em>: {text}" for name, text in VERDICTS.items())
            + "."
        )
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


def _table(page: Page, results: list[Result]) -> None:
    with_verdict = any(result.verdict != "erratum" for result in results)
    header = ["quantity, where, id", "published", "computed", "unit", *(["verdict"] if with_verdict else []), "why"]
    page.table(
        header,
        [
            [
                f"{claim.quantity} · {claim.source} · {_breakable(claim.id)}",
                number(claim.published),
                number(result.computed),
                claim.unit,
                *([result.verdict] if with_verdict else []),
                result.why,
            ]
            for result in results
            for claim in (result.claim,)
        ],
        classes=[result.verdict for result in results],
    )


def _breakable(identity: str) -> str:
    """An id that may be broken at its dots and underscores (zero-width spaces)."""
    return identity.replace(".", ".\u200b").replace("_", "_\u200b")


def _calibrations(page: Page, rows: list[dict[str, object]]) -> None:
    page.heading("Two calibrations fit the published rows")
    main, other = paper.calibration("main"), paper.calibration("second")
    page.text(
        "What the paper does not say was fitted to the rows without the adaptive law, and frozen. The main calibration "
        f"takes a period of {main.period:g} s and an observer whose α̂h is {main.observer_share:.2f} of the true one; "
        f"the second lets the observer know the cable exactly and finds a period of {other.period:.2f} s. Both meet "
        "the fitted rows; the published figures cannot decide between them. The adaptive rows are predictions of each."
    )
    page.table(
        ["quantity", "published", "main", "second", "use"],
        [
            [
                str(row["quantity"]),
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
        caption="The fitted values, frozen in rig/presets/paper.toml.",
    )
