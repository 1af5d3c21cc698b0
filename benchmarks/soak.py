"""The long tests, each of which can be interrupted and goes on where it was left: ``make soak``.

    python benchmarks/soak.py [live steady stops kills recorder faults releases hours streams hostile fuzzing page
        drawing console] [--minutes 10]

`live`: the loop against the twin for so many minutes a law, beside a loop that only sleeps and cyclictest. `steady`:
one run for as long, whose processes may not grow. `stops`: 200 bursts of keys in live runs and 10 000 interleavings of
requests, each with a stop. `kills`: any process of a run killed or stopped, 1000 times. `recorder`: it is killed 500
times, and a log cut at every byte. `faults`: the whole matrix of faults, every two of them, and ten million inputs of
every kind. `hours`: a day without a fault. `streams`: EMG over LSL and the Trigno protocol for five minutes each.
`hostile`: every attack on such a stream 20 times. `fuzzing`: a million inputs that nobody would write, for everything
that reads what others wrote. `page`: the console's tab, browser, network or process killed or halted 200 times.
`drawing`: its curves in Chromium for so many minutes, beside the loop. `console`: its memory for so many minutes with
three viewers. What is done of the others is kept in ``out/bench`` until the package changes. Each part that was run
whole writes its section of ``benchmarks/RESULTS.md``; a `--share` below 1 is a try, and writes nothing. Exit code 1 if
a target is missed.
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


def live(given: argparse.Namespace) -> Found:
    return import_module("live_loop").figures(given.minutes)


def steady(given: argparse.Namespace) -> Found:
    return import_module("steady_run").figures(given.minutes)


def stops(given: argparse.Namespace) -> Found:
    return import_module("key_bursts").figures(given.share)


def kills(given: argparse.Namespace) -> Found:
    return import_module("process_kills").figures(given.share)


def recorder(given: argparse.Namespace) -> Found:
    return import_module("recorder_kills").figures(given.share)


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


def page(given: argparse.Namespace) -> Found:
    return import_module("console_kills").figures(given.share)


def drawing(given: argparse.Namespace) -> Found:
    return import_module("console_cost").figures(given.minutes)


def console(given: argparse.Namespace) -> Found:
    return import_module("console_cost").memory(given.minutes)


PARTS: dict[str, tuple[str, Callable[[argparse.Namespace], Found]]] = {
    "live": ("The live loop", live),
    "steady": ("A long run", steady),
    "stops": ("Stops among other requests", stops),
    "kills": ("Loss of a process", kills),
    "recorder": ("Loss of the recorder", recorder),
    "faults": ("Faults", faults),
    "releases": ("A thousand releases", releases),
    "hours": ("Hours without a fault", hours),
    "streams": ("EMG streams", streams),
    "hostile": ("Hostile streams of EMG", hostile),
    "fuzzing": ("Inputs that nobody would write", fuzzing),
    "page": ("Loss of the console's page", page),
    "drawing": ("Curves of the console", drawing),
    "console": ("A console for a long time", console),
}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="*", choices=[[], *PARTS], help="run only these")
    parser.add_argument("--minutes", type=float, default=10.0, help="of `live`, a law; of `steady` and the console")
    parser.add_argument("--share", type=float, default=1.0, help="of the other parts, for a try")
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
