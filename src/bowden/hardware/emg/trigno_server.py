"""A Trigno SDK server that plays a recording: the documented protocol, for tests, and to try things without hardware.

It answers what `bowden.hardware.emg.trigno_dialogue` asks, and sends EMG; it has no auxiliary data such as
acceleration.
One process serves all clients from one loop; every client of a data port gets every frame.
"""

import asyncio
import contextlib
import dataclasses
import socket
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from random import Random
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.clock import SECOND, MonotonicClock, TimeSource
from bowden.core.errors import ParameterError, StreamError, counted
from bowden.hardware.emg import trigno_protocol as protocol

_WORDS = {"garbage": ("greeting", "data", "values"), "refuse": ("START", "EMG", "questions", "sensors")}


@dataclass(frozen=True)
class TrignoFaults:
    """Faults of a server; without any it does as the guide says."""

    late: float = 0.0
    """One frame in 20 is held back by up to this much, and with it all after it [s]."""
    torn: bool = False
    """Frames are sent in pieces of 1 to 97 bytes."""
    missing: float = 0.0
    """Share of frames that are never sent."""
    disconnect: float = 0.0
    """All connections are closed this long after each START [s]; 0 for never."""
    silent: float = 0.0
    """Nothing is sent any more this long after each START [s]; 0 for never."""
    garbage: str = ""
    """``greeting``: random bytes in its place. ``data``: random bytes in place of samples, in the second and third
    second. ``values``: one sample in ten has NaN, infinity or 1e30 in it."""
    refuse: str = ""
    """``START``: CANNOT COMPLETE. ``EMG``: nobody listens at its port. ``questions``: INVALID COMMAND to all of them
    but PAIRED?. ``sensors``: none is paired."""


def read_faults(texts: Sequence[str]) -> TrignoFaults:
    """Faults from texts such as ``late=0.1``, ``torn``, ``garbage=data``.

    Raises:
        ParameterError: there is no such fault, or none of this size.

    >>> read_faults(["late=0.1", "torn"]).late
    0.1
    """
    kinds = {field.name: type(field.default) for field in dataclasses.fields(TrignoFaults)}
    found: dict[str, float | bool | str] = {}
    for text in texts:
        name, _, value = text.partition("=")
        kind = kinds.get(name)
        try:
            if kind is bool and not value:
                found[name] = True
            elif kind is str and value in _WORDS[name]:
                found[name] = value
            elif kind is float and 0.0 <= float(value) <= (1.0 if name == "missing" else 1e4):
                found[name] = float(value)
            else:
                raise ValueError
        except ValueError:
            said = "torn, late=SECONDS, missing=SHARE (0 to 1), disconnect=SECONDS, silent=SECONDS, "
            words = ", ".join(f"{key}={'|'.join(choices)}" for key, choices in _WORDS.items())
            raise ParameterError(f"--fault is {text!r}", expected=said + words) from None
    return TrignoFaults(**found)  # type: ignore[arg-type] # each was read by its field's type


Array = NDArray[np.float64]

_PENDING = 1 << 20
"""A client that leaves this much unread is let go [bytes]."""


class Ports(NamedTuple):
    """TCP ports; 0 for any that is free."""

    command: int
    emg: int


ANY = Ports(0, 0)
"""Whichever are free."""


def frames_of(values: Array, size: int) -> list[bytes]:
    """A recording in mV (n, channels) as frames of `size` samples in volts; what does not fill the last is left out."""
    sent = np.zeros((len(values) - len(values) % size, protocol.SLOTS), dtype="<f4")
    sent[:, : values.shape[1]] = 1e-3 * values[: len(sent)]
    data, step = sent.tobytes(), size * protocol.SAMPLE_BYTES
    return [data[k : k + step] for k in range(0, len(data), step)]


