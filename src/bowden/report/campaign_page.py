"""A campaign as a page: shares, how figures are spread, what they depend on, and the worst cases."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from bowden.drawing import style
from bowden.report.page import Page
from bowden.study.distributions import Distribution
from bowden.study.figures import MOVING, UNSTABLE, LawFigures, Summary
from bowden.study.results import FigureSpread, ParameterShare

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_NAMES = {
    "rmse_deg": "RMSE from rest [°]",
    "rmse_after_10s_deg": "RMSE after 10\N{NO-BREAK SPACE}s [°]",
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
_MATTERS = 0.02
"""Share of the variance from which a parameter is named."""

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
            "runs",
            "unstable [%]",
            "95 % interval [%]",
            "oscillating [%]",
            "worse [%]",
            "ran away [runs]",
            "RMSE, median [°]",
            "RMSE, 90 % [°]",
            "RMSE, 99 % [°]",
            "RMSE, worst [°]",
            "peak error, 99 % [°]",
        ],
        [_row(one) for one in summary.laws],
        caption=f"{UNSTABLE} The interval is Wilson's, of the unstable share. {MOVING} RMSE from "
        "rest and peak error are of the runs that reached their end; 90 %: nine runs in ten have at most this.",
    )
    page.heading("Distributions")
    page.figure(
        _spread_figure(summary.laws, summary.shown),
        "Share of the runs that reached their end in which a figure is at most as large.",
    )
    if drawn:
        _dependence(page, summary, drawn)
    page.heading("Worst cases")
    page.text("Each command runs its case alone, and writes its traces and a page.")
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
        [[name, unit or "–", f"{spread.kind} {', '.join(map(_short, spread.given))}"] for name, unit, spread in drawn],
        caption=f"Study {summary.study}; SHA-256 of the sorted rows {summary.rows_sha256}.",
    )
    return page


def _laws(summary: Summary) -> str:
    return "law" if len(summary.laws) == 1 else "laws"


def _short(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _row(one: LawFigures) -> list[str]:
    rmse, peak = one.figures.get("rmse_deg"), one.figures.get("peak_deg")
    low, high = one.unstable_interval
    values = [*_values(rmse), f"{peak.q99:.3g}" if peak else "–"]
    shares = [
        "–" if n is None else f"{100.0 * n / one.runs:.3g}" for n in (one.oscillating, one.worse_than_uncompensated)
    ]
    interval = f"{100.0 * low:.2g} … {100.0 * high:.2g}"
    return [
        one.law,
        str(one.runs),
        f"{100.0 * one.unstable / one.runs:.3g}",
        interval,
        *shares,
        str(one.ran_away),
        *values,
    ]


def _values(found: FigureSpread | None) -> list[str]:
    return [f"{v:.3g}" for v in (found.median, found.q90, found.q99, found.most)] if found else ["–"] * 4


def _spread_figure(laws: Sequence[LawFigures], shown: Sequence[str]) -> "Figure":
    """Empirical distribution functions, one plot a figure of merit."""
    rows = -(-len(shown) // 3)
    names = [one.law for one in laws]
    figure, axes = style.new_figure(rows, 3, width=9.0, height=2.5 * rows + style.legend_height(names, 9.0))
    colours, dashes = style.colours_for(names), style.dashes_for(names)
    for place, name in zip(axes, shown, strict=False):
        for one in laws:
            if name in one.quantiles:
                x = one.quantiles[name]
                shares = np.linspace(0.0, 100.0, len(x))
                place.plot(x, shares, color=colours[one.law], ls=dashes[one.law], label=one.law)
        smallest = [one.quantiles[name][0] for one in laws if name in one.quantiles]
        if name in _LOGARITHMIC and smallest and min(smallest) > 0.0:
            style.logarithmic(place, "x")
        place.set_xlabel(_NAMES[name])
        place.set_ylim(0.0, 100.0)
    for place in axes[len(shown) :]:
        place.set_axis_off()
    for place in axes[::3]:
        place.set_ylabel("share of runs [%]")
    style.legend_of_all(axes)
    return figure


def _dependence(page: Page, summary: Summary, drawn: Sequence[Drawn]) -> None:
    varied = [name for name, _, spread in drawn if spread.kind != "fixed"]
    of_law = {one.law: {found.parameter: found for found in one.sensitivity} for one in summary.laws}
    names = sorted(varied, key=lambda name: -max(found[name].share for found in of_law.values()))
    if not names:
        return
    page.heading("What the error depends on")
    for law, found in of_law.items():
        order = sorted(varied, key=lambda name: -found[name].share)
        first = [name for name in order if found[name].share >= _MATTERS and found[name].above_chance]
        said = ", ".join(f"{name} ({100.0 * found[name].share:.0f} %)" for name in first)
        page.text("<b>{law}</b>: {said}.", law=law, said=said or "no single parameter matters much")
    page.figure(
        _ranking_figure(of_law, names),
        "Parameters and faults from the one that matters most to the one that matters least: share of the variance of "
        "the RMSE's rank that each one explains by itself.",
    )
    units = {name: unit for name, unit, _ in drawn}
    rows = []
    for place, name in enumerate(names, 1):
        row = [str(place), name, units[name] or "–"]
        for found in of_law.values():
            rho = found[name].rank_correlation
            share = f"{100.0 * found[name].share:.1f}"
            if not found[name].above_chance:
                share = f"({share})" if found[name].variance_share is not None else "–"
            row += [share, "–" if rho is None else f"{rho:+.2f}".replace("-", "−")]
        rows.append(row)
    header = ["rank", "parameter", "unit"]
    for law in of_law:
        header += [f"{law}: share [%]", "ρ [–]"]
    page.table(
        header,
        rows,
        caption="Of the ranks of the RMSE from rest; a run that ran away has the highest rank. Share: variance between "
        "the means of up to twenty bins of the parameter with as many runs each, ten at least (Sobol’s first-order "
        f"index), less what chance gives on average (Kelley’s ε²). {_chance(of_law, summary.runs)}A dash: the law has "
        "no such gain. ρ: Spearman’s rank correlation, a dash for words. What the shares leave to 100 % "
        "is noise, and parameters that act together.",
    )
    shown = [name for name in names if any(len(one.steps.get(name, ((),))[0]) > 1 for one in summary.laws)][:_SMALL]
    evenly = {name for name, _, spread in drawn if spread.kind == "log_uniform"}
    if shown:
        page.figure(
            _steps_figure(summary.laws, {name: units[name] for name in shown}, evenly),
            "Median RMSE from rest over the parameters that matter most, in tenths of the runs; of a word, such as a "
            "fault's kind, for each of them. A tenth in which more than half of the runs ran away is left out.",
        )


def _chance(of_law: Mapping[str, Mapping[str, ParameterShare]], runs: int) -> str:
    """What chance gives, in words."""
    levels = [one.chance_share for found in of_law.values() for one in found.values() if one.chance_share]
    if not levels:
        return ""
    most = f"{100.0 * max(levels):.2g} %"
    return (
        f"With {runs} runs, 95 % of the shares of parameters that change nothing are below {most}; those stand in "
        "brackets. "
    )


def _ranking_figure(of_law: Mapping[str, Mapping[str, ParameterShare]], names: Sequence[str]) -> "Figure":
    """The share of each parameter, a bar for each law."""
    laws = list(of_law)
    height = max(0.12 * len(laws), 0.22)
    figure, (axes,) = style.new_figure(height=0.8 + height * len(names) + style.legend_height(laws))
    for i, (law, colour) in enumerate(style.colours_for(laws).items()):
        places = np.arange(len(names)) + (i + 0.5) * 0.8 / len(laws) - 0.4
        shares = [100.0 * of_law[law][name].share for name in names]
        axes.barh(places, shares, height=0.72 / len(laws), color=colour, label=law)
    axes.set_yticks(range(len(names)), names)
    axes.set(xlabel="share of variance [%]", ylim=(len(names) - 0.5, -0.5), xlim=(0.0, None))
    axes.grid(visible=False, axis="y")
    style.legend(axes)
    return figure


def _steps_figure(laws: Sequence[LawFigures], units: Mapping[str, str], evenly: set[str]) -> "Figure":
    """Median RMSE over each parameter; those that were drawn `evenly` over orders of magnitude are shown so."""
    columns = min(3, len(units))
    rows = -(-len(units) // columns)
    words = laws[0].words
    all_laws, width = [one.law for one in laws], 9.0 if columns > 1 else 5.0
    height = 2.5 * rows + style.legend_height(all_laws, width)
    figure, axes = style.new_figure(rows, columns, width=width, height=height)
    colours, dashes = style.colours_for(all_laws), style.dashes_for(all_laws)
    for place, (name, unit) in zip(axes, units.items(), strict=False):
        for one in laws:
            if name in one.steps:
                line = "" if name in words else dashes[one.law]
                place.plot(*one.steps[name], marker="o", ms=3.0, ls=line, color=colours[one.law], label=one.law)
        place.set_xlabel(f"{name} [{unit}]" if unit and name not in words else name)
        style.logarithmic(place, "y")
        if name in words:
            place.set_xticks(range(len(words[name])), [word.replace("_", "\n") for word in words[name]], fontsize=8.0)
            place.set_xlim(-0.5, len(words[name]) - 0.5)
        elif name in evenly:
            style.logarithmic(place, "x")
    for place in axes[len(units) :]:
        place.set_axis_off()
    for place in axes[::columns]:
        place.set_ylabel("median RMSE [°]")
    style.legend_of_all(axes)
    return figure
