"""`demo`: the main job on one page, from a log of a cable to a law that runs live on a simulated drive."""

import shlex
import time as clock
from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from bowden.live.figures import EndedRun
from bowden.operations.check import Verdict
from bowden.operations.simulate import SimulatedRun, simulate
from bowden.operations.support.operation import Folder, GivenProgress, Operation, Quiet, Switch, Tell
from bowden.operations.support.results import Result, TrustLevel

if TYPE_CHECKING:
    from bowden.design.verdict import CheckVerdict
    from bowden.live.session import Session
    from bowden.rig.rig import Rig

LENGTH = 20.0
"""Of the simulation and of the live run [s]."""
_TRIES, _PAUSE = 3, 3.0
"""At the live run, where this computer stalls, and the time between them [s]."""


@dataclass(frozen=True)
class Demo(Result["Demo"]):
    """The main job, done once."""

    best: str
    """Name of the recommended model, as bowden identify has it."""
    trust: TrustLevel
    """Whether to trust the model, and why."""
    verdict: Verdict
    """Verdict of the check of the law."""
    runs: tuple[SimulatedRun, ...]
    """Simulated: without compensation first, then with the law."""
    live: EndedRun
    """The run on the twin, as bowden run has it."""
    files: tuple[Path, ...]
    """Model, rig and page."""
    _: KW_ONLY
    words: tuple[str, ...] = ()
    """The log and its options, for other commands; empty of the simulated one."""

    @property
    def exit_code(self) -> int:
        """1 where something ended the live run."""
        return 0 if self.live.ended_well else 1


def demo(
    log: Annotated[Path | None, Switch(place=True)] = None,
    *,
    time: str | None = None,
    motor: str | None = None,
    joint: str | None = None,
    unit: Annotated[str | None, Switch(metavar="UNIT[,UNIT]")] = None,
    counts_per_turn: Annotated[str | None, Switch(metavar="N[,N]")] = None,
    rate: Annotated[float | None, Switch(metavar="HZ")] = None,
    out: Folder = Path("out/demo"),
    progress: GivenProgress = None,
    tell: Tell = None,
    quiet: Quiet = False,
) -> Demo:
    """Show the main job on one page: from a log to a law that runs live on a twin.

    The steps are those of the commands: log, model, rig, check, a law against no compensation, 20 s live, and one page.
    The drive is simulated: nothing moves. Exit code 0 when the live run ended as asked, 1 when something ended it, 2
    when a step refused; its message is the last line then.

    Args:
        log: a log of your cable, as for ``bowden identify``; a simulated one by default.
        time: name of the time column; guessed by default.
        motor: name of the motor-side angle's column.
        joint: name of the joint-side angle's column.
        unit: unit of both angles, or of motor and joint: deg, rad or counts; by default as the columns' names end.
        counts_per_turn: counts in a turn of both encoders, or of motor and joint, whatever the log's unit.
        rate: rows a second, of a log without times.
        out: folder for model, rig, log and page.

    Raises:
        LogError: a log whose model is not to be trusted.
        ParameterError: no law holds.

    Examples:
        bowden demo
        bowden demo my.csv
        bowden demo my.csv --unit deg --json
    """
    from bowden.core.errors import LogError, ParameterError
    from bowden.core.files import write_text
    from bowden.design.new_rig import around
    from bowden.design.verdict import checked, verdict_of
    from bowden.identify.cable.identification import identify
    from bowden.identify.log.read import read_log
    from bowden.operations.support.progress import reported
    from bowden.plants.identified import load_cable
    from bowden.report import demo_page as page
    from bowden.rig.rig import Rig

    def say(*lines: str) -> None:
        """What a step came to, and what that means."""
        if callable(progress):
            progress("", 1.0)  # a bar goes, so that lines have the screen
        if not quiet:
            print("\n  ".join(lines), flush=True)

    note = tell or (lambda text: None)
    out.mkdir(parents=True, exist_ok=True)
    model, rig_file, html = out / "demo.model.toml", out / "demo.toml", out / "demo.html"  # nobody else's names
    source = log or out / "demo.csv"
    if log is None:
        from bowden.sim.samples.cable import cable_files

        write_text(source, cable_files(1)["log.csv"].text)
    named: dict[str, Any] = {"time": time, "motor": motor, "joint": joint, "unit": unit, "rate": rate}
    named["counts_per_turn"] = counts_per_turn
    read = read_log(source, **named)
    options = [(f"--{name.replace('_', '-')}", str(value)) for name, value in named.items() if value is not None]
    words = [str(source), *(word for pair in options for word in pair)]
    say(page.log_line(read, simulated=log is None))
    with reported(progress, "demo") as report:
        fit = identify([read], progress=report)
        say(*page.model_lines(fit))
        for warning in fit.warnings:
            note(warning)
        if fit.trust.level == "no":
            raise LogError(
                f"the model of {read.name} is not to be trusted: {'; '.join(fit.trust.reasons)}",
                do=f"record another log; {shlex.join(['bowden', 'identify', *words])} draws what this one shows",
            )
        fit.write(model)
        report("looking for a law that holds", 0.1)
        new = around(load_cable(model), rig_file, model.name)
        write_text(rig_file, new.text)
        rig = Rig.read(rig_file).replace(duration=LENGTH)
        say(f"Rig: {rig_file}", *new.notes)
        report(f"checking {rig.law_name}", 0.1)
        found = checked(rig.each_joint[0])
        say(page.check_line(found))
        if not found.holds:
            raise ParameterError(f"{found.law} does not hold on {rig_file}: {found.reason}", do=found.advice)
        laws = list(dict.fromkeys((page.WITHOUT, rig.law_name)))
        simulated = simulate(rig, [None if name == rig.law_name else name for name in laws], progress=report)
        traces = simulated.joints[0].traces
        say(page.simulated_line(traces))
        say(f"Live: {LENGTH:g} s in real time on a twin: drive, motor and cable, simulated in another process …")
        verdict = verdict_of(rig.fitted(), found, rig_file.name)
        session, ended = _live(rig, rig_file.name, out, verdict, note, quiet=quiet)
        live = session.trace()
        say(page.live_line(live, ended))
        report("drawing the page", 0.8)
        page.demo_page(fit, found, traces, live, ended, [] if log is None else words).write(html)
    return Demo(
        fit.best.name,
        TrustLevel(*fit.trust),
        found.verdict,
        simulated.runs,
        ended,
        (model, rig_file, html),
        words=() if log is None else tuple(words),
    )


def _live(
    rig: "Rig", name: str, out: Path, checked: "CheckVerdict", tell: Any, *, quiet: bool
) -> "tuple[Session, EndedRun]":
    """A live run on a twin, and its summary; once more where this computer stalled.

    Raises:
        KeyboardInterrupt: the user ended it.
    """
    from bowden.live.operator import ending_signals, operate
    from bowden.live.start import live_session
    from bowden.live.summary import ended_run
    from bowden.report.demo_page import by_the_computer

    for further in reversed(range(_TRIES)):
        with (
            ending_signals() as ending,
            live_session(rig, name, twin=True, out=out, force=False, tell=tell, checked=checked) as session,
        ):
            operate(session, ending, auto=True, quiet=quiet)
        if ending.asked:
            raise KeyboardInterrupt
        found = ended_run(session)
        if found.ended_well or not by_the_computer(found):
            break
        if further:
            tell("this computer stalled and ended the run; once more")
            clock.sleep(_PAUSE)  # a shared computer stalls for seconds at a time
    return session, found


OPERATIONS = (Operation("demo", demo, 3),)
