"""The operator at the terminal: keys in, the run on the screen, and an orderly end whatever ends it."""

import contextlib
import os
import select
import signal
import sys
import termios
import threading
import tty
from collections.abc import Callable, Iterator, Mapping, Sequence
from types import FrameType
from typing import TYPE_CHECKING, Any, TypeVar

from bowden.core.errors import ParameterError, SafetyError, note
from bowden.live.session import STANDS_STILL, Session, automatic
from bowden.rig.families import family_of
from bowden.safety import faults
from bowden.safety.state import Mode, Request

if TYPE_CHECKING:
    from bowden.rig.rig import Rig

Handed = TypeVar("Handed")

_LOOK = 0.05
"""Between two looks at the run and at the keys [s]."""
_CLEARED = 1.0
"""At the end a terminal is given this long to take the picture away, and a disk to take the motor's warmth [s]."""
_REMEMBER = 100
"""Looks between two times that the motor's warmth is kept."""
_PRIORITY = 1
"""Of SCHED_RR, the lowest there is [–]."""
_MOST_KEYS = 4096
"""Looked at together; a terminal holds no more of them (N_TTY_BUF_SIZE of Linux)."""
_NOT_TAKEN = "the loop does not answer the stop: use the emergency stop"
_LETTERS = {Request.ARM: "a", Request.RUN: "r", Request.ACKNOWLEDGE: "k"}
_KEYS = {"a": Request.ARM, "r": Request.RUN, "s": Request.STOP, " ": Request.STOP, "k": Request.ACKNOWLEDGE}


def refuse_without_keys(auto: bool, json: bool) -> None:
    """Refuse a run that nobody could arm.

    Raises:
        ParameterError: no terminal, or --json, without --auto.
    """
    if not auto and (json or not sys.stdin.isatty()):
        why = "with --json there is no screen" if json else "there is no terminal for the keys"
        do = (
            "with --twin add --auto; on a rig, where people may be near, run it in a terminal: its keys arm and stop it"
        )
        raise ParameterError(why, do=do)


def refuse_over_ssh(rig: "Rig", *, attended: bool) -> None:
    """Refuse to move a real drive from a terminal that is reached by ssh, unless somebody stands at the rig.

    A connection that hangs looks here like a terminal at which nobody presses a key: its process goes on giving the
    sign of life, and the run goes on while no key arrives, until TCP gives up.

    Args:
        rig: with its drive.
        attended: its user says that somebody at the rig has the emergency stop.

    Raises:
        SafetyError: nobody says so.
    """
    played = all(family_of(motor.rig.drive).simulated(motor.rig.drive) for motor in rig.parts)
    if attended or "SSH_CONNECTION" not in os.environ or played:
        return
    raise SafetyError(
        "this terminal is reached by ssh, and a connection that hangs does not stop the run: no key arrives then",
        expected="a terminal at the rig",
        do="run it there; or, with somebody at the rig who has the emergency stop in hand, add --attended",
    )


