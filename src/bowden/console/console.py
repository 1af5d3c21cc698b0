"""A console of one rig: its settings, the check, the run, its curves, and who looks on. For one event loop."""

import asyncio
import contextlib
import secrets
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bowden.console.access import parts_of
from bowden.console.earlier import EarlierRuns
from bowden.console.guided import GuidedPath
from bowden.console.jobs import Jobs
from bowden.console.lease import Lease, Stamps
from bowden.console.runs import RunOwner, RunSeen, TerminalRun
from bowden.console.settings import RunSettings
from bowden.console.state import VOLATILE, gains_of, rig_of, run_of
from bowden.console.stream import Watch
from bowden.core.arguments import format_value
from bowden.core.clock import SECOND
from bowden.core.documented import finite
from bowden.core.errors import BowdenError, ParameterError, SafetyError, note
from bowden.design.verdict import CheckVerdict
from bowden.hardware.twin.control import TwinControl
from bowden.live.gain_check import required
from bowden.live.live_run import live_run
from bowden.live.operator import prompt
from bowden.live.ring import RingReader
from bowden.live.start import live_session
from bowden.rig.families import family_of
from bowden.rig.rig import Rig
from bowden.safety.state import Mode, Request

if TYPE_CHECKING:
    from bowden.live.session import Session

REQUESTS = {"arm": Request.ARM, "run": Request.RUN, "stop": Request.STOP, "acknowledge": Request.ACKNOWLEDGE}
"""Those that go to the supervisor."""
TICK = 0.025
"""Between two looks at the ring [s]."""
_SAID = 4
"""Ticks between two looks at whether the state has changed."""
_WHILE_IT_RUNS = 10
"""Ticks between two states while a run goes on."""
_PATIENCE = 0.5
"""For the answer of a twin [s]."""
_LONGEST_NAME = 80


class Viewer:
    """A page that looks on, which may be the one that controls."""

    def __init__(self) -> None:
        self.tab = secrets.token_urlsafe(12)
        """Its name, known to the page alone."""
        self.asked: tuple[list[str], float, int, bool, int] | None = None
        """What it wants to see: columns, seconds, pixels, loop, number."""


