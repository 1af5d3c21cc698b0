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

_WIDTH, _HEIGHT = 72.0, 18.0
"""Of a small plot [px]."""

_LOWEST, _HIGHEST = 0.01, 30.0
"""Ends of the small plots' logarithmic scale [deg]."""

_COLOURS = ((0.25, "#bfe6d5"), (0.5, "#e0f3ea"), (1.0, "#f6f6f6"), (2.0, "#fbe6d6"), (math.inf, "#f5c9ab"))
"""RMSE over the baseline's, up to → background."""


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
        "Every law on every plant in every scenario, with one set of gains for each law, told only of the rig's servo "
        "and delay." + (f" Rig {rig}." if rig else ""),
    )
    if interrupted:
        page.notice("The league was interrupted: this page holds what had been played.")
    if not played:
        page.notice("No cell has been played.")
        return page
    page.heading("Ranking")
    page.table(
        ["law", "cells won", "RMSE", f"over {BASELINE}", "chatter", "most chatter", "unstable", "cells"],
        [_ranked(one) for one in standings],
        caption="Cells won: share in which no law had a lower RMSE from rest. RMSE [°], ratio to the paper's law and "
        "chatter are medians over the cells; an unstable cell counts as the largest error.",
        classes=["best", *[""] * (len(standings) - 1)],
    )
    laws = [one.law for one in standings]
    page.figure(
        _spread_figure([one.cell for one in played], laws),
        "RMSE from rest in each law's stable cells, from the best to the worst.",
    )
    page.heading("Cells")
    page.text(
        "<p>Each cell shows the RMSE from rest [°], the chatter in brackets, and the largest error over time on a "
        f"logarithmic scale from {_LOWEST:g}° to {_HIGHEST:g}°, the same in all cells. Colour is the RMSE over that of "
        f"<code>{BASELINE}</code>: green below a half, darker below a quarter; red above one, darker above two. The "
        "lowest RMSE of a row is bold.</p>"
    )
    page.text(_cells_table(played, laws))
    page.heading("Plants and scenarios")
    page.table(["plant", "what it is"], [list(pair) for pair in {one.cell.plant: one.what for one in played}.items()])
    page.table(["scenario", "what it is"], [[one.name, one.what] for one in scenarios])
    return page


def _ranked(one: Standing) -> list[str]:
    values = (one.rmse_deg, one.ratio, one.chatter, one.most_chatter)
    shown = ["–" if value is None else f"{value:.3g}" for value in values]
    return [one.law, f"{100.0 * one.won:.0f} %", *shown, str(one.unstable), str(one.cells)]


def _spread_figure(cells: Sequence[Cell], laws: Sequence[str]) -> "Figure":
    figure, (axes,) = style.new_figure(height=3.4)
    used: set[str] = set()
    for law, colour in style.colours_for(laws).items():
        line = "--" if colour in used else "-"  # more laws than colours
        used.add(colour)
        errors = sorted(cell.rmse_deg for cell in cells if cell.law == law and cell.rmse_deg is not None)
        if errors:
            shares = 100.0 * (np.arange(len(errors)) + 0.5) / len(errors)
            axes.semilogy(shares, errors, line, color=colour, label=law, marker=".", markersize=3.0)
    axes.set(xlabel="share of the law's stable cells [%]", ylabel="RMSE from rest [°]")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8.0)
    return figure


def _cells_table(played: Sequence[Played], laws: Sequence[str]) -> str:
    rows: dict[tuple[str, str], dict[str, Played]] = {}
    for one in played:
        rows.setdefault((one.cell.plant, one.cell.scenario), {})[one.cell.law] = one
    head = Markup("").join(
        Markup('<th scope="col">{}</th>').format(Markup("_<wbr>").join(name.split("_")))
        for name in ("plant", "scenario", *laws)
    )
    body = Markup("").join(
        Markup('<tr><td>{}</td><td style="white-space:nowrap">{}</td>{}</tr>').format(
            plant, scenario, Markup("").join(_cell(row.get(law), row) for law in laws)
        )
        for (plant, scenario), row in rows.items()
    )
    return f'<div class="wide"><table><thead><tr>{escape(head)}</tr></thead><tbody>{escape(body)}</tbody></table></div>'


def _cell(one: Played | None, row: Mapping[str, Played]) -> Markup:
    if one is None:
        return Markup("<td>–</td>")
    if one.cell.rmse_deg is None:
        return Markup('<td style="background:#f0a98a">unstable</td>')
    errors = [other.cell.rmse_deg for other in row.values() if other.cell.rmse_deg is not None]
    baseline = row[BASELINE].cell.rmse_deg if BASELINE in row else None
    colour = "#ffffff"
    if baseline is not None and one.cell.law != BASELINE:
        colour = next(shade for limit, shade in _COLOURS if one.cell.rmse_deg <= limit * baseline)
    chatter = "" if one.cell.chatter is None else f" ({one.cell.chatter:.2g})"
    return Markup('<td style="background:{};white-space:nowrap;font-weight:{}">{}{}<br>{}</td>').format(
        colour,
        700 if one.cell.rmse_deg == min(errors) else 400,
        f"{one.cell.rmse_deg:.3g}",
        chatter,
        _sparkline(one.errors),
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
        '<svg width="{w:g}" height="{h:g}" viewBox="0 0 {w:g} {h:g}" aria-hidden="true">'
        '<polyline points="{points}" fill="none" stroke="#444" stroke-width="1"/></svg>'
    ).format(w=_WIDTH, h=_HEIGHT, points=points)
