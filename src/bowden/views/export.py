"""What an export wrote, in a terminal."""

import shlex

from bowden.operations.export import Exported
from bowden.views.text import Call


def show_export(found: Exported, call: Call) -> None:
    """The files, and what comes next."""
    print(f"{found.law} in {found.precision}: {', '.join(file.name for file in found.files)}")
    print(f"Wrote {call['folder']}  ({call.seconds:.1f} s)")
    print(f"Next: {shlex.join(['make', '-C', str(call['folder']), 'check'])}  # replays a run of the rig in C")
