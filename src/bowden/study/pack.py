"""A study as plain bytes, for processes that may run on another machine, and what they do with it."""

import pickle
from contextlib import ExitStack
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING

from bowden.control import user_law
from bowden.core.errors import ParameterError
from bowden.study.rows import table_of
from bowden.study.study import Study, software

if TYPE_CHECKING:
    import pyarrow as pa


def packed(study: Study) -> bytes:
    """The study with the models, recordings and laws that it needs.

    Raises:
        ParameterError: a plant or a reference that exists only in this process.
    """
    study.rig.document()  # refuses what other processes cannot have
    return pickle.dumps((software(), pickle.dumps(study)))


@lru_cache(2)
def unpacked(pack: bytes) -> Study:
    """The study again.

    Raises:
        ParameterError: it comes from another version of the package.
    """
    theirs, study = pickle.loads(pack)
    if theirs != software():
        raise ParameterError(
            f"a worker has bowden {software()}, and the command {theirs}",
            expected="the same software on both",
            do="install it there",
        )
    found: Study = pickle.loads(study)
    return found


def compute(pack: bytes, first: int, last: int) -> "pa.Table":
    """The rows of the runs `first` to `last` − 1 of a packed study.

    Raises:
        ParameterError: another version of the package, or a run whose values do not fit one another.
    """
    return rows(unpacked(pack), range(first, last))


def rows(study: Study, numbers: range) -> "pa.Table":
    """`table_of`, with a user's mistakes in one line each.

    Raises:
        ParameterError: see there, or a law that cannot be compiled.
    """
    with ExitStack() as stack:
        for law in study.laws:
            stack.enter_context(user_law.explained(law))
        return table_of(study, numbers)


def warm(study: Study) -> None:
    """Compile what the study needs, so that processes on this machine find it: its first run, for a few cycles.

    Raises:
        ParameterError: a law that cannot be compiled.
    """
    cycle = study.run(0)[0].sample_time  # [s]; it may be drawn
    rows(replace(study, rig=study.rig.replace(duration=8.0 * cycle)), range(1))
