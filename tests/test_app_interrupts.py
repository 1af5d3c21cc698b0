"""Ctrl-C ends a command even where Python can only ignore the exception, as in a callback from LLVM."""

import ctypes
import multiprocessing
import signal
import sys
import time

import pytest

from bowden.app import interrupts, main
from bowden.design.processes import starting
from support.command import Command

pytestmark = pytest.mark.usefixtures("undrawn")

callback = ctypes.CFUNCTYPE(None)


def ignored() -> None:
    """An interruption inside a callback from C, which cannot be raised there."""
    callback(lambda: signal.raise_signal(signal.SIGINT))()


def interrupted(monkeypatch: pytest.MonkeyPatch, seconds: float) -> float:
    """How long a command went on that loses an interruption and would then go on for so long."""

    def command(*arguments: object, **options: object) -> int:
        ignored()
        time.sleep(seconds)
        return 0

    monkeypatch.setattr(main, "application", lambda first_word: command)
    hook, begin = sys.unraisablehook, time.monotonic()
    assert main.run([]) == 130
    assert sys.unraisablehook is hook
    return time.monotonic() - begin


def test_one_that_was_ignored_comes_again(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    assert interrupted(monkeypatch, seconds=60.0) < 30.0
    assert capsys.readouterr().err == "bowden: interrupted\n"


def test_one_that_was_ignored_at_the_very_end_is_not_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    interrupted(monkeypatch, seconds=0.0)


def test_none_is_lost_where_the_next_comes_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """As on a busy computer: the next one came while the hook that had asked for it was still at work."""
    monkeypatch.setattr(interrupts, "AGAIN", 0.0)
    for _ in range(50):
        interrupted(monkeypatch, seconds=0.0)
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_what_fails_by_one_that_was_ignored_is_an_interruption(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], command: Command
) -> None:
    def command(*arguments: object, **options: object) -> int:
        ignored()
        raise RuntimeError("no compiled object yet")

    monkeypatch.setattr(main, "application", lambda first_word: command)
    assert main.run([]) == 130
    assert capsys.readouterr().err == "bowden: interrupted\n"


def test_one_that_comes_while_llvm_works_waits_until_it_is_done(monkeypatch: pytest.MonkeyPatch) -> None:
    done: list[str] = []
    names = {"signal": signal, "time": time, "done": done}
    code = "signal.raise_signal(signal.SIGINT)\ntime.sleep(0.2)\ndone.append('compiled')"

    def command(*arguments: object, **options: object) -> int:
        exec(compile(code, "site-packages/llvmlite/binding/executionengine.py", "exec"), names)
        time.sleep(60.0)
        return 0

    monkeypatch.setattr(main, "application", lambda first_word: command)
    assert main.run([]) == 130
    assert done == ["compiled"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_other_things_that_are_ignored_are_told_as_ever(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[object] = []
    monkeypatch.setattr(sys, "unraisablehook", lambda lost: told.append(lost.exc_type))

    def command(*arguments: object, **options: object) -> int:
        callback(lambda: 1 // 0)()
        return 0

    monkeypatch.setattr(main, "application", lambda first_word: command)
    assert main.run([]) == 0
    assert told == [ZeroDivisionError]


@pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="signals cannot be blocked here")
def test_a_process_that_is_only_starting_hears_none() -> None:
    """The shell sends Ctrl-C to it as well, and its imports would print a traceback."""
    context = multiprocessing.get_context("spawn")
    with starting():
        first = context.Process(target=signal.raise_signal, args=(signal.SIGINT,))
        first.start()
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, [])
    first.join(60.0)
    assert first.exitcode == 0


def test_one_that_comes_while_processes_start_is_not_lost() -> None:
    with pytest.raises(KeyboardInterrupt), starting():
        signal.raise_signal(signal.SIGINT)  # to this thread: another one would take it at a time of its own
