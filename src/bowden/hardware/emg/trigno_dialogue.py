"""The dialogue with a Trigno SDK server: greeting, what is paired, which rate, START; and its data socket."""

import contextlib
import socket
from typing import NamedTuple

from bowden.core.clock import SECOND, MonotonicClock, TimeSource
from bowden.core.errors import StreamError
from bowden.hardware.emg import trigno_protocol as protocol

_ANSWER = 2.0
"""Longest that an answer may take, from the question to its last byte, whatever else comes meanwhile [s]."""
_TALK = 20.0
"""Longest that all questions to a server may take [s]."""


class Address(NamedTuple):
    """Where a server is."""

    host: str
    command: int = protocol.COMMAND_PORT
    emg: int | None = None
    """None: `EMG_PORT`, or `LEGACY_EMG_PORT` where that refuses."""

    def said(self) -> str:
        """For messages."""
        return f"Trigno server {self.host}:{self.command}"


class Base(NamedTuple):
    """What a server has."""

    version: str
    rate: float
    """Of its EMG port [Hz]."""
    columns: tuple[protocol.EmgColumn, ...]
    idle: tuple[int, ...]
    """Slots whose sensor is paired and not active."""
    legacy: bool


class TrignoDialogue:
    """One connection to a server, from its making to `close`.

    Args:
        address: of the server.
        clock: that answers are waited for by.

    Raises:
        StreamError: nobody there, another kind of server, or nothing that can be measured.
    """

    def __init__(self, address: Address, clock: TimeSource | None = None) -> None:
        self._address = address
        self._clock = MonotonicClock() if clock is None else clock
        self._end = self._now() + _TALK
        self._lines = protocol.Lines()
        self._waiting: list[str] = []
        self.data: socket.socket
        """The EMG port, connected, before `start`."""
        self._sockets: list[socket.socket] = []
        try:
            self._command = self._connect(address.command, "command")
            self.base = self._look()
        except BaseException:
            self.close()
            raise

    def _now(self) -> float:
        return self._clock.now() / SECOND

    def _connect(self, port: int, kind: str) -> socket.socket:
        try:
            found = socket.create_connection((self._address.host, port), _ANSWER)
        except OSError as error:
            raise StreamError(
                f"no {kind} port {port} at {self._address.host}: {error.strerror or error}",
                do="start the Trigno Control Utility with its base station connected, or correct host and ports",
            ) from error
        found.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._sockets.append(found)
        return found

    def _look(self) -> Base:
        greeting = self._line()
        if not greeting.startswith(protocol.GREETING):
            raise StreamError(
                f"{self._address.said()} answers the connection with {protocol.shown(greeting.encode())}",
                expected=f"{protocol.GREETING} …",
            )
        self._accepted("ENDIAN LITTLE", self.ask("ENDIAN LITTLE"))
        settings = [
            self.ask(question)
            for question in ("BACKWARDS COMPATIBILITY?", "UPSAMPLING?", "FRAME INTERVAL?", "MAX SAMPLES EMG?")
        ]
        sensors, idle = [], []
        for slot in range(1, protocol.SLOTS + 1):
            if not protocol.yes(self.ask(f"SENSOR {slot} PAIRED?"), "PAIRED?"):
                continue
            active = self.ask(f"SENSOR {slot} ACTIVE?")
            if not protocol.refused(active) and not protocol.yes(active, "ACTIVE?"):
                idle.append(slot)
                continue
            questions = ("STARTINDEX?", "EMGCHANNELCOUNT?", "CHANNEL 1 UNITS?")
            sensors.append(
                protocol.SensorAnswers(slot, *(self.ask(f"SENSOR {slot} {question}") for question in questions))
            )
        columns = protocol.columns_of(sensors)
        if not columns:
            asleep = f"; not active: {', '.join(map(str, idle))}" if idle else ""
            raise StreamError(
                f"{self._address.said()} has no sensor with EMG{asleep}",
                do="pair one in the Trigno Control Utility, and take it out of its dock",
            )
        legacy = self._open_data()
        rate = protocol.rate_of(protocol.LEGACY_EMG_PORT if legacy else protocol.EMG_PORT, *settings)
        return Base(greeting.removeprefix(protocol.GREETING).strip(), rate, tuple(columns), tuple(idle), legacy)

    def _open_data(self) -> bool:
        """Connect the EMG port; whether it is the legacy one."""
        if self._address.emg is not None:
            self.data = self._connect(self._address.emg, "EMG")
            return self._address.emg == protocol.LEGACY_EMG_PORT
        try:
            self.data = self._connect(protocol.EMG_PORT, "EMG")
            return False
        except StreamError as error:
            with contextlib.suppress(StreamError):
                self.data = self._connect(protocol.LEGACY_EMG_PORT, "EMG")
                return True
            raise error

    def start(self, again: bool = False) -> None:
        """Let the samples come; `again` where an earlier connection of ours may have left the server running.

        Raises:
            StreamError: the server refuses.
        """
        self._end = self._now() + _TALK
        answer = self.ask("START")
        if again and protocol.refused(answer):
            self.ask("STOP")
            answer = self.ask("START")
        self._accepted("START", answer)

    def ask(self, command: str) -> str:
        """The answer to a command.

        Raises:
            StreamError: the server is gone, or silent.
        """
        try:
            self._command.sendall(command.encode("ascii") + protocol.END + protocol.END)
        except OSError as error:
            raise self._gone(error) from error
        return self._line()

    def _accepted(self, command: str, answer: str) -> None:
        if answer.upper() != "OK":
            raise StreamError(
                f"{self._address.said()} answers {command} with {answer!r}",
                expected="'OK'",
                do="end other programs that use the base station, and look at its sensors",
            )

    def _line(self) -> str:
        """The next line; one that says by itself that the server has stopped is left out."""
        until = min(self._now() + _ANSWER, self._end)
        while True:
            while self._waiting:
                line = self._waiting.pop(0)
                if line != "STOPPED":
                    return line
            left = until - self._now()
            if left <= 0.0:
                raise self._silent()
            self._command.settimeout(left)
            try:
                data = self._command.recv(4096)
            except TimeoutError:
                raise self._silent() from None
            except OSError as error:
                raise self._gone(error) from error
            finally:
                self._command.settimeout(_ANSWER)
            if not data:
                raise self._gone(None)
            self._waiting = self._lines.feed(data)

    def _silent(self) -> StreamError:
        said = (
            f"does not answer all questions in {_TALK:g} s"
            if self._now() >= self._end
            else f"gives no answer in {_ANSWER:g} s"
        )
        return StreamError(f"{self._address.said()} {said}", expected="a Trigno SDK server")

    def _gone(self, error: OSError | None) -> StreamError:
        said = f": {error.strerror or error}" if error else ""
        return StreamError(f"{self._address.said()} has closed the connection{said}", do="start it again")

    def close(self, stop: bool = False) -> None:
        """Let go of the server; with `stop` stop it as well. Safe to call twice."""
        if stop and self._sockets:
            with contextlib.suppress(OSError):
                self._command.sendall(b"STOP\r\n\r\nQUIT\r\n\r\n")
        for one in self._sockets:
            one.close()
        self._sockets = []
