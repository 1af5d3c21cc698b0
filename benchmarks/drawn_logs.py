"""Logs drawn from a number: their sets, and which of them a benchmark is asked for."""

import argparse

SETS = {"development": 1, "judging": 2}
"""Set → its key, which goes into every draw: no two sets share a seed."""


def asked(what: str | None) -> tuple[str, range]:
    """The set, and the numbers of its draws, that a command line asks for.

    Args:
        what: the program is for.
    """
    parser = argparse.ArgumentParser(description=what, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("set", choices=SETS)
    parser.add_argument("first", type=int)
    parser.add_argument("stop", type=int)
    given = parser.parse_args()
    return given.set, range(given.first, given.stop)
