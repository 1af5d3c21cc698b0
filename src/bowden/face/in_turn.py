"""Laws, run one after the other."""

from collections.abc import Callable, Sequence
from typing import TypeVar

from bowden.control import Law, user_law
from bowden.face import given
from bowden.face.progress import Progress

Run = TypeVar("Run")


def in_turn(laws: Sequence[Law], run: Callable[[int], Run], progress: Progress) -> tuple[dict[str, Run], bool]:
    """Run laws one after the other, until an interruption.

    An interruption before the first is done passes through.

    Args:
        laws: in their order.
        run: what comes of the law at that place.
        progress: called with what is being done and the share of the work that is behind.

    Returns:
        What came of each, by its name (laws of one name get a number), and whether an interruption ended it.

    Raises:
        ParameterError: a law of the user's own failed; with its file and line.
    """
    found = dict[str, Run]()
    names = given.numbered([law.name for law in laws])
    for i, (law, name) in enumerate(zip(laws, names, strict=True)):
        progress(f"simulating {name}", 0.1 + 0.7 * i / len(laws))
        try:
            with user_law.explained(law):
                found[name] = run(i)
        except KeyboardInterrupt:
            if not found:
                raise
            return found, True
    return found, False
