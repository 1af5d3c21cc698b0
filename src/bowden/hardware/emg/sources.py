"""A source of EMG from its name, as the command line and rig.toml give it."""

from collections.abc import Sequence
from pathlib import Path

from bowden.core.clock import TimeSource
from bowden.core.errors import StreamError
from bowden.hardware.emg.trigno_dialogue import Address
from bowden.hardware.ports import EmgStream

FORMS = "lsl:NAME, lsl:NAME#SOURCE_ID, trigno:HOST, trigno:HOST:COMMAND_PORT:EMG_PORT or file:PATH"
"""What can be written."""


def open_source(text: str, wanted: Sequence[str] = (), clock: TimeSource | None = None) -> EmgStream:
    """The source that `text` names, not yet opened.

    Args:
        text: one of `FORMS`.
        wanted: names of channels that it must have.
        clock: the monotonic clock of its times; this computer's where it is not given.

    Raises:
        StreamError: it names no source.
    """
    kind, _, rest = text.partition(":")
    if not rest.strip():
        there = f"write file:{text}" if text and Path(text).exists() else ""
        raise StreamError(f"{text!r} is not a source of EMG", expected=FORMS, do=there)
    if kind == "lsl":
        from bowden.hardware.emg.lsl import LslStream

        name, _, source = rest.rpartition("#") if "#" in rest else (rest, "", "")
        return LslStream(name, source, wanted, clock=clock)
    if kind == "trigno":
        from bowden.hardware.emg.trigno import TrignoStream

        return TrignoStream(_address(text, rest), wanted, clock)
    if kind == "file":
        from bowden.hardware.emg.playback import Playback

        return Playback(Path(rest), wanted)
    raise StreamError(f"{text!r} is not a source of EMG", expected=FORMS)


def _address(text: str, rest: str) -> Address:
    """Host and ports of a Trigno server."""
    host, *ports = rest.split(":")
    if not host or len(ports) > 2 or not all(port.isdecimal() and 0 < int(port) < 65536 for port in ports):
        raise StreamError(f"{text!r} is not a source of EMG", expected=FORMS)
    return Address(host, *map(int, ports))
