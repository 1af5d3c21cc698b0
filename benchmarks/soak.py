"""The long tests, each of which can be interrupted and goes on where it was left: ``make soak``.

    python benchmarks/soak.py [stops kills faults releases hours streams hostile fuzzing] [--share 0.1]

`stops`: 200 bursts of keys in live runs and 10 000 interleavings of requests, each with a stop. `kills`: any process of
a run killed or stopped, 1000 times. `faults`: the whole matrix of faults, every two of them, and ten million inputs of
every kind. `releases`: a thousand of them on random rigs. `hours`: a day without a fault. `streams`: EMG over LSL and
the Trigno protocol for five minutes each. `hostile`: every attack on such a stream 20 times. `fuzzing`: a million
inputs that nobody would write, for everything that reads what others wrote. What is done is kept in ``out/bench`` until
the package changes. Each part that was run whole writes its section of ``benchmarks/RESULTS.md``; a `--share` below 1
is a try, and writes nothing. Exit code 1 if a target is missed.
"""

import argparse
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path

import results
from measure import Figure, table

sys.path.append(str(Path(__file__).parents[1] / "tests"))  # where the fault matrix is

Found = tuple[list[Figure], str]


def stops(given: argparse.Namespace) -> Found:
    return import_module("key_bursts").figures(given.share)


def kills(given: argparse.Namespace) -> Found:
    return import_module("process_kills").figures(given.share)


def faults(given: argparse.Namespace) -> Found:
    return import_module("fault_matrix").figures(given.share)


def releases(given: argparse.Namespace) -> Found:
    return import_module("releases").figures(given.share)


def hours(given: argparse.Namespace) -> Found:
    return import_module("soak_supervisor").figures(given.share)


def streams(given: argparse.Namespace) -> Found:
    module = import_module("emg_streams")
    found: Found = module.figures(5.0 * given.share, list(module.KINDS))
    return found


def hostile(given: argparse.Namespace) -> Found:
    return import_module("hostile_streams").figures(given.share)


def fuzzing(given: argparse.Namespace) -> Found:
    return import_module("fuzzing").figures(given.share)


PARTS: dict[str, tuple[str, Callable[[argparse.Namespace], Found]]] = {
    "stops": ("Stops among other requests", stops),
    "kills": ("Loss of a process", kills),
    "faults": ("Faults", faults),
    "releases": ("A thousand releases", releases),
    "hours": ("Hours without a fault", hours),
    "streams": ("EMG streams", streams),
    "hostile": ("Hostile streams of EMG", hostile),
    "fuzzing": ("Inputs that nobody would write", fuzzing),
}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="*", choices=[[], *PARTS], help="run only these")
    parser.add_argument("--share", type=float, default=1.0, help="of each part, for a try")
    given = parser.parse_args()
    missed = []
    for name in given.parts or PARTS:
        title, part = PARTS[name]
        found, more = part(given)
        text = f"{table(found)}\n\n{more}"
        print(f"\n## {title}\n\n{text}", flush=True)
        if given.share == 1.0:
            results.write(title, text)
        missed += [figure for figure in found if not figure.held]
    for figure in missed:
        print(f"missed: {figure.what}: {figure.found}, not {figure.target}")
    return 1 if missed else 0


if __name__ == "__main__":
    raise SystemExit(main())
