"""The league as a page: the ranking, every cell in colour with a small plot of its error, and what the cells are."""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from markupsafe import Markup, escape
from numpy.typing import NDArray

from bowden.core import style
from bowden.design.league import BASELINE, Cell, Played, Standing
from bowden.design.league_cells import LeagueScenario
from bowden.report.page import Page

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_WIDTH, _HEIGHT = 60.0, 16.0
"""Of a small plot, in its own units: it is as wide as its cell."""

_LOWEST, _HIGHEST = 0.01, 30.0
"""Ends of the small plots' logarithmic scale [deg]."""

_SHADES = ((0.25, "much-better"), (0.5, "better"), (1.0, "same"), (2.0, "worse"), (math.inf, "much-worse"))
"""RMSE over the baseline's, up to → a cell's class in page.css: blue for better, orange for worse."""


def league_page(
    played: Sequence[Played],
    standings: Sequence[Standing],
    scenarios: Sequence[LeagueScenario],
    *,
    rig: str = "",
    interrupted: bool = False,
) -> Page:
    """The page of a league.

    Args:
        played: every cell, in the order in which it was played.
        standings: the laws from best to worst.
        scenarios: those that were to be played.
        rig: hash of the one whose servo and clock all plants have.
        interrupted: whether it was broken off.
    """
    page = Page(
        "League of control laws",
        "Every law on every plant in every scenario. Each law has one set of gains for all of them, and knows only the "
        "rig's servo and delay." + (f" Rig {rig}." if rig else ""),
    )
    if interrupted:
        page.notice("The league was interrupted: this page shows the cells that were played before.")
    if not played:
        page.notice("No cell has been played.")
        return page
    page.heading("Ranking")
    page.table(
        [
            "law",
            "cells",
            "won [%]",
            "RMSE, median [°]",
            f"RMSE over {BASELINE}'s, median [–]",
            "chatter, median [–]",
            "chatter, largest [–]",
            "unstable [cells]",
        ],
        [_ranked(one) for one in standings],
        caption="A cell is one plant in one scenario. Won: no law had a lower RMSE from rest. An unstable cell counts "
        "as the largest error. Chatter: how far the command travels, over how far that of an exact inverse does.",
        classes=["best", *[""] * (len(standings) - 1)],
    )
    laws = [one.law for one in standings]
    page.figure(
        _spread_figure([one.cell for one in played], laws),
        "RMSE from rest in each law's stable cells, from its best cell to its worst. A lower curve is better; laws "
        "stand in the legend in the order of the ranking.",
    )
    page.heading("Cells")
    page.text(
        "<p>In each cell: the RMSE from rest [°], bold where it is the lowest of the row; the chatter [–] in brackets; "
        f"and the largest error over time as a line, on a logarithmic scale from {_LOWEST:g}° to {_HIGHEST:g}° in all "
        f"cells. The colour compares the RMSE with that of <code>{BASELINE}</code>:</p>"
        '<div class="wide cells"><table><tbody><tr><td class="much-better">at most a quarter</td>'
        '<td class="better">at most a half</td><td class="same">at most the same</td>'
        '<td class="worse">up to twice as large</td><td class="much-worse">larger</td>'
        '<td class="unstable">unstable</td></tr></tbody></table></div>'
    )
    page.text(_cells_table(played, laws))
    page.heading("Plants and scenarios")
    page.table(["plant", "what it is"], [list(pair) for pair in {one.cell.plant: one.what for one in played}.items()])
    page.table(["scenario", "what it is"], [[one.name, one.what] for one in scenarios])
    return page


def _ranked(one: Standing) -> list[str]:
    values = (one.rmse_deg, one.ratio, one.chatter, one.most_chatter)
    shown = ["–" if value is None else f"{value:.3g}" for value in values]
    return [one.law, str(one.cells), f"{100.0 * one.won:.0f}", *shown, str(one.unstable)]


def _spread_figure(cells: Sequence[Cell], laws: Sequence[str]) -> "Figure":
    figure, (axes,) = style.new_figure(height=4.2)
    colours, dashes = style.colours_for(laws), style.dashes_for(laws)
    for law in laws:
        errors = sorted(cell.rmse_deg for cell in cells if cell.law == law and cell.rmse_deg is not None)
        if errors:
            shares = 100.0 * (np.arange(len(errors)) + 0.5) / len(errors)
            axes.plot(shares, errors, color=colours[law], ls=dashes[law], label=law, marker=".", markersize=3.0)
    style.logarithmic(axes, "y")
    axes.set(xlabel="share of the law's stable cells [%]", ylabel="RMSE from rest [°]")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8.0, handlelength=2.4)
    return figure


def _cells_table(played: Sequence[Played], laws: Sequence[str]) -> str:
    rows: dict[tuple[str, str], dict[str, Played]] = {}
    for one in played:
        rows.setdefault((one.cell.plant, one.cell.scenario), {})[one.cell.law] = one
    head = Markup("").join(Markup('<th scope="col"><span>{}</span></th>').format(law.replace("_", " ")) for law in laws)
    body = Markup("").join(
        Markup('<tr><th scope="row">{}<br><small>{}</small></th>{}</tr>').format(
            plant, scenario, Markup("").join(_cell(row.get(law), row) for law in laws)
        )
        for (plant, scenario), row in rows.items()
    )
    return (
        f'<div class="wide cells"><table><thead><tr><th scope="col" style="width: 13%">plant<br>'
        f"<small>scenario</small></th>{escape(head)}</tr></thead><tbody>{escape(body)}</tbody></table></div>"
    )


def _cell(one: Played | None, row: Mapping[str, Played]) -> Markup:
    if one is None:
        return Markup("<td>–</td>")
    if one.cell.rmse_deg is None:
        return Markup('<td class="unstable">unstable</td>')
    errors = [other.cell.rmse_deg for other in row.values() if other.cell.rmse_deg is not None]
    baseline = row[BASELINE].cell.rmse_deg if BASELINE in row else None
    shade = ""
    if baseline is not None and one.cell.law != BASELINE:
        shade = next(name for limit, name in _SHADES if one.cell.rmse_deg <= limit * baseline)
    least = " least" if one.cell.rmse_deg == min(errors) else ""
    chatter = "" if one.cell.chatter is None else f" ({one.cell.chatter:.2g})"
    return Markup('<td class="{}">{}<small>{}</small>{}</td>').format(
        f"{shade}{least}".strip(), f"{one.cell.rmse_deg:.3g}", chatter, _sparkline(one.errors)
    )


def _sparkline(errors: NDArray[np.float64]) -> Markup:
    """The largest error over time as a line without axes."""
    span = math.log(_HIGHEST / _LOWEST)
    heights = np.log(np.clip(errors, _LOWEST, _HIGHEST) / _LOWEST) / span
    across = np.linspace(1.0, _WIDTH - 1.0, len(errors))
    points = " ".join(
        f"{x:.0f},{_HEIGHT - 1.0 - y * (_HEIGHT - 2.0):.1f}" for x, y in zip(across, heights, strict=True)
    )
    return Markup(
        '<svg viewBox="0 0 {w:g} {h:g}" preserveAspectRatio="none" aria-hidden="true">'
        '<polyline points="{points}" fill="none" stroke="currentColor" vector-effect="non-scaling-stroke"/></svg>'
    ).format(w=_WIDTH, h=_HEIGHT, points=points)
