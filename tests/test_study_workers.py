"""Processes that compute chunks: each gets one before any gets two, and several that die at once are one accident."""

import contextlib
import multiprocessing
import os
import threading
from collections.abc import Callable
from multiprocessing.connection import Connection, Pipe
from typing import Any

import pytest

from bowden.core.errors import ParameterError
from bowden.study import workers

WITHIN = 5.0
"""[s]"""
Life = Callable[[int, Connection], None]
"""What a process of a number does with its end of the pipe."""


def played(monkeypatch: pytest.MonkeyPatch, life: Life | None, stillborn: int = 0) -> None:
    """Threads in place of processes; the first `stillborn` of them are dead before they have begun."""
    begun: list[Any] = []

    class Process:
        def __init__(self, target: object, args: tuple[Connection, bytes], daemon: bool) -> None:
            self.theirs = args[0]

        def start(self) -> None:
            begun.append(self)
            if len(begun) > stillborn and life is not None:
                mine = Connection(os.dup(self.theirs.fileno()))
                threading.Thread(target=life, args=(len(begun), mine), daemon=True).start()

        def kill(self) -> None: ...

        def join(self) -> None: ...

    class Context:
        Pipe = staticmethod(Pipe)

    Context.Process = Process  # type: ignore[attr-defined]
    monkeypatch.setattr(multiprocessing, "get_context", lambda _: Context)
    monkeypatch.setattr(workers, "packed", lambda _: b"")
    monkeypatch.setattr(workers, "table", lambda said: said)


def computed(chunks: int, count: int) -> list[int]:
    work = [(chunk, range(chunk, chunk + 1)) for chunk in range(chunks)]
    return sorted(chunk for chunk, _ in workers.in_processes(None, work, count))  # type: ignore[arg-type]


def answers(pipe: Connection) -> None:
    try:
        while True:
            pipe.send(pipe.recv())
    except (EOFError, OSError):
        pipe.close()


@pytest.mark.parametrize("chunks", [4, 6, 9])
def test_no_process_has_two_chunks_while_another_has_none(chunks: int, monkeypatch: pytest.MonkeyPatch) -> None:
    all_at_work = threading.Barrier(4)

    def life(_: int, pipe: Connection) -> None:
        first = pipe.recv()
        with contextlib.suppress(threading.BrokenBarrierError):
            all_at_work.wait(WITHIN)
        pipe.send(first)
        answers(pipe)

    played(monkeypatch, life)
    assert computed(chunks, 4) == list(range(chunks))
    assert not all_at_work.broken


def test_several_that_die_at_one_moment_are_one_death(monkeypatch: pytest.MonkeyPatch) -> None:
    played(monkeypatch, lambda _, pipe: answers(pipe), stillborn=4)
    assert computed(8, 4) == list(range(8))


def test_processes_that_die_again_and_again_end_the_campaign(monkeypatch: pytest.MonkeyPatch) -> None:
    played(monkeypatch, None, stillborn=1000)
    with pytest.raises(ParameterError, match="died 3 times in a row"):
        computed(8, 4)


class Unpackable(Exception):
    def __init__(self, what: str, *, line: int) -> None:
        super().__init__(f"{what} at line {line}")
        self.lock = threading.Lock()  # which no way of packing takes


def test_an_error_that_cannot_be_packed_comes_as_its_text(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object) -> bytes:
        raise Unpackable("no number", line=3)

    monkeypatch.setattr(workers, "_prepare", lambda: None)
    monkeypatch.setattr(workers, "compute", fails)
    ours, theirs = Pipe()
    ours.send((0, 1))
    thread = threading.Thread(target=workers._work, args=(theirs, b""))
    thread.start()
    assert ours.poll(WITHIN)
    said = ours.recv()
    assert isinstance(said, ParameterError)
    assert "no number at line 3" in str(said)
    ours.close()
    thread.join(WITHIN)
    assert not thread.is_alive()


def test_a_process_whose_parent_is_gone_ends_without_a_word(monkeypatch: pytest.MonkeyPatch) -> None:
    ours, theirs = Pipe()

    def meanwhile(*_: object) -> bytes:
        ours.close()
        return b"rows"

    monkeypatch.setattr(workers, "_prepare", lambda: None)
    monkeypatch.setattr(workers, "compute", meanwhile)
    ours.send((0, 1))
    workers._work(theirs, b"")
