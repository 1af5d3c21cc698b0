"""All benchmarks in one run: ``make bench``.

Prints tables and writes each to its section of ``benchmarks/RESULTS.md``. Of speed it is the ratios that count: the
times are this machine's. With the names of parts (functions of this file) only these are run, and only sections that
were run whole are written anew. `study` and `plants` take minutes and keep what is done in ``out/bench``, so that they
can be interrupted; with ``--count`` they run on fewer rigs (of another seed), plants or wearers, and write nothing.
"""

import argparse
import time
from collections.abc import Callable

import results
from measure import Figure, Row, machine, table

Found = tuple[list[Row], list[str]] | tuple[list[Figure], list[str]]
HOW = (
    "Times are seconds on the processor, medians (smallest … largest) of rounds in which the tasks take turns; a ratio "
    "is the median of the rounds' own ratios (middle half)."
)


def c(count: int | None) -> Found:
    """The closed loop against C."""
    import hand_c

    return hand_c.rows()


def control(count: int | None) -> Found:
    """The closed loop against python-control."""
    import peer_control

    return peer_control.rows()


def scipy(count: int | None) -> Found:
    """The closed loop against SciPy's solve_ivp."""
    import peer_scipy

    return peer_scipy.rows()


def jax(count: int | None) -> Found:
    """The closed loop against JAX and diffrax."""
    import peer_jax

    return peer_jax.rows()


def search(count: int | None) -> Found:
    """Identification against a genetic algorithm and differential evolution."""
    import peer_search

    return peer_search.rows()


def study(count: int | None) -> Found:
    """The verdicts of `bowden check` against long simulations."""
    import check_study

    return check_study.figures() if count is None else check_study.figures(count, check_study.SEED_OF_TRIES)


def plants(count: int | None) -> Found:
    """Our law on random plants."""
    import random_plants

    return random_plants.figures(count or random_plants.COUNT)


def wearers(count: int | None) -> Found:
    """The compensated suit on random wearers."""
    import suit_wearers

    return suit_wearers.figures(count or suit_wearers.COUNT)


SECTIONS: dict[str, tuple[Callable[[int | None], Found], ...]] = {
    "Speed": (c, control, scipy, jax, search),
    "How far `bowden check` can be trusted": (study,),
    "Our law on random plants": (plants,),
    "The suit on random wearers": (wearers,),
}


def main() -> None:
    parts = [part.__name__ for section in SECTIONS.values() for part in section]
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", nargs="*", choices=[[], *parts], help="run only these parts")
    parser.add_argument("--count", type=int, help="of the rigs, plants or wearers of the last three, for a try")
    arguments = parser.parse_args()
    begin = time.perf_counter()
    for title, section in SECTIONS.items():
        chosen = [part for part in section if not arguments.parts or part.__name__ in arguments.parts]
        if chosen:
            text = _section(chosen, arguments.count)
            print(f"\n## {title}\n\n{text}\n{time.perf_counter() - begin:.0f} s in all", flush=True)
            if len(chosen) == len(section) and arguments.count is None:
                results.write(title, text)


def _section(parts: list[Callable[[int | None], Found]], count: int | None) -> str:
    rows: list[Row] = []
    figures: list[Figure] = []
    notes = []
    for part in parts:
        print(f"{part.__name__} …", flush=True)
        found, said = part(count)
        rows += [row for row in found if isinstance(row, Row)]
        figures += [row for row in found if isinstance(row, Figure)]
        notes += said
    if rows:
        notes = [*machine(), HOW, *notes]
    explained = "\n".join(f"- {note}" for note in notes)
    return f"{table(rows or figures)}\n\n{explained}\n"


if __name__ == "__main__":
    main()
