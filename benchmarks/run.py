"""Speed against others, the trust of `bowden check`, and the suit on random wearers: ``make bench``.

Prints tables and writes them to ``benchmarks/results``, of which `make docs` makes those of the pages. Of speed the
ratios count: the times are this machine's. With names of parts only these are run. `check_study` and `suit_wearers`
keep what is done in ``out/bench``; with ``--count`` they run on fewer rigs or wearers, and write nothing.
"""

import argparse
from importlib import import_module

from measure import Found, machine, report

PARTS = {
    "speed": ("Speed against C and python-control; ratios of processor times", ""),
    "check_study": ("Verdicts of `bowden check` against long simulations of 500 random rigs", "study"),
    "suit_wearers": ("The suit on 500 random wearers", "wearers"),
}
"""Name of the result file → its caption, and the module that makes it."""
PEERS = ("hand_c", "peer_control")
HOW = (
    "Medians (smallest … largest) of rounds in which the tasks take turns, processor time; a ratio is the median of "
    "the rounds' ratios (middle half)."
)


def speed() -> Found:
    """All peers, one after another."""
    found = [import_module(peer).rows() for peer in PEERS]
    return Found([row for rows, _ in found for row in rows], " ".join((machine(), HOW, *(how for _, how in found))))


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="*", choices=[[], *PARTS], help="run only these parts")
    parser.add_argument("--count", type=int, help="of the rigs or wearers, for a try")
    given = parser.parse_args()
    for name in given.parts or PARTS:
        what, module = PARTS[name]
        found = import_module(module).figures(given.count) if module else speed()
        report(name, what, f"python benchmarks/run.py {name}", found, write=given.count is None)


if __name__ == "__main__":
    main()
