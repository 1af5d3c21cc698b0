"""The command ``bowden``: registers the commands, and turns every failure into one line and an exit code.

Nothing heavy is imported here or at the top of a command's module, so that ``bowden --help`` answers at once.
"""

import gc
import io
import sys
from collections.abc import Callable
from typing import Annotated, NamedTuple

import typer

from bowden import __version__
from bowden.app import arm_command
from bowden.app.campaign_command import campaign
from bowden.app.check_command import check
from bowden.app.console import InterruptedPartway
from bowden.app.doctor_command import doctor
from bowden.app.emg_calibrate_command import calibrate
from bowden.app.emg_command import score
from bowden.app.emg_stream_command import serve, stream
from bowden.app.export_command import export as export_law
from bowden.app.identify_command import identify
from bowden.app.identify_servo_command import identify_servo
from bowden.app.init_command import init
from bowden.app.interrupts import delivered
from bowden.app.league_command import league
from bowden.app.log_command import export, info, plot, recover, replay
from bowden.app.measure_command import measure
from bowden.app.reproduce_command import reproduce
from bowden.app.run_command import run as run_live
from bowden.app.simulate_command import simulate
from bowden.app.tune_command import tune
from bowden.app.twin_command import twin
from bowden.core.errors import BowdenError


class _Entry(NamedTuple):
    """A command."""

    function: Callable[..., None]
    summary: str
    """One line for ``bowden --help``."""
    examples: list[str]


_COMMANDS = [
    _Entry(
        init,
        "Write a commented rig.toml of the default bench.",
        ["bowden init", "bowden init my_rig.toml --force"],
    ),
    _Entry(
        identify,
        "Identify a cable from a log of its motion.",
        ["bowden identify log.csv", "bowden identify log.csv.gz --out out/cable", "bowden identify log.csv --json"],
    ),
    _Entry(
        simulate,
        "Simulate one law or several on a rig.",
        [
            "bowden simulate rig.toml",
            "bowden simulate rig.toml --law uncompensated --law observer --law adaptive",
            "bowden simulate rig.toml --law my_law.py --duration 30 --csv",
            "bowden simulate rig.toml --law adaptive --preset paper --force --json",
        ],
    ),
    _Entry(
        identify_servo,
        "Identify a servo from a log of a step or a chirp.",
        ["bowden identify-servo step.csv", "bowden identify-servo chirp.csv --command target --unit deg --json"],
    ),
    _Entry(
        measure,
        "Move the motor of a rig, and leave logs for identify and identify-servo.",
        ["bowden measure rig.toml", "bowden measure rig.toml --twin --auto"],
    ),
    _Entry(
        run_live,
        "Run a law live on a rig's drive, under the supervisor.",
        ["bowden run rig.toml", "bowden run rig.toml --twin --auto --duration 20", "bowden run rig.toml --law bowden"],
    ),
    _Entry(
        doctor,
        "Say what this machine can hold at 1 kHz, and what to change.",
        ["bowden doctor", "bowden doctor --seconds 60 --cpu 1 --json"],
    ),
    _Entry(
        check,
        "Say whether a rig's gains hold, before anything moves.",
        [
            "bowden check rig.toml",
            "bowden check rig.toml --preset paper",
            "bowden check rig.toml --law my_law.py --json",
        ],
    ),
    _Entry(
        league,
        "Compare control laws on plants that nobody tuned them for.",
        [
            "bowden league",
            "bowden league --laws adaptive --laws bowden --plants bench --plants play",
            "bowden league --law my_law.py:MINE --scenarios periodic,fast --json",
        ],
    ),
    _Entry(
        campaign,
        "Run thousands of closed loops with random plants, gains and faults.",
        [
            "bowden campaign study.toml",
            "bowden campaign study.toml --out out/study --workers 2 --json",
            "bowden campaign study.toml --cluster tcp://127.0.0.1:8786",
            "bowden campaign study.toml --run 17",
        ],
    ),
    _Entry(
        tune,
        "Find gains for a rig, with margins, and write them into it.",
        ["bowden tune rig.toml", "bowden tune rig.toml --dry-run --json", "bowden tune rig.toml --study study.toml"],
    ),
    _Entry(
        export_law,
        "Write a law as C99 for a microcontroller.",
        [
            "bowden export rig.toml --law bowden --to firmware/law",
            "bowden export rig.toml --to firmware/law --float32 --emg --safety",
        ],
    ),
    _Entry(
        twin,
        "Run a digital twin of a rig's drive, and give it faults.",
        [
            "bowden twin rig.toml",
            "bowden twin rig.toml --status",
            "bowden twin rig.toml --inject 'encoder_frozen joint' --after 2 --for 0.5",
        ],
    ),
    _Entry(
        reproduce,
        "Reproduce the paper's bench, claim by claim.",
        ["bowden reproduce", "bowden reproduce --only table1 --only fig16", "bowden reproduce --json"],
    ),
]

