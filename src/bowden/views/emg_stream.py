"""A recording that is played, in a terminal."""

from bowden.core.errors import counted
from bowden.operations.emg_stream import EmgServed, EmgStreamed
from bowden.views.text import Call


def show_emg_serve(found: EmgServed, call: Call) -> None:
    """Where it is heard, and what is in it."""
    print(f"{found.source}: {', '.join(found.channels)}, {found.rate_hz:g} Hz; Ctrl-C ends it")


show_emg_stream = show_emg_serve


def ended_emg_stream(found: EmgStreamed, call: Call) -> None:
    """How much was sent."""
    for sent in (count for counts in found.sent for count in counts):
        print(f"{counted(sent, 'sample')} of {counted(len(found.channels), 'channel')} sent")
