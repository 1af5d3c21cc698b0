"""Who computes the chunks of a campaign: this process, others on this machine, or a cluster."""

import multiprocessing
import os
import pickle
import signal
import threading
from collections import deque
from collections.abc import Generator, Sequence
from multiprocessing import connection
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING

from bowden.core.errors import ParameterError
from bowden.design.processes import starting
from bowden.study.pack import compute, packed, rows, table
from bowden.study.study import Study

if TYPE_CHECKING:
    import pyarrow as pa

Work = Sequence[tuple[int, range]]
"""Chunks that are missing: their number, and the numbers of their runs."""
Done = Generator[tuple[int, "pa.Table"], None, None]
"""Chunks with their rows, in the order in which they are ready."""
_PATIENCE = 3
"""How often processes may die, one or several at a time, without anything having been finished in between."""
_AHEAD = 2
"""Chunks that a process has at a time, so that none waits while its last result is kept."""


def in_this_process(study: Study, work: Work) -> Done:
    """One chunk after the other."""
    for chunk, numbers in work:
        yield chunk, rows(study, numbers)


def in_processes(study: Study, work: Work, count: int) -> Done:
    """Over processes of this machine; one that dies costs what it was about, and another takes its place.

    Each has a pipe of its own and shares no lock, so that one that is killed, or stands still, holds up nobody else.
    However this ends, they are killed: what they still compute, nobody waits for.

    Raises:
        ParameterError: a run that cannot be, or processes that die again and again.
    """
    pack, waiting, deaths = packed(study), deque(work), 0
    workers: list[_Worker] = []
    try:
        while waiting or any(one.given for one in workers):
            while waiting and len(workers) < count:
                workers.append(_Worker(pack))
                workers[-1].give(waiting, count)
            ready, died, done = connection.wait([one.pipe for one in workers]), False, False
            for one in [one for one in workers if one.pipe in ready]:
                try:
                    said = one.pipe.recv()
                except (EOFError, OSError):  # it has died
                    workers.remove(one)
                    one.end()
                    waiting.extendleft(reversed(one.given))
                    died = True
                    continue
                if isinstance(said, Exception):
                    raise said
                chunk, _ = one.given.popleft()
                one.give(waiting, count)
                done = True
                yield chunk, table(said)
            deaths = 0 if done else deaths + died
            if deaths >= _PATIENCE:
                raise ParameterError(
                    f"the processes that compute died {deaths} times in a row",
                    do="find what kills them (memory?), or compute with --workers 1",
                )
    finally:
        for one in workers:
            one.end()


class _Worker:
    """A process that computes chunks of a packed study in the order in which they are given."""

    def __init__(self, pack: bytes) -> None:
        self.given: deque[tuple[int, range]] = deque()
        """What it has been given, and not answered yet."""
        context = multiprocessing.get_context("spawn")
        self.pipe, theirs = context.Pipe()
        self._process = context.Process(target=_work, args=(theirs, pack), daemon=True)
        with starting():
            self._process.start()
        theirs.close()  # so that its death is the pipe's end

    def give(self, waiting: deque[tuple[int, range]], count: int) -> None:
        """Hand it a chunk, and others ahead as long as there is one for each of `count` processes."""
        while waiting and len(self.given) < (_AHEAD if len(waiting) >= count else 1):
            self.given.append(waiting.popleft())
            numbers = self.given[-1][1]
            try:
                self.pipe.send((numbers.start, numbers.stop))
            except OSError:  # it has died, which its pipe says as well
                return

    def end(self) -> None:
        """Kill it, which a process that stands still heeds as well."""
        self._process.kill()
        self._process.join()
        self.pipe.close()


def _work(pipe: Connection, pack: bytes) -> None:
    """In the new process: compute what is asked for, until nobody asks any more."""
    _prepare()
    while True:
        try:
            first, last = pipe.recv()
        except (EOFError, OSError):  # the parent is gone
            return
        said: object
        try:
            said = compute(pack, first, last)
        except Exception as error:  # so that the parent can say it
            said = _sendable(error)
        try:
            pipe.send(said)
        except OSError:
            return


def _sendable(error: Exception) -> Exception:
    """An error as another process can have it: itself, or its text where it cannot be packed and unpacked."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:  # whatever an error of a user's own class raises
        return ParameterError(f"{type(error).__name__}: {error}")
    return error


def _prepare() -> None:
    """In a new process: leave an interruption to the parent, and end when it ends, however that comes about."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_with, args=(parent.sentinel,), daemon=True).start()


def _end_with(sentinel: int) -> None:
    connection.wait([sentinel])
    os._exit(1)
