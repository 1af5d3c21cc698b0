"""Admittance on the suit: whom it is stable against, and how little of the suit a wearer feels.

    python benchmarks/admittance.py [FOLDER] [--fast]

Writes ``admittance.json`` and ``admittance.svg`` to FOLDER (out/admittance), in a few minutes on one core; ``--fast``
takes every third stiffness, one body and five of the drawn wearers.
"""

import argparse
import json
import sys
import time
from dataclasses import asdict
from pathlib import Path
from typing import Any

from admittance_study import (
    FIRM,
    QUIET,
    PushedReference,
    back_driven,
    misjudged,
    pushed,
    sweep,
    swinging,
)
from admittance_unseen import unseen, unseen_felt
from bowden.control import LAWS
from bowden.control.admittance.port import passive_to
from bowden.control.admittance.virtual_elbow import Admittance
from bowden.core.units import RADIANS
from bowden.design.felt import felt
from bowden.models.suit.arm import arm_of
from bowden.plants.presets.suit import suit
from bowden.plants.suit_parts import Suit
from bowden.plants.suit_push import BODIES, limit_for, ports_of

STIFFNESSES = (0.0, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0)
DAMPINGS = (0.0, 0.5, 2.0, 10.0)
UNSEEN = 50
SURE = LAWS["uncompensated"]


def suits(body: tuple[float, float]) -> dict[str, tuple[Suit, Suit]]:
    """As believed, and as it may be, with what is believed of it."""
    made = suit()._replace(arm=arm_of(*body))
    return {"as believed": (made, made), "misjudged": (misjudged(made), made)}


def stability(*, fast: bool) -> list[dict[str, Any]]:
    """A row for each torque source, carried share, body and suit."""
    rows = []
    for body in BODIES[:1] if fast else BODIES:
        for name, (made, believed) in suits(body).items():
            for estimated, carried in ((False, 0.0), (False, 1.0), (True, 0.0), (True, 1.0)):
                how = PushedReference(SURE, estimated=estimated, carried=carried)
                stiffnesses = STIFFNESSES[::3] if fast else STIFFNESSES
                found = list(sweep(made, how, stiffnesses, DAMPINGS, believed=believed))
                rows.append(
                    {
                        "mass_kg": body[0],
                        "suit": name,
                        "torque": _source(estimated),
                        "carried": carried,
                        "runs": len(found),
                        "stable": sum(each.stable for each in found),
                        "largest_speed": max(each.speed for each in found),
                        "cells": [asdict(each) for each in found],
                    }
                )
                said = f"{body[0]:g} kg, {name}, {_source(estimated)}, carried {carried:g}: "
                said += f"{rows[-1]['stable']} of {rows[-1]['runs']}"
                _say(f"{said}, at most {rows[-1]['largest_speed']:.3f} rad/s")
    return rows


def transparency() -> list[dict[str, Any]]:
    """A row for each amplitude and way: the suit switched off, held, and with admittance."""
    rows: list[dict[str, Any]] = []
    laws = {"uncompensated": SURE} | {name: LAWS[name].preset("suit") for name in ("adaptive", "bowden")}
    for degrees in (20.0, 25.0, 30.0):
        wearer = swinging(degrees * RADIANS)
        for name, (made, believed) in suits(BODIES[1]).items():
            common = {"amplitude_deg": degrees, "suit": name}
            for way, on in (("switched off", False), ("holding", True)):
                rows.append(common | {"way": way} | asdict(felt(back_driven(made, SURE, wearer, powered=on), made.arm)))
            for law in laws.values():
                for estimated in (False, True):
                    how = PushedReference(law, estimated=estimated)
                    run = pushed(made, how, wearer, believed=believed)
                    way = f"admittance, {_source(estimated)}, {law.name}"
                    rows.append(common | {"way": way} | asdict(felt(run, made.arm)))
            for row in rows[-8:]:
                _say(f"±{degrees:g}° {name}, {row['way']}: {row['rms']:.2f} N·m RMS, peak {row['peak']:.2f}")
    return rows