_LOG_COMMANDS = [
    _Entry(info, "Say what a log holds.", ["bowden log info run.mcap", "bowden log info run.mcap --json"]),
    _Entry(
        recover,
        "Save what a kill or a full disk left of a log.",
        ["bowden log recover run.mcap", "bowden log recover run.mcap --out saved.mcap"],
    ),
    _Entry(
        export,
        "Write a log as Parquet or CSV.",
        ["bowden log export run.mcap", "bowden log export run.mcap --to csv --out run.csv"],
    ),
    _Entry(plot, "Draw a log as a page.", ["bowden log plot run.mcap", "bowden log plot run.mcap --out page.html"]),
    _Entry(
        replay,
        "Feed a run through a law and the supervisor again.",
        ["bowden log replay run.mcap", "bowden log replay run.mcap --law my_law.py:MINE --json"],
    ),
]

_EMG_COMMANDS = [
    _Entry(
        calibrate,
        "Measure a wearer's rest and maximum contraction.",
        [
            "bowden emg calibrate mvc.csv",
            "bowden emg calibrate mvc.csv --rest rest.csv --out anna.toml",
            "bowden emg calibrate --source lsl:EMG --channel biceps --seconds 5 --out anna.toml",
        ],
    ),
    _Entry(
        score,
        "Say how well contractions are found in a recording.",
        ["bowden emg score biceps.csv", "bowden emg score biceps.csv --labels biceps.labels.csv --json"],
    ),
    _Entry(
        stream,
        "Play a recording in real time as a stream of LSL.",
        ["bowden emg stream biceps.csv", "bowden emg stream biceps.csv --name EMG --loop --wait"],
    ),
    _Entry(
        serve,
        "Play a recording in real time as a Trigno base station.",
        ["bowden emg serve biceps.csv", "bowden emg serve biceps.csv --loop --fault late=0.1 --fault torn"],
    ),
]

_ARM_COMMANDS = [
    _Entry(
        arm_command.check,
        "Compare the suit's geometry and elbow with MuJoCo's.",
        ["bowden arm check", "bowden arm check --mass-kg 120 --height-m 1.9 --load-kg 2 --json"],
    ),
    _Entry(
        arm_command.render,
        "Draw the suit on the arm, and a run as a video.",
        ["bowden arm render", "bowden arm render out/simulate/adaptive.parquet --speed 2 --out out/arm"],
    ),
]

_USAGE_ERROR: type[Exception] = typer.BadParameter.__bases__[0]
"""What typer raises for a wrong option or argument; it gives no public name to this class."""

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"bowden {__version__}")
        raise typer.Exit


@app.callback()
def _bowden(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version and exit.", is_eager=True, callback=_print_version)
    ] = False,
) -> None:
    """From a cable's log to a compensated cable: models, identification, control laws, simulation."""


_log = typer.Typer(add_completion=False, rich_markup_mode=None)


def _register(group: typer.Typer, entries: list[_Entry]) -> None:
    for entry in entries:
        examples = "\n".join(f"  {example}" for example in entry.examples)
        group.command(short_help=entry.summary, epilog=f"\b\nExamples:\n{examples}")(entry.function)


_register(app, _COMMANDS)
_register(_log, _LOG_COMMANDS)
_emg = typer.Typer(add_completion=False, rich_markup_mode=None)
_register(_emg, _EMG_COMMANDS)
_arm = typer.Typer(add_completion=False, rich_markup_mode=None)
_register(_arm, _ARM_COMMANDS)
app.add_typer(_arm, name="arm", help="The suit on the arm in MuJoCo: a check, pictures, a video.")
app.add_typer(_emg, name="emg", help="Contractions of a muscle in its EMG.")
app.add_typer(_log, name="log", help="What is in the log of a run, and what can be made of it.")


def run(arguments: list[str]) -> int:
    """Run one command line and return its exit code: 0, 2 for anything the user can mend, 130 when interrupted."""
    try:
        with delivered():
            code = app(arguments, prog_name="bowden", standalone_mode=False)
    except BowdenError as error:
        return _fail(str(error), 2)
    except _USAGE_ERROR as error:
        where = getattr(getattr(error, "ctx", None), "command_path", "bowden")
        message = getattr(error, "format_message", error.__str__)()
        return _fail(f"{message.rstrip('.')}; see {where} --help", 2)
    except InterruptedPartway as error:
        return _fail(f"interrupted; {error}", 130)
    except OSError as error:  # what no command foresaw: a disk that goes away, a standard output that is full
        where = f" ({error.filename})" if error.filename else ""
        return _fail(f"{error.strerror or error}{where}; check the paths and the room on their disk", 2)
    except (KeyboardInterrupt, typer.Abort):
        code = 130
    return _fail("interrupted", 130) if code == 130 else int(code or 0)


def _fail(message: str, code: int) -> int:
    print("bowden: " + " ".join(message.split()), file=sys.stderr)
    return code


def main() -> None:
    """Entry point of the command ``bowden``."""
    gc.set_threshold(100_000, 20, 20)  # an eighth of the start would be searches for garbage in what is just imported
    for output in (sys.stdout, sys.stderr):
        if isinstance(output, io.TextIOWrapper):
            output.reconfigure(errors="backslashreplace")  # a terminal without Greek letters is no reason to fail
    sys.exit(run(sys.argv[1:]))
