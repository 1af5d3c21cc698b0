"""`run`: a law live on a rig's drive, or on a twin of it, under the supervisor."""

import contextlib
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bowden.core import arguments
from bowden.core.errors import OutputError, asked_for_by
from bowden.core.files import output_folder
from bowden.core.toml_text import quoted
from bowden.face import given
from bowden.face.given import GivenLaw, GivenRig
from bowden.rig.rig import Rig

if TYPE_CHECKING:
    from bowden.design.verdict import CheckVerdict
    from bowden.live.session import Session


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
    twin: bool = False,
    channel: str | None = None,
    emg: str | None = None,
    out: str | Path = "out/run",
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

    >>> with run("rig.tom", twin=True) as session:
    ...     session.complete()
    Traceback (most recent call last):
    ...
    bowden.core.errors.ParameterError: cannot read rig.tom: no such file or directory; write one with: bowden init
    """
    return _Run(_run(rig, law, preset, duration, twin, channel, emg, out, force))


@contextlib.contextmanager
def _run(
    rig: GivenRig,
    law: GivenLaw | None,
    preset: str | None,
    duration: float | None,
    twin: bool,
    channel: str | None,
    emg: str | None,
    out: str | Path,
    force: bool,
) -> Iterator["Session"]:
    """See `run`."""
    whole = given.under(given.rig_of(rig, "run", several=True), law, preset, "run")
    whole = whole if duration is None else whole.replace(duration=duration)
    twin, force = arguments.flag(twin, "run: twin"), arguments.flag(force, "run: force")
    if channel is not None:
        arguments.text(channel, "run: channel", 'the name of a bus, such as "can0"')
    if emg is not None:
        arguments.text(emg, "run: emg", '"lsl:NAME", "trigno:HOST" or "file:PATH"')
    folder = arguments.path_of(out, "run: out", "folder")
    whole = whole.on_bus(channel)
    whole = whole if emg is None else whole.with_emg(emg)
    with (
        given.in_words_of_python(),
        live_session(
            whole, given.name_of(whole), twin=twin, out=folder, force=force, tell=lambda note: given.tell([note])
        ) as session,
    ):
        yield session
    said = [session.outcome] if not session.ended_well else [session.log_lost] if session.log_lost else []
    given.tell(said)


@contextlib.contextmanager
def live_session(
    rig: Rig,
    name: str,
    *,
    twin: bool,
    out: Path,
    force: bool,
    tell: Callable[[str], None],
    measure: bool = False,
    checked: "CheckVerdict | None" = None,
    about: Mapping[str, str] | None = None,
    alone: str = "",
) -> Iterator["Session"]:
    """A session of a rig's own law, checked, or of its excitation; see `run`.

    Args:
        rig: with the law and all else that is to run.
        name: of the rig, for messages.
        twin: whether on a twin.
        out: folder for the log.
        force: run a law that does not hold.
        tell: called with each thing that the user should know.
        measure: move the motor through the excitation, in place of a law; nothing is checked then.
        checked: what the check says of this rig and its law, where it has been asked already.
        about: who and what for, for the log; see `Session`.
        alone: name of the axis that the rig is, of a file with several.
    """
    from bowden.design.forecast import off_reference
    from bowden.design.objections import mismatches
    from bowden.design.verdict import CheckVerdict, verdicts
    from bowden.live import left_behind
    from bowden.live.by_hand import require_confirmed, require_watch, unseen_watch
    from bowden.live.emg_process import EmgProcess
    from bowden.live.live_run import live_run
    from bowden.live.preflight import require
    from bowden.live.session import Session, own_twin, prepared_loop
    from bowden.rig.families import family_of

    live = live_run(rig, measure=measure)
    for axis in () if twin else live.axes:  # another run's bus is refused at once; the drive claims it for good
        left_behind.await_host(partial(family_of(axis.rig.drive).claim, axis.rig.drive), tell)
        with asked_for_by(f"axis {quoted(axis.name)}") if axis.name else contextlib.nullcontext():
            require_watch(axis.rig, [other.rig for other in live.axes])
        require_confirmed(axis.rig, axis.name or alone)
    with contextlib.ExitStack() as stack:
        loop = stack.enter_context(prepared_loop())
        emg_process = None if live.emg is None else stack.enter_context(contextlib.closing(EmgProcess(rig)))
        pushing = live.pushing.notes([live.law], force=force) if live.pushing else []
        for note in (*live.notes, *pushing):
            tell(note)
        allowed = []
        for axis in live.axes:
            of_axis = f"axis {quoted(axis.name)}"
            with asked_for_by(of_axis) if axis.name else contextlib.nullcontext():
                found = CheckVerdict("holds", "") if measure else checked  # no gains take part in a measurement
                found = found or verdicts(axis.rig, [axis.law], name, force=force)[0]
                for note in filter(None, (unseen_watch(axis.rig), found.note)):
                    tell(f"{of_axis}: {note}" if axis.name else note)
                verdict = "little_margin" if force else found.name or "little_margin"
                require(
                    *(axis.limits, axis.rig.sample_time, verdict),
                    opposed=axis.opposed,
                    given=axis.rig.limits,
                    mismatches=() if axis.limits.paired else mismatches(axis.rig, axis.limits),
                )
                allowed.append(axis.limits.off_reference if measure else off_reference(axis.rig, axis.law))
        if emg_process is not None:
            emg_process.await_ready()  # a stream that cannot be used is refused before anything else is started
        if twin:
            live = live_run(
                stack.enter_context(own_twin(rig, measure=measure, alone=alone)), measure=measure, logged=rig
            )
        live = live.following(allowed)
        log = new_log(out, "measure" if measure else "-".join(dict.fromkeys(axis.law.name for axis in live.axes)))
        yield stack.enter_context(Session(live, log, emg_process, remembers=not twin, about=about, loop=loop))


def new_log(folder: Path, name: str) -> Path:
    """A name for a log that is not taken yet, in a folder that is there.

    Raises:
        OutputError: the folder cannot be made or written.
    """
    output_folder(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"cannot make the folder {folder}: {error.strerror}", do="choose another one") from None
    number = 1
    while (path := folder / f"{name}-{number}.mcap").exists():
        number += 1
    return path