class TrignoServer:
    """A server at `ports`, from its making to `close`.

    Args:
        values: a recording in mV (n, channels); channel k is the sensor in slot k + 1.
        rate: of the recording [Hz].
        ports: where to listen.
        host: on which of this computer's addresses.
        loop: whether the recording begins again at its end.
        faults: what is wrong with it.
        clock: for the pace.

    Raises:
        StreamError: too many channels, or ports that are taken.
    """

    def __init__(
        self,
        values: Array,
        rate: float,
        ports: Ports = ANY,
        host: str = "127.0.0.1",
        loop: bool = False,
        faults: TrignoFaults | None = None,
        clock: TimeSource | None = None,
    ) -> None:
        if values.shape[1] > protocol.SLOTS:
            raise StreamError(
                f"the recording has {counted(values.shape[1], 'channel')}", expected=f"at most {protocol.SLOTS} sensors"
            )
        self._size = max(1, round(rate * protocol.FRAME))
        self._frames, self._rate, self._loop = frames_of(values, self._size), rate, loop
        self._paired = values.shape[1]
        self._faults = TrignoFaults() if faults is None else faults
        self._clock = MonotonicClock() if clock is None else clock
        self._random = Random(1)
        self.started: int | None = None
        """When the samples began [ns]; None while there are none."""
        self._sent = 0
        self._free = 0
        """When the last frame that was held back is free [ns]."""
        self._clients: dict[asyncio.StreamWriter, bool] = {}
        """Connections → whether they are of the EMG port."""
        self._sockets: list[socket.socket] = []
        self.ports = Ports(*(self._listen(host, port) for port in ports))
        """Where it listens."""
        if self._faults.refuse == "EMG":
            self._sockets.pop().close()

    def _listen(self, host: str, port: int) -> int:
        try:
            one = socket.create_server((host, port), reuse_port=False)
        except OSError as error:
            self.close()
            raise StreamError(
                f"cannot listen at {host}:{port}: {error.strerror or error}",
                do="choose other ports, or end the program that uses them",
            ) from error
        self._sockets.append(one)
        return int(one.getsockname()[1])

    def serve(self, until: Callable[[], bool], progress: Callable[[float], None] = lambda seconds: None) -> None:
        """Serve clients until `until` says so, asked every few milliseconds; report how much was played [s]."""
        asyncio.run(self._serve(until, progress))

    async def _serve(self, until: Callable[[], bool], progress: Callable[[float], None]) -> None:
        kinds = zip(self._sockets, (self._talk, self._send_to), strict=False)
        servers = [await asyncio.start_server(kind, sock=one) for one, kind in kinds]
        while not until():
            self._play()
            progress(self._sent * self._size / self._rate if self.started is not None else 0.0)
            await asyncio.sleep(self._pause())
        for server in servers:
            server.close()
        for client in tuple(self._clients):
            self._drop(client)

    def _due(self) -> int:
        """When the next frame is complete [ns]."""
        assert self.started is not None
        return self.started + round((self._sent + 1) * self._size / self._rate * SECOND)

    def _pause(self) -> float:
        if self.started is None:
            return 0.02
        return min(0.02, max(0.0, (max(self._due(), self._free) - self._clock.now()) / SECOND))

    async def _talk(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """A client of the command port."""
        self._clients[writer], lines = False, protocol.Lines()
        greeting = f"{protocol.GREETING} 3.6.0".encode() + 2 * protocol.END
        writer.write(self._random.randbytes(80) if self._faults.garbage == "greeting" else greeting)
        with contextlib.suppress(OSError, StreamError):
            while data := await reader.read(4096):
                writer.writelines(self._answer(line).encode() + 2 * protocol.END for line in lines.feed(data))
        self._drop(writer)

    async def _send_to(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """A client of the EMG port."""
        self._clients[writer] = True
        with contextlib.suppress(OSError):
            while await reader.read(4096):
                pass
        self._drop(writer)

    def _answer(self, command: str) -> str:
        """The answer to one command, which may start or stop the samples."""
        words, refuse = command.upper().split(), self._faults.refuse
        if words == ["START"]:
            if refuse == "START" or self.started is not None:
                return protocol.REFUSED
            self.started, self._sent, self._free = self._clock.now(), 0, 0
            return "OK"
        if words == ["STOP"]:
            running, self.started = self.started is not None, None
            return "OK" if running else protocol.REFUSED
        if words == ["QUIT"]:
            return "BYE"
        if words[:1] == ["SENSOR"] and len(words) > 2 and words[1].isdecimal() and 1 <= int(words[1]) <= protocol.SLOTS:
            return self._answer_of_sensor(int(words[1]), words[2:])
        known = {
            "ENDIAN LITTLE": "OK",
            "ENDIANNESS?": "LITTLE",
            "BACKWARDS COMPATIBILITY?": "NO",
            "UPSAMPLING?": "NO",
            "FRAME INTERVAL?": f"{self._size / self._rate:.12g}",
            "MAX SAMPLES EMG?": str(self._size),
        }
        return (
            protocol.INVALID
            if refuse == "questions" and words[0] != "ENDIAN"
            else known.get(command.upper(), protocol.INVALID)
        )

    def _answer_of_sensor(self, slot: int, words: list[str]) -> str:
        paired = slot <= self._paired and self._faults.refuse != "sensors"
        if words == ["PAIRED?"]:
            return "YES" if paired else "NO"
        if self._faults.refuse == "questions":
            return protocol.INVALID
        known = {
            ("ACTIVE?",): "YES",
            ("TYPE?",): "O",
            ("MODE?",): "40",
            ("STARTINDEX?",): str(slot),
            ("CHANNELCOUNT?",): "1",
            ("EMGCHANNELCOUNT?",): "1",
            ("AUXCHANNELCOUNT?",): "0",
            ("CHANNEL", "1", "UNITS?"): "V",
            ("CHANNEL", "1", "RATE?"): f"{self._rate:.12g}",
            ("CHANNEL", "1", "SAMPLES?"): str(self._size),
        }
        return known.get(tuple(words), protocol.INVALID) if paired else protocol.REFUSED

    def _play(self) -> None:
        """Send the frames that are due."""
        now = self._clock.now()
        while self.started is not None and max(self._due(), self._free) <= now:
            if self._sent >= len(self._frames) and not self._loop:
                self.started = None
                self._tell(b"STOPPED" + 2 * protocol.END, False)
                return
            since = (now - self.started) / SECOND
            if self._faults.disconnect and since > self._faults.disconnect:
                self.started = None
                for client in tuple(self._clients):
                    self._drop(client)
                return
            self._send(self._frames[self._sent % len(self._frames)], since)
            self._sent += 1
            if self._random.random() < 0.05:
                self._free = self._due() + int(self._random.uniform(0.0, self._faults.late) * SECOND)

    def _send(self, frame: bytes, since: float) -> None:
        faults, random = self._faults, self._random
        if random.random() < faults.missing or (faults.silent and since > faults.silent):
            return
        if faults.garbage == "data" and 1.0 < since < 3.0:
            frame = random.randbytes(len(frame) - 3)
        elif faults.garbage == "values":
            values = np.frombuffer(frame, dtype="<f4").reshape(-1, protocol.SLOTS).copy()
            for k in range(0, self._size, 10):
                values[k] = random.choice((np.nan, np.inf, -np.inf, 1e30))
            frame = values.tobytes()
        while faults.torn and len(frame) > 97:
            cut = random.randint(1, 97)
            self._tell(frame[:cut], True)
            frame = frame[cut:]
        self._tell(frame, True)

    def _tell(self, data: bytes, is_data: bool) -> None:
        for client in [client for client, kind in self._clients.items() if kind == is_data]:
            client.write(data)
            if client.transport.get_write_buffer_size() > _PENDING:
                self._drop(client)

    def _drop(self, client: asyncio.StreamWriter) -> None:
        if self._clients.pop(client, None) is not None and not self._clients:
            self.started = None  # whoever started it is gone without a word
        client.transport.abort() if client.transport.get_write_buffer_size() > _PENDING else client.close()

    def close(self) -> None:
        """End it; safe to call twice."""
        for one in self._sockets:
            one.close()
