"""The Lab Streaming Layer's library, and what a stream says of itself, read and checked: rate, channels, unit."""

import functools
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from bowden.core.errors import StreamError, counted
from bowden.core.files import printable
from bowden.sensing.onset_settings import QUICKEST, SAFE

TYPES = ("EMG", "SEMG", "EXG")
"""Content types of streams that hold EMG, in capitals."""
MOST_CHANNELS = 512
"""No amplifier has more; as many of one sample each are what a look may have to hold."""
_STRING = 3
"""LSL's channel format of text."""
_UNITS = {
    **dict.fromkeys(("microvolts", "microvolt", "uv", "µv", "μv"), "µV"),
    **dict.fromkeys(("millivolts", "millivolt", "mv"), "mV"),
    **dict.fromkeys(("volts", "volt", "v"), "V"),
}


def check_info(info: Any, name: str) -> None:
    """See that a stream is EMG at a rate that the detector takes.

    Raises:
        StreamError: another content, text in place of numbers, an irregular rate or one that is out of range, more
            channels than any amplifier has.
    """
    if info.channel_format() == _STRING:
        raise StreamError(
            f"the LSL stream {name!r} ({shown([info.type() or 'no type'])}) holds text", expected="numbers"
        )
    if info.type().upper() not in TYPES:
        raise StreamError(
            f"the LSL stream {name!r} has the type {info.type()!r}", expected="EMG", do="let its sender declare it"
        )
    if not 0 < info.channel_count() <= MOST_CHANNELS:
        raise StreamError(
            f"the LSL stream {name!r} has {info.channel_count()} channels", expected=f"1 to {MOST_CHANNELS}"
        )
    rate = info.nominal_srate()
    if rate == 0.0:
        raise StreamError(
            f"the LSL stream {name!r} has an irregular rate", expected="a rate that it declares and keeps"
        )
    check_rate(rate, f"the LSL stream {name!r}")


def channel_names(info: Any, wanted: Sequence[str] = ()) -> tuple[str, ...]:
    """Names of the channels; ``ch1``, ``ch2`` … where the stream does not describe them.

    Raises:
        StreamError: it describes another number of channels than it has, leaves one without a name, gives two the same,
            or has none of a name that is `wanted`.
    """
    name, count = info.name(), info.channel_count()
    labels = _described(info, "label")
    if labels and len(labels) != count:
        raise StreamError(f"the LSL stream {name!r} has {counted(count, 'channel')} and describes {len(labels)}")
    names = tuple(labels) or tuple(f"ch{k}" for k in range(1, count + 1))
    odd = next((one for one in names if not one.isprintable()), None)
    if odd is not None:
        raise StreamError(f"a channel of the LSL stream {name!r} is named {odd[:40]!r}", expected="text")
    if "" in names:
        raise StreamError(f"channel {names.index('') + 1} of the LSL stream {name!r} has no name")
    twice = next((one for one in names if names.count(one) > 1), None)
    if twice is not None:
        raise StreamError(f"two channels of the LSL stream {name!r} are named {twice!r}", expected="a name for each")
    check_wanted(names, wanted, f"the LSL stream {name!r}")
    return names


def check_rate(rate: float, where: str) -> None:
    """See that a rate is one by whose contractions something may be moved.

    Raises:
        StreamError: it is not.
    """
    if not SAFE <= rate <= QUICKEST:
        raise StreamError(f"{where} has {rate:.6g} samples a second", expected=f"{SAFE:g} to {QUICKEST:g} Hz")


def check_wanted(names: Sequence[str], wanted: Sequence[str], where: str) -> None:
    """See that channels are there.

    Raises:
        StreamError: one is not.
    """
    for one in wanted:
        if one not in names:
            raise StreamError(f"{where} has no channel {one!r}", expected=f"one of {', '.join(map(repr, names))}")


def unit_of(info: Any) -> str:
    """The channels' unit, where all have the same; empty otherwise."""
    units = {_UNITS.get(unit.lower(), unit) for unit in _described(info, "unit")}
    return shown([units.pop()], 20) if len(units) == 1 else ""


def shown(texts: Sequence[str], most: int = 80) -> str:
    """What a sender says of itself, fit for a message or a screen.

    >>> shown(["lab", "\\x1b[2J" + 100 * "a"], 10)
    'lab, ·[2Jaaaaaa…'
    """
    cut = (text[:most] + ("…" if len(text) > most else "") for text in texts)
    return ", ".join(map(printable, cut))


def which(name: str, sources: Sequence[str]) -> str:
    """What to do about several streams of one name, given their source ids.

    >>> which("EMG", ["a", "b"]), which("EMG", ["a", "a"])
    ('choose one by its source id, lsl:EMG#ID', 'end all of them but one, or give each a name or source id of its own')
    """
    if any(source and sources.count(source) == 1 for source in sources):
        return f"choose one by its source id, lsl:{name}#ID"
    return "end all of them but one, or give each a name or source id of its own"


def _described(info: Any, what: str) -> list[str]:
    """One entry of each channel's description, at most one more than there may be; none where none is described."""
    found: list[str] = []
    channel = info.desc().child("channels").child("channel")
    while not channel.empty() and len(found) <= MOST_CHANNELS:
        found.append(str(channel.child_value(what)).strip())
        channel = channel.next_sibling("channel")
    return found if any(found) else []


_PLACES = ("lsl_api.cfg", "~/lsl_api/lsl_api.cfg", "/etc/lsl_api/lsl_api.cfg")
"""Where liblsl looks for its configuration, after the file that the variable LSLAPICFG names."""
_QUIET = "\n[log]\nlevel = -3\n"
"""What liblsl prints to standard error by itself is said in our own words."""


@functools.cache
def library() -> Any:
    """The module pylsl, with the user's lsl_api.cfg in force.

    Raises:
        StreamError: it is not installed, or its liblsl does not load.
    """
    try:
        import pylsl
    except ImportError as error:
        raise StreamError("the Lab Streaming Layer is not installed", do='pip install "bowden[lsl]"') from error
    except (RuntimeError, OSError) as error:
        raise StreamError(
            f"liblsl does not load: {error}", do="install the extra lsl again: pip install --force-reinstall pylsl"
        ) from error
    text = _configuration()
    if "[log]" not in text.lower() and hasattr(pylsl.util.lib, "lsl_set_config_content"):
        pylsl.util.set_config_content(text + _QUIET)
    return pylsl


def _configuration() -> str:
    """The user's lsl_api.cfg, empty where there is none."""
    for place in (os.environ.get("LSLAPICFG", ""), *_PLACES):
        path = Path(place).expanduser()
        if place and path.is_file():
            try:
                return path.read_text(encoding="utf-8", errors="replace")
            except OSError:
                continue
    return ""
