"""A campaign as a page: shares, how figures are spread, what they depend on, and the worst cases."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from bowden.core import style
from bowden.report.page import Page
from bowden.study.distributions import Distribution
from bowden.study.figures import LawFigures, Spread, Summary

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_NAMES = {
    "rmse_deg": "RMSE from rest [°]",
    "rmse_after_10s_deg": "RMSE after 10 s [°]",
    "peak_deg": "peak error [°]",
    "lag_s": "lag [s]",
    "command_travel_deg": "travel of the command [°]",
    "electrical_energy_j": "electrical energy [J]",
    "shown_rmse_deg": "RMSE as the sensor shows it [°]",
    "largest_tension_n": "largest tension [N]",
    "largest_torque_nm": "largest torque on the elbow [N·m]",
    "hottest_winding_c": "hottest winding [°C]",
}
_LOGARITHMIC = ("rmse_deg", "rmse_after_10s_deg", "peak_deg", "command_travel_deg", "shown_rmse_deg")
_SMALL = 6
"""Parameters with a small plot."""

Drawn = tuple[str, str, Distribution]
"""Name, unit and spread of what was drawn."""


def campaign_page(summary: Summary, title: str, drawn: Sequence[Drawn], again: str, duration: float) -> Page:
    """The page of a campaign.

    Args:
        summary: what the runs show.
        title: of the page.
        drawn: what differed from run to run.
        again: the command that reruns one run, without its number; empty where Python alone can.
        duration: of a run [s].
    """
    page = Page(
        title,
        f"{summary.runs} plants drawn at random, {len(summary.laws)} control {_laws(summary)} on each of them for "
        f"{duration:g} s of simulated time.",
    )
    page.heading("Laws")
    page.table(
        [
            "law",
            "unstable",
            "95 % interval",
            "ran away",
            "RMSE median",
            "RMSE 90 %",
            "RMSE 99 %",
            "worst",
            "peak 99 %",
            "runs",
        ],
        [_row(one) for one in summary.laws],
        caption="Unstable: the joint was further from the reference than the reference's whole stroke (5° at least), "
        "or the run ran away: a command beyond 1000 rad. The interval is Wilson's. RMSE from rest and peak error [°] "
        "are of the runs that reached their end.",
    )
    page.heading("Distributions")
    page.figure(
        _spread_figure(summary.laws, summary.shown),
        "Share of the runs that reached their end in which a figure is at most as large.",
    )
    if drawn:
        _dependence(page, summary, drawn)
    page.heading("Worst cases")
    page.text("<p>Each command runs the case alone, with traces and a page.</p>")
    for one in summary.laws:
        page.heading(one.law, level=3)
        page.table(
            ["RMSE [°]", "drawn", "command"],
            [
                [
                    "ran away" if case.value is None else f"{case.value:.3g}",
                    ", ".join(f"{name} {_short(value)}" for name, value in case.drawn.items()),
                    f"{again} {case.number}" if again else f"campaign.trace({case.number})",
                ]
                for case in one.worst
            ],
        )
    page.heading("What was drawn")
    page.table(
        ["parameter", "unit", "spread"],
        [[name, unit, f"{spread.kind} {', '.join(map(_short, spread.given))}"] for name, unit, spread in drawn],
        caption=f"Study {summary.study_hash}; SHA-256 of the sorted rows {summary.digest}.",
    )
    return page


def _laws(summary: Summary) -> str:
    return "law" if len(summary.laws) == 1 else "laws"


def _short(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _row(one: LawFigures) -> list[str]:
    rmse, peak = one.figures.get("rmse_deg"), one.figures.get("peak_deg")
    low, high = one.interval
    values = [*_values(rmse), f"{peak.q99:.3g}" if peak else "–"]
    interval = f"{100.0 * low:.2g} … {100.0 * high:.2g} %"
    return [one.law, f"{100.0 * one.unstable / one.runs:.3g} %", interval, str(one.ran_away), *values, str(one.runs)]


def _values(found: Spread | None) -> list[str]:
    return [f"{v:.3g}" for v in (found.median, found.q90, found.q99, found.most)] if found else ["–"] * 4


def _spread_figure(laws: Sequence[LawFigures], shown: Sequence[str]) -> "Figure":
    """Empirical distribution functions, one plot a figure of merit."""
    rows = -(-len(shown) // 3)
    figure, axes = style.new_figure(rows, 3, width=9.0, height=2.5 * rows)
    colours = style.colours_for([one.law for one in laws])
    for place, name in zip(axes, shown, strict=False):
        for one in laws:
            if name in one.quantiles:
                x = one.quantiles[name]
                place.plot(x, np.linspace(0.0, 100.0, len(x)), color=colours[one.law], label=one.law)
        smallest = [one.quantiles[name][0] for one in laws if name in one.quantiles]
        if name in _LOGARITHMIC and smallest and min(smallest) > 0.0:
            style.logarithmic(place, "x")
        place.set_xlabel(_NAMES[name])
        place.set_ylim(0.0, 100.0)
    for place in axes[len(shown) :]:
        place.set_axis_off()
    for place in axes[::3]:
        place.set_ylabel("share of runs [%]")
    style.legend(axes[2])
    return figure


def _dependence(page: Page, summary: Summary, drawn: Sequence[Drawn]) -> None:
    page.heading("What the error depends on")
    page.text(
        "<p>Of the ranks of the RMSE from rest, a run that ran away having the highest. <em>Share</em>: how much of "
        "their variance lies between the means of twenty bins of the parameter with as many runs each (Sobol’s "
        "first-order index by binned conditional means), less what chance gives (Kelley’s ε²). <em>ρ</em>: Spearman’s "
        "rank correlation. What the shares leave to 1 is noise, and parameters that act together.</p>"
    )
    names = [one.name for one in summary.laws[0].sensitivities]
    best = {name: max(s.share for one in summary.laws for s in one.sensitivities if s.name == name) for name in names}
    names.sort(key=lambda name: -best[name])
    rows = []
    for name in names:
        row = [name]
        for one in summary.laws:
            found = next(s for s in one.sensitivities if s.name == name)
            row += [
                f"{100.0 * found.share:.1f} %",
                "–" if np.isnan(found.correlation) else f"{found.correlation:+.2f}".replace("-", "−"),
            ]
        rows.append(row)
    header = ["parameter"]
    for one in summary.laws:
        header += [f"{one.law}: share", "ρ"]
    page.table(header, rows)
    shown = [name for name in names if any(len(one.steps.get(name, ((),))[0]) > 1 for one in summary.laws)][:_SMALL]
    if shown:
        page.figure(
            _steps_figure(summary.laws, shown, {name for name, _, spread in drawn if spread.kind == "log_uniform"}),
            "Median RMSE from rest [°] in tenths of the runs by a parameter, for those that matter most; a tenth in "
            "which more than half ran away is left out.",
        )


def _steps_figure(laws: Sequence[LawFigures], names: Sequence[str], logarithmic: set[str]) -> "Figure":
    columns = min(3, len(names))
    rows = -(-len(names) // columns)
    figure, axes = style.new_figure(rows, columns, width=9.0 if columns > 1 else 5.0, height=2.5 * rows)
    colours = style.colours_for([one.law for one in laws])
    for place, name in zip(axes, names, strict=False):
        for one in laws:
            if name in one.steps:
                x, y = one.steps[name]
                place.plot(x, y, "o-", markersize=3.0, color=colours[one.law], label=one.law)
        place.set_xlabel(name)
        style.logarithmic(place, "y")
        if name in logarithmic:
            style.logarithmic(place, "x")
    for place in axes[len(names) :]:
        place.set_axis_off()
    for place in axes[::columns]:
        place.set_ylabel("median RMSE [°]")
    style.legend(axes[columns - 1])
    return figure
