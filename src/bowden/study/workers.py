"""Who computes the chunks of a campaign: this process, or others, which get the study as bytes."""

import multiprocessing
import os
import pickle
import signal
import threading
from collections.abc import Generator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack
from dataclasses import replace
from functools import lru_cache
from multiprocessing import connection
from typing import TYPE_CHECKING

from bowden.control import user_law
from bowden.core.errors import ParameterError
from bowden.design.processes import starting
from bowden.study.rows import table_of
from bowden.study.study import Study, software

if TYPE_CHECKING:
    import pyarrow as pa

Work = Sequence[tuple[int, range]]
"""Chunks that are missing: their number, and the numbers of their runs."""
Done = Generator[tuple[int, "pa.Table"], None, None]
"""Chunks with their rows, in the order in which they are ready."""
_PATIENCE = 3
"""How often processes may die, one or several at a time, without anything having been finished in between."""


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


def in_this_process(study: Study, work: Work) -> Done:
    """One chunk after the other."""
    for chunk, numbers in work:
        yield chunk, rows(study, numbers)


def in_processes(study: Study, work: Work, count: int) -> Done:
    """Over processes of this machine; where one dies, all begin anew with what is not finished.

    However this ends, they are killed: what they still compute, nobody waits for.

    Raises:
        ParameterError: a run that cannot be, or processes that die again and again.
    """
    pack, missing, deaths = packed(study), dict(work), 0
    while missing:
        before = set(multiprocessing.active_children())
        pool = ProcessPoolExecutor(count, multiprocessing.get_context("spawn"), initializer=_prepare)
        try:
            with starting():
                tasks = {pool.submit(_computed, pack, runs.start, runs.stop): chunk for chunk, runs in missing.items()}
            for task in as_completed(tasks):
                found, chunk = task.result(), tasks.pop(task)
                del missing[chunk]
                deaths = 0
                yield chunk, found
        except BrokenProcessPool as error:
            deaths += 1
            if deaths >= _PATIENCE:
                raise ParameterError(
                    f"the processes that compute died {deaths} times in a row",
                    do="find what kills them (memory?), or compute with --workers 1",
                ) from error
        finally:
            for process in set(multiprocessing.active_children()) - before:
                process.kill()  # which a process that stands still heeds as well
            pool.shutdown(cancel_futures=True)


def _computed(pack: bytes, first: int, last: int) -> "pa.Table":
    """`compute`, whose error another process can have: itself, or its text where it cannot be packed and unpacked."""
    try:
        return compute(pack, first, last)
    except Exception as error:
        try:
            pickle.loads(pickle.dumps(error))
        except Exception:  # whatever an error of a user's own class raises
            raise ParameterError(f"{type(error).__name__}: {error}") from None
        raise


def _prepare() -> None:
    """In a new process: leave an interruption to the parent, and end when it ends, however that comes about."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_with, args=(parent.sentinel,), daemon=True).start()


def _end_with(sentinel: int) -> None:
    connection.wait([sentinel])
    os._exit(1)
