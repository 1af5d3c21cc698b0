"""The long tests, each of which can be interrupted and goes on where it was left: ``make soak``.

    python benchmarks/soak.py [stops kills faults releases hours fuzzing] [--share 0.1]

What is done is kept in ``out/bench`` until the package changes. Each part that was run whole writes its results to
``benchmarks/results``; a `--share` below 1 is a try, and writes nothing. Exit code 1 if a target is missed.
"""

import argparse
import sys
from importlib import import_module
from pathlib import Path

from measure import Figure, report

sys.path.append(str(Path(__file__).parents[1] / "tests"))  # where the fault matrix is

PARTS = {
    "stops": ("key_bursts", "Stops among other requests: 200 bursts of keys, 10 000 interleavings in memory"),
    "kills": ("process_kills", "Any process of a run killed or stopped, 1000 times"),
    "faults": ("fault_matrix", "The fault matrix: single faults, pairs, and ten million inputs of every kind"),
    "releases": ("releases", "A thousand releases on random rigs"),
    "hours": ("soak_supervisor", "24 hours without a fault under the supervisor"),
    "fuzzing": ("fuzzing", "One million fuzzed files, frames and streams"),
}
"""Part → its module, after which its result file is named, and the caption."""


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="*", choices=[[], *PARTS], help="run only these")
    parser.add_argument("--share", type=float, default=1.0, help="of each part, for a try")
    given = parser.parse_args()
    missed: list[Figure] = []
    for name in given.parts or PARTS:
        module, what = PARTS[name]
        found = import_module(module).figures(given.share)
        report(module, what, f"make soak PARTS={name}", found, write=given.share == 1.0)
        missed += [figure for figure in found.figures if not figure.held]
    for figure in missed:
        print(f"missed: {figure.what}: {figure.found}, not {figure.target}")
    return 1 if missed else 0


if __name__ == "__main__":
    raise SystemExit(main())
