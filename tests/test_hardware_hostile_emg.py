"""Streams of EMG against senders that do harm: tables of attacks, and what must come of each.

Whatever comes, times increase and are never of the future, values are numbers of an electrode or missing, nothing is
raised, and `close` ends it. A sample of the attacks runs always, all of them by ``make long`` and ``make soak``.
"""

import contextlib
import math
import os
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from bowden.core.errors import StreamError
from bowden.hardware.emg import trigno, trigno_dialogue
from bowden.hardware.emg.listener import Listener
from bowden.hardware.emg.lsl import LslStream
from bowden.hardware.emg.trigno import TrignoStream
from bowden.hardware.emg.trigno_dialogue import Address
from bowden.hardware.ports import EmgStream
from live_runs import tries
from support import hostile_outlet, hostile_trigno
from support.hostile_outlet import HostileOutlet
from support.hostile_trigno import FRAME, HostileTrigno, whole

HERE = f"{os.getpid()}"
LISTENED = 6.5
"""How long a stream that was opened is listened to [s]."""
OLD = 0.2
"""What the supervisor takes for lost by default, `emg_age` [s]."""


@dataclass(frozen=True)
class Heard:
    """What came of a stream."""

    refused: str = ""
    """Why it was not opened."""
    lost: tuple[str, ...] = ()
    """Why it was lost, each reason in its turn; the empty one between them where it was alive again."""
    age: float = 0.0
    """Of the newest sample, at its oldest after the first [s]."""
    trouble: float = 0.0
    closed_in: float = 0.0
    """[s]"""


@dataclass(frozen=True)
class Row:
    """What an attack must come to."""

    attack: Any
    refused: str = ""
    """In the one line that refuses the stream; empty where it is opened."""
    lost: str = ""
    """Among the reasons for which it is lost; empty where it is never."""
    old: bool = False
    """Whether its newest sample becomes too old, so that the supervisor releases."""
    trouble: bool = False
    """Whether the detector is in trouble at the end."""


def listened(stream: EmgStream, seconds: float = LISTENED) -> Heard:
    """Open a stream and listen to it, as the process does that reads EMG; the laws that hold for any sender."""
    refused = ""
    try:
        said = stream.open()
    except StreamError as error:
        said = refused = str(error)
    assert said.isprintable(), "it is one line of text"
    if refused:
        return Heard(refused)
    listener, lost, last, age = Listener(stream.rate, 0), [""], -math.inf, 0.0
    end = time.monotonic() + seconds
    while (now := time.monotonic()) < end:
        chunk = stream.read(now)
        assert len(chunk.times) == len(chunk.values) <= 12.0 * stream.rate
        if len(chunk.times):
            assert np.all(np.diff(chunk.times, prepend=last) > 0.0)
            last = float(chunk.times[-1])
            assert last <= time.monotonic() + 1e-3
            size = np.abs(chunk.values[np.isfinite(chunk.values)])
            assert np.all((size == 0.0) | ((size > 1e-300) & (size < 1e12)))
        reading = listener.take(chunk, now)
        assert math.isfinite(reading.level)
        age = max(age, now - reading.newest * 1e-9 if reading.newest else 0.0)
        if stream.lost() != lost[-1]:
            lost.append(stream.lost())
            assert lost[-1].isprintable()
        time.sleep(0.002)
    assert len(lost) < 10 * LISTENED, "what is said is not more than can be read"
    begin = time.monotonic()
    stream.close()
    return Heard("", tuple(lost), age, reading.trouble, time.monotonic() - begin)


def complaints(row: Row, heard: Heard) -> Iterator[str]:
    """What has come of an attack and should not have."""
    if (row.refused or "<opened>") not in (heard.refused or "<opened>"):
        yield f"refused with {heard.refused!r}"
    if row.refused:
        return
    if row.lost and not any(row.lost in reason for reason in heard.lost):
        yield f"lost with {heard.lost}"
    if not row.lost and any(heard.lost):
        yield f"lost with {heard.lost}, and should not be"
    if (heard.age > OLD) is not row.old:
        yield f"its newest sample is {heard.age:.3g} s old at its oldest"
    if (heard.trouble > 0.0) is not row.trouble and not row.old:
        yield f"trouble is {heard.trouble:g}"
    if heard.closed_in > 2.0:
        yield f"it took {heard.closed_in:.3g} s to close"


def at_once(rows: Mapping[str, Row], names: Iterable[str], one: Callable[[str, Row], Heard]) -> dict[str, list[str]]:
    """Attacks side by side, and what is to be complained of, where there is anything."""
    names = list(names)
    with ThreadPoolExecutor(len(names)) as pool:
        heard = list(pool.map(one, names, (rows[name] for name in names)))
    found = {name: list(complaints(rows[name], said)) for name, said in zip(names, heard, strict=True)}
    return {name: said for name, said in found.items() if said}


