"""Two processes that share a search's work, where the computer has two cores."""

import contextlib
import multiprocessing
import os
import signal
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import resource_tracker
from types import ModuleType
from typing import Any

from bowden.control.law_file import LawFile
from bowden.plants.plant_file import PlantFile

Mapper = Callable[[Callable[..., Any], Iterable[Any]], Iterable[Any]]


@contextlib.contextmanager
def two_workers(law: str | LawFile, plant: PlantFile | None = None) -> Iterator[Mapper]:
    """A `map` over two processes, or the plain one where there is a single core, or no processes can be had.

    Args:
        law: a law's name, or the user's own, which the processes must know by what its file held.
        plant: the user's own, which the processes must know likewise.
    """
    if (os.cpu_count() or 1) < 2:
        yield map
        return
    try:
        context = multiprocessing.get_context("spawn")  # a fork would copy the compiler's threads and locks half-way
        pool = ProcessPoolExecutor(2, context, initializer=_prepare, initargs=(law, plant))
        with starting():
            for _ in range(2):
                pool.submit(os.getpid)  # starts a process
    except (OSError, ImportError, NotImplementedError):  # no semaphores or no pipes here
        yield map
        return
    try:
        yield pool.map
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


@contextlib.contextmanager
def starting() -> Iterator[None]:
    """Processes that are started meanwhile have an empty main module, and get no interruption.

    A new process runs its parent's main module again, and that script may not be guarded. What it imports takes a
    second, in which Ctrl-C, which reaches it too, would print its traceback: it inherits that the signal is blocked.
    One that comes meanwhile reaches the parent afterwards.
    """
    masked = hasattr(signal, "pthread_sigmask")  # not on Windows
    if masked:
        resource_tracker.ensure_running()  # this unblocks the signal
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    main = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = main
        if masked:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _prepare(law: str | LawFile, plant: PlantFile | None) -> None:
    """In a new process: leave an interruption to the parent, and load a user's law and plant, to be handed over."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if isinstance(law, LawFile):
        law.load()
    if plant is not None:
        plant.load()
