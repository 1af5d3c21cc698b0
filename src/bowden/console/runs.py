"""The one run of a console: begun, watched, asked and ended by one thread, which alone gives the loop its sign of life.

Why nothing moves without somebody at the page, whoever of the chain page → server → this thread → loop fails:

- The page is gone, hidden or cut off: no sign of life comes, the lease grows old, and this thread asks for a stop.
- The server's event loop hangs: signs of life come through it and through nothing else, so the lease grows old as well;
  this thread does not need the event loop to see that.
- This thread hangs: it alone beats, in the same round in which it looks at the lease and takes the requests, so the
  loop's `operator_age` grows, and the loop releases. A thread that holds the interpreter is the same case.
- A stop that was asked for does not take: after `TAKEN` this thread beats no more while there is power. The thread that
  a stop comes to hands it to the loop, without this one.
- This process is killed: no beat.
- A request that gives power comes late, after a stop that its sender did not see: its stamp is older than the stop.

A round takes 25 ms. Requests are handed over in a queue, their answers in futures; what there is to see is one value
that is replaced whole, so that no reader waits for this thread and it waits for none.
"""

import contextlib
import queue
import sys
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from bowden.console.lease import Lease, Stamps
from bowden.core.clock import SECOND, MonotonicClock
from bowden.core.errors import BowdenError, LogError, SafetyError, note
from bowden.core.files import printable
from bowden.live.operator import keeping, prompt, why_not
from bowden.live.ring import RingReader
from bowden.live.session import STANDS_STILL
from bowden.safety.state import Mode, Request

if TYPE_CHECKING:
    from bowden.live.session import Session

ROUND = 0.025
"""Between two looks at the lease [s]."""
TAKEN = 0.2
"""A stop that has not taken the law off the motor after this long is not taken at all [s]."""
_REMEMBER = 200
"""Rounds between two times that the motor's warmth is kept."""
POWERED = frozenset({Mode.PREFLIGHT, Mode.RUNNING, Mode.BRIDGING})
"""Modes in which somebody has to be at the page; in a release the cable is being let out already."""

STAMPED = frozenset({Request.ARM, Request.RUN, Request.ACKNOWLEDGE})
"""Requests that are granted only to who has seen how the rig stands now."""

Begin = Callable[[Callable[[str], None]], AbstractContextManager["Session"]]
"""Begins a session, and says meanwhile what its user should know."""


@dataclass(frozen=True)
class RunSeen:
    """Snapshot of the run; a new one each round."""

    phase: str = "idle"
    """``idle``, ``starting``, ``live`` or ``ending``."""
    session: "Session | None" = None
    """The one that goes on, or else the last one."""
    row: dict[str, float] | None = None
    """The newest row."""
    recorder: int = 0
    """A `RecorderState`."""
    logs: tuple[str, ...] = ()
    """Names of the run's files."""
    notes: tuple[str, ...] = ()
    """What the user should know of the run."""
    lost: str = ""
    """Why the lease was lost under power; empty where it was not, or a new one was armed with."""
    error: BowdenError | None = None
    """Why there is no run, or why it ended without being asked to."""

    @property
    def mode(self) -> Mode | None:
        """Of the supervisor; None where there is no row."""
        return None if self.row is None or self.phase != "live" else Mode(int(self.row["mode"]))

    @property
    def power(self) -> bool:
        """True if the motor has power, or may have."""
        return self.mode not in (None, Mode.STOPPED, Mode.LATCHED)


@dataclass(frozen=True)
class _Asked:
    """A request with the place for its answer: empty, or why it does nothing."""

    tab: str
    request: Request | None
    gain: tuple[str, float] | None = None
    """In place of a request: another value of a gain, whose check holds."""
    seen: object = None
    """Stamp of the newest state that its page was sent."""
    answer: "Future[str]" = field(default_factory=Future)


