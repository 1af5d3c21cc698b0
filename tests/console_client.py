"""What tests of the console share: a console in a process of its own, and a page that talks to it."""

import contextlib
import http.client
import json
import re
import socket
import subprocess
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar

import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from live_runs import COMMAND, strokes, tries

T = TypeVar("T")

RIG = strokes(60.0)
STRANGE = "<script>alert(1)</script>"
_TRIES = 6
LIFE = 0.1
"""Between two signs of life of a page [s]."""


class Page:
    """A browser's page, as far as the server sees one.

    Args:
        port: of the console.
        token: of its link.
        cookie: of a browser that has a session already.
        reads: whether it reads what comes.
        via: port to connect to in place of the console's own: of something between the two.
    """

    def __init__(self, port: int, token: str = "", cookie: str = "", *, reads: bool = True, via: int = 0) -> None:
        self.port, self.host, self.via = port, f"127.0.0.1:{port}", via or port
        self.cookie = cookie
        if token:
            status, headers, _ = self.get(f"/?token={token}")
            assert status == 303, status
            self.cookie = headers["set-cookie"].partition(";")[0]
        self.state: dict[str, Any] = {}
        self.seen: int | None = None
        """Stamp of the newest message."""
        self.frames: list[bytes] = []
        self.tab, self.alive, self.count = "", threading.Event(), 0
        self.closed: threading.Event = threading.Event()
        self.dropped = False
        """Whether the server has closed the stream."""
        self._threads: list[threading.Thread] = []
        self.socket: ClientConnection | None = None
        self._open = contextlib.ExitStack()
        self._reads = reads

    def open(self) -> "Page":
        """Connect to the stream."""
        headers = {"Cookie": self.cookie}
        url = f"ws://{self.host}/stream"
        origin: Any = f"http://{self.host}"
        to = socket.create_connection(("127.0.0.1", self.via), 10.0)
        given: dict[str, Any] = {"compression": None, "ping_interval": None}  # a browser's page sends no pings either
        link = connect(url, sock=to, origin=origin, additional_headers=headers, **given)
        self.socket = self._open.enter_context(link)
        self.tab = json.loads(self.socket.recv(5.0))["tab"]
        for work in (self._read, self._live) if self._reads else (self._live,):
            self._threads.append(threading.Thread(target=work, daemon=True))
            self._threads[-1].start()
        return self

    def _read(self) -> None:
        assert self.socket is not None
        with contextlib.suppress(ConnectionClosed):
            for message in self.socket:
                if isinstance(message, bytes):
                    self.frames.append(message)
                else:
                    found = json.loads(message)
                    self.state, self.seen = found.get("state", self.state), found["beat"]
        self.dropped = not self.closed.is_set()
        self.closed.set()

    def _live(self) -> None:
        assert self.socket is not None
        with contextlib.suppress(ConnectionClosed):
            while not self.closed.is_set():
                if self.alive.is_set():
                    self.count += 1
                    self.socket.send(json.dumps({"life": self.count}))
                time.sleep(LIFE)

    def say(self, text: str | bytes) -> None:
        """Send something."""
        assert self.socket is not None
        self.socket.send(text)

    def close(self) -> None:
        """Close the stream."""
        self.closed.set()
        self._open.close()

    def request(
        self, method: str, path: str, body: bytes | None = None, headers: dict[str, str] | None = None
    ) -> tuple[int, dict[str, str], bytes]:
        """One request, with the cookie and, where it changes something, the page's origin; headers may differ."""
        given = {"Host": self.host, "Cookie": self.cookie, "Bowden-Tab": getattr(self, "tab", "")}
        if method == "POST":
            given |= {"Origin": f"http://{self.host}", "Content-Type": "application/json"}
        given |= headers or {}
        link = http.client.HTTPConnection("127.0.0.1", self.via, timeout=60.0)
        with contextlib.closing(link):
            link.putrequest(method, path, skip_host=True, skip_accept_encoding=True)
            for name, value in given.items():
                if value:
                    link.putheader(name, value)
            if body is not None:
                link.putheader("Content-Length", str(len(body)))
            link.endheaders()
            if body is not None:
                with contextlib.suppress(BrokenPipeError, ConnectionResetError):
                    link.send(body)
            answer = link.getresponse()
            return answer.status, {name.lower(): value for name, value in answer.getheaders()}, answer.read()

    def get(self, path: str, headers: dict[str, str] | None = None) -> tuple[int, dict[str, str], bytes]:
        """A GET."""
        return self.request("GET", path, None, headers)

    def get_json(self, path: str) -> Any:
        """What a GET gives."""
        status, _, said = self.get(path)
        assert status == 200, said
        return json.loads(said)

    def post(self, path: str, **given: Any) -> Any:
        """What a POST of JSON gives: the document, or its error's first part; a request has the newest stamp."""
        if path == "/api/request":
            given = {"seen": self.seen, **given}
        status, _, said = self.request("POST", path, json.dumps(given).encode())
        found = json.loads(said)
        return found["error"]["what"] if status != 200 else found.get("answer", found)

    def until(self, holds: Callable[[dict[str, Any]], Any], seconds: float = 60.0, what: str = "") -> None:
        """Wait until the state is like this."""
        deadline = time.monotonic() + seconds
        while not (self.state and holds(self.state)):
            if time.monotonic() > deadline:
                said = {name: self.state.get(name) for name in ("phase", "error")}
                raise AssertionError(f"{what} did not come: {said} {(self.state.get('run') or {}).get('events')}")
            time.sleep(0.01)

    @property
    def mode(self) -> str:
        """Of the run."""
        return str((self.state.get("run") or {}).get("mode"))

    def take(self) -> "Page":
        """Take the control, and live."""
        self.alive.set()
        self.post("/api/control", take=True)
        return self

    def start(self) -> None:
        """Check and start."""
        if self.state["check"] is None:
            self.post("/api/check")
            self.until(lambda state: state["check"] and not state["check"]["running"], 120.0, "the check")
        assert self.post("/api/request", request="start") == ""
        self.until(lambda state: state["error"] or (state["phase"] == "live" and state["run"]), 180.0, "the session")
        assert not self.state["error"], self.state["error"]

    def run(self) -> None:
        """Arm and run, until the law has the motor; what a computer that stalls latches is acknowledged."""
        for _ in range(_TRIES):
            if self._runs():
                return
        raise AssertionError(f"no run came to the law: {self.state['run']['events']}")

    def _runs(self) -> bool:
        for request, modes in (("acknowledge", ("stopped",)), ("arm", ("ready",)), ("run", ("running",))):
            deadline = time.monotonic() + 10.0
            if request == "acknowledge" and self.mode == "stopped":
                continue
            while (said := self.post("/api/request", request=request)) and time.monotonic() < deadline:
                time.sleep(0.1)
                if self.mode in modes:  # the state came later than the answer
                    said = ""
                    break
            assert said == "", said
            time.sleep(0.2)
            wanted = (*modes, "latched") if request != "acknowledge" else modes
            self.until(lambda state, wanted=wanted: state["run"]["mode"] in wanted, 20.0, request)  # type: ignore[misc]
            if self.mode == "latched":
                return False
        self.until(lambda state: state["run"]["mode"] != "running" or state["run"]["elapsed"] > 0.3, 20.0, "the law")
        return self.mode == "running"

    @property
    def cut_off(self) -> bool:
        """Whether it has lost what a computer that stalls loses by right: stream, control, the law by a fault."""
        if self.dropped:
            return True
        state = self.get_json("/api/state")
        return self.alive.is_set() and (not state["you"]["controls"] or (state["run"] or {}).get("mode") == "latched")


