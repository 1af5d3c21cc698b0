"""Reproduce the paper's bench: run the experiments and judge the claims."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from bowden.paper import (
    errata,
    fig04_spools,
    fig06_suit,
    fig09_fig12,
    fig13_adaptive,
    fig15_moved,
    fig16_bandwidth,
    fig17_energy,
    fig18_clinic,
    gain_choice,
    sensitivity,
)
from bowden.paper.bench import bench_run
from bowden.paper.claims import Claim, JudgedClaim, interval, judge, select
from bowden.paper.experiment import Experiment, Finding
from bowden.records.trace import Trace

EXPERIMENTS: dict[str, tuple[Experiment, tuple[str, ...]]] = {
    "fig4": (fig04_spools.run, ("fig4.", "erratum.spools.")),
    "fig9": (fig09_fig12.fig09, ("fig9.",)),
    "fig12": (fig09_fig12.fig12, ("table1.observer.constant",)),
    "fig13": (
        fig13_adaptive.run,
        ("table1.adaptive.constant", "fig14.", "erratum.convergence.", "erratum.gains.static"),
    ),
    "fig15": (fig15_moved.run, ("table1.observer.varying", "table1.adaptive.varying", "fig15.")),
    "fig16": (fig16_bandwidth.run, ("fig16.", "erratum.bandwidth")),
    "fig6": (fig06_suit.run, ("fig6.",)),
    "fig17": (fig17_energy.run, ("fig17.",)),
    "fig19": (fig18_clinic.run, ("fig19.",)),
    "errata_cable": (errata.cable_errata, ("erratum.units", "erratum.monotone.", "erratum.gap")),
    "errata_law": (
        errata.law_errata,
        ("erratum.eq14.", "erratum.gains.pole", "erratum.gains.fastest", "erratum.lyapunov", "erratum.rmse"),
    ),
    "errata_chirp": (errata.chirp_errata, ("erratum.chirp",)),
}
"""Name → experiment, and the beginnings of the claims that it computes, in the order of the report."""


@dataclass(frozen=True)
class Reproduction:
    """The judged claims, and what `bowden.paper.report` needs to show them."""

    results: list[JudgedClaim]
    findings: list[Finding]
    earlier: dict[str, dict[str, float | None]]
    """What the two earlier calibrations predict, by claim; empty where only a part was asked for."""
    bench: dict[str, Trace]
    """The bench's runs at constant bend, by their laws; empty where only a part was asked for."""


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
    steps = len(needed) + (0 if only else 2)
    findings = []
    for done, (name, experiment) in enumerate(needed.items()):
        if progress is not None:
            progress(name, done / steps)
        findings.append(experiment())
    bench: dict[str, Trace] = {}
    earlier: dict[str, dict[str, float | None]] = {}
    if not only:
        bench = {law: bench_run(law) for law in ("uncompensated", "observer", "adaptive")}
        if progress is not None:
            progress("stability map", (steps - 2) / steps)
        findings.append(gain_choice.run())
        if progress is not None:
            progress("earlier calibrations", (steps - 1) / steps)
        earlier = sensitivity.earlier()
    if progress is not None:
        progress("done", 1.0)
    return Reproduction([_judged(claim, findings) for claim in wanted], findings, earlier, bench)


def claims_of(only: Sequence[str]) -> list[str]:
    """Figures without a claim of their own stand for the claims that they show."""
    shown = {"fig12": ["table1.observer.constant"], "fig13": ["table1.adaptive.constant"]}
    shown["fig18"] = ["fig19"]  # the EMG of the motions, and the motions
    shown["fig15"] = ["fig15", "table1.observer.varying", "table1.adaptive.varying"]
    return [claim for name in only for claim in shown.get(name, [name])]


def _judged(claim: Claim, findings: list[Finding]) -> JudgedClaim:
    for finding in findings:
        if claim.id in finding.values:
            over = finding.intervals.get(claim.id) or (None if claim.fitted else interval(claim.id))
            computed, why = finding.values[claim.id], claim.why.format(**finding.details)
            said = (claim.id, claim.source, claim.quantity, claim.published, computed, over, claim.unit)
            return JudgedClaim(*said, judge(claim, computed, over), claim.fitted, why)
    raise LookupError(f"no experiment computes {claim.id}")
