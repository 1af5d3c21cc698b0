"""Hours of fault-free running under the supervisor: all laws in the scenarios of league.py on the default bench.

Every cycle's verdict must be the law's requested target, with power on.
"""

import itertools
from collections.abc import Iterator
from typing import Any

import numpy as np

from bowden.control import LAWS
from bowden.control.knowledge import informed
from bowden.plants.knowledge_of import knowledge_of
from bowden.plants.presets.bench import default_bench
from bowden.safety.faults import of
from bowden.safety.limits import Limits
from kept import Kept
from league import plants, scenarios
from measure import Figure, Found
from support.fault_matrix import MEASURED
from support.supervised import supervised

HOURS = 24.0


def runs(hours: float, done: int) -> Iterator[list[Any]]:
    """[law, plant, scenario, seed, seconds, cycles in which the verdict was not the requested target, faults]."""
    bench = default_bench()
    found, played, gone = plants(bench)[:2], 0, 0.0
    for seed in itertools.count(1):
        for scenario, plant, law in itertools.product(scenarios(), found, LAWS.values()):
            if gone >= 3600.0 * hours:
                return
            played, gone = played + 1, gone + scenario.duration
            if played <= done:
                continue
            out, _ = supervised(
                bench,
                informed(law, knowledge_of(plant.plant)),
                scenario.reference(plant.stroke),
                MEASURED if seed % 2 else Limits(),
                duration=scenario.duration,
                bend=plant.bend,
                seed=seed,
                initial_motor=plant.plant.resting_motor(0.0, float(plant.bend(np.zeros(1))[0])),
            )
            names = " ".join(fault.name for fault in of(out.faults))
            yield [law.name, plant.name, scenario.name, seed, scenario.duration, out.differs + out.bad, names]


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