class RunOwner:
    """The thread that holds the run.

    Args:
        lease: who controls.
        stamps: of what the pages were sent.
        ended: called by this thread with each session that has ended.
    """

    def __init__(self, lease: Lease, stamps: Stamps, ended: Callable[["Session"], None] = lambda session: None) -> None:
        self.lease, self.stamps, self.clock = lease, stamps, MonotonicClock()
        self.seen = RunSeen()
        """Snapshot of the run."""
        self.looked = self.clock.now()
        """When the thread looked at the run last [ns]."""
        self._ended = ended
        self._mode: Mode | None = None
        self._begins: queue.Queue[Begin | None] = queue.Queue()
        self._asked: queue.SimpleQueue[_Asked | None] = queue.SimpleQueue()
        self._end, self._over = threading.Event(), threading.Event()
        self._stops = 0
        """Number of the last stop of the run that this thread has seen."""
        self._stopping: list[_Asked] = []
        """Stops that the loop has not taken yet."""
        self._thread = threading.Thread(target=self._live, name="run", daemon=True)
        self._thread.start()

    # by any thread

    def begin(self, begin: Begin) -> None:
        """Start a session.

        Raises:
            SafetyError: there is one, or the console ends.
        """
        if self.seen.phase != "idle" or not self._begins.empty() or self._over.is_set():
            raise SafetyError("a session goes on", expected="none", do="end it first")
        self.seen = RunSeen("starting")
        self._end.clear()
        self._begins.put(begin)

    def ask(self, tab: str, request: Request, seen: object = None) -> "Future[str]":
        """Ask for something; the answer is empty, or why it does nothing. A stop needs no lease, is handed to the loop
        at once, and answered when the loop has taken it.

        Args:
            tab: who asks.
            request: for what.
            seen: stamp of the newest state that it was sent; those in `STAMPED` need it.
        """
        return self._handed(_Asked(tab, request, seen=seen))

    def ask_gain(self, tab: str, name: str, value: float) -> "Future[str]":
        """Ask for another value of a live gain, whose check holds; the answer as of `ask`."""
        return self._handed(_Asked(tab, None, (name, value)))

    def _handed(self, asked: _Asked) -> "Future[str]":
        stop, seen = asked.request == Request.STOP, self.seen
        if stop:
            self.stamps.stop(self.clock.now())
        if seen.phase != "live" or seen.session is None:
            asked.answer.set_result("" if stop else "there is no session: start one first")
            return asked.answer
        if stop:
            seen.session.block.ask(Request.STOP)  # `ask` of the session would be a sign of life
        self._asked.put(asked)
        return asked.answer

    def end(self) -> None:
        """End the session, in a controlled release."""
        self._end.set()
        self._asked.put(None)

    def close(self, patience: float = 30.0) -> None:
        """End the session and the thread, and wait until both have ended [s]."""
        self._over.set()
        self.end()
        self._begins.put(None)
        self._thread.join(patience)

    # by its own thread

    def _live(self) -> None:
        while not self._over.is_set():
            begin = self._begins.get()
            if begin is None:
                return
            notes: list[str] = []
            try:
                self._see_through(begin, notes)
            except BowdenError as error:
                self._rest(error)
            except Exception as error:  # the page says so; whoever started the console sees what it was
                print(f"bowden: the run failed: {type(error).__name__}: {printable(str(error))}", file=sys.stderr)
                self._rest(SafetyError(_BROKEN, do="see the terminal that started it"))
            self._answer_all("the session has ended")

    def _rest(self, error: BowdenError | None, **more: Any) -> None:
        """No session goes on any more, for a reason or because it has ended; what the last one showed stays."""
        seen = self.seen
        self.seen = RunSeen(session=seen.session, row=seen.row, error=error, **more)

    def _see_through(self, begin: Begin, notes: list[str]) -> None:
        error: BowdenError | None = None
        with begin(notes.append) as session:
            self._answer_all("the session has only just begun")  # what was asked of the one before
            self.seen, self._mode = RunSeen("live", session, notes=(*notes, session.live.losses())), None
            self._stops = 0
            with keeping(session) as keep, prompt():
                self._operate(session, keep)
            self.seen = self._look(session, "ending")
        if session.error:
            error = SafetyError(session.error, do="look at the log, then start again")
        elif session.log_lost:
            error = LogError(session.log_lost)
        self._ended(session)
        self._rest(error, logs=self.seen.logs, lost=self.seen.lost)

    def _operate(self, session: "Session", keep: Callable[[dict[str, float]], None]) -> None:
        """Round after round, until the end is asked for or the loop's process has ended."""
        asked_at: int | None = None
        for count in range(sys.maxsize):
            if self._end.is_set() or not session.running:
                return
            now = self.clock.now()
            asked_at = self._look_after(session, now, asked_at)
            if asked_at is None or now - asked_at < TAKEN * SECOND:
                session.last()  # the sign of life
                if session.still > STANDS_STILL:
                    note(f"the loop has not answered for {session.still:.0f} s")
                    return
            self._see(session)
            if count % _REMEMBER == _REMEMBER - 1 and self.seen.row is not None:
                keep(self.seen.row)
            self._take(session, now + round(ROUND * SECOND))

    def _look_after(self, session: "Session", now: int, asked_at: int | None) -> int | None:
        """Have the run stopped where nobody is there; when a stop was asked for that still has to take [ns]."""
        block = session.block
        if not block.stop_waits:
            while self._stopping:
                _give(self._stopping.pop(), "")
        row = session.rows.last()
        mode = None if row is None else Mode(int(session.row_of(row)["mode"]))
        stops = block.stops  # read once: a stop may come from any thread
        asked, self._stops = stops != self._stops, stops
        if mode not in POWERED and not block.stop_waits:
            return None
        if asked_at is not None or asked or block.stop_waits:
            return asked_at or now
        view = self.lease.look(now)
        if view.fresh:
            return None
        self.seen = self._look(session, "live", lost=_why_lost(view.holder, self.lease.limit))
        self.lease.drop()
        self.stamps.stop(now)
        block.ask(Request.STOP)
        self._stops = block.stops
        return now

    def _see(self, session: "Session") -> None:
        """Look at the run; a mode without power that has come since the last look is a stop, by whomever."""
        self.looked = self.clock.now()
        self.seen = self._look(session, "live")
        mode, before = self.seen.mode, self._mode
        self._mode = mode
        if mode not in POWERED and mode != before:
            self.stamps.stop(self.clock.now())  # after `seen`: no page was sent a state of before with a later stamp

    def _take(self, session: "Session", until: int) -> None:
        """Take requests until the round is over."""
        while (left := (until - self.clock.now()) / SECOND) > 0.0:
            try:
                asked = self._asked.get(timeout=left)
            except queue.Empty:
                return
            if asked is None:
                return
            if asked.request == Request.STOP:
                self._stopping.append(asked)
                return
            _give(asked, self._granted(session, asked))

    def _granted(self, session: "Session", asked: _Asked) -> str:
        """Hand a request on; why it does nothing where it does nothing."""
        stops, view = session.block.stops, self.lease.look(self.clock.now())
        if not view.holder or view.holder != asked.tab:
            return "this page does not control: take the control first"
        if not view.fresh:
            return "no sign of life comes from this page: keep it visible and in the foreground"
        if asked.gain is not None:
            try:
                session.ask_gain(*asked.gain)
            except BowdenError as error:
                return error.what
            return ""
        assert asked.request is not None
        if asked.request in STAMPED:
            self._see(session)
            if late := self.stamps.why_not(asked.seen, self.clock.now()):
                return late
        why = why_not(asked.request, session.judged(self.seen.row))
        if not why:
            session.block.ask(asked.request, stops)  # a stop that has come since is asked for by another thread
            if asked.request == Request.ARM:
                self.seen = self._look(session, "live", lost="")
        return why

    def _look(self, session: "Session", phase: str, lost: str | None = None) -> RunSeen:
        found = _looked(session, session.rows, phase, self.seen.notes, self.seen.lost if lost is None else lost)
        return found if found.row is not None else replace(found, row=self.seen.row)

    def _answer_all(self, why: str) -> None:
        while self._stopping:
            _give(self._stopping.pop(), "")
        with contextlib.suppress(queue.Empty):
            while True:
                asked = self._asked.get_nowait()
                if asked is not None:
                    _give(asked, "" if asked.request == Request.STOP else why)


