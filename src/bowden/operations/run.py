"""`run`: a law live on a rig's drive, or on a twin of it, under the supervisor, with every cycle in a log."""

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from bowden.live.figures import EndedRun
from bowden.operations.support.operation import Folder, GivenLaw, GivenRig, Operation, Quiet, Switch, Tell
from bowden.operations.support.results import Result

if TYPE_CHECKING:
    from bowden.live.session import Session


@dataclass(frozen=True)
class RunResult(EndedRun, Result["RunResult"]):
    """A live run that has ended."""

    @property
    def exit_code(self) -> int:
        """1 where a fault or an error ended it, or cycles of it are in no log."""
        return 0 if self.ended_well and self.cycles_logged >= (self.cycles or 0) else 1


class _Run(contextlib.AbstractContextManager["Session"]):
    """A run that begins with the block of its ``with`` statement; outside of one it says so."""

    def __init__(self, within: contextlib.AbstractContextManager["Session"]) -> None:
        self._within = within

    def __enter__(self) -> "Session":
        return self._within.__enter__()

    def __exit__(self, *why: Any) -> bool | None:
        return self._within.__exit__(*why)

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(f"bowden.run(…) has no {name!r}: {self!r}")

    def __repr__(self) -> str:
        return "nothing runs yet: with bowden.run(…) as session: session.complete()"


def run(
    rig: GivenRig,
    law: GivenLaw | None = None,
    *,
    preset: str | None = None,
    duration: float | None = None,
    motor: str | None = None,
    twin: bool = False,
    channel: str | None = None,
    emg: str | None = None,
    out: Folder = Path("out/run"),
    force: bool = False,
) -> contextlib.AbstractContextManager["Session"]:
    """Run a law live and record every cycle in a log; use it in a ``with`` statement.

    The law is checked first, as `bowden.check` does it. The run starts stopped: ``session.complete()`` arms it, runs
    the reference, and says whether it came to its end (True) or something stopped it (False). To do this step by step,
    use ``session.ask(…)``, ``session.last()`` and ``session.wait(…)``. Each call is a sign of life: without one for
    ``limits.operator_age`` the run ends. The end of the block ends the run in a controlled release. After it,
    ``session.outcome`` says how the run ended, and ``session.trace()`` is the record. If a fault ended it, a warning
    says the same. On a twin ``session.inject(…)`` tries faults.

    Args:
        rig: a `Rig`, or the path of a rig.toml.
        law: a key of `LAWS`, ``FILE.py:NAME`` or a `Law` that is in a file; the rig's by default.
        preset: a named set of gains of that law.
        duration: of the run, in place of the rig's [s].
        motor: one motor alone, of a rig with several.
        twin: run on a simulated drive with the same protocol, on a bus of its own, and not on the rig's drive.
        channel: the bus, in place of the rig's.
        emg: ``lsl:NAME``, ``trigno:HOST`` or ``file:PATH``: EMG moves the joint, from that source.
        out: folder for the log.
        force: run a law that does not hold on the rig.

    Returns:
        What gives the session in a ``with`` statement; nothing runs before.

    Raises:
        ParameterError: a rig, law or setting that cannot be used, or a law that does not hold.
        SafetyError: limits that contradict one another, or a drive without an angle that was confirmed by hand.
        DriveError: a bus or drive that cannot be used.
        OutputError: a folder that cannot be written.

    >>> import bowden
    >>> with bowden.run("rig.tom", twin=True) as session:
    ...     session.complete()
    Traceback (most recent call last):
    ...
    bowden.core.errors.ParameterError: cannot read rig.tom: no such file or directory; write one with: bowden init
    """
    from bowden.live.start import live_session
    from bowden.operations.support import given
    from bowden.operations.support.python import tell

    @contextlib.contextmanager
    def begun() -> Iterator["Session"]:
        whole = _given(rig, law, preset, duration, motor, channel, emg)
        begin = partial(live_session, whole, given.name_of(whole), tell=lambda note: tell([note]), alone=motor or "")
        with begin(twin=twin, out=out, force=force) as session:
            yield session
        tell([session.outcome] if not session.ended_well else [session.log_lost] if session.log_lost else [])

    return _Run(begun())