class Ending:
    """The signals that ask for the end.

    While a run is being put together the first of them interrupts it; from `operate` on each asks the loop itself to
    end, whatever this process is at, and is noted, so that nothing cuts an orderly end short.
    """

    def __init__(self) -> None:
        self.asked = False
        """True if a request has come."""
        self._end: Callable[[], None] | None = None

    def ends(self, end: Callable[[], None]) -> None:
        """From here on none of them interrupts anything; each calls `end`."""
        self._end = end

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Take a signal."""
        first, self.asked = not self.asked, True
        if self._end is not None:
            self._end()
        elif first:
            raise KeyboardInterrupt


@contextlib.contextmanager
def ending_signals() -> Iterator[Ending]:
    """Take Ctrl-C, SIGTERM and a closed terminal as `Ending` says, and give them back afterwards."""
    ending = Ending()
    before = {number: signal.signal(number, ending) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    try:
        yield ending
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def operate(session: Session, ending: Ending, *, auto: bool, quiet: bool) -> None:
    """See a run through, until the operator or a signal ends it, or with `auto` the script or a fault does.

    The sign of life is given here, between two looks at the keys, and by nobody else: whoever cannot read a key gives
    none. Nothing here waits for the terminal to take what is shown, nor for a disk.

    Args:
        session: the run.
        ending: the signals that ask for its end.
        auto: let the script arm and run it.
        quiet: show nothing.

    Raises:
        SafetyError: with `auto`, the supervisor or the preflight did not let it run.
    """
    ending.ends(session.end)
    _tell_grants(session)
    with (
        _keys() as keys,
        _screen(session, auto, quiet) as show,
        keeping(session) as keep,
        prompt(),
        contextlib.closing(_Ends(session)),
    ):
        steps = automatic(session) if auto else None
        looks, answer, pressed_in = 0, "", -1.0
        while session.running and not ending.asked:
            session.beat()
            row = session.last()
            if session.still > STANDS_STILL:
                note(f"the loop has not answered for {session.still:.0f} s")
                return
            if row is not None:
                if row["mode"] != pressed_in:
                    answer = ""
                show(row, _NOT_TAKEN if session.stop_waits and session.still > _LOOK else answer)
                if steps is not None and next(steps, None) is None:
                    return
            pressed = keys()
            if "q" in pressed:
                return
            wanted = [_KEYS[key] for key in pressed if key in _KEYS]
            if wanted:
                request = Request.STOP if Request.STOP in wanted else wanted[-1]
                answer = ignored(request, session.judged(row))
                pressed_in = -1.0 if row is None else row["mode"]
                session.ask(request)
            looks += 1
            if looks % _REMEMBER == 0 and row is not None:
                keep(row)
            session.wait(0.5 * _LOOK if auto else 0.0)


def ignored(request: Request, rows: Sequence[Mapping[str, float]]) -> str:
    """Why a key does nothing in this state; empty where it does something, or nothing is known."""
    why = why_not(request, rows)
    return f"{_LETTERS[request]} does nothing now: {_NAMED.get(why, why)}" if why else ""


def why_not(request: Request, rows: Sequence[Mapping[str, float]]) -> str:
    """Why a request does nothing in this state, in words of no terminal; empty likewise.

    Args:
        request: of the operator.
        rows: `Session.judged`: it does something where it does so by one of them.
    """
    why = [_why_not(request, row) for row in rows]
    return why[0] if why and all(why) else ""


def _why_not(request: Request, row: Mapping[str, float]) -> str:
    if request == Request.STOP:
        return ""
    mode, shown = Mode(int(row["mode"])), faults.of(row["faults"])
    if request == Request.ACKNOWLEDGE:
        return "" if mode == Mode.LATCHED or shown else "there is no fault to acknowledge"
    if mode in (Mode.LATCHED, Mode.RELEASING):
        return _LATCHED if mode == Mode.LATCHED else "the cable is being let out"
    if request == Request.ARM:
        return "it is armed" if mode != Mode.STOPPED else ", ".join(fault.meaning for fault in shown)
    if mode == Mode.STOPPED:
        return _NOT_ARMED
    if mode == Mode.PREFLIGHT and row["preflight"] <= 0.0:
        return "the preflight has failed" if row["preflight"] else "the preflight has not ended"
    return ""


_LATCHED, _NOT_ARMED = "acknowledge the fault first", "it is not armed: arm it first"
_NAMED = {_LATCHED: "acknowledge the fault first, with k", _NOT_ARMED: "it is not armed: press a first"}
"""The same with the keys."""


@contextlib.contextmanager
def prompt() -> Iterator[None]:
    """Have this thread woken before what merely computes, where that is allowed: a busy computer is no operator who is
    gone. Loop, twin and reader of EMG come before it; what is started meanwhile has ordinary priority.
    """
    with contextlib.suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_RR | os.SCHED_RESET_ON_FORK, os.sched_param(_PRIORITY))
    try:
        yield
    finally:
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


class _Ends:
    """Tells the loop to end before the terminal is put in order, which may take as long as it likes."""

    def __init__(self, session: Session) -> None:
        self.close = session.end


def _tell_grants(session: Session) -> None:
    for grant in session.ready["grants"]:
        if not grant["granted"]:
            note(f"{grant['name']} {grant['detail']}; {grant['remedy']}")


@contextlib.contextmanager
def _keys() -> Iterator[Callable[[], str]]:
    """A function that waits a little for keys and gives all that were pressed; the empty text for none."""
    if not sys.stdin.isatty():
        yield lambda: ""
        return
    handle = sys.stdin.fileno()
    before = termios.tcgetattr(handle)

    def keys() -> str:
        ready, _, _ = select.select([handle], [], [], _LOOK)
        pressed = b""
        with contextlib.suppress(OSError):
            pressed = os.read(handle, _MOST_KEYS) if ready else b""
        return "q" if ready and not pressed else pressed.decode(errors="replace")  # the terminal is gone

    try:
        tty.setcbreak(handle)
        yield keys
    finally:
        with contextlib.suppress(termios.error):
            termios.tcsetattr(handle, termios.TCSANOW, before)


@contextlib.contextmanager
def _screen(session: Session, auto: bool, quiet: bool) -> Iterator[Callable[..., Any]]:
    """A function that has a row shown; on a terminal only.

    A terminal may take nothing for as long as it likes (Ctrl-S, a connection that hangs), and writing to it waits. So
    it is written to by a thread of its own, and what comes meanwhile is left out but for the newest.
    """
    if quiet or not sys.stdout.isatty():
        yield lambda row, answer: None
        return

    def draw(pairs: Iterator[tuple[dict[str, float], str]]) -> None:
        _draw(session, auto, pairs)

    with _apart(draw) as show:
        yield lambda row, answer: show((row, answer))


@contextlib.contextmanager
def keeping(session: Session) -> Iterator[Callable[[dict[str, float]], None]]:
    """A function that has a row's warmth of the motor kept, by a thread of its own: a disk may be slow."""

    def write(rows: Iterator[dict[str, float]]) -> None:
        for row in rows:
            session.remember(row)

    with _apart(write) as keep:
        yield keep


@contextlib.contextmanager
def _apart(work: Callable[[Iterator[Handed]], None]) -> Iterator[Callable[[Handed], None]]:
    """A function that hands something to a thread of its own, which may wait for as long as it likes.

    Args:
        work: what the thread does with what is handed; of what comes while it is busy it sees the newest.
    """
    newest: list[Handed] = []
    come, over = threading.Event(), threading.Event()

    def hand(row: Handed) -> None:
        newest[:] = [row]
        come.set()

    def rows() -> Iterator[Handed]:
        while come.wait() and not over.is_set():
            come.clear()
            yield newest[0]

    thread = threading.Thread(target=lambda: work(rows()), daemon=True)
    thread.start()
    try:
        yield hand
    finally:
        over.set()
        come.set()
        thread.join(_CLEARED)


def _draw(session: Session, auto: bool, shown: Iterator[tuple[dict[str, float], str]]) -> None:
    from rich.live import Live

    from bowden.live.screen import picture

    # nothing else that is printed may go through it: it would wait for this thread
    live = Live(auto_refresh=False, transient=True, redirect_stdout=False, redirect_stderr=False)
    with contextlib.suppress(OSError), live:  # the terminal may be gone
        size = live.console.size
        for row, answer in shown:
            if live.console.size != size:  # a terminal that is another one now wraps what stands on it
                size = live.console.size
                live.console.clear()
            live.update(picture(session, row, auto, answer), refresh=True)
