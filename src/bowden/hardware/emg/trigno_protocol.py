"""The Trigno SDK's protocol without its sockets: lines of the command port, samples of a data port, rates, columns.

As documented in Delsys' Trigno Wireless System SDK User's Guide (MAN-025): an ASCII command ends in CR LF CR LF, its
answer is one line; a data port sends 4-byte floats, one for each of 16 channels a sample, nothing between samples.
"""

import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import StreamError

COMMAND_PORT, EMG_PORT, LEGACY_EMG_PORT = 50040, 50043, 50041
"""TCP ports; the legacy one carries the first generations of sensors alone."""
SLOTS = 16
"""Sensors of a base station, and channels of an EMG port."""
GREETING = "Delsys Trigno System Digital Protocol Version"
"""How the server greets."""
INVALID, REFUSED = "INVALID COMMAND", "CANNOT COMPLETE"
"""Answers to a command that is unknown, and to one that cannot be done now."""
END = b"\r\n"
"""Of a line; a command ends in two."""
SAMPLE_BYTES = 4 * SLOTS
"""Of one sample of all channels."""
LEAST, LARGEST = 1e-6, 1e3
"""An electrode's signal is 0 or between these; the sensors' range is ± 11 mV or ± 22 mV [mV]."""
FRAME = 0.0135
"""What the server sends at once, as a rule [s]."""

_FIXED_RATES = {
    (EMG_PORT, True): 2000.0,
    (EMG_PORT, False): 15.0 / FRAME,
    (LEGACY_EMG_PORT, True): 2000.0,
    (LEGACY_EMG_PORT, False): 26.0 / FRAME,
}
"""Port and upsampling → samples a second in backwards compatibility [Hz] (MAN-025-3, 6.1.2)."""
_FACTORS = {"V": 1e3, "VOLTS": 1e3, "MV": 1.0, "MILLIVOLTS": 1.0, "UV": 1e-3, "MICROVOLTS": 1e-3}
"""Unit as the server writes it, in capitals → mV."""


_TEXT = frozenset((*b"\t\n\r", *range(32, 127)))
"""Bytes of a line: nothing that a terminal would take for an order."""


