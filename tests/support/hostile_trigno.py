"""A Trigno SDK server that does harm, written from the documented protocol alone; `Attack` says what it may do.

Nothing of the client or of our own server is used here, so that what both misread alike can show. Source: Delsys,
Trigno Wireless System SDK User's Guide (MAN-025), as public clients quote it.
"""

import contextlib
import socket
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float32]
RATE, FRAME = 2000.0, 27
"""Samples a second, and in a frame of 13.5 ms."""
CALM = 1.2
"""For so long after START it sends what is right, so that it is opened [s]."""
GREETING = b"Delsys Trigno System Digital Protocol Version 3.6.0\r\n\r\n"


def whole(frame: Array) -> bytes:
    return frame.astype("<f4").tobytes()


@dataclass(frozen=True)
class Attack:
    """What the server does; without any it is a sound one that sends noise in its first two channels."""

    greeting: Callable[[], bytes] = lambda: GREETING
    """What it answers the connection with, asked for again and again until it is empty."""
    between: float = 0.0
    """Before each byte of an answer [s]."""
    answers: Mapping[str, str] = field(default_factory=dict)
    """By the command; in place of what is right."""
    spoils: Callable[[Array], bytes] = whole
    """What is sent for each frame (n, 16), once it has been calm for `CALM`."""
    calm: float = CALM
    speed: float = 1.0
    """How quickly it sends, once it has been calm."""
    pauses: float = 0.0
    """Once it has been calm it sends nothing for so long, and then all that is due at once [s]."""
    silent_after: float = float("inf")
    """[s]"""
    drops_after: float = float("inf")
    """It closes every connection so long after each START [s]."""
    storm: bool = False
    """From the second connection on it closes each right after START."""
    chatters: bool = False
    """The command port sends lines without end while samples are sent."""
    paired_again: int = 2
    """Sensors that are paired from the second connection on."""


class HostileTrigno:
    """The server, from its making to `close`."""

    def __init__(self, attack: Attack) -> None:
        self._attack, self._stop = attack, threading.Event()
        self.connections = 0
        """Of the command port until now."""
        self._command, self._data = (socket.create_server(("127.0.0.1", 0)) for _ in range(2))
        self.ports = (self._command.getsockname()[1], self._data.getsockname()[1])
        self._listeners: list[socket.socket] = []
        self._started = float("inf")
        self._threads = [threading.Thread(target=run) for run in (self._talk, self._accept, self._send)]
        for thread in self._threads:
            thread.start()

    def _talk(self) -> None:
        while not self._stop.is_set():
            with contextlib.suppress(OSError):
                one, _ = self._command.accept()
                self.connections += 1
                with one:
                    self._serve(one)
                self._started = float("inf")

    def _serve(self, one: socket.socket) -> None:
        one.settimeout(2.0)  # who listens may be slow
        while (said := self._attack.greeting()) and not self._stop.is_set():
            one.sendall(said)
            if said == GREETING:
                break
        one.settimeout(0.02)
        pending = b""
        while not self._stop.is_set() and time.monotonic() - self._started < self._drops_after():
            if self._attack.chatters and self._started < float("inf"):
                one.sendall(b"STOPPED\r\n\r\n")
            try:
                data = one.recv(4096)
            except TimeoutError:
                continue
            if not data:
                return
            *lines, pending = (pending + data).split(b"\r\n")
            for line in filter(None, lines):
                answer = self._answer(line.decode("ascii")).encode("latin-1") + b"\r\n\r\n"
                for k in range(len(answer) if self._attack.between else 0):
                    one.sendall(answer[k : k + 1])
                    self._stop.wait(self._attack.between)
                if not self._attack.between:
                    one.sendall(answer)

    def _drops_after(self) -> float:
        return 0.0 if self._attack.storm and self.connections > 1 else self._attack.drops_after

    def _answer(self, command: str) -> str:
        if command in self._attack.answers:
            return self._attack.answers[command]
        words = command.split()
        if command == "START":
            self._started = time.monotonic()
            return "OK"
        if words[0] == "SENSOR":
            paired = int(words[1]) <= (2 if self.connections == 1 else self._attack.paired_again)
            known = {"PAIRED?": "YES" if paired else "NO", "ACTIVE?": "YES", "STARTINDEX?": words[1]}
            return {**known, "EMGCHANNELCOUNT?": "1", "UNITS?": "V"}[words[-1]]
        known = {"BACKWARDS COMPATIBILITY?": "NO", "UPSAMPLING?": "NO", "FRAME INTERVAL?": "0.0135"}
        return {**known, "MAX SAMPLES EMG?": str(FRAME)}.get(command, "OK")

    def _accept(self) -> None:
        while not self._stop.is_set():
            with contextlib.suppress(OSError):
                self._listeners.append(self._data.accept()[0])

    def _send(self) -> None:
        attack, random, sent, started = self._attack, np.random.default_rng(1), 0.0, float("inf")
        while not self._stop.is_set():
            time.sleep(0.002)
            if self._started != started:
                started, sent = self._started, 0.0
            since = time.monotonic() - started
            pauses = attack.calm < since < attack.calm + attack.pauses
            if pauses or not 0.0 < since < attack.silent_after:
                continue
            if since >= self._drops_after():
                self._let_go()
                continue
            calm = since < attack.calm
            due = since * RATE if calm else attack.calm * RATE + (since - attack.calm) * RATE * attack.speed
            while sent + FRAME <= due and not self._stop.is_set():
                sent += FRAME
                frame = np.zeros((FRAME, 16), dtype=np.float32)
                frame[:, :2] = 1e-5 * random.standard_normal((FRAME, 2))
                data = whole(frame) if calm else attack.spoils(frame)
                for one in tuple(self._listeners):
                    try:
                        one.sendall(data)
                    except OSError:
                        one.close()
                        with contextlib.suppress(ValueError):
                            self._listeners.remove(one)

    def _let_go(self) -> None:
        while self._listeners:
            with contextlib.suppress(OSError):
                self._listeners.pop().close()

    def close(self) -> None:
        """End it; safe to call twice."""
        self._stop.set()
        for port in self.ports:  # wakes whoever accepts
            with contextlib.suppress(OSError):
                socket.create_connection(("127.0.0.1", port), 0.5).close()
        for thread in self._threads:
            thread.join(5.0)
        self._let_go()
        for one in (self._command, self._data):
            one.close()