def unseen_ones(*, fast: bool) -> list[dict[str, Any]]:
    """A row for each drawn wearer and torque source: what they feel with a source that believes the usual suit."""
    rows = []
    for estimated in (False, True):
        how = PushedReference(SURE, estimated=estimated)
        for number in range(5 if fast else UNSEEN):
            drawn = unseen(number, suit())
            row = {"number": number, "torque": _source(estimated), "mass_kg": drawn.mass, "hz": drawn.frequency}
            rows.append(row | {"amplitude_deg": drawn.amplitude / RADIANS} | asdict(unseen_felt(number, suit(), how)))
        found = sorted(row["rms"] for row in rows if row["torque"] == _source(estimated))
        within = sum(rms <= 1.0 for rms in found)
        middle = found[len(found) // 2]
        said = f"unseen, {_source(estimated)}: {within} of {len(found)} within 1 N·m"
        _say(f"{said}, {middle:.2f}, at most {found[-1]:.2f}")
    return rows


def limits() -> list[dict[str, Any]]:
    """The least inertia for some dampings, and up to where the port is passive then."""
    made = suit()
    limit, ports = limit_for(made), ports_of(made)
    rows = []
    for damping in (0.05, 0.1, 0.25, 0.5, 1.0):
        settings = Admittance(damping=damping)
        least = limit.least(settings, "inertia")
        at = with_inertia(settings, least)
        to = None if at is None else min(passive_to(port, at) for port in ports)
        rows.append({"damping": damping, "least_inertia": least, "passive_to": to})
        _say(f"B = {damping:g}: M at least {least}, passive to {to} rad/s")
    return rows


def with_inertia(settings: Admittance, inertia: float | None) -> Admittance | None:
    """The settings with another inertia, if there is one."""
    return None if inertia is None else settings._replace(inertia=inertia)


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    """One swing: the suit switched off, and with admittance; and the worst of the sweep, cell by cell."""
    from bowden.core import style
    from bowden.core.style import COLOURS, thin

    made, wearer = suit(), swinging(25.0 * RADIANS)
    runs = {"switched off": back_driven(made, SURE, wearer)}
    runs |= {
        _source(estimated): pushed(made, PushedReference(SURE, estimated=estimated), wearer)
        for estimated in (False, True)
    }
    figure, (left, right) = style.new_figure(1, 2, width=10.0, height=3.4)
    for (name, run), colour in zip(runs.items(), ("uncompensated", "joint", "motor"), strict=True):
        part = (run.time >= 6.0) & (run.time < 10.0)
        left.plot(*thin(run.time[part] - 6.0, run["interaction_torque"][part]), color=COLOURS[colour], label=name)
    left.set(xlabel="time [s]", ylabel="suit on the elbow [N·m]", ylim=(-8.0, 11.0))
    left.legend(loc="upper right", ncols=3)
    for source, colour in (("load cell", "joint"), ("estimate", "motor")):
        worst: dict[float, float] = {}
        for row in rows:
            for cell in row["cells"] if row["torque"] == source else ():
                worst[cell["stiffness"]] = max(worst.get(cell["stiffness"], 1e-5), cell["speed"])
        right.plot(range(len(worst)), list(worst.values()), "o-", color=COLOURS[colour], label=source)
        right.set_xticks(range(len(worst)), [f"{stiffness:g}" for stiffness in worst])
    right.axhline(QUIET, color=COLOURS["error"], lw=1.0, ls="--", label="counts as at rest")
    right.set(
        xlabel="wearer's stiffness [N·m/rad]", ylabel="largest speed left [rad/s]", yscale="log", ylim=(1e-4, 3.0)
    )
    right.legend(loc="upper right", ncols=3)
    with style.drawing():
        figure.savefig(path, metadata={"Date": None, "Creator": None})


def _source(estimated: bool) -> str:
    return "estimate" if estimated else "load cell"


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def main() -> None:
    """Everything, to files."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", nargs="?", type=Path, default=Path("out/admittance"))
    parser.add_argument("--fast", action="store_true")
    chosen = parser.parse_args()
    chosen.folder.mkdir(parents=True, exist_ok=True)
    begun = time.perf_counter()
    document = {
        "admittance": Admittance()._asdict(),
        "firm": FIRM,
        "quiet_rad_per_s": QUIET,
        "limits": limits(),
        "transparency": transparency(),
        "unseen": unseen_ones(fast=chosen.fast),
        "stability": (rows := stability(fast=chosen.fast)),
    }
    document["seconds"] = time.perf_counter() - begun
    (chosen.folder / "admittance.json").write_text(json.dumps(document, ensure_ascii=False, indent=1) + "\n")
    draw(rows, chosen.folder / "admittance.svg")


if __name__ == "__main__":
    main()
