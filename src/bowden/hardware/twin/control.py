"""Talking to a running twin: one JSON document each way, as datagrams, over a Unix socket in the bus' folder."""

import contextlib
import json
import os
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any

from bowden.core.errors import BowdenError, DriveError
from bowden.hardware.buses.unix_bus import LONGEST_PATH, bus_folder
from bowden.hardware.twin.injection import Injection, parse

LARGEST = 1 << 17
"""Of a document [bytes]."""


def control_path(interface: str, channel: str, node_id: int) -> Path:
    """The socket at which the twin of that node listens."""
    return bus_folder(channel if interface == "bowden_unix" else f"{interface}-{channel}") / f"twin-{node_id}.control"


class ControlServer:
    """The twin's end; never waits.

    Args:
        path: where to listen; what a twin that died has left there is cleared away.

    Raises:
        DriveError: the socket cannot be made.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
        try:
            if len(os.fsencode(path)) > LONGEST_PATH:
                raise OSError(0, "its name is too long")
            path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            path.unlink(missing_ok=True)
            self._socket.bind(str(path))
        except OSError as error:
            self._socket.close()
            raise DriveError(f"cannot listen at {path}: {error.strerror}", do="name another channel") from error

    def answer(self, answered: Callable[[dict[str, Any]], dict[str, Any]]) -> None:
        """Answer what has been asked since the last call, by a function of the request; a caller who has gone, or does
        not read, gets nothing.
        """
        with contextlib.suppress(OSError):
            while True:
                text, caller = self._socket.recvfrom(LARGEST)
                try:
                    request = json.loads(text)
                    answer = answered(request) if isinstance(request, dict) else {"error": "not a JSON object"}
                except (BowdenError, TypeError, ValueError) as error:
                    answer = {"error": str(error)}
                with contextlib.suppress(OSError):
                    self._socket.sendto(json.dumps(answer).encode(), caller)

    def close(self) -> None:
        """Stop listening."""
        self._path.unlink(missing_ok=True)
        self._socket.close()


class TwinControl:
    """A running twin, from outside; a context manager.

    Args:
        path: see `control_path`.
        timeout: for its answer [s].

    Raises:
        DriveError: no twin listens there.
    """

    def __init__(self, path: Path, timeout: float = 5.0) -> None:
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.settimeout(timeout)
        try:
            self._socket.bind("")  # a name of the system's choice, for the answers
            self._socket.connect(str(path))
        except OSError as error:
            self._socket.close()
            raise DriveError(
                f"no twin listens at {path}: it has not been started, or has ended",
                do="start one with bowden twin RIG.toml; the twin of bowden run --twin lives as long as its run, on "
                "the channel that the run prints",
            ) from error

    def __enter__(self) -> "TwinControl":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Let go of it; the twin runs on."""
        self._socket.close()

    def ask(self, **request: Any) -> dict[str, Any]:
        """One question and its answer.

        Raises:
            DriveError: no answer, or an answer that says what is wrong.
        """
        try:
            self._socket.send(json.dumps(request).encode())
            answer = json.loads(self._socket.recv(LARGEST))
        except (OSError, ValueError) as error:
            raise DriveError("the twin does not answer", do="check whether it still runs") from error
        if "error" in answer:
            raise DriveError(f"the twin says: {answer['error']}")
        return dict(answer)

    def status(self) -> dict[str, Any]:
        """Where it is: state, angles, torque, temperature, its clock, the share of a processor that it takes."""
        return self.ask(do="status")

    def journal(self, since: float = -1.0) -> list[dict[str, Any]]:
        """What happened after `since` on the twin's clock [s]: time, event, detail; the last 500 at most."""
        return list(self.ask(do="journal", since=since)["journal"])

    def inject(self, text: str, after: float = 0.0, lasting: float | None = None) -> Injection:
        """Inject a fault, as `hardware.twin.injection.parse` reads it.

        Args:
            text: name, side and amount.
            after: from now [s].
            lasting: for how long; until it is cleared where it is not given [s].

        Raises:
            ParameterError: there is no such fault.
            DriveError: the twin does not answer.
        """
        injection = parse(text)
        self.ask(do="inject", fault=text, after=after, lasting=lasting)
        return injection

    def wait(self, seconds: float) -> None:
        """Have it wait for a silent host while there is torque, which no drive does: for a computer that stalls.

        Args:
            seconds: how long at most [s].
        """
        self.ask(do="wait", seconds=seconds)

    def clear(self) -> None:
        """End all faults that last."""
        self.ask(do="clear")

    def start_scenario(self, at: float | None = None) -> None:
        """Let the sheath's bend begin its course; until then it is as at the scenario's start.

        Args:
            at: on the monotonic clock, also in the past; infinity for not yet; now where it is not given [s].
        """
        self.ask(do="scenario", at=at)
