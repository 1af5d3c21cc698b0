"""``bowden check``: whether the gains of a rig.toml hold on it, before anything moves."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bowden.app.command import Command
from bowden.app.console import print_json, progress_bar, seconds
from bowden.app.given_rig import read_given
from bowden.app.next_step import say_next

if TYPE_CHECKING:
    from bowden.design.check import Check
    from bowden.rig.rig import Rig


def check(
    rig: Annotated[Path, typer.Argument(help="The bench, law and scenario; bowden init writes one.")],
    law: Annotated[
        str | None, typer.Option(help="A law's name, or FILE.py:NAME of your own, in place of the rig's.")
    ] = None,
    preset: Annotated[str | None, typer.Option(help="A named set of gains of that law.")] = None,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")] = False,
) -> None:
    """Say whether a rig's gains hold: margins, limit cycle, chatter, the paper's bounds, and what to change.

    Exit code 0 where the loop stays bounded, with little margin or a limit cycle too (the verdict says which), 1 where
    it does not hold, 2 where that cannot be said.
    """
    from bowden.design.findings import check_rows
    from bowden.face.check import checked

    own = read_given(rig)
    given = own.with_law(law, preset)
    with progress_bar(quiet=json) as progress:
        progress(f"checking {given.law_name}", 0.0)
        found = checked(given)
    for note in given.notes:
        print(f"bowden: note: {note}", file=sys.stderr)
    if json:
        about = {"law": found.law, "rig": given.hash}
        print_json(about | _document(found) | {"advice": found.advice, "seconds": seconds()})
    else:
        for label, text in check_rows(found):
            if text:
                print(f"{label:<13} {text}")
        print(f"({seconds():.1f} s)")
        options = ["--law", str(law)] if given.law_name != own.law_name else []
        _say_next(rig, given, found, [*options, *(("--preset", preset) if preset else ())])
    if not found.holds:
        raise typer.Exit(1)


def _say_next(rig: Path, given: "Rig", found: "Check", options: list[str]) -> None:
    """Gains for the rig's own law, where it has a choice; else a run of what was checked, or of a law that holds."""
    if given.loaded_law.choices and not options:
        say_next("tune", rig)
    elif found.holds:
        say_next("run", rig, *options, "--twin", "--auto")
    elif found.instead:
        say_next("simulate", rig, "--law", found.instead)
    elif found.advice:
        print("Next: change the rig as the advice says, then check it again")
    else:
        print("Next: change the law or the rig, then check it again")


def _document(found: "Check") -> dict[str, Any]:
    """The figures of a check as JSON values, angles in degrees; None where one does not exist."""
    period = next((t.period for t in found.trials if t.swing is not None and t.swing == found.swing), None)
    swing, cycle = _deg(found.swing), found.cycle
    ripple = [t.ripple for t in found.trials if t.ripple is not None]
    peak = [t.peak for t in found.trials if t.peak is not None]
    whole = len(peak) == len(found.trials)
    return {
        "holds": found.holds,
        "verdict": found.verdict,
        "reason": found.reason,
        "gain_margin_db": found.gain_margin_db,
        "phase_margin_deg": found.phase_margin_deg,
        "delay_margin_s": found.delay_margin_s,
        "worst": {
            "bend_deg": _deg(found.worst.bend),
            "at": found.worst.at,
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
        "leaves_out": found.leaves_out,
        "refuted": found.refuted,
    }


def _deg(angle: float | None) -> float | None:
    from bowden.core.units import DEGREES

    return None if angle is None else float(angle * DEGREES)


COMMANDS = (
    Command(
        "check",
        check,
        "Say whether a rig's gains hold, before anything moves.",
        (
            "bowden check rig.toml",
            "bowden check rig.toml --preset paper",
            "bowden check rig.toml --law my_law.py --json",
        ),
        place=80,
    ),
)