def wrong(rows: Mapping[str, Row], names: str, one: Callable[[str, Row], Heard]) -> dict[str, list[str]]:
    """The same; what is complained of is tried once more, for a computer may stall."""
    found = {name: ["it has not been tried"] for name in names.split(", ")}
    for _ in tries():
        found = at_once(rows, found, one)
        if not found:
            break
    return found


def outlet(spoils: Any = hostile_outlet.as_it_is, **more: Any) -> hostile_outlet.Attack:
    return hostile_outlet.Attack(spoils=spoils, **more)


def jumbled(values: Any, stamps: Any) -> Any:
    return values, stamps + np.random.default_rng(len(values)).uniform(-1.0, 1.0, len(stamps))


def stuck(values: Any, stamps: Any) -> Any:
    """Seven tenths of a second of noise, for ever, with fresh stamps."""
    said = np.random.default_rng(7).standard_normal(700)
    return said[np.round(stamps * hostile_outlet.RATE).astype(int) % 700, None], stamps


def shifted_by(seconds: float) -> Any:
    """From now on."""
    return lambda values, stamps: (values, stamps + seconds)


def now_and_then(seconds: float) -> Any:
    """In every fourth quarter of a second."""
    return lambda values, stamps: (values, stamps + seconds * (stamps[:1] % 1.0 > 0.75))


def repeated(times: int) -> Any:
    return lambda values, stamps: (np.repeat(values, times, 0), np.repeat(stamps, times))