class Console:
    """One rig's console.

    Args:
        rig: of the file.
        name: of the rig's file, for messages.
        twin: whether it runs on a twin of its own.
        out: folder of the runs' logs.
        terminal: a run that a terminal operates, and at which pages look on only.
    """

    def __init__(self, rig: Rig, name: str, *, twin: bool, out: Path, terminal: TerminalRun | None = None) -> None:
        self.name, self.twin, self.out = name, twin, out
        self.settings = RunSettings(rig)
        self.lease = Lease(rig.supervisor_limits.console_lease)
        self._terminal = terminal
        self.stamps = Stamps(self.lease.limit)
        owner = RunOwner(self.lease, self.stamps, self._ended) if terminal is None else terminal
        self.owner: RunOwner | TerminalRun = owner
        self.jobs = Jobs()
        self.earlier = EarlierRuns(out, self.jobs, self._going)
        self.viewers: set[Viewer] = set()
        self.watch: Watch | None = None
        self.check: dict[str, Any] | None = None
        self.path = GuidedPath(out, self.jobs)
        self.gain: dict[str, Any] | None = None
        """The newest change of a gain while a law runs."""
        self.error: BowdenError | None = None
        self._watched: Session | None = None
        self._tasks: set[asyncio.Task[Any]] = set()
        self._changing = asyncio.Lock()
        self._promptly = contextlib.ExitStack()
        self._prompt = False
        self.ticked = asyncio.Event()
        """Set, and replaced, at each tick."""
        self.newest: tuple[int, dict[str, Any]] = (0, {})
        """Number and content of the newest state, without who asks."""
        self._renewed = 0
        self.stamp = 0
        """Of the newest look at the rig: the newest state still is how it stands, but for what changes with time."""
        self._news: Any = None
        self._document: dict[str, Any] = {}

    def _going(self) -> tuple[str, ...]:
        """Names of the logs that are being written."""
        seen = self.owner.seen
        return seen.logs if seen.phase != "idle" else ()

    # what there is to see

    async def begin(self) -> None:
        """Make ready what takes longer than an instant."""
        self._document = await asyncio.to_thread(self._fixed)
        self.tick(0)

    def _fixed(self) -> dict[str, Any]:
        """What changes with the settings alone."""
        settings = self.settings
        return finite(
            {
                "rig": rig_of(settings.rig, self.name, twin=self.twin),
                "settings": settings.document(locked=False),
            }
        )

    @property
    def phase(self) -> str:
        """See web/README.md."""
        seen = self.owner.seen
        if seen.phase != "idle":
            return seen.phase
        if self.path.going:
            return "step"
        return "checking" if self.check is not None and self.check["running"] else "idle"

    def state(self) -> dict[str, Any]:
        """What every page sees."""
        seen = self.owner.seen
        run = finite(run_of(seen, self.watch))
        view = self.lease.look(self.owner.clock.now())
        since = (self.owner.clock.now() - view.since) * 1e-9
        self._follow_gain(seen)
        settings = self._document["settings"]
        if self.path.going == "measure" and run is not None and run["remaining"] is not None:
            self.path.fraction = run["elapsed"] / max(1e-9, run["elapsed"] + run["remaining"])
        error = seen.error or self.error
        return {
            "rig": self._document["rig"],
            "phase": self.phase,
            "stops": self.stamps.stops,
            "controller": {"seconds": since, "fresh": view.fresh} if view.holder else None,
            "viewers": len(self.viewers),
            "settings": {**settings, "gains": gains_of(settings, seen, self.gain), "locked": seen.phase != "idle"},
            "check": self.check,
            "run": run,
            "path": self.path.document(),
            "lease_s": self.lease.limit,
            "error": error and parts_of(error),
        }

    def for_viewer(self, tab: str) -> dict[str, Any]:
        """The newest state, as one page sees it."""
        state = dict(self.newest[1])
        controller, viewers = state.pop("controller"), state.pop("viewers")
        controls = bool(tab) and self.lease.look(self.owner.clock.now()).holder == tab
        since = None if controller is None else f"since {controller['seconds']:.0f} s"
        you = {"controls": controls, "viewers": viewers, "controller": since}
        if controller is not None:
            you["fresh"] = controller["fresh"]
        return {"rig": state.pop("rig"), "you": you, **state}

    def tick(self, count: int) -> None:
        """Take in the rows that have come, and wake every viewer; the state is looked at now and then."""
        seen = self.owner.seen
        self._be_prompt(seen.phase == "live")
        if seen.session is not self._watched and seen.session is not None:
            self._watched = seen.session
            live = seen.session.live
            reader = RingReader(seen.session.rows.path)
            self.watch = Watch(reader, live.rig.sample_time, measures=live.measure)
        if self.watch is not None:
            self.watch.look()
        if self.path.going == "measure" and seen.phase == "idle":  # it could not begin, or not end
            self.path.end(str(seen.error or "the measurement did not begin"), [], failed=True)
        late = self.owner.clock.now() - self._renewed > _SAID * TICK * SECOND  # also where ticks are late
        if count % _SAID == 0 or late or (seen.power and count % _WHILE_IT_RUNS == 0):
            self.renew(moved=seen.power and count % _WHILE_IT_RUNS == 0)
        self.ticked.set()
        self.ticked = asyncio.Event()

    def _be_prompt(self, live: bool) -> None:
        """While a session goes on signs of life come through this thread: other work here is no page that is gone."""
        if live != self._prompt:
            self._prompt = live
            if live:
                self._promptly.enter_context(prompt())
            else:
                self._promptly.close()

    def renew(self, *, moved: bool = False) -> None:
        """Make the state anew, and have it sent where it is news, or `moved` says that it goes on."""
        now = self.owner.clock.now()
        live = self.owner.seen.phase == "live"
        # A thread that hangs sees nothing: then no page is shown that this is how the rig stands.
        fresh = not live or now - self.owner.looked <= self.lease.limit * SECOND
        looked = min(now, self.owner.looked) if live else now
        self._renewed = now
        state = self.state()
        news = _without_moments(state)
        if news != self._news or moved:
            self._news, self.newest = news, (self.newest[0] + 1, state)
        if fresh:
            self.stamp = self.stamps.issue(looked)

    async def keep_ticking(self) -> None:
        """Tick after tick, until it is cancelled; what fell behind is left out."""
        loop, count = asyncio.get_running_loop(), 0
        due = loop.time()
        while True:
            count += 1
            try:
                self.tick(count)
            except BowdenError as error:
                self.error = error
            except Exception as error:  # signs of life go on, and so does the stop
                note(f"the page is not up to date: {type(error).__name__}: {error}")
            due = max(due + TICK, loop.time())
            await asyncio.sleep(due - loop.time())

    # what may be done

    def control(self, tab: str, take: Any) -> None:
        """Take the lease, or give it back.

        Raises:
            SafetyError: the page is not connected.
        """
        if not isinstance(take, bool):
            raise ParameterError(f"take is {format_value(take)}", expected="true or false", do="reload the page")
        self._require_page(tab)
        if self._terminal is not None:
            raise SafetyError("the terminal controls this run", expected="no page in control", do="use its keys")
        if take:
            self.lease.take(tab, self.owner.clock.now())
        else:
            self.lease.give_back(tab)

    def _require_page(self, tab: str) -> None:
        if not any(secrets.compare_digest(tab.encode(), one.tab.encode()) for one in self.viewers):
            raise SafetyError("this page is not connected", expected="an open stream", do="reload the page")

    def require_control(self, tab: str) -> None:
        """Refuse what only the page in control may do.

        Raises:
            SafetyError: it is another one.
        """
        self._require_page(tab)
        if self.lease.look(self.owner.clock.now()).holder != tab:
            raise SafetyError("this page does not control", expected="the page in control", do="take the control first")

    async def change(self, given: Mapping[str, Any]) -> None:
        """Change the settings.

        Raises:
            ParameterError: a value that cannot be.
            SafetyError: a session goes on.
        """
        async with self._changing:
            self._require_idle()
            made = await asyncio.to_thread(_tried, self.settings, given)
            self._require_idle()
            self.settings, self.error = made, None
            self._document = await asyncio.to_thread(self._fixed)
            if self.check is not None and self.check["of"] != made.rig.hash:
                self.check = None

    def _require_idle(self) -> None:
        if self.phase not in ("idle", "checking"):
            raise SafetyError("settings cannot change while a session goes on", do="end it first")

    async def begin_check(self) -> None:
        """Have the law checked, beside.

        Raises:
            SafetyError: a session or a check goes on.
        """
        if self.phase != "idle":
            raise SafetyError("something goes on already", expected="nothing", do="wait until it has ended")
        self.error = None
        rig = self.settings.rig
        blank: dict[str, Any] = {"holds": False, "name": None, "text": "", "rows": [], "of": rig.hash}
        self.check = {"running": True, **blank}
        self._beside(self._check(rig))

    async def _check(self, rig: Rig) -> None:
        try:
            found = await self.jobs.do("check", rig=rig.document())
        except BowdenError as error:
            if self.check is not None and self.check["of"] == rig.hash:
                self.check, self.error = None, error
            return
        if self.check is not None and self.check["of"] == rig.hash:
            self.check = finite({"running": False, **found})

    def _beside(self, work: Any) -> None:
        task = asyncio.get_running_loop().create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def request(self, tab: str, name: Any, seen: Any = None) -> str:
        """Do what a page asks for; the answer is empty, or why it does nothing.

        Args:
            tab: the page.
            name: of the request.
            seen: stamp of the newest state that it was sent.

        Raises:
            ParameterError: there is no such request.
            SafetyError: it cannot be done.
        """
        if name == "stop":
            return await self.stop()
        if name in ("start", "end"):
            self.require_control(tab)
            return self.start() if name == "start" else self.end()
        if not isinstance(name, str) or name not in REQUESTS:
            known = ", ".join(["start", *REQUESTS, "end"])
            raise ParameterError(f"request is {format_value(name)}", expected=f"one of {known}", do="reload the page")
        self._require_page(tab)
        return await asyncio.wrap_future(self.owner.ask(tab, REQUESTS[name], seen))

    async def set_gain(self, tab: str, name: Any, value: Any) -> None:
        """Have a gain changed while the law runs, if the gains wanted hold; `state` says how far it is.

        Raises:
            ParameterError: there is no such gain, it is not live, or the value cannot be.
            SafetyError: the page does not control, nothing runs, or another change goes on.
        """
        if not isinstance(name, str) or len(name) > _LONGEST_NAME:
            raise ParameterError(f"gain is {format_value(name)}", expected="the name of a gain", do="choose one")
        session = self.owner.seen.session
        if session is not None:
            session.require_value(name, value)  # what can never be is said first, whatever the time
        if self._terminal is not None:
            raise SafetyError("the terminal controls this run", expected="no change of gains", do="end it there")
        self.require_control(tab)
        if session is None or self.owner.seen.phase != "live":
            raise SafetyError("no session is live", expected="one that goes on", do="change the gain in the settings")
        if self.gain is not None and self.gain["state"] in ("checking", "going"):
            raise SafetyError("another change of gains goes on", do="wait until it is in force, or refused")
        rig = session.with_gain(name, value)
        self.gain = {"name": name, "from": session.gains[name], "to": float(value), "state": "checking", "text": ""}
        self._beside(self._changed(tab, session, rig, self.gain))

    async def _changed(self, tab: str, session: "Session", rig: Rig, change: dict[str, Any]) -> None:
        """Check a change, and hand it to the run's thread where it holds; what becomes of it is written into it."""
        why = "the console failed to check it"
        try:
            found = await self.jobs.do("verdict", rig=rig.document())
            change["text"] = required(rig.law_name, found["name"], found["text"])
            if self.owner.seen.session is not session:
                raise SafetyError("the session has ended")
            why = await asyncio.wrap_future(self.owner.ask_gain(tab, change["name"], change["to"]))
        except BowdenError as error:
            why = error.what
        finally:
            change.update({"state": "refused", "text": why} if why else {"state": "going"})

    def _follow_gain(self, seen: RunSeen) -> None:
        """See whether the newest change is in force."""
        change = self.gain
        if change is None or seen.session is None or seen.row is None:
            return
        if seen.phase != "live":
            self.gain = None
        elif change["state"] == "going" and seen.session.gains.get(change["name"]) == change["to"]:
            change["state"] = "in force"

    def stop(self) -> "asyncio.Future[str]":
        """Stop the run, whoever asks; the answer comes when the loop has taken it."""
        return asyncio.wrap_future(self.owner.ask("", Request.STOP))

    def start(self) -> str:
        """Begin a session with the settings."""
        if self.phase != "idle":
            return "something goes on already: wait until it has ended"
        rig, check = self.settings.rig, self.check
        if check is None or check["running"] or check["of"] != rig.hash:
            return "check the settings first: gains are armed only where a check says that they hold"
        if not check["holds"]:
            return f"these gains do not hold on this rig: {check['text']}"
        _ = live_run(rig)  # which refuses what cannot run
        checked = CheckVerdict(check["name"], "" if check["name"] == "holds" else check["text"])
        self.error = None
        self.owner.begin(self._session(rig, checked=checked))
        return ""

    def end(self) -> str:
        """End the session, in a controlled release."""
        if self.owner.seen.phase != "live":
            return "there is no session that could be ended"
        self.owner.end()
        return ""

    def _session(self, rig: Rig, **more: Any) -> Callable[[Callable[[str], None]], AbstractContextManager["Session"]]:
        made = partial(live_session, rig, self.name, twin=self.twin, out=self.out, force=False)
        return lambda tell: made(tell=tell, about=self.settings.about, **more)

    async def step(self, tab: str, step: Any) -> None:
        """Begin a step of the guided path.

        Raises:
            SafetyError: something goes on.
            ParameterError: there is no such step, or what it needs is not there.
        """
        self.require_control(tab)
        if self.phase != "idle":
            raise SafetyError("something goes on already", expected="nothing", do="wait until it has ended")
        name, rig = self.path.require(step), self.settings.rig.only()
        self.error = None
        if name == "measure":
            _ = live_run(rig, measure=True)
            self.owner.begin(self._session(rig, measure=True))
            self.path.begin(name)
        else:
            self.path.begin(name)
            self._beside(self._computed(name, rig))

    async def _computed(self, name: str, rig: Rig) -> None:
        made = await self.path.compute(name, rig)
        if made is not None:
            async with self._changing:
                self.settings = RunSettings(made, about=self.settings.about)
                self._document = await asyncio.to_thread(self._fixed)
                self.check = None

    def _ended(self, session: "Session") -> None:
        """A session has ended; called by the thread that held it."""
        if session.live.measure:
            ended = session.ended
            well = not session.error and ended is not None and ended.mode == Mode.STOPPED and not ended.torque
            self.path.measured(session.live, session.log, well=well, lost=session.log_lost)

    async def inject(self, fault: Any) -> str:
        """Give the twin a fault; the answer is empty.

        Raises:
            SafetyError: it is no twin, or none runs.
            ParameterError: there is no such fault.
        """
        session = self.owner.seen.session
        if not self.twin:
            raise SafetyError(
                "this is no twin: faults are not injected into hardware", do="start the console with --twin"
            )
        if session is None or self.owner.seen.phase != "live":
            raise SafetyError("no twin runs", do="start a session first")
        if not isinstance(fault, str) or len(fault) > _LONGEST_NAME:
            raise ParameterError(f"fault is {format_value(fault)}", expected="the name of a fault", do="choose one")
        motor, _, kind = fault.rpartition(": ")
        found = [one for one in session.motors if one.name == motor]
        if not found:
            raise ParameterError(
                f"there is no motor {format_value(motor)}", expected="one of the rig's", do="choose one"
            )
        drive = found[0].live.rig.drive_parameters
        await asyncio.to_thread(_injected, family_of(drive).control(drive), kind)
        return ""

    def see(self, viewer: Viewer) -> None:
        """A page has come."""
        self.viewers.add(viewer)

    def leave(self, viewer: Viewer) -> None:
        """A page has gone; what it controlled, nobody does."""
        self.viewers.discard(viewer)
        self.lease.give_back(viewer.tab)

    async def close(self) -> None:
        """End everything, the run in a controlled release."""
        for task in tuple(self._tasks):
            task.cancel()
        self.jobs.close()
        await asyncio.to_thread(self.owner.close)
        self.earlier.close()


def _tried(settings: RunSettings, given: Mapping[str, Any]) -> RunSettings:
    made = settings.changed(given)
    _ = live_run(made.rig)
    return made


def _injected(path: Path, fault: str) -> None:
    with TwinControl(path, _PATIENCE) as twin:
        if fault == "none":
            twin.clear()
        else:
            twin.inject(fault)


def _without_moments(state: Mapping[str, Any]) -> Any:
    run = state["run"]
    kept = {**state, "controller": state["controller"] and state["controller"]["fresh"]}
    return kept if run is None else {**kept, "run": {key: one for key, one in run.items() if key not in VOLATILE}}
