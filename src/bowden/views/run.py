"""What a live run came to, in a terminal."""

from pathlib import Path
from typing import TYPE_CHECKING

from bowden.views.text import Call, free_name, say_next

if TYPE_CHECKING:
    from bowden.operations.run import RunResult


def show_run_to_end(found: "RunResult", call: Call) -> None:
    """Figures, what stopped it, its log, and what comes next."""
    from bowden.live.summary import print_summary
    from bowden.operations.support.results import json_of

    print_summary(json_of(found))
    if not found.log_lost:
        say_next_of(found, call)


def say_next_of(found: "RunResult", call: Call) -> None:
    """What ended a run that did not end as asked; a log that is in parts; the export of what has run, of each motor."""
    if not (found.ended_well and found.log_whole):
        say_next("log", "info" if found.log_whole else "recover", found.log)
        return
    options, motor = [*call.repeated("law", "preset")], call["motor"]
    for name, law in [(one.name, one.law) for one in found.motors] or [(motor, found.law)]:
        folder = Path("firmware", law if motor == name else name)
        of_motor = [] if name is None else ["--motor", name]
        say_next("export", call["rig"], *options, *of_motor, "--to", free_name(folder))
