"""Who computes the chunks of a campaign: this process, others on this machine, or a cluster."""

import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import connection
from typing import TYPE_CHECKING

from bowden.core.errors import ParameterError
from bowden.design.processes import starting
from bowden.study.pack import compute, packed, rows, table
from bowden.study.study import Study

if TYPE_CHECKING:
    import pyarrow as pa

Work = Sequence[tuple[int, range]]
"""Chunks that are missing: their number, and the numbers of their runs."""
Done = Iterator[tuple[int, "pa.Table"]]
"""Chunks with their rows, in the order in which they are ready."""
_PATIENCE = 3
"""How often processes may die without anything having been finished in between."""


def in_this_process(study: Study, work: Work) -> Done:
    """One chunk after the other."""
    for chunk, numbers in work:
        yield chunk, rows(study, numbers)


def in_processes(study: Study, work: Work, count: int) -> Done:
    """Over processes of this machine; one that dies costs what it was about, and another takes its place.

    Raises:
        ParameterError: a run that cannot be, or processes that die again and again.
    """
    pack, left, deaths = packed(study), dict(work), 0
    while left:
        try:
            for chunk, found in _pooled(pack, list(left.items()), count):
                del left[chunk]
                deaths = 0
                yield chunk, found
        except BrokenProcessPool as error:
            deaths += 1
            if deaths >= _PATIENCE:
                raise ParameterError(
                    f"the processes that compute died {deaths} times in a row",
                    do="look for what kills them (memory?), or compute with --workers 1",
                ) from error


def _pooled(pack: bytes, work: Work, count: int) -> Done:
    context = multiprocessing.get_context("spawn")
    others = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(count, context, initializer=_prepare)
    try:
        waiting = iter(work)
        running: dict[Future[bytes], int] = {}
        _fill(pool, pack, waiting, running, 2 * count)
        while running:
            done, _ = wait(running, return_when=FIRST_COMPLETED)
            for future in done:
                chunk = running.pop(future)
                yield chunk, table(future.result())
            _fill(pool, pack, waiting, running, 2 * count)
    except BaseException:  # nobody waits for what is being computed: an interruption, or what is done cannot be kept
        for process in set(multiprocessing.active_children()) - others:
            process.terminate()
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _fill(
    pool: ProcessPoolExecutor,
    pack: bytes,
    waiting: Iterator[tuple[int, range]],
    running: dict[Future[bytes], int],
    most: int,
) -> None:
    while len(running) < most and (one := next(waiting, None)) is not None:
        chunk, numbers = one
        with starting():  # this may start a process
            running[pool.submit(compute, pack, numbers.start, numbers.stop)] = chunk


def _prepare() -> None:
    """In a new process: leave an interruption to the parent, and end when it ends, however that comes about."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_with, args=(parent.sentinel,), daemon=True).start()


def _end_with(sentinel: int) -> None:
    connection.wait([sentinel])
    os._exit(1)
