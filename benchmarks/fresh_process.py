"""From nothing to a simulated minute in a fresh process: with an empty cache of compiled code, and with a full one."""

import os
import subprocess
import sys
import tempfile

from measure import Row, Timing

_MINUTE = """
from bowden.control import LAWS
from bowden.control.reference import PeriodicMinimumJerk
from bowden.sim.closed_loop import simulate
from bowden.sim.plant import Bench
simulate(Bench(), LAWS["adaptive"], PeriodicMinimumJerk(0.0, 1.2, 10.0), duration=60.0)
"""


def rows(warm_rounds: int = 5) -> list[Row]:
    """One row for each kind of start."""
    with tempfile.TemporaryDirectory() as folder:
        cold = Timing((_process(folder),))
        warm = Timing(tuple(_process(folder) for _ in range(warm_rounds)))
    return [
        Row("a fresh process to a simulated minute, empty cache", cold, "", "", "", "≤ 10 s"),
        Row("the same, cache filled", warm, "", "", "", "≤ 1.5 s"),
    ]


def _process(cache: str) -> float:
    before = os.times()
    subprocess.run([sys.executable, "-c", _MINUTE], check=True, env=os.environ | {"BOWDEN_CACHE_DIR": cache})
    after = os.times()
    return after.children_user + after.children_system - before.children_user - before.children_system
