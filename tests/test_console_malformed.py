"""Whatever comes over a wire, whole or bent out of shape: the console answers, forgets it, and goes on.

Each example draws some texts and a seed; from each text come several bent ones, each of which is said once to a stream
of its own and once in a request. Many sessions take turns, so that the limit of a session's requests keeps none away.
"""

import contextlib
import json
import os
import random
import socket
import struct
import time
from collections.abc import Iterator
from dataclasses import dataclass, field

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from console_client import RIG, Page, RunningConsole, running_console

POSTS = ("control", "settings", "check", "request", "stop", "gain", "inject", "path")
CONTROLS = ("control", "settings", "request", "gain", "inject")
"""Those that half of the time carry the name of the page in control: nothing of theirs moves without a check."""
SESSIONS = 48
TEXTS, BENT = 8, 5
"""Of an example: texts, and what is made of each."""
AT_ONCE = 12
"""Streams: fewer than the console takes."""
PER_EXAMPLE = 2 * TEXTS * BENT
UPGRADE = (
    f"Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: {'x' * 22}==\r\n\r\n"
)
_KEYS = st.sampled_from(["life", "stop", "view", "state", "take", "request", "seen", "x", ""])
_PLAIN = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20)
_ANY = st.recursive(
    _PLAIN, lambda inner: st.lists(inner, max_size=4) | st.dictionaries(_KEYS, inner, max_size=4), max_leaves=12
)
_VIEW = {
    name: _PLAIN | st.lists(st.text(max_size=8), max_size=20) for name in ("columns", "seconds", "pixels", "number")
}
_REFERENCE = {"kind": "periodic_minimum_jerk", "low_deg": 0.0, "high_deg": 40.0, "period_s": 4.0}
_GOOD = {
    **{"law": "bowden", "preset": "paper", "gains": {"feedback_gain": 30.0}, "reference": _REFERENCE, "duration": 9.5},
    **{"notes": "n", "subject": "S", "take": True, "request": "arm", "fault": "none", "step": "tune", "life": 3},
    **{"name": "integral_gain", "value": 30.0},
    **{"view": {"columns": ["joint_deg"], "seconds": 10, "pixels": 300, "number": 1}, "stop": True},
}
_NEARLY = st.dictionaries(st.sampled_from([*_GOOD]), _ANY, max_size=3)
_WHOLE = st.lists(st.sampled_from([*_GOOD]), min_size=1, max_size=3).map(lambda names: {n: _GOOD[n] for n in names})
_VIEWS = st.fixed_dictionaries({"view": st.fixed_dictionaries({}, optional=_VIEW)})
TEXT = st.one_of(
    st.binary(max_size=200),
    st.text(max_size=200).map(lambda text: text.encode("utf-8", "replace")),
    *(found.map(lambda value: json.dumps(value).encode()) for found in (_ANY, _VIEWS, _NEARLY, _WHOLE)),
)


@pytest.fixture(scope="module")
def console(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningConsole]:
    folder = tmp_path_factory.mktemp("console")
    (folder / "rig.toml").write_text(RIG)
    with running_console(folder / "rig.toml", folder / "out", "--twin") as running:
        yield running


def bent(content: bytes, by: random.Random) -> bytes:
    """A text with some of its bytes changed, lost, repeated or put in; sometimes as it is."""
    for _ in range(by.choice((0, 1, 1, 2, 8))):
        at, much = by.randrange(len(content) + 1), by.choice((1, 1, 4, 40))
        how = by.randrange(4)
        if how == 0 and content:
            at = min(at, len(content) - 1)
            content = content[:at] + bytes([content[at] ^ 1 << by.randrange(8)]) + content[at + 1 :]
        elif how == 1:
            content = content[:at] + content[at + much :]
        elif how == 2:
            content = content[:at] + content[at : at + much] * by.choice((2, 30)) + content[at:]
        else:
            content = content[:at] + by.choice((b"\x00", b"{", b'"', b"\xff\xfe", b"NaN", b"1e999")) + content[at:]
    return content[:6000]


def masked(content: bytes, kind: int = 1) -> bytes:
    """A frame of a WebSocket from a client."""
    length = bytes([0x80 | len(content)]) if len(content) < 126 else b"\xfe" + struct.pack("!H", len(content))
    mask = b"\x01\x02\x03\x04"
    return bytes([0x80 | kind]) + length + mask + bytes(one ^ mask[i % 4] for i, one in enumerate(content))


