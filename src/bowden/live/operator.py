"""The operator at the terminal: keys in, the run on the screen, and an orderly end whatever ends it."""

import contextlib
import os
import select
import signal
import sys
import termios
import tty
from collections.abc import Callable, Iterator
from types import FrameType
from typing import TYPE_CHECKING, Any

from bowden.core.errors import ParameterError
from bowden.live.automatic import automatic
from bowden.safety.supervisor import Request

if TYPE_CHECKING:
    from bowden.live.session import Session

_LOOK = 0.1
"""Between two looks at the run and at the keys [s]."""
_REMEMBER = 50
"""Looks between two times that the motor's warmth is kept."""
_KEYS = {"a": Request.ARM, "r": Request.RUN, "s": Request.STOP, " ": Request.STOP, "k": Request.ACKNOWLEDGE}


def refuse_without_keys(auto: bool, json: bool) -> None:
    """Refuse a run that nobody could arm.

    Raises:
        ParameterError: no terminal, or --json, without --auto.
    """
    if not auto and (json or not sys.stdin.isatty()):
        why = "--json leaves no room for a screen" if json else "there is no terminal to take keys from"
        raise ParameterError(why, do="add --auto, which arms and runs by itself")


class Ending:
    """The signals that ask for the end.

    While a run is being put together the first of them interrupts it; from `operate` on they are only noted, so that
    nothing cuts an orderly end short.
    """

    def __init__(self) -> None:
        self.asked = False
        """Whether one has come."""
        self._interrupts = True

    def only_noted(self) -> None:
        """From here on none of them interrupts anything."""
        self._interrupts = False

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Take a signal."""
        interrupts, self.asked, self._interrupts = self._interrupts, True, False
        if interrupts:
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


def operate(session: "Session", ending: Ending, *, auto: bool, quiet: bool) -> None:
    """See a run through, until the operator or a signal ends it, or with `auto` the script or a fault does.

    Raises:
        SafetyError: with `auto`, the supervisor or the preflight did not let it run.
    """
    ending.only_noted()
    _tell_grants(session)
    with _keys() as key, _screen(session, auto, quiet) as show:
        steps = automatic(session) if auto else None
        looks = 0
        while session.running and not ending.asked:
            row = session.last()
            if row is not None:
                show(row)
                if steps is not None and next(steps, None) is None:
                    return
            pressed = key()
            if pressed == "q":
                return
            if pressed in _KEYS:
                session.ask(_KEYS[pressed])
            looks += 1
            if looks % _REMEMBER == 0:
                session.remember()
            session.wait(0.5 * _LOOK if auto else 0.0)


def _tell_grants(session: "Session") -> None:
    for grant in session.ready["grants"]:
        if not grant["granted"]:
            print(f"bowden: note: {grant['name']} {grant['said']}; {grant['remedy']}", file=sys.stderr)


@contextlib.contextmanager
def _keys() -> Iterator[Callable[..., Any]]:
    """A function that waits a little for a key and gives it; the empty text for none."""
    if not sys.stdin.isatty():
        yield lambda: ""
        return
    handle = sys.stdin.fileno()
    before = termios.tcgetattr(handle)

    def key() -> str:
        ready, _, _ = select.select([handle], [], [], _LOOK)
        pressed = b""
        with contextlib.suppress(OSError):
            pressed = os.read(handle, 1) if ready else b""
        return "q" if ready and not pressed else pressed.decode(errors="replace")  # the terminal is gone

    try:
        tty.setcbreak(handle)
        yield key
    finally:
        with contextlib.suppress(termios.error):
            termios.tcsetattr(handle, termios.TCSADRAIN, before)


@contextlib.contextmanager
def _screen(session: "Session", auto: bool, quiet: bool) -> Iterator[Callable[..., Any]]:
    """A function that shows a row; on a terminal only."""
    if quiet or not sys.stdout.isatty():
        yield lambda row: None
        return
    from rich.live import Live

    from bowden.live.screen import picture

    live = Live(auto_refresh=False, transient=True)

    def show(row: dict[str, float]) -> None:
        with contextlib.suppress(OSError):  # the terminal is gone: the run ends in its own way
            live.update(picture(session, row, auto), refresh=True)

    live.start()
    try:
        yield show
    finally:
        with contextlib.suppress(OSError):
            live.stop()
