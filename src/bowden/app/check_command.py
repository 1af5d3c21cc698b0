"""``bowden check``: whether the gains of a rig.toml hold on it, before anything moves."""

import contextlib
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bowden.app.command import Command
from bowden.app.console import print_json, progress_bar, say_note, seconds
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
    axis: Annotated[str | None, typer.Option(help="One axis alone, of a rig with several.")] = None,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")] = False,
) -> None:
    """Say whether a rig's gains hold: margins, limit cycle, chatter, the paper's bounds, and what to change.

    Of a rig with several axes, of each; of two motors on one joint (docs/pair.md), as one. Exit code 0 where the loop
    stays bounded, with little margin or a limit cycle too (the verdict says which), 1 where it does not hold, 2 where
    that cannot be said.
    """
    from bowden.core.errors import asked_for_by
    from bowden.core.toml_text import quoted
    from bowden.design.objections import refusals, refuse_sources
    from bowden.face.check import checked
    from bowden.face.pair import checked_pair

    own = read_given(rig, axis, several=True)
    given = own.with_law(law, preset)
    refuse_sources(given)
    singles = [one for one in given.parts if not (given.axes and one.name in given.pair.names)]
    found = {}
    with progress_bar(quiet=json) as progress:
        for number, one in enumerate(singles):
            progress(f"checking {one.name} {one.rig.law_name}".replace("  ", " "), number / len(given.parts))
            with asked_for_by(f"axis {quoted(one.name)}") if one.name else contextlib.nullcontext():
                found[f"axis {one.name}" if one.name else ""] = checked(one.rig)
        if given.axes and given.pair.there:
            progress(f"checking {' and '.join(given.pair.names)} on one joint", len(singles) / len(given.parts))
            found[_PAIR.format(*given.pair.names)] = checked_pair(given)
    for one in given.parts:
        for note in one.rig.notes:
            print(f"bowden: note: {f'axis {one.name}: ' if one.name else ''}{note}", file=sys.stderr)
    for note in (refused := refusals(given)):
        say_note(note)
    holds = all(one.holds for one in found.values())
    if json:
        documents = [_about(one.rig, check) for one, check in zip(singles, found.values(), strict=False)]
        if given.axes:
            named = [{"axis": one.name} | about for one, about in zip(singles, documents, strict=True)]
            pair = {"pair": _about_pair(given, [*found.values()][-1])} if given.pair.there else {}
            print_json({"rig": given.hash, "holds": holds, "axes": named} | pair | {"seconds": seconds()})
        else:
            print_json(documents[0] | {"seconds": seconds()})
    else:
        _print(found)
        print(f"({seconds():.1f} s)")
        options = ["--law", str(law)] if given.parts[0].rig.law_name != own.parts[0].rig.law_name else []
        options += [*(("--preset", preset) if preset else ()), *(("--axis", axis) if axis else ())]
        if refused:
            print("Next: correct what bowden run refuses, see the note, then check it again")
        else:
            _say_next_of(rig, given, found, options)
    if not holds:
        raise typer.Exit(1)


_PAIR = "{} and {} on one joint"


def _about_pair(rig: "Rig", found: "Check") -> dict[str, Any]:
    """What ``--json`` says of two motors on one joint."""
    assert found.pair is not None  # a pair was judged
    loops = [
        {
            "at": loop.at,
            "gain_margin_db": loop.gain_margin_db,
            "phase_margin_deg": loop.phase_margin_deg,
            "delay_margin_s": loop.delay_margin_s,
        }
        for loop in found.pair.loops
    ]
    own = {
        "axes": list(rig.pair.names),
        "co_contraction_deg": _deg(rig.pair.co_contraction),
        "loops": loops,
        "motors_apart_deg": _deg(found.pair.drift),
        "largest_pole_apart": found.pair.apart,
    }
    return own | {"law": found.law} | _document(found) | {"advice": found.advice}


def _about(rig: "Rig", found: "Check") -> dict[str, Any]:
    return {"law": found.law, "rig": rig.hash} | _document(found) | {"advice": found.advice}


def _print(found: dict[str, "Check"]) -> None:
    from bowden.design.findings import check_rows

    for name, one in found.items():
        if name:
            print(name)
        width = max(13, *(len(label) for label, _ in check_rows(one)))
        for label, text in check_rows(one):
            if text:
                print(f"{label:<{width}} {text}")


def _say_next_of(rig: Path, given: "Rig", found: dict[str, "Check"], options: list[str]) -> None:
    """What comes next; of several axes for the first that does not hold, and a run where all do."""
    for one in given.parts:
        key = f"axis {one.name}" if one.name else ""
        if key in found and not (found[key].holds and given.axes):
            own = ["--axis", one.name] if one.name else []
            _say_next(rig, one.rig, found[key], [*options, *own])
            return
    if all(one.holds for one in found.values()):
        say_next("run", rig, *options, "--twin", "--auto")
    else:
        say_next("check", rig, *options, "--axis", given.pair.agonist)


def _say_next(rig: Path, given: "Rig", found: "Check", options: list[str]) -> None:
    """Gains for the rig's own law, where it has a choice; else a run of what was checked, or of a law that holds."""
    if given.loaded_law.choices and options[:1] in ([], ["--axis"]):
        say_next("tune", rig, *options)
    elif found.holds:
        say_next("run", rig, *options, "--twin", "--auto")
    elif found.instead:
        say_next("simulate", rig, "--law", found.instead, *(options[-2:] if "--axis" in options else ()))
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