@dataclass
class Wires:
    """What is said to a console, over sessions that take turns."""

    console: RunningConsole
    cookies: list[str] = field(default_factory=list)
    turn: int = 0
    counts: dict[str, int] = field(default_factory=dict)
    """How often each status came; ``said`` for messages that a stream took."""
    link: socket.socket | None = None
    controlling: Page | None = None

    def cookie(self) -> str:
        """Of the next session."""
        self.turn += 1
        return self.cookies[self.turn % len(self.cookies)]

    def count(self, what: str) -> None:
        """One more."""
        self.counts[what] = self.counts.get(what, 0) + 1

    def head(self, line: str) -> bytes:
        """Of a request of the next session."""
        host = f"127.0.0.1:{self.console.port}"
        return f"{line} HTTP/1.1\r\nHost: {host}\r\nOrigin: http://{host}\r\nCookie: {self.cookie()}\r\n".encode()

    def connected(self) -> socket.socket:
        """A new connection."""
        return socket.create_connection(("127.0.0.1", self.console.port), 20.0)

    def say(self, messages: list[bytes], by: random.Random) -> None:
        """Each to a stream of its own; nothing but an end comes of what is no message."""
        links = []
        for _ in messages:
            link = self.connected()
            link.sendall(self.head("GET /stream") + UPGRADE.encode())
            links.append(link)
        for link, message in zip(links, messages, strict=True):
            with contextlib.closing(link):
                begin = link.recv(12)
                self.count("said" if begin == b"HTTP/1.1 101" else begin.decode("latin-1"))
                frame = masked(message, by.choice((1, 1, 1, 2)))
                frame = bent(frame, by) if by.random() < 0.2 else frame
                with contextlib.suppress(OSError):  # it may have ended already, by what is wrong with the frame
                    link.sendall(frame + masked(b"\x03\xe8", 8))
                    link.shutdown(socket.SHUT_WR)
                    while len(link.recv(65_536)):
                        pass

    def ask(self, body: bytes, by: random.Random) -> None:
        """One request; its answer says no more than that it is none."""
        path = by.choice(POSTS)
        head = self.head(f"POST /api/{path}") + b"Content-Type: application/json\r\n"
        if path in CONTROLS and self.controlling is not None and by.random() < 0.5:
            head += f"Bowden-Tab: {self.controlling.tab}\r\n".encode()
        whole = by.random() < 0.85
        if not whole:
            head = bent(head, by)
        status, content = self._answer(head + f"Content-Length: {len(body)}\r\n\r\n".encode() + body)
        self.count(status)
        assert status in ("200", "400", "401", "404", "405", "409", "411", "413", "415", "421", "429", "403", "none")
        assert b"Traceback" not in content
        assert status != "none" or not whole

    def _answer(self, request: bytes) -> tuple[str, bytes]:
        """Status and content; a connection is kept as long as the console keeps it."""
        for _ in range(2):
            link = self.link or self.connected()
            fresh, self.link = self.link is None, link
            content = b""
            with contextlib.suppress(ConnectionError):
                link.sendall(request)
                content = link.recv(65_536)
            if content or fresh:
                break
            link.close()
            self.link = None
        head, _, rest = content.partition(b"\r\n\r\n")
        length = next((int(one[15:]) for one in head.lower().split(b"\r\n") if one.startswith(b"content-length:")), 0)
        while len(rest) < length and (more := link.recv(65_536)):
            rest += more
        status = head[9:12].decode("latin-1") or "none"
        if status != "200" or b"connection: close" in head.lower():
            link.close()  # what is wrong with one request is no part of the next
            self.link = None
        return status, rest


def many(console: RunningConsole, count: int) -> dict[str, int]:
    """So many messages and requests; what came of them."""
    wires = Wires(console)
    for _ in range(SESSIONS):
        wires.cookies.append(console.page().cookie)
        time.sleep(0.11)  # openings have a limit of their own
    wires.controlling = console.page(wires.cookies[0]).open().take()
    files = len(os.listdir(f"/proc/{console.process.pid}/fd"))

    @settings(max_examples=max(1, count // PER_EXAMPLE), suppress_health_check=list(HealthCheck), database=None)
    @given(texts=st.lists(TEXT, min_size=TEXTS, max_size=TEXTS), seed=st.integers(0, 2**32))
    def said(texts: list[bytes], seed: int) -> None:
        by = random.Random(seed)
        made = [bent(text, by) for text in texts for _ in range(BENT)]
        for first in range(0, len(made), AT_ONCE):
            wires.say(made[first : first + AT_ONCE], by)
        for one in made:
            wires.ask(one, by)

    said()
    wires.controlling.close()
    if wires.link is not None:
        wires.link.close()
    time.sleep(1.0)
    state = console.page(wires.cookies[0]).get_json("/api/state")
    assert state["phase"] == "idle"
    assert state["you"]["controller"] is None
    assert state["you"]["viewers"] == 0
    assert state["error"] is None
    assert len(os.listdir(f"/proc/{console.process.pid}/fd")) <= files
    return wires.counts


def test_whatever_comes_the_console_goes_on(console: RunningConsole) -> None:
    counts = many(console, 800)
    print(counts)
    assert counts["said"] > 300
    assert counts.get("429", 0) < 40


@pytest.mark.long
def test_a_hundred_thousand_of_them(console: RunningConsole) -> None:
    begun = time.monotonic()
    counts = many(console, 100_000)
    print(f"{sum(counts.values())} in {time.monotonic() - begun:.0f} s: {counts}")
    assert sum(counts.values()) >= 100_000
    assert counts["said"] > 0.98 * 50_000
    assert counts.get("429", 0) < 1000