class RunningConsole:
    """A console in a process of its own."""

    def __init__(self, process: "subprocess.Popen[str]", port: int, token: str, out: Path) -> None:
        self.process, self.port, self.token, self.out = process, port, token, out
        self._pages: list[Page] = []

    def page(self, cookie: str = "", *, reads: bool = True) -> Page:
        """A page of a browser of its own, or of one with a cookie."""
        self._pages.append(Page(self.port, "" if cookie else self.token, cookie, reads=reads))
        return self._pages[-1]

    def in_control(self) -> Page:
        """A page that controls, without a session: one that a test before has left is ended."""
        page = self.page().open().take()
        page.until(lambda state: state, 10.0, "the state")
        if page.state["phase"] == "live":
            page.post("/api/request", request="end")
        page.until(lambda state: state["phase"] == "idle", 60.0, "idle")
        return page

    def carried_through(self, run: Callable[[Page, "RunningConsole"], T]) -> T:
        """What a run gives that comes to its end; one of which a page was cut off is tried again.

        A page that is not woken for half a second has lost the control, and one for a second its stream: by right.
        """
        for _ in tries():
            self._pages = []
            page = self.in_control()
            try:
                return run(page, self)
            except (AssertionError, ConnectionClosed) as error:
                if not any(one.cut_off for one in self._pages):
                    raise
                print(f"cut off: {error}")
            finally:
                page.close()
        pytest.fail("each time a page was cut off")


