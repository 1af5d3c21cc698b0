"""``bowden check``: whether the gains of a rig.toml hold on it, before anything moves."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bowden.app.console import print_json, progress_bar, seconds
from bowden.app.given_rig import read_given

if TYPE_CHECKING:
    from bowden.design.check import Check


def check(
    rig: Annotated[Path, typer.Argument(help="The bench, law and scenario; bowden init writes one.")],
    law: Annotated[
        str | None, typer.Option(help="A law's name, or FILE.py:NAME of your own, in place of the rig's.")
    ] = None,
    preset: Annotated[str | None, typer.Option(help="A named set of gains of that law.")] = None,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")] = False,
) -> None:
    """Say whether a rig's gains hold: margins, limit cycle, chatter, the paper's bounds, and what to change."""
    from bowden.control import user_law
    from bowden.design.advice import advise
    from bowden.design.check import check as judge
    from bowden.rig import ranges

    given = read_given(rig).with_law(law, preset)
    chosen = given.fitted()
    bends, stroke = ranges.bends(given), ranges.stroke(given)
    with progress_bar(quiet=json) as progress, user_law.explained(chosen):
        progress(f"checking {chosen.name}", 0.0)
        found = judge(given.cabled, chosen, bends=bends, stroke=stroke, seed=given.seed)
        advice = advise(given.cabled, chosen, found, bends=bends, stroke=stroke)
    for note in given.notes:
        print(f"bowden: note: {note}", file=sys.stderr)
    document = {"law": chosen.name, "rig": given.hash} | _document(found) | {"advice": advice, "seconds": seconds()}
    if json:
        print_json(document)
    else:
        _print(document)


def _document(found: "Check") -> dict[str, Any]:
    """The figures of a check as JSON values, angles in degrees; None where one does not exist."""
    period = next((t.period for t in found.trials if t.swing is not None and t.swing == found.swing), None)
    swing, cycle = _deg(found.swing), found.cycle
    ripple = [t.ripple for t in found.trials if t.ripple is not None]
    peak = [t.peak for t in found.trials if t.peak is not None]
    whole = len(peak) == len(found.trials)
    return {
        "verdict": found.verdict,
        "reason": found.reason,
        "gain_margin_db": found.gain_margin_db,
        "phase_margin_deg": found.phase_margin_deg,
        "delay_margin_s": found.delay_margin_s,
        "worst": {
            "bend_deg": _deg(found.worst.bend),
            "slope": found.worst.slope,
            "estimates": found.worst.estimates,
            "largest_pole": found.worst.margins.largest_pole,
        },
        "limit_cycle": {
            "predicted": cycle is not None,
            "amplitude_deg": _deg(cycle.amplitude) if cycle else None,
            "period_s": cycle.period if cycle else None,
            "confirmed": found.cycle_confirmed,
            "simulated_amplitude_deg": swing,
            "simulated_period_s": period,
        },
        "chatter": {
            "predicted": found.chatters,
            "command_per_count_deg": _deg(found.command_per_count),
            "simulated_ripple_deg": _deg(max(ripple)) if whole else None,
        },
        "ultimate_bound_deg": _deg(found.ultimate_error),
        "ultimate_bound_s": found.ultimate_s,
        "simulated_peak_deg": _deg(max(peak)) if whole else None,
    }


def _deg(angle: float | None) -> float | None:
    from bowden.core.units import DEGREES

    return None if angle is None else float(angle * DEGREES)


def _print(document: dict[str, Any]) -> None:
    def shown(value: float | None, unit: str, factor: float = 1.0) -> str:
        return "none" if value is None else f"{factor * value:.3g} {unit}"

    cycle, chatter = document["limit_cycle"], document["chatter"]
    said = {True: "confirmed in simulation", False: "refuted in simulation", None: "nothing to confirm"}
    rows = [
        ("verdict", f"{document['verdict']}: {document['reason']}"),
        ("gain margin", shown(document["gain_margin_db"], "dB")),
        ("phase margin", shown(document["phase_margin_deg"], "°")),
        ("delay margin", shown(document["delay_margin_s"], "ms", 1e3)),
        (
            "limit cycle",
            f"±{cycle['amplitude_deg']:.2g}° every {cycle['period_s']:.2g} s predicted, {said[cycle['confirmed']]}"
            if cycle["predicted"]
            else "none predicted",
        ),
        ("at rest", f"±{shown(cycle['simulated_amplitude_deg'], '°')} at the joint in simulation"),
        ("chatter", f"{shown(chatter['command_per_count_deg'], '°')} of command for one count of the encoder"),
        ("error", f"at most {shown(document['simulated_peak_deg'], '°')} in simulation"),
    ]
    if document["ultimate_bound_deg"] is not None:
        rows.append(("proven bound", f"{document['ultimate_bound_deg']:.3g}° (the paper's Lyapunov bound)"))
    if document["advice"]:
        rows.append(("advice", document["advice"]))
    for name, text in rows:
        print(f"{name:<13} {text}")
    print(f"({document['seconds']:.1f} s)")
