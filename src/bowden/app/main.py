"""The command ``bowden``: its operations as their files declare them, and every failure as one line and an exit code.

Nothing heavy is imported here or at the top of an operation's module, so that ``bowden --help`` answers at once.
"""

import gc
import io
import os
import sys
from typing import Annotated

import typer

from bowden import __version__
from bowden.app.command_line import command
from bowden.app.console import InterruptedPartway
from bowden.app.interrupts import delivered
from bowden.core.errors import BowdenError
from bowden.core.files import printable, shortened
from bowden.operations.support.operation import declared

_USAGE_ERROR: type[Exception] = typer.BadParameter.__bases__[0]
"""What typer raises for a wrong option or argument; it gives no public name to this class."""


_POSIX = ("fcntl", "resource", "termios", "tty")
"""Modules that Windows has not."""
_LONGEST = 2000
"""Of the line that says why a command failed [characters]."""


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"bowden {__version__}")
        raise typer.Exit


def _bowden(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version and exit.", is_eager=True, callback=_print_version)
    ] = False,
) -> None:
    """From a cable's log to a compensated cable: models, identification, control laws, simulation."""


def application(first_word: str = "") -> typer.Typer:
    """The command with what its files declare, as `bowden.operations.support.operation.declared` has it.

    Args:
        first_word: of the command line; an option, or nothing, for all commands.
    """
    whole = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)
    whole.callback()(_bowden)
    operations, groups = declared("" if first_word.startswith("-") else first_word)
    inside = {word: typer.Typer(add_completion=False, rich_markup_mode=None) for word in sorted(groups)}
    for one in operations:
        *group, name = one.words.split()
        examples = "\n".join(f"  {example}" for example in one.examples)
        owner = inside[group[0]] if group else whole
        owner.command(name, short_help=one.summary, epilog=f"\b\nExamples:\n{examples}")(command(one))
    for word, group_ in inside.items():
        whole.add_typer(group_, name=word, help=groups[word])
    return whole


def run(arguments: list[str]) -> int:
    """Run one command line and return its exit code: 0, 2 for anything the user can mend, 130 when interrupted."""
    try:
        with delivered():
            words = arguments or ["--help"]
            code = application(words[0])(words, prog_name="bowden", standalone_mode=False)
    except BowdenError as error:
        code = _fail(str(error), 2)
        for note in getattr(error, "__notes__", ()):  # a Next:, of a command that has one though it failed
            print(printable(note), file=sys.stderr)
        return code
    except _USAGE_ERROR as error:
        where = getattr(getattr(error, "ctx", None), "command_path", "bowden")
        message = getattr(error, "format_message", error.__str__)()
        said = f"{message} See" if message.endswith("?") else f"{message.rstrip('.')}; see"
        return _fail(f"{said} {where} --help", 2)
    except InterruptedPartway as error:
        return _fail(f"interrupted; {error}", 130)
    except OSError as error:  # what no command foresaw: a disk that goes away, a standard output that is full
        where = f" ({error.filename})" if error.filename else ""
        return _fail(f"{error.strerror or error}{where}; check the paths and the room on their disk", 2)
    except ModuleNotFoundError as error:
        if error.name not in _POSIX:
            raise
        return _fail(f"this system has no {error.name}; expected Linux for it; use WSL 2 there", 2)
    except (KeyboardInterrupt, typer.Abort):
        code = 130
    return _fail("interrupted", 130) if code == 130 else int(code or 0)


def _fail(message: str, code: int) -> int:
    """One line, whatever of a file is quoted in it: not endless, and no order to a terminal."""
    line = printable(" ".join(message.split()))
    print(f"bowden: {shortened(line, _LONGEST)}", file=sys.stderr)
    return code


def main() -> None:
    """Entry point of the command ``bowden``."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # matrices are small: threads would wait for one another
    gc.set_threshold(100_000, 20, 20)  # an eighth of the start would be searches for garbage in what is just imported
    sys.stdout, sys.stderr = (one or open(os.devnull, "w") for one in (sys.stdout, sys.stderr))  # noqa: SIM115  # closed
    for output in (sys.stdout, sys.stderr):
        if isinstance(output, io.TextIOWrapper):
            output.reconfigure(errors="backslashreplace")  # a terminal without Greek letters is no reason to fail
    sys.exit(run(sys.argv[1:]))