class Lines:
    """Lines out of a byte stream, however it is cut.

    >>> lines = Lines()
    >>> lines.feed(b"OK\\r"), lines.feed(b"\\n\\r\\nYES\\r\\n")
    ([], ['OK', 'YES'])
    """

    LONGEST = 512
    """A line of more is none of this protocol [bytes]."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> list[str]:
        """The lines that are complete now, without empty ones.

        Raises:
            StreamError: what comes is no line of text.
        """
        *whole, self._rest = (self._rest + data).split(END)
        long = max(map(len, (*whole, self._rest))) > self.LONGEST
        if long or any(byte not in _TEXT for line in (*whole, self._rest) for byte in line):
            raise StreamError(
                f"the command port sends {shown(b''.join(whole) + self._rest)}, which is no text",
                expected="a Trigno SDK server",
                do="look at host and port",
            )
        return [line.decode("ascii").strip() for line in whole if line.strip()]


class Samples:
    """Samples out of a data port's bytes, however they are cut.

    >>> samples = Samples()
    >>> data = np.arange(32, dtype="<f4").tobytes()
    >>> samples.feed(data[:70]).shape, samples.feed(data[70:])[0, 3]
    ((1, 16), np.float32(19.0))
    """

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> NDArray[np.float32]:
        """Samples that are complete now, as they were sent (n, 16)."""
        data = self._rest + data
        whole = len(data) - len(data) % SAMPLE_BYTES
        self._rest = data[whole:]
        return np.frombuffer(data[:whole], dtype="<f4").reshape(-1, SLOTS)


class EmgColumn(NamedTuple):
    """One channel of EMG among those of a data port."""

    name: str
    place: int
    """From 0."""
    factor: float
    """Sent value → mV."""


class SensorAnswers(NamedTuple):
    """What the server says of a paired sensor, as it says it."""

    slot: int
    start: str
    """To STARTINDEX?"""
    channels: str
    """To EMGCHANNELCOUNT?"""
    unit: str
    """To CHANNEL 1 UNITS?"""


def columns_of(sensors: Sequence[SensorAnswers]) -> list[EmgColumn]:
    """Where the sensors' EMG is among a port's channels.

    A server that does not know the question has one channel a sensor, in volts, in the order of the slots. The guide's
    examples count start indices from 0 and from 1; they count from 0 where one is 0 or all are one below their slots.

    Raises:
        StreamError: indices that cannot be, or a unit that is none of a voltage.
    """
    starts = [sensor.slot if refused(sensor.start) else _whole(sensor.start, "STARTINDEX?") for sensor in sensors]
    slots = [sensor.slot for sensor in sensors]
    base = 0 if 0 in starts or starts == [slot - 1 for slot in slots] else 1
    columns = []
    for sensor, start in zip(sensors, starts, strict=True):
        count = 1 if refused(sensor.channels) else _whole(sensor.channels, "EMGCHANNELCOUNT?")
        unit = "V" if refused(sensor.unit) else sensor.unit.strip().upper()
        if count and unit not in _FACTORS:
            raise StreamError(f"the EMG of sensor {sensor.slot} is in {sensor.unit!r}", expected="volts or millivolts")
        for k in range(count):
            name = f"sensor{sensor.slot}" + (f".{k + 1}" if k else "")
            columns.append(EmgColumn(name, start - base + k, _FACTORS[unit]))
    places = [column.place for column in columns]
    if len(set(places)) < len(places) or not all(0 <= place < SLOTS for place in places):
        raise StreamError(
            f"the sensors' start indices are {starts}", expected=f"{SLOTS} different places", do="pair them again"
        )
    return columns


def rate_of(port: int, compatible: str, upsampling: str, interval: str, most: str) -> float:
    """Samples a second of an EMG port, from the server's answers [Hz].

    Args:
        port: `EMG_PORT` or `LEGACY_EMG_PORT`, wherever they really are.
        compatible: to BACKWARDS COMPATIBILITY?
        upsampling: to UPSAMPLING?
        interval: to FRAME INTERVAL?
        most: to MAX SAMPLES EMG?

    Raises:
        StreamError: answers that are none.

    >>> rate_of(EMG_PORT, "NO", "NO", "0.0135", "26")
    1925.9259259259259
    """
    if not refused(compatible) and yes(compatible, "BACKWARDS COMPATIBILITY?"):
        return _FIXED_RATES[port, refused(upsampling) or yes(upsampling, "UPSAMPLING?")]
    if refused(interval) or refused(most):
        return _FIXED_RATES[LEGACY_EMG_PORT, True]
    seconds, samples = _number(interval, "FRAME INTERVAL?"), _number(most, "MAX SAMPLES EMG?")
    if not (seconds > 0.0 and samples > 0.0):
        raise StreamError(
            f"the Trigno server has {samples:g} samples of EMG in a frame of {seconds:g} s",
            do="take a sensor out of its dock, and restart the server",
        )
    return samples / seconds


def refused(answer: str) -> bool:
    """True if the server does not know a question or does not answer it now."""
    return answer.upper() in (INVALID, REFUSED)


def yes(answer: str, question: str) -> bool:
    """An answer that is yes or no; servers write YES, ON, UPSAMPLING ON.

    Raises:
        StreamError: it is neither.
    """
    word = answer.upper().split()[-1] if answer.split() else ""
    if word not in ("YES", "ON", "NO", "OFF"):
        raise _odd(answer, question)
    return word in ("YES", "ON")


def shown(data: bytes, most: int = 24) -> str:
    """Bytes for a message."""
    text = re.sub(r"[^ -~]", "·", data[:most].decode("latin-1"))
    return repr(text + ("…" if len(data) > most else ""))


def _number(answer: str, question: str) -> float:
    try:
        return float(answer.split()[-1])
    except (ValueError, IndexError):
        raise _odd(answer, question) from None


def _whole(answer: str, question: str) -> int:
    value = _number(answer, question)
    if not 0.0 <= value <= 1000.0 or value != round(value):
        raise _odd(answer, question)
    return round(value)


def _odd(answer: str, question: str) -> StreamError:
    return StreamError(f"the Trigno server answers {question} with {answer!r}", do="start it again")
