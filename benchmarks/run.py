"""All benchmarks in one run: ``make bench``.

Prints a table of ratios and writes it to ``benchmarks/RESULTS.md``. Ratios are what to read: the times are this
machine's. With the names of parts (``c control genetic start``) only these are run, and nothing is written.
"""

import argparse
import time
from collections.abc import Callable
from pathlib import Path

from bowden.core.files import whole_file
from measure import Row, machine, table

Part = Callable[[], tuple[list[Row], list[str]]]


def c() -> tuple[list[Row], list[str]]:
    """The closed loop against C."""
    import hand_c

    return hand_c.rows()


def control() -> tuple[list[Row], list[str]]:
    """The closed loop against python-control."""
    import peer_control

    return peer_control.rows()


def genetic() -> tuple[list[Row], list[str]]:
    """Identification against a genetic algorithm."""
    import peer_genetic

    return peer_genetic.rows()


def start() -> tuple[list[Row], list[str]]:
    """The first run of a fresh process."""
    import fresh_process

    return fresh_process.rows(), []


PARTS: dict[str, Part] = {part.__name__: part for part in (c, control, genetic, start)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", nargs="*", choices=[[], *PARTS], help="run only these parts")
    chosen = parser.parse_args().parts or list(PARTS)
    begin, rows, notes = time.perf_counter(), [], []
    for name in chosen:
        print(f"{name} …", flush=True)
        found, said = PARTS[name]()
        rows += found
        notes += said
    about = "\n".join(f"- {line}" for line in machine())
    explained = "\n".join(f"- {note}" for note in notes)
    how = (
        "Times are seconds on the processor, medians (smallest … largest) of rounds in which the tasks take turns; a "
        "ratio is the median of the rounds' own ratios (middle half)."
    )
    report = f"{about}\n\n{table(rows)}\n\n{how}\n\n{explained}\n"
    print(f"\n{report}\n{time.perf_counter() - begin:.0f} s in all")
    if chosen == list(PARTS):
        text = f"# Benchmarks\n\nWritten by `make bench`; the numbers are one run's.\n\n{report}"
        with whole_file(Path(__file__).parent / "RESULTS.md") as part:
            part.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
