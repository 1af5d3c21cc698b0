"""Hours of fault-free running under the supervisor: all laws in four motions on the default bench.

Every cycle's verdict must be the law's requested target, with power on.
"""

import itertools
from collections.abc import Iterator
from typing import Any

import numpy as np

from bowden.control import LAWS
from bowden.control.knowledge import informed
from bowden.control.reference import PeriodicMinimumJerk, PointToPoint, Trajectory
from bowden.core.units import RADIANS
from bowden.models.cable.sheath_path import BendPath, constant_bend
from bowden.plants.knowledge_of import knowledge_of
from bowden.plants.presets.bench import default_bench
from bowden.plants.presets.paper import moved_sheath
from bowden.safety.faults import of
from bowden.safety.limits import Limits
from kept import Kept
from measure import Figure, Found
from support.fault_matrix import MEASURED
from support.supervised import supervised

HOURS = 24.0
STROKE = 70.0 * RADIANS
"""Of the bench's joint (Section 3.1) [rad]."""
WAY_POINTS = (0.0, 0.5, 0.5, 1.0, 1.0, 0.8, 0.8, 0.9, 0.9, 0.3, 0.3, 0.4, 0.4, 0.4, 0.0, 0.0, 0.7, 0.7)
"""Shares of the stroke, every two seconds: moves of 10 to 70 %, some on, some back."""
MOTIONS: dict[str, tuple[float, Trajectory]] = {
    "periodic": (60.0, PeriodicMinimumJerk(0.0, STROKE, 10.0)),
    "slow": (50.0, PeriodicMinimumJerk(0.0, STROKE, 25.0)),
    "fast": (20.0, PeriodicMinimumJerk(0.0, STROKE, 2.0)),
    "point_to_point": (
        36.0,
        PointToPoint(tuple(2.0 * i for i in range(len(WAY_POINTS))), tuple(share * STROKE for share in WAY_POINTS)),
    ),
}
"""Name → duration [s] and motion."""


def sheaths() -> dict[str, BendPath]:
    """The bench's sheath at rest, and moved."""
    return {"bench": constant_bend(default_bench().sheath.bend), "moved_sheath": moved_sheath()}


def runs(hours: float, done: int) -> Iterator[list[Any]]:
    """[law, plant, scenario, seed, seconds, cycles in which the verdict was not the requested target, faults]."""
    bench = default_bench()
    known, played, gone = knowledge_of(bench), 0, 0.0
    for seed in itertools.count(1):
        for motion, (sheath, bend), law in itertools.product(MOTIONS, sheaths().items(), LAWS.values()):
            if gone >= 3600.0 * hours:
                return
            duration, reference = MOTIONS[motion]
            played, gone = played + 1, gone + duration
            if played <= done:
                continue
            out, _ = supervised(
                bench,
                informed(law, known),
                reference,
                MEASURED if seed % 2 else Limits(),
                duration=duration,
                bend=bend,
                seed=seed,
                initial_motor=bench.resting_motor(0.0, float(bend(np.zeros(1))[0])),
            )
            names = " ".join(fault.name for fault in of(out.faults))
            yield [law.name, sheath, motion, seed, duration, out.differs + out.bad, names]


def figures(share: float) -> Found:
    """Runs that were stopped or changed."""
    hours = share * HOURS
    kept = Kept(f"soak_supervisor_{hours:g}")
    rows = kept.filled(runs(hours, len(kept.rows())), round(3600.0 * hours / 41.5))
    tripped = [row for row in rows if row[5] or row[6]]
    for row in tripped[:20]:
        print("tripped:", *row)
    gone = sum(row[4] for row in rows) / 3600.0
    what = f"runs with a trip or a changed target, of {len(rows)} in {gone:.1f} h"
    return Found([Figure(what, str(len(tripped)), "0", not tripped)], "On the bench, sheath still and moved.")