@contextlib.contextmanager
def running_console(
    rig: Path, out: Path, *options: str, prelude: str = "", ends: bool = True, speaks: bool = True
) -> Iterator[RunningConsole]:
    """A console of a rig, ended afterwards; it must not have shown a traceback.

    Args:
        rig: its file.
        out: folder for the logs.
        options: of the command.
        prelude: what its process does first.
        ends: whether it still can when it is asked to.
        speaks: HTTP; it is waited for then.
    """
    command = [*COMMAND[:-1], f"{prelude}\n{COMMAND[-1]}"]
    words = [*command, "console", str(rig), "--no-open", "--out", str(out), *options]
    with tempfile.TemporaryFile("w+") as errors:
        process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=errors, text=True, start_new_session=True)
        try:
            assert process.stdout is not None
            line = process.stdout.readline()
            found = re.search(r":(\d+)/\?token=(\S+)", line)
            if found is None:
                process.wait(10.0)
                errors.seek(0)
                raise AssertionError(f"no console: {line}{errors.read()}")
            console = RunningConsole(process, int(found[1]), found[2], out)
            if speaks:
                await_answer(console.port)
            yield console
        finally:
            (process.terminate if ends else process.kill)()
            try:
                process.wait(40.0)
            finally:
                process.kill()
                process.communicate()
            errors.seek(0)
            said = errors.read()
            assert "Traceback" not in said, said


@contextlib.contextmanager
def half_open(page: Page, count: int) -> Iterator[list[socket.socket]]:
    """Connections whose request never ends, for 20 s at most, with the cookie of a page.

    By turns they send: nothing, a head from its first byte on, half a head, the rest of it, a body; what comes a byte
    at a time has one each half second.
    """
    head = f"POST /api/stop HTTP/1.1\r\nHost: {page.host}\r\nOrigin: http://{page.host}\r\nCookie: {page.cookie}\r\n"
    text = f"{head}Content-Type: application/json\r\nContent-Length: 999\r\n\r\n{{".encode()
    kinds = ((0, b""), (0, b"G"), (len(text) // 2, b""), (len(text) // 2, b"x"), (len(text), b" "))
    ended = threading.Event()

    def drip() -> None:
        for _ in range(40):
            if ended.wait(0.5):
                return
            for number, one in enumerate(there):
                with contextlib.suppress(OSError):
                    one.sendall(kinds[number % len(kinds)][1])

    with contextlib.ExitStack() as stack:
        there = []
        for number in range(count):
            there.append(stack.enter_context(socket.create_connection(("127.0.0.1", page.port), 5.0)))
            there[-1].sendall(text[: kinds[number % len(kinds)][0]])
        thread = threading.Thread(target=drip)
        thread.start()
        try:
            yield there
        finally:
            ended.set()
            thread.join()


def await_answer(port: int) -> None:
    """Until it answers."""
    for _ in range(200):
        link = http.client.HTTPConnection("127.0.0.1", port, timeout=5.0)
        try:
            link.request("GET", "/")
            link.getresponse().read()
            return
        except OSError:
            time.sleep(0.05)
        finally:
            link.close()
    raise AssertionError("the console does not answer")