class TerminalRun:
    """A run that a terminal operates, with the face of a `RunOwner`: pages look on, and may stop it.

    Args:
        session: that goes on.
        notes: what its user was shown.
    """

    def __init__(self, session: "Session", notes: Sequence[str]) -> None:
        self.clock = MonotonicClock()
        self._session, self._notes = session, tuple(notes)
        self._rows = RingReader(session.rows.path)  # of its own: a reader is one thread's, and the terminal has one

    @property
    def looked(self) -> int:
        """When the run was looked at last: whenever it is asked [ns]."""
        return self.clock.now()

    @property
    def seen(self) -> RunSeen:
        """Snapshot of the run."""
        return _looked(self._session, self._rows, "live", self._notes)

    def begin(self, begin: Begin) -> None:
        """Nothing is started here.

        Raises:
            SafetyError: always.
        """
        raise SafetyError(_OF_TERMINAL, do="use its keys")

    def ask(self, tab: str, request: Request, seen: object = None) -> "Future[str]":
        """A stop is asked for; all else is the terminal's."""
        answer: Future[str] = Future()
        if request == Request.STOP:
            self._session.block.ask(request)  # `ask` of the session would be the terminal's sign of life
        answer.set_result("" if request == Request.STOP else _OF_TERMINAL)
        return answer

    def ask_gain(self, tab: str, name: str, value: float) -> "Future[str]":
        """Nothing is changed here."""
        return self.ask(tab, Request.NONE)

    def end(self) -> None:
        """The terminal ends its run."""

    def close(self, patience: float = 0.0) -> None:
        """Nothing is held here."""


_OF_TERMINAL = "the terminal controls this run"
_BROKEN = "the run failed by an error of the console"


def _looked(session: "Session", rows: RingReader, phase: str, notes: tuple[str, ...], lost: str = "") -> RunSeen:
    """Snapshot of a session, with the newest of its rows."""
    row, logs = rows.last(), tuple(path.name for path in session.logs)
    newest = None if row is None else session.row_of(row)
    return RunSeen(phase, session, newest, session.recorder, logs, notes, lost)


def _give(asked: _Asked, answer: str) -> None:
    """Answer, unless whoever asked is gone."""
    if asked.answer.set_running_or_notify_cancel():
        asked.answer.set_result(answer)


def _why_lost(holder: str, limit: float) -> str:
    if not holder:
        return "nobody controlled the run"
    return f"no sign of life from the page in control for {limit:g} s"
