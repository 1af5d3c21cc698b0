"""Figures of the package, on this machine or on random draws: ``make bench``, ``make soak``.

    python benchmarks/run.py [PART ...] [--share 0.1]

`bench` is speed against others (of which the ratios count: the times are this machine's), the trust of `bowden check`
and the suit on random wearers; `soak` takes hours. Tables are printed and written to ``benchmarks/results``. Each part
can be interrupted and goes on where it was left: what is done is kept in ``out/bench`` until the package changes. A
`--share` below 1 is a try, and writes nothing. Exit code 1 if a target of `soak` is missed.
"""

import argparse
import sys
from importlib import import_module
from pathlib import Path

from measure import Figure, Found, machine, report

sys.path.append(str(Path(__file__).parents[1] / "tests"))  # where the fault matrix is

BENCH = {
    "speed": ("", "speed", "Speed against C and python-control; ratios of processor times"),
    "check_study": ("study", "check_study", "Verdicts of `bowden check` against long simulations of 500 random rigs"),
    "suit_wearers": ("wearers", "suit_wearers", "The suit on 500 random wearers"),
}
"""Part → its module (none: `speed`), its result file, and the caption."""
SOAK = {
    "kills": ("process_kills", "Any process of a run killed or stopped, 1000 times"),
    "faults": ("fault_matrix", "The fault matrix: single faults, pairs, and ten million inputs of every kind"),
    "releases": ("releases", "A thousand releases on random rigs"),
    "hours": ("soak_supervisor", "24 hours without a fault under the supervisor"),
    "joint_angle": ("joint_angle", "An estimate of the joint's angle in place of an encoder"),
    "fuzzing": ("fuzzing", "One million fuzzed files, frames and streams"),
}
"""Part → its module, after which its result file is named, and the caption."""
PARTS = BENCH | {name: (module, module, what) for name, (module, what) in SOAK.items()}
GROUPS = {"bench": list(BENCH), "soak": list(SOAK)}
HOW = (
    "Medians (smallest … largest) of rounds in which the tasks take turns, processor time; a ratio is the median of "
    "the rounds' ratios (middle half)."
)


def speed() -> Found:
    """All peers, one after another."""
    found = [import_module(peer).rows() for peer in ("hand_c", "peer_control")]
    return Found([row for rows, _ in found for row in rows], " ".join((machine(), HOW, *(how for _, how in found))))


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="+", choices=[*GROUPS, *PARTS], metavar="PART", help=", ".join(GROUPS | PARTS))
    parser.add_argument("--share", type=float, default=1.0, help="of each part, for a try")
    given = parser.parse_args()
    missed: list[Figure] = []
    for name in (one for part in given.parts for one in GROUPS.get(part, [part])):
        module, file, what = PARTS[name]
        found = import_module(module).figures(given.share) if module else speed()
        report(file, what, f"python benchmarks/run.py {name}", found, write=given.share == 1.0)
        missed += [one for one in found.figures if isinstance(one, Figure) and not one.held]
    for figure in missed:
        print(f"missed: {figure.what}: {figure.found}, not {figure.target}")
    return 1 if missed else 0


if __name__ == "__main__":
    raise SystemExit(main())
