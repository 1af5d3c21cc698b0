"""What a campaign shows, in a terminal."""

import textwrap
from typing import Any

from bowden.operations.campaign import CampaignResult, CampaignRun
from bowden.views.text import Call, table

_TITLES = (
    "unstable\n%",
    "oscil.\n%",
    "worse\n%",
    "RMSE\nmedian",
    "\n90 %",
    "\n99 %",
    "\nworst",
    "peak\nworst",
    "worst\nrun",
)
"""Of the columns after the first, angles in degrees."""


def show_campaign(found: CampaignResult | CampaignRun, call: Call) -> None:
    """A row for each law, and what its errors depend on; of one run what was drawn, and its figures."""
    if isinstance(found, CampaignRun):
        for name, value in found.drawn.items():
            if name != "seed":
                print(f"  {name} = {value if isinstance(value, str) else format(value, '.6g')}")
        for one in found.runs:
            ran = one.rmse_deg is not None and one.peak_deg is not None
            said = f"RMSE {one.rmse_deg:.3g}°, peak {one.peak_deg:.3g}°" if ran else "ran away"
            print(f"{one.law}: {said}")
        print(f"\nPage: {found.files[-1]}  ({call.seconds:.1f} s)")
        return
    _show_laws(found)
    rows, page = found.files
    print(f"\nRows: {found.runs * len(found.laws)} in {rows}, SHA-256 {found.rows_sha256}")
    print(f"Page: {page}  ({call.seconds:.1f} s)")


def _show_laws(found: CampaignResult) -> None:
    from bowden.study.figures import MOVING, UNSTABLE

    lines = []
    for one in found.laws:
        rmse, peak = one.figures.get("rmse_deg"), one.figures.get("peak_deg")
        counts = (one.unstable, one.oscillating, one.worse_than_uncompensated)
        values: list[Any] = [None if count is None else 100.0 * count / one.runs for count in counts]
        values += [rmse.median, rmse.q90, rmse.q99, rmse.most] if rmse else [None] * 4
        lines.append([one.law, *values, peak.most if peak else None, one.worst[0].number if one.worst else None])
    table(("law", *_TITLES), lines, width=100)
    print(textwrap.fill(f"Errors in degrees. {UNSTABLE} {MOVING}", 100))
    for one in found.laws:
        varied = [share for share in one.sensitivity if share.chance_share]
        if not varied:
            continue
        shares = (f"{s.parameter} {100.0 * (s.variance_share or 0.0):.0f} %" for s in varied if s.above_chance)
        chance = 100.0 * max(share.chance_share or 0.0 for share in varied)
        print(
            f"{one.law}: its RMSE depends on {', '.join(shares) or 'nothing that shows'} "
            f"(shares of up to {chance:.2g} % are not more than chance with {one.runs} runs)"
        )