OUTLETS: dict[str, Row] = {
    "does no harm": Row(outlet()),
    "stamps that are no numbers": Row(outlet(lambda v, s: (v, s * np.nan)), lost="no numbers", old=True),
    "infinite stamps": Row(outlet(lambda v, s: (v, s + np.inf)), lost="no numbers", old=True),
    "stamps of the end of time": Row(outlet(lambda v, s: (v, s + 1e300)), lost="in the future", old=True),
    "stamps of before time": Row(outlet(lambda v, s: (v, s - 1e300)), lost="go back", old=True),
    "stamps of the future": Row(outlet(lambda v, s: (v, s + 3.0)), lost="in the future", old=True),
    "old samples": Row(outlet(lambda v, s: (v, s - 5.0)), lost="go back", old=True),
    "stamps that jump about": Row(outlet(jumbled), lost="sends stamps that", old=True),
    "stamps 300 ms ahead": Row(outlet(shifted_by(0.3)), lost="in the future", old=True),
    "stamps 300 ms back": Row(outlet(shifted_by(-0.3)), lost="go back", old=True),
    "stamps 300 ms ahead now and then": Row(outlet(now_and_then(0.3)), lost="in the future", old=True),
    "stamps 300 ms back now and then": Row(outlet(now_and_then(-0.3)), lost="go back", old=True),
    "stamps 12 s ahead": Row(outlet(shifted_by(12.0)), lost="in the future", old=True),
    "stamps 12 s back": Row(outlet(shifted_by(-12.0)), lost="go back", old=True),
    "stamps 12 s ahead now and then": Row(outlet(now_and_then(12.0)), lost="in the future", old=True),
    "stamps back by one sample": Row(outlet(lambda v, s: (v, s[::-1]))),
    "two channels swapped": Row(outlet(lambda v, s: (v[:, ::-1], s), channels=2)),
    "comes back with its channels swapped": Row(
        outlet(
            channels=2,
            labels=("flexor", "extensor"),
            closes_after=2.0,
            again_with=2,
            labels_again=("extensor", "flexor"),
        ),
        lost="has come back with other channels",
        old=True,
    ),
    "comes back as it was": Row(
        outlet(channels=2, labels=("flexor", "extensor"), closes_after=3.0, again_with=2), lost="nothing from", old=True
    ),
    "one stamp for all": Row(outlet(lambda v, s: (v, s // 100.0 * 0.0 + s[:1])), lost="", old=False),
    "half the rate": Row(outlet(lambda v, s: (v[::2], s[::2])), lost="declares 1000 Hz and sends", old=True),
    "twice the rate": Row(outlet(repeated(2)), lost="declares 1000 Hz and sends", old=True),
    "a flood": Row(outlet(repeated(300)), lost="declares 1000 Hz and sends", old=True),
    "no numbers": Row(outlet(lambda v, s: (v * np.nan, s)), old=True),
    "infinite values": Row(outlet(lambda v, s: (v * np.inf, s)), old=True),
    "huge values": Row(outlet(lambda v, s: (v * 1e200, s)), old=True),
    "denormal values": Row(outlet(lambda v, s: (v * 1e-310, s)), old=True),
    "one in ten is none": Row(outlet(lambda v, s: (np.where(np.arange(len(v))[:, None] % 10, v, np.nan), s))),
    "on the rails": Row(outlet(lambda v, s: (np.full_like(v, 5.0), s)), trouble=True),
    "zeros": Row(outlet(lambda v, s: (0.0 * v, s)), trouble=True),
    "the same again and again": Row(outlet(stuck), trouble=True),
    "falls silent": Row(outlet(silent_after=2.0), lost="nothing from", old=True),
    "goes for good": Row(outlet(closes_after=2.0), lost="nothing from", old=True),
    "goes without a source id": Row(outlet(closes_after=2.0, source=""), lost="the LSL stream", old=True),
    "comes back with another channel": Row(outlet(closes_after=2.0, again_with=2), lost="the LSL stream", old=True),
    "goes and comes back all the time": Row(outlet(storm=True), lost="the LSL stream", old=True),
    "a second of its name": Row(outlet(twin_after=2.0), lost="shares its name and source with another one", old=True),
    "sends nothing": Row(outlet(silent_after=-1.0), refused="sends nothing"),
    "half the rate from the first": Row(outlet(lambda v, s: (v[::2], s[::2]), calm=0.0), refused="samples a second"),
    "the future from the first": Row(outlet(lambda v, s: (v, s + 3.0), calm=0.0), refused="in the future"),
    "no numbers for stamps from the first": Row(outlet(lambda v, s: (v, s + np.nan), calm=0.0), refused="no numbers"),
    "orders to the terminal": Row(outlet(labels=("\x1b[2J",)), refused="is named '\\x1b[2J'; expected text"),
    "a unit that is an order": Row(outlet(labels=("a",), unit="\x1b[2J\r\n")),
    "a source that is an order": Row(outlet(source="\x1b[2J")),
    "more channels than there are": Row(outlet(channels=5000), refused="has 5000 channels; expected 1 to 512"),
    "no rate": Row(outlet(rate=0.0), refused="irregular rate"),
    "another kind": Row(outlet(kind="\x1b[2J"), refused="has the type"),
}
"""What an outlet does → what must come of it."""


def against_outlet(lsl: Any, name: str, row: Row) -> Heard:
    with contextlib.closing(HostileOutlet(lsl, f"{name} {HERE} {time.monotonic():g}", row.attack)) as sender:
        return listened(LslStream(sender.name, wait=3.0))


@pytest.mark.live
@pytest.mark.parametrize(
    "names",
    [
        "does no harm, stamps that are no numbers, stamps of the end of time, old samples, half the rate, zeros, "
        "a second of its name, orders to the terminal, a unit that is an order",
        *(pytest.param(", ".join(list(OUTLETS)[k::3]), marks=pytest.mark.long) for k in range(3)),
    ],
    ids=["some", *(f"all {k}" for k in range(3))],
)
def test_an_outlet_that_does_harm_ends_as_the_table_says(lsl: Any, names: str) -> None:
    assert not wrong(OUTLETS, names, lambda name, row: against_outlet(lsl, name, row))


def server(spoils: Any = whole, **more: Any) -> hostile_trigno.Attack:
    return hostile_trigno.Attack(spoils=spoils, **more)


def shifted(frame: Any) -> bytes:
    """Every sample begins a byte too late, as after a byte that was lost."""
    data = whole(frame)
    return data[-1:] + data[:-1]


def answering(**answers: str) -> hostile_trigno.Attack:
    return server(answers={command.replace("_", " ") + "?": answer for command, answer in answers.items()})


def sensor(question: str, answer: str) -> hostile_trigno.Attack:
    return server(answers={f"SENSOR {slot} {question}": answer for slot in (1, 2)})


SERVERS: dict[str, Row] = {
    "does no harm": Row(server()),
    "a greeting of orders": Row(server(greeting=lambda: b"\x1b[2J\r\n"), refused="which is no text"),
    "a greeting without end": Row(server(greeting=lambda: 4096 * b"D"), refused="which is no text"),
    "blank lines without end": Row(server(greeting=lambda: 100 * b"\r\n"), refused="gives no answer"),
    "that it has stopped without end": Row(server(greeting=lambda: 100 * b"STOPPED\r\n"), refused="gives no answer"),
    "another program": Row(server(greeting=lambda: b"SSH-2.0\r\n"), refused="with 'SSH-2.0'; expected Delsys Trigno"),
    "an empty greeting": Row(server(greeting=lambda: b""), refused="gives no answer"),
    "drips": Row(server(between=0.35), refused="gives no answer"),
    "answers slowly": Row(server(between=0.1), refused="does not answer all questions"),
    "an answer of orders": Row(sensor("PAIRED?", "YES\x1b[2J"), refused="which is no text"),
    "an answer that is none": Row(sensor("PAIRED?", "PERHAPS"), refused="answers PAIRED? with 'PERHAPS'"),
    "no length of a frame": Row(answering(FRAME_INTERVAL="nan"), refused="in a frame of nan s"),
    "a denormal frame": Row(answering(FRAME_INTERVAL="1e-320"), refused="samples a second"),
    "an endless frame": Row(answering(FRAME_INTERVAL="1e999"), refused="samples a second"),
    "a negative frame": Row(answering(FRAME_INTERVAL="-0.0135"), refused="in a frame of -0.0135 s"),
    "no samples in a frame": Row(answering(MAX_SAMPLES_EMG="0"), refused="has 0 samples"),
    "two sensors in one place": Row(sensor("STARTINDEX?", "3"), refused="start indices are [3, 3]"),
    "a place far away": Row(sensor("STARTINDEX?", "1e9"), refused="answers STARTINDEX?"),
    "a place that is no number": Row(sensor("STARTINDEX?", "nan"), refused="answers STARTINDEX?"),
    "channels without end": Row(sensor("EMGCHANNELCOUNT?", "1000"), refused="start indices are"),
    "no voltage": Row(sensor("CHANNEL 1 UNITS?", "parsec"), refused="expected volts or millivolts"),
    "nobody there": Row(sensor("PAIRED?", "NO"), refused="has no sensor with EMG"),
    "never starts": Row(server(answers={"START": "CANNOT COMPLETE"}), refused="answers START"),
    "silent after its start": Row(server(silent_after=0.0), refused="nothing comes from"),
    "half the rate from the first": Row(server(calm=0.0, speed=0.5), refused="samples a second"),
    "ten times the rate from the first": Row(server(calm=0.0, speed=10.0), refused="samples a second"),
    "half the rate": Row(server(speed=0.5), lost="samples a second", old=True),
    "twice the rate": Row(server(speed=2.0), lost="samples a second", old=True),
    "a flood": Row(server(speed=30.0), lost="samples a second", old=True),
    "falls silent": Row(server(silent_after=2.0), lost="nothing comes from", old=True),
    "pauses for 300 ms": Row(server(pauses=0.3), lost="nothing comes from", old=True),
    "pauses for 3 s": Row(server(pauses=3.0), lost="nothing comes from", old=True),
    "two channels swapped": Row(server(lambda frame: whole(frame[:, [1, 0, *range(2, 16)]]))),
    "half samples": Row(server(shifted), lost="is no EMG", old=True),
    "no numbers": Row(server(lambda frame: whole(frame * np.float32(np.nan))), lost="is no EMG", old=True),
    "infinite values": Row(server(lambda frame: whole(frame + np.float32(np.inf))), lost="is no EMG", old=True),
    "denormal values": Row(server(lambda frame: whole(frame * 0 + np.float32(1e-40))), lost="is no EMG", old=True),
    "random bytes": Row(server(lambda frame: os.urandom(64 * FRAME)), lost="is no EMG", old=True),
    "on the rails": Row(server(lambda frame: whole(frame * 0 + np.float32(0.011))), trouble=True),
    "zeros": Row(server(lambda frame: whole(frame * 0)), trouble=True),
    "drops its clients": Row(server(drops_after=2.0), lost="Trigno server", old=True),
    "drops them again and again": Row(server(drops_after=2.0, storm=True), lost="Trigno server", old=True),
    "comes back as another": Row(
        server(drops_after=2.0, paired_again=5), lost="come back as a different one", old=True
    ),
    "chatters": Row(server(chatters=True)),
}
"""What a server does → what must come of it."""


def against_server(row: Row) -> Heard:
    with contextlib.closing(HostileTrigno(row.attack)) as sender:
        found = listened(TrignoStream(Address("127.0.0.1", *sender.ports)))
        assert sender.connections <= 3 * LISTENED, "it is not stormed by us in turn"
        return found


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is waited for is waited for less long."""
    monkeypatch.setattr(trigno_dialogue, "_ANSWER", 1.5)
    monkeypatch.setattr(trigno_dialogue, "_TALK", 4.0)
    monkeypatch.setattr(trigno, "_WAIT", 1.0)


@pytest.mark.live
@pytest.mark.usefixtures("impatient")
@pytest.mark.parametrize(
    "names",
    [
        "does no harm, a greeting of orders, another program, an empty greeting, blank lines without end, drips, "
        "that it has stopped without end, answers slowly, never starts, nobody there, a denormal frame, half the rate, "
        "a place that is no number, half samples, denormal values, on the rails, drops them again and again, comes "
        "back as another",
        *(pytest.param(", ".join(list(SERVERS)[k::3]), marks=pytest.mark.long) for k in range(3)),
    ],
    ids=["some", *(f"all {k}" for k in range(3))],
)
def test_a_server_that_does_harm_ends_as_the_table_says(names: str) -> None:
    assert not wrong(SERVERS, names, lambda name, row: against_server(row))
