"""Runs of the default bench with a law as it is: no rig tells it anything, and nothing checks it."""

from bowden.control.law import Law
from bowden.plants.presets.bench import bench
from bowden.plants.presets.paper import document, minimum_jerk, moved_sheath
from bowden.records.trace import Trace
from bowden.sim.run import simulate


def run(law: Law, *, moved: bool = False, duration: float | None = None) -> Trace:
    """One of Table 1's runs, for a minute where no `duration` [s] is given."""
    chosen = document()["chosen"]
    length = chosen["duration_s"] if duration is None else duration
    path = moved_sheath() if moved else None
    return simulate(bench(), law, minimum_jerk(), duration=length, bend=path, seed=chosen["seed"])