def _given(rig: Any, law: Any, preset: Any, duration: Any, motor: Any, channel: Any, emg: Any) -> Any:
    """The rig with all that was said of it."""
    from bowden.operations.support import given

    whole = given.of_motor(given.rig_of(rig), motor)
    whole = given.under(whole if duration is None else whole.replace(duration=duration), law, preset).on_bus(channel)
    return whole if emg is None else whole.with_emg(emg)


def run_to_end(
    rig: GivenRig,
    *,
    law: str | None = None,
    preset: str | None = None,
    duration: float | None = None,
    motor: str | None = None,
    out: Folder = Path("out/run"),
    auto: bool = False,
    twin: bool = False,
    channel: str | None = None,
    emg: str | None = None,
    attended: bool = False,
    console: bool = False,
    foxglove: Annotated[int | None, Switch(metavar="PORT")] = None,
    force: bool = False,
    tell: Tell = None,
    quiet: Quiet = False,
) -> RunResult:
    """Run a law live on a rig's drive, under the supervisor.

    It starts stopped; keys arm, run, stop and acknowledge; it ends in a controlled release. Exit code 0 when the run
    ended as asked, 1 when a fault or an error ended it or cycles of it are in no log, 2 when it could not begin.

    Args:
        rig: the rig, with its [drive] and [limits]; ``bowden init`` writes one.
        law: a law's name, or FILE.py:NAME of your own, in place of the rig's.
        preset: a named set of gains of that law.
        duration: length of the run in seconds.
        motor: one motor alone, of a rig with several.
        out: folder for the log.
        auto: arm and run without keys, once, and end.
        twin: start bowden twin as well, on a bus of its own.
        channel: the bus, in place of the rig's.
        emg: EMG moves the joint: lsl:NAME, trigno:HOST or file:PATH, in place of the rig's.
        attended: over ssh: somebody at the rig has the emergency stop in hand.
        console: serve a page as well, on which others can watch and stop the run.
        foxglove: serve live data for Foxglove at this port; 0 for a free one.
        force: run a law that fails the check on the rig.

    Raises:
        ParameterError: a rig, law or setting that cannot be used, or a law that does not hold.
        SafetyError: limits that contradict one another, or a drive without an angle that was confirmed by hand.
        DriveError: a bus or drive that cannot be used.

    Examples:
        bowden run rig.toml
        bowden run rig.toml --twin --auto --duration 20
        bowden run rig.toml --law bowden
    """
    from bowden.live.foxglove_process import require
    from bowden.live.operator import ending_signals, operate, refuse_over_ssh, refuse_without_keys
    from bowden.live.start import live_session
    from bowden.live.summary import ended_run
    from bowden.operations.support import given

    note = tell or (lambda text: None)
    refuse_without_keys(auto, quiet)
    if foxglove is not None:
        require(foxglove)
    if console:
        from bowden.console.open import beside as console_beside  # now: it takes longer than an operator may be silent
    whole = _given(rig, law, preset, duration, motor, channel, emg)
    name = given.name_of(whole)
    if not twin:
        refuse_over_ssh(whole, attended=attended)
    with (
        ending_signals() as ending,
        live_session(whole, name, twin=twin, out=out, force=force, tell=note, alone=motor or "") as session,
    ):
        if not quiet:
            note(session.live.losses())
        with _live_data(session, foxglove), contextlib.ExitStack() as page:
            if console:
                page.enter_context(console_beside(session, name, twin=twin, notes=[session.live.losses()]))
            operate(session, ending, auto=auto, quiet=quiet)
    return RunResult(**vars(ended_run(session)))


@contextlib.contextmanager
def _live_data(session: "Session", port: int | None) -> Iterator[None]:
    """Serve live data for Foxglove where a port is given."""
    if port is None:
        yield
        return
    import sys

    from bowden.live.foxglove_process import served

    with served(session.rows.path, port, session.beat) as address:
        print(f"Live data for Foxglove: {address}", file=sys.stderr, flush=True)
        yield


OPERATIONS = (Operation("run", run_to_end, 60),)
