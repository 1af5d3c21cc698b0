"""A Trigno SDK server that plays a recording: the documented protocol, for tests, and to try things without hardware.

It answers what `bowden.hardware.emg.trigno_dialogue` asks, and sends EMG; it has no auxiliary data such as
acceleration.
One process serves all clients from one loop; every client of a data port gets every frame.
"""

import contextlib
import selectors
import socket
from collections.abc import Callable
from random import Random
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.clock import SECOND, MonotonicClock, TimeSource
from bowden.core.errors import StreamError, counted
from bowden.hardware.emg.trigno_faults import TrignoFaults
from bowden.hardware.emg.trigno_protocol import (
    END,
    FRAME,
    GREETING,
    INVALID,
    REFUSED,
    SAMPLE_BYTES,
    SLOTS,
    Lines,
)

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
    sent = np.zeros((len(values) - len(values) % size, SLOTS), dtype="<f4")
    sent[:, : values.shape[1]] = 1e-3 * values[: len(sent)]
    data, step = sent.tobytes(), size * SAMPLE_BYTES
    return [data[k : k + step] for k in range(0, len(data), step)]


class _Client:
    """One connection of the command port or of the EMG port."""

    def __init__(self, one: socket.socket, is_data: bool) -> None:
        one.setblocking(False)
        one.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.socket, self.is_data = one, is_data
        self.lines, self.pending = Lines(), b""

    def send(self, data: bytes) -> bool:
        """Send as much as goes; whether the client is still there."""
        self.pending += data
        try:
            while self.pending:
                self.pending = self.pending[self.socket.send(self.pending) :]
        except BlockingIOError:
            return len(self.pending) < _PENDING
        except OSError:
            return False
        return True


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
        if values.shape[1] > SLOTS:
            raise StreamError(
                f"the recording has {counted(values.shape[1], 'channel')}", expected=f"at most {SLOTS} sensors"
            )
        self._size = max(1, round(rate * FRAME))
        self._frames, self._rate, self._loop = frames_of(values, self._size), rate, loop
        self._paired = values.shape[1]
        self._faults = TrignoFaults() if faults is None else faults
        self._clock = MonotonicClock() if clock is None else clock
        self._random = Random(1)
        self._selector = selectors.DefaultSelector()
        self.started: int | None = None
        """When the samples began [ns]; None while there are none."""
        self._sent = 0
        self._free = 0
        """When the last frame that was held back is free [ns]."""
        self._listeners: list[socket.socket] = []
        self._clients: list[_Client] = []
        self.ports = Ports(self._listen(host, ports.command, "command"), self._listen(host, ports.emg, "emg"))
        """Where it listens."""

    def _listen(self, host: str, port: int, kind: str) -> int:
        try:
            one = socket.create_server((host, port), reuse_port=False)
        except OSError as error:
            self.close()
            raise StreamError(
                f"cannot listen at {host}:{port}: {error.strerror or error}",
                do="choose other ports, or end the program that uses them",
            ) from error
        self._listeners.append(one)
        found = int(one.getsockname()[1])
        if kind == "emg" and self._faults.refuse == "EMG":
            one.close()
        else:
            self._selector.register(one, selectors.EVENT_READ, kind)
        return found

    def serve(self, until: Callable[[], bool], progress: Callable[[float], None] = lambda seconds: None) -> None:
        """Serve clients until `until` says so, asked every few milliseconds; report how much was played [s]."""
        while not until():
            for key, _ in self._selector.select(self._pause()):
                if isinstance(key.data, str):
                    self._accept(key.fileobj, key.data)  # type: ignore[arg-type] # it is a listener's socket
                elif not self._receive(key.data):
                    self._drop(key.data)
            self._play()
            progress(self._sent * self._size / self._rate if self.started is not None else 0.0)

    def _due(self) -> int:
        """When the next frame is complete [ns]."""
        assert self.started is not None
        return self.started + round((self._sent + 1) * self._size / self._rate * SECOND)

    def _pause(self) -> float:
        if self.started is None:
            return 0.02
        return min(0.02, max(0.0, (max(self._due(), self._free) - self._clock.now()) / SECOND))

    def _accept(self, listener: socket.socket, kind: str) -> None:
        one, _ = listener.accept()
        client = _Client(one, kind == "emg")
        self._clients.append(client)
        self._selector.register(one, selectors.EVENT_READ, client)
        if not client.is_data:
            garbage = self._faults.garbage == "greeting"
            greeting = self._random.randbytes(80) if garbage else f"{GREETING} 3.6.0".encode() + 2 * END
            client.send(greeting)

    def _receive(self, client: _Client) -> bool:
        """Answer a client's commands; whether it is still there."""
        try:
            data = client.socket.recv(4096)
            lines = client.lines.feed(data)
        except BlockingIOError:
            return True
        except (OSError, StreamError):
            return False
        return bool(data) and all(client.send(self._answer(line).encode() + 2 * END) for line in lines)

    def _answer(self, command: str) -> str:
        """The answer to one command, which may start or stop the samples."""
        words, refuse = command.upper().split(), self._faults.refuse
        if words == ["START"]:
            if refuse == "START" or self.started is not None:
                return REFUSED
            self.started, self._sent, self._free = self._clock.now(), 0, 0
            return "OK"
        if words == ["STOP"]:
            running, self.started = self.started is not None, None
            return "OK" if running else REFUSED
        if words == ["QUIT"]:
            return "BYE"
        if words[:1] == ["SENSOR"] and len(words) > 2 and words[1].isdecimal() and 1 <= int(words[1]) <= SLOTS:
            return self._answer_of_sensor(int(words[1]), words[2:])
        known = {
            "ENDIAN LITTLE": "OK",
            "ENDIANNESS?": "LITTLE",
            "BACKWARDS COMPATIBILITY?": "NO",
            "UPSAMPLING?": "NO",
            "FRAME INTERVAL?": f"{self._size / self._rate:.12g}",
            "MAX SAMPLES EMG?": str(self._size),
        }
        return INVALID if refuse == "questions" and words[0] != "ENDIAN" else known.get(command.upper(), INVALID)

    def _answer_of_sensor(self, slot: int, words: list[str]) -> str:
        paired = slot <= self._paired and self._faults.refuse != "sensors"
        if words == ["PAIRED?"]:
            return "YES" if paired else "NO"
        if self._faults.refuse == "questions":
            return INVALID
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
        return known.get(tuple(words), INVALID) if paired else REFUSED

    def _play(self) -> None:
        """Send the frames that are due."""
        now = self._clock.now()
        while self.started is not None and max(self._due(), self._free) <= now:
            if self._sent >= len(self._frames) and not self._loop:
                self.started = None
                self._tell(b"STOPPED" + 2 * END, False)
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
            values = np.frombuffer(frame, dtype="<f4").copy()
            for k in range(0, self._size, 10):
                values[SLOTS * k : SLOTS * k + SLOTS] = random.choice((np.nan, np.inf, -np.inf, 1e30))
            frame = values.tobytes()
        while faults.torn and len(frame) > 97:
            cut = random.randint(1, 97)
            self._tell(frame[:cut], True)
            frame = frame[cut:]
        self._tell(frame, True)

    def _tell(self, data: bytes, is_data: bool) -> None:
        for client in tuple(self._clients):
            if client.is_data == is_data and not client.send(data):
                self._drop(client)

    def _drop(self, client: _Client) -> None:
        self._clients.remove(client)
        self._selector.unregister(client.socket)
        client.socket.close()
        if not self._clients:  # whoever started it is gone without a word
            self.started = None

    def close(self) -> None:
        """End it; safe to call twice."""
        for client in tuple(self._clients):
            self._drop(client)
        for one in self._listeners:
            with contextlib.suppress(KeyError, ValueError):
                self._selector.unregister(one)
            one.close()
        self._listeners = []
        self._selector.close()
