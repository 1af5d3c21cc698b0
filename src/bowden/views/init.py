"""What `init` wrote, in a terminal."""

from bowden.operations.init import Initialised
from bowden.views.text import Call, say_next


def show_init_file(found: Initialised, call: Call) -> None:
    """The file, what the rig has and why, and what comes next."""
    path = call["path"]
    print(f"Wrote {path}")
    for line in found.said:
        print(line)
    say_next(*(("run", path, "--twin") if call["suit"] else ("simulate", path)))
