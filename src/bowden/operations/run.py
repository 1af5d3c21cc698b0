"""`run`: a law live on a rig's drive, or on a twin of it, under the supervisor, with every cycle in a log."""

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from bowden.hardware.realtime import Grant
from bowden.live.figures import Lateness
from bowden.operations.log import LogStop
from bowden.operations.support.operation import Folder, GivenLaw, GivenRig, Operation, Quiet, Switch, Tell
from bowden.operations.support.results import Result, ResultPart, made

if TYPE_CHECKING:
    from bowden.live.session import Session


@dataclass(frozen=True)
class DelaySpread(ResultPart):
    """Quantiles of a delay [ms]."""

    p50: float
    p99: float
    max: float


@dataclass(frozen=True)
class EmgRunFigures(ResultPart):
    """How a run by EMG went."""

    source: str
    stream: str
    """What the stream says it is."""
    wearer: str | None
    """The wearer's file whose levels the run went by, as rig.toml names it; null without."""
    motions: int | None
    """Motions that contractions began or turned round; null in the proportional mode."""
    onset_to_cycle_ms: DelaySpread | None
    """Until the cycle in which the reference began to move."""
    onset_to_command_ms: DelaySpread | None
    """Until the command had moved by 0.1°."""
    onset_to_joint_ms: DelaySpread | None
    """Until the joint had moved by 1°."""
    peak_after_first_second_deg: float | None
    """Largest error after the first second of each motion."""
    age_ms: DelaySpread | None
    """Age of the newest sample in the loop's cycles."""
    samples: int
    """Samples that came, missing ones included."""
    lost: int
    """Samples that are missing."""
    why_lost: str | None
    """Why nothing came any more at the end; null where the stream was alive."""


@dataclass(frozen=True)
class FeltInRun(ResultPart):
    """What the wearer felt."""

    rms_nm: float
    """RMS of the suit's torque on the elbow less the weight that it is to carry [N m]."""
    peak_nm: float
    """Its largest size [N m]."""
    doubt_nm: float
    """Median of the standard deviation that the estimate reckons with [N m]."""


@dataclass(frozen=True)
class RunMotor(ResultPart):
    """One motor of several."""

    name: str
    law: str
    rig: str
    """Hash of the motor's own rig."""
    drive: str
    mode: str | None
    faults: tuple[str, ...]
    preflight: str | None
    """Why its preflight failed; null where it did not."""
    torque: Literal["off", "unknown", "on"]
    seconds_led: float
    rmse_deg: float | None
    peak_deg: float | None
    emergencies: tuple[str, ...]


@dataclass(frozen=True)
class LiveEnd(ResultPart):
    """How a live run ended."""

    rig: str
    """Hash of the rig: equal rigs have the same, whether they come from a file, Python or a log."""
    twin: bool
    """True if the drive was the command's own twin, and not one on the rig's bus."""
    unattended: str | None
    """That the run was ended before its time because the command that started it gave no sign of life, with the figure
    and what to set; null where it was not."""
    ended_well: bool
    """True if the run ended as asked, not by a fault."""
    mode: str | None
    """The supervisor's last mode; null where the loop failed."""
    faults: tuple[str, ...]
    remedies: tuple[str, ...]
    stops: tuple[LogStop, ...]
    """What stopped the run, in the order of time; also what was acknowledged and gone on from."""
    preflight: str | None
    """Why the preflight failed; null where it did not."""
    emergencies: tuple[str, ...]
    """The drive's emergencies in words, with their codes."""
    error: str | None
    """Why the loop ended without a word of its own; null where it did not."""
    log: str
    """The MCAP file."""


@dataclass(frozen=True)
class RunResult(LiveEnd, Result["RunResult"]):
    """A live run that has ended."""

    law: str
    """Name of the law; of several motors with different ones all of them."""
    drive: str
    """Who the drive says it is."""
    stalled_ms: float | None
    """How long this computer did not let the loop run, where that ended the run [ms]; null where it did not."""
    torque: Literal["off", "unknown", "on"]
    """What the drive has said of its torque at the end: off; on, although it was switched off; unknown, if it has not
    confirmed it: press the emergency stop."""
    cycles: int | None
    cycles_logged: int
    """Cycles in the log."""
    seconds_led: float | None
    """Time under the law [s]."""
    rmse_deg: float | None
    """Joint against reference under the law, root mean square [°]. Of several motors the largest."""
    peak_deg: float | None
    """Largest error under the law [°]. Of several motors the largest."""
    lateness: Lateness | None
    run_time_median_us: float | None
    """Median run time of the whole cycle [µs]."""
    overruns: int | None
    """Deadlines that were skipped."""
    emg: EmgRunFigures | None
    """Figures of a run by EMG; null in any other. Delays count from the sample in which a contraction was found."""
    interaction: FeltInRun | None
    """What the wearer felt of a suit that follows their push ([admittance]), as the loop estimated it, after the first
    4 s or half of a shorter run; null in any other run."""
    grants: tuple[Grant, ...]
    more_logs: tuple[str, ...]
    """Where the recorder had to be started again: what it wrote then, which begins with the last half minute before."""
    log_whole: bool
    """True if the log was closed properly and every row that was written can be read."""
    log_lost: str | None
    """What became of a log that is not there at the end: removed, replaced or moved; null where it is."""
    motors: tuple[RunMotor, ...]
    """The same for each motor of a rig with several; else empty."""

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
    return _Run(_session(rig, law, preset, duration, motor, twin, channel, emg, out, force))


@contextlib.contextmanager
def _session(
    rig: GivenRig,
    law: GivenLaw | None,
    preset: str | None,
    duration: float | None,
    motor: str | None,
    twin: bool,
    channel: str | None,
    emg: str | None,
    out: Path,
    force: bool,
) -> "Iterator[Session]":
    """See `run`."""
    from bowden.live.start import live_session
    from bowden.operations.support import given
    from bowden.operations.support.python import tell

    whole = _given(rig, law, preset, duration, motor, channel, emg)
    name, alone = given.name_of(whole), motor or ""
    told = partial(live_session, whole, name, tell=lambda note: tell([note]), alone=alone)
    with told(twin=twin, out=out, force=force) as session:
        yield session
    tell([session.outcome] if not session.ended_well else [session.log_lost] if session.log_lost else [])


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
    """
    from bowden.live.foxglove_process import require
    from bowden.live.operator import ending_signals, operate, refuse_over_ssh, refuse_without_keys
    from bowden.live.start import live_session
    from bowden.live.summary import document
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
    return made(RunResult, {"motors": []} | document(session))


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


OPERATIONS = (
    Operation(
        "run",
        run_to_end,
        (
            "bowden run rig.toml",
            "bowden run rig.toml --twin --auto --duration 20",
            "bowden run rig.toml --law bowden",
        ),
        place=60,
    ),
)
