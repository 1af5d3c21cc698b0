"""``bowden demo``: the main job on one page, from a log of a cable to a law that runs live on a simulated drive."""

import shlex
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bowden.app.command import Command
from bowden.app.console import folder_argument, print_json, progress_bar, say_note, seconds
from bowden.app.identify_command import Counts, JointColumn, MotorColumn, Rate, TimeColumn, Unit
from bowden.app.next_step import say_next
from bowden.core.errors import LogError, ParameterError
from bowden.core.files import output_folder, write_text

if TYPE_CHECKING:
    from bowden.design.verdict import CheckVerdict
    from bowden.live.session import Session
    from bowden.rig.rig import Rig

LENGTH = 20.0
"""Of the simulation and of the live run [s]."""
_TRIES, _PAUSE = 3, 3.0
"""At the live run, where this computer stalls, and the time between them [s]."""


def demo(
    log: Annotated[
        Path | None, typer.Argument(help="A log of your cable, as for bowden identify; a simulated one by default.")
    ] = None,
    time: TimeColumn = None,
    motor: MotorColumn = None,
    joint: JointColumn = None,
    unit: Unit = None,
    counts_per_turn: Counts = None,
    rate: Rate = None,
    out: Annotated[
        Path, typer.Option(parser=folder_argument, metavar="FOLDER", help="Folder for model, rig, log and page.")
    ] = Path("out/demo"),
    json: Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")] = False,
) -> None:
    """Show the main job: log, model, rig, check, a law against no compensation, 20 s live on a twin, and one page.

    Each step is that of the command of its name. The drive is simulated: nothing moves. Exit code 0 when the live run
    ended as asked, 1 when something ended it, 2 when a step refused; its message is the last line then.
    """
    from bowden.design.verdict import verdict_of
    from bowden.face.check import checked
    from bowden.face.init import around
    from bowden.face.simulate import simulated
    from bowden.identify.cable.fit import identify_log
    from bowden.identify.log.read import read_log
    from bowden.plants.identified import load_cable
    from bowden.report import demo_page as page
    from bowden.rig.rig import Rig

    def say(*lines: str) -> None:
        """What a step came to, and what that means."""
        if not json:
            print("\n  ".join(lines), flush=True)

    output_folder(out)
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
    with progress_bar(quiet=json) as progress:
        fit = identify_log(read, progress=progress)
    say(*page.model_lines(fit))
    for warning in fit.warnings:
        say_note(warning)
    if fit.trust.level == "no":
        raise LogError(
            f"the model of {read.name} is not to be trusted: {'; '.join(fit.trust.reasons)}",
            do=f"record another log; {shlex.join(['bowden', 'identify', *words])} draws what this one shows",
        )
    fit.write(model)
    with progress_bar(quiet=json) as progress:
        progress("looking for a law that holds", 0.1)
        made = around(load_cable(model), rig_file, model.name)
    write_text(rig_file, made.text)
    rig = Rig.read(rig_file).replace(duration=LENGTH)
    say(f"Rig: {rig_file}", *made.notes)
    with progress_bar(quiet=json) as progress:
        progress(f"checking {rig.law_name}", 0.1)
        found = checked(rig)
    say(page.check_line(found))
    if not found.holds:
        raise ParameterError(f"{found.law} does not hold on {rig_file}: {found.reason}", do=found.advice)
    laws = list(dict.fromkeys((page.WITHOUT, rig.law_name)))
    with progress_bar(quiet=json) as progress:
        fitted = [rig.with_law(name).fitted() if name != rig.law_name else rig.fitted() for name in laws]
        ran = simulated(rig, fitted, rig_file.name, force=False, progress=progress)
    say(page.simulated_line(ran.traces))
    say(
        f"Live: {LENGTH:g} s in real time on a twin: drive, motor and cable of this rig, simulated in another process …"
    )
    session, ended = _live(rig, rig_file.name, out, verdict_of(rig.fitted(), found, rig_file.name), quiet=json)
    live = session.trace()
    say(page.live_line(live, ended))
    with progress_bar(quiet=json) as progress:
        progress("drawing the page", 0.8)
        text = page.demo_page(fit, found, ran.traces, live, ended, [] if log is None else words).html()
        write_text(html, text)
    if json:
        runs = [{"law": name, "rmse_deg": one.metrics().rmse_deg} for name, one in ran.traces.items()]
        kept = ("ended_well", "seconds_led", "rmse_deg", "peak_deg", "faults", "log")
        print_json(
            {
                "best": fit.best.name,
                "trust": fit.trust._asdict(),
                "verdict": found.verdict,
                "runs": runs,
                "live": {name: ended[name] for name in kept},
                "files": [str(file) for file in (model, rig_file, html)],
                "seconds": seconds(),
            }
        )
    else:
        print(f"\nPage: {html}  ({seconds():.0f} s)")
        if log is None:
            say_next("demo", "my.csv", why="with a log of your own")
        else:
            say_next("identify", *words, why="the same step by step: the page has the commands")
    if not ended["ended_well"]:
        raise typer.Exit(1)


def _live(
    rig: "Rig", name: str, out: Path, checked: "CheckVerdict", *, quiet: bool
) -> "tuple[Session, dict[str, Any]]":
    """A live run on a twin, and its summary; once more where this computer stalled.

    Raises:
        KeyboardInterrupt: the user ended it.
    """
    from bowden.face.run import live_session
    from bowden.live.operator import ending_signals, operate
    from bowden.live.summary import document
    from bowden.report.demo_page import by_the_computer

    for further in reversed(range(_TRIES)):
        with (
            ending_signals() as ending,
            live_session(rig, name, twin=True, out=out, force=False, tell=say_note, checked=checked) as session,
        ):
            operate(session, ending, auto=True, quiet=quiet)
        if ending.asked:
            raise KeyboardInterrupt
        found = document(session)
        if found["ended_well"] or not by_the_computer(found):
            break
        if further:
            say_note("this computer stalled and ended the run; once more")
            time.sleep(_PAUSE)  # a shared computer stalls for seconds at a time
    return session, found


COMMANDS = (
    Command(
        "demo",
        demo,
        "Show the main job on one page: from a log to a law that runs live on a twin.",
        ("bowden demo", "bowden demo my.csv", "bowden demo my.csv --unit deg --json"),
        place=3,
    ),
)
