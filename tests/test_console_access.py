"""Who may ask a console, and what: token, cookie, Host, Origin, sizes, rates, and whatever else comes over a wire."""

import asyncio
import contextlib
import http.client
import json
import shutil
import socket
import ssl
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from starlette.responses import JSONResponse
from websockets.exceptions import InvalidStatus

from bowden.app.main import run
from bowden.console.access import COOKIE, LARGEST_BODY, LARGEST_MESSAGE, POLICY, Bucket, Guard
from bowden.console.console import Console, Viewer
from bowden.console.server import MOST_NEW, REQUEST_WITHIN
from bowden.core.errors import SafetyError
from bowden.rig.rig import Rig
from console_client import RIG, STRANGE, Page, RunningConsole, half_open, running_console

GETS = ("/", "/api/state", "/api/runs", "/api/runs/adaptive-1", "/api/runs/adaptive-1/log.csv", "/static/console.js")
UPGRADE = (
    f"Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: {'x' * 22}==\r\n"
)
POSTS = ("control", "settings", "check", "request", "stop", "gain", "inject", "path")


@pytest.fixture(scope="module")
def console(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningConsole]:
    folder = tmp_path_factory.mktemp("console")
    (folder / "rig<img src=x onerror=alert(1)>.toml").write_text(RIG)
    (folder / "secret.mcap").write_bytes(b"\x89MCAP")
    with running_console(next(folder.glob("rig*")), folder / "out", "--twin") as running:
        yield running


@pytest.fixture(scope="module")
def session(console: RunningConsole) -> Page:
    return console.page()


@pytest.fixture
def calm(session: Page) -> Page:
    """A page whose session has its requests again."""
    time.sleep(0.5)
    return session


def error_of(status: int, content: bytes) -> dict[str, str]:
    """The three parts of an error."""
    assert status >= 400
    found: dict[str, str] = json.loads(content)["error"]
    assert set(found) == {"what", "expected", "do"}
    assert b"Traceback" not in content
    return found


def test_without_a_session_nothing_is_had(console: RunningConsole) -> None:
    stranger = Page(console.port)
    name = COOKIE.format(port=console.port)
    for cookie in ("", f"{name}=x", f"{name}=", f"{name}={'a' * 43}", "other=1"):
        stranger.cookie = cookie
        for path in GETS:
            status, headers, content = stranger.get(path)
            assert status in (401, 429)
            error_of(status, content)
            assert headers["content-security-policy"] == POLICY
    for path in POSTS:
        time.sleep(0.15)
        assert stranger.request("POST", f"/api/{path}", b"{}")[0] == 401
    with pytest.raises(InvalidStatus):
        stranger.open()


def test_a_wrong_token_is_none(console: RunningConsole) -> None:
    stranger = Page(console.port)
    for token in ("", "x", console.token[:-1], console.token + "x", console.token.swapcase(), "%00", "ü"):
        status, headers, _ = stranger.get(f"/?token={token}" if token.isascii() else "/?token=%C3%BC")
        assert status == 401
        assert "set-cookie" not in headers
        time.sleep(0.1)
    assert stranger.get(f"/api/state?token={console.token}")[0] == 401, "the token opens the page and nothing else"


def test_the_cookie_is_for_this_page_alone(console: RunningConsole) -> None:
    status, headers, _ = Page(console.port).get(f"/?token={console.token}")
    assert status == 303
    assert headers["location"] == "/"
    assert {"HttpOnly", "SameSite=Strict", "Path=/"} <= {one.strip() for one in headers["set-cookie"].split(";")}
    assert console.token not in headers["set-cookie"]


def test_two_consoles_of_one_host_keep_their_sessions(console: RunningConsole, tmp_path: Path) -> None:
    """A cookie knows no port: one browser has those of both, and each console takes its own."""
    first = console.page().cookie
    (tmp_path / "rig.toml").write_text(RIG)
    with running_console(tmp_path / "rig.toml", tmp_path / "out", "--twin") as other:
        second = other.page().cookie
        jar = dict(cookie.split("=", 1) for cookie in (first, second))
        assert len(jar) == 2, "the second one has overwritten the first one"
        both = "; ".join(f"{name}={value}" for name, value in jar.items())
        for port in (console.port, other.port):
            assert Page(port, cookie=both).get("/api/state")[0] == 200
        assert Page(other.port, cookie=first).get("/api/state")[0] == 401
        renamed = f"{COOKIE.format(port=other.port)}={first.partition('=')[2]}"
        assert Page(other.port, cookie=renamed).get("/api/state")[0] == 401


async def asked(
    guard: Guard, path: str, method: str = "GET", *, query: bytes = b"", cookie: bytes = b""
) -> list[dict[str, Any]]:
    """What a guard sends to a request in memory."""
    said: list[dict[str, Any]] = []
    headers = [(b"host", b"a:1"), (b"origin", b"http://a:1"), (b"content-type", b"application/json")]
    scope = {"type": "http", "method": method, "path": path, "query_string": query}

    async def receive() -> dict[str, Any]:
        return {"type": "http.request", "body": b"{}"}

    async def send(message: Any) -> None:
        said.append(message)

    await guard({**scope, "headers": [*headers, (b"cookie", cookie)]}, receive, send)
    return said


async def session_of(guard: Guard) -> bytes:
    """The cookie that a guard gives who has its token."""
    head, _ = await asked(guard, "/", query=b"token=" + guard.token.encode())
    return bytes(dict(head["headers"])[b"set-cookie"].partition(b";")[0])


def guarded(inner: Any) -> Guard:
    """A guard for which no time passes."""
    return Guard(inner, ("a",), 1, secure=False, clock=lambda: 0.0)


def test_guesses_are_slowed_down() -> None:
    async def guess() -> list[int]:
        return [(await asked(guard, "/", query=b"token=guess"))[0]["status"] for _ in range(60)]

    guard = guarded(JSONResponse({}))
    assert asyncio.run(guess()) == [401] * 30 + [429] * 30


def test_a_flood_is_refused_and_a_stop_is_not() -> None:
    async def flood() -> tuple[list[int], list[int]]:
        cookie = await session_of(guard)
        states = [(await asked(guard, "/api/state", cookie=cookie))[0]["status"] for _ in range(400)]
        return states, [(await asked(guard, "/api/stop", "POST", cookie=cookie))[0]["status"] for _ in range(50)]

    guard = guarded(JSONResponse({}))
    assert asyncio.run(flood()) == ([200] * 120 + [429] * 280, [200] * 50)


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:{port}", "127.0.0.1", "127.0.0.1:1", "10.0.0.1:{port}", ""]
)
def test_a_foreign_host_is_no_name_of_the_console(calm: Page, host: str) -> None:
    """DNS rebinding: the browser sends the name of the page that it believes to be at."""
    status, _, content = calm.get("/api/state", {"Host": host.format(port=calm.port) or " "})
    assert status in (400, 421)
    if status == 421:
        error_of(status, content)


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "null", "https://127.0.0.1:{port}", "http://127.0.0.1:1", ""]
)
def test_a_foreign_origin_changes_nothing(calm: Page, origin: str) -> None:
    given = {"Origin": origin.format(port=calm.port)}
    for path in (*POSTS, "control"):
        status, _, content = calm.request("POST", f"/api/{path}", b'{"take": true}', given)
        assert status == 403
        error_of(status, content)
    assert calm.get_json("/api/state")["you"]["controller"] is None


def test_a_foreign_origin_gets_no_stream(console: RunningConsole, calm: Page) -> None:
    page = Page(console.port, cookie=calm.cookie)
    page.host = f"localhost:{console.port}"
    page.open().close()
    for origin in ("Origin: http://evil.example\r\n", ""):
        head = f"GET /stream HTTP/1.1\r\nHost: {calm.host}\r\n{origin}Cookie: {calm.cookie}\r\n{UPGRADE}\r\n"
        assert said_to(console.port, head.encode()).startswith(b"HTTP/1.1 403")


def said_to(port: int, text: bytes) -> bytes:
    """What comes first when this is sent as it is."""
    with socket.create_connection(("127.0.0.1", port), 5.0) as link:
        link.sendall(text)
        link.settimeout(5.0)
        return link.recv(4096)


def test_every_answer_has_its_headers(calm: Page) -> None:
    for path in ("/", "/api/state", "/api/runs", "/nowhere", "/static/x.js"):
        _, headers, _ = calm.get(path)
        assert headers["content-security-policy"] == POLICY
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["referrer-policy"] == "no-referrer"
        assert headers["cache-control"] == "no-store"
        assert "server" not in headers
    assert "unsafe" not in POLICY


def test_a_name_with_html_in_it_is_text_in_json(calm: Page) -> None:
    status, headers, content = calm.get("/api/state")
    assert status == 200
    assert headers["content-type"].startswith("application/json")
    assert json.loads(content)["rig"]["name"] == "rig<img src=x onerror=alert(1)>.toml"


PLACES = [
    *("../secret", "..%2Fsecret", "%2e%2e%2fsecret", "..", ".", "/etc/passwd", "%2Fetc%2Fpasswd", "a%00b", "secret"),
    *("..\\secret", "out/../../secret", "adaptive-1%0d%0aX:%20y", "%F0%9F%98%80", "a" * 300),
]


@pytest.mark.parametrize("name", PLACES)
def test_no_path_of_the_file_system_can_be_asked_for(calm: Page, name: str) -> None:
    shapes = ["/api/runs/{}", "/api/runs/{}/log.mcap", "/api/runs/{}/page.html", "/static/{}"]
    shapes.append("/api/runs/{}/curves?columns=joint_deg&from=0&to=1&pixels=100")
    for shape in shapes:
        status, headers, content = calm.get(shape.format(name.replace("\\", "%5C")))
        assert status == 404, shape
        error_of(status, content)
        assert "x" not in headers
        assert b"MCAP" not in content
        assert b"/tmp" not in content


def test_law_names_are_no_files(calm: Page, console: RunningConsole, tmp_path: Path) -> None:
    (tmp_path / "law.py").write_text("raise SystemExit('run!')\n")
    page = console.page(calm.cookie).open().take()
    for law in (f"{tmp_path}/law.py:LAW", "law.py", "../x.py:A", 7, None, ["adaptive"]):
        status, _, content = page.request("POST", "/api/settings", json.dumps({"law": law}).encode())
        assert status == 400
        assert "law is" in error_of(status, content)["what"]
    for reference in ({"kind": "recorded", "file": "/etc/passwd"}, {"kind": "chirp", "file": "x"}, {"kind": 3}, []):
        assert page.request("POST", "/api/settings", json.dumps({"reference": reference}).encode())[0] == 400
    page.close()


def test_settings_are_checked_and_in_the_state(calm: Page, console: RunningConsole) -> None:
    page = console.page(calm.cookie).open().take()
    for wrong in (
        *({"duration": "x"}, {"duration": 0}, {"duration": 1e9}, {"duration": True}, {"gains": {"nothing": 1}}),
        *({"gains": {"feedback_gain": -1}}, {"gains": []}, {"notes": "x" * 3000}, {"subject": 1}, {"unknown": 1}),
        *({"preset": "none"}, {"reference": {"kind": "periodic_minimum_jerk", "high_deg": 500.0}}),
    ):
        status, _, content = page.request("POST", "/api/settings", json.dumps(wrong).encode())
        assert status in (400, 409), wrong
        error_of(status, content)
    made = page.post("/api/settings", law="bowden", notes=STRANGE, subject="S", duration=12.5)["settings"]
    assert (made["law"], made["notes"], made["duration"]) == ("bowden", STRANGE, 12.5)
    made = page.post("/api/settings", law="adaptive", gains={"feedback_gain": 30.0})["settings"]
    assert made["gains"]["feedback_gain"]["value"] == 30.0
    made = page.post("/api/settings", reference={"kind": "periodic_minimum_jerk", "high_deg": 40.0})["settings"]
    assert made["reference"]["fields"]["high_deg"]["value"] == 40.0
    page.close()


def test_gains_that_do_not_hold_cannot_be_armed(calm: Page, console: RunningConsole) -> None:
    page = console.page(calm.cookie).open().take()
    page.until(lambda state: state["phase"] == "idle")
    page.post("/api/settings", law="adaptive", preset=None, gains={"feedback_gain": 5000.0})
    assert "check the settings first" in page.post("/api/request", request="start")
    page.post("/api/check")
    page.until(lambda state: state["check"] and not state["check"]["running"], 120.0, "the check")
    assert page.state["check"]["name"] == "does_not_hold"
    assert "do not hold" in page.post("/api/request", request="start")
    page.post("/api/settings", gains={"feedback_gain": 40.0})
    page.until(lambda state: state["check"] is None, 5.0, "a check that is none any more")
    assert "check the settings first" in page.post("/api/request", request="start")
    page.close()


def test_one_controls_and_it_is_taken_over_on_purpose(tmp_path: Path) -> None:
    """In memory: a page that a busy computer does not wake in time loses its stream by right."""

    async def handed_over() -> None:
        console = Console(Rig(), "rig.toml", twin=True, out=tmp_path)
        await console.begin()
        first, second = Viewer(), Viewer()
        try:
            for viewer in (first, second):
                console.see(viewer)
                console.control(viewer.tab, True)
            with pytest.raises(SafetyError, match="this page does not control"):
                console.require_control(first.tab)
            with pytest.raises(SafetyError, match="not connected"):
                console.control(first.tab[:-1] + "x", True)
            console.renew()
            assert [console.for_viewer(one.tab)["you"]["controls"] for one in (first, second)] == [False, True]
            console.leave(second)
            console.renew()
            assert console.for_viewer(first.tab)["you"]["controller"] is None
        finally:
            await console.close()

    asyncio.run(handed_over())


def test_only_the_page_in_control_changes_something(calm: Page, console: RunningConsole) -> None:
    page = console.page(calm.cookie)
    for path in ("settings", "check", "inject"):
        assert page.request("POST", f"/api/{path}", b"{}")[0] == 409
    page.tab = "x"
    assert "not connected" in page.post("/api/control", take=True)


def test_large_and_malformed_requests(console: RunningConsole) -> None:
    page = console.page()
    for body in (b"", b"[]", b"1", b"null", b"{", b"\xff\xfe", b'{"a": NaN}', b"[" * 8000, b'{"take": "yes"}'):
        status, _, content = page.request("POST", "/api/control", body)
        assert status in (400, 409), body[:20]
        error_of(status, content)
    status, _, content = page.request("POST", "/api/control", b" " * (LARGEST_BODY + 1))
    assert status == 413
    assert page.request("POST", "/api/control", b"{}", {"Content-Type": "text/plain"})[0] == 415
    assert page.request("PUT", "/api/control", b"{}", {"Origin": f"http://{page.host}"})[0] == 405
    assert page.get("/api/control")[0] in (404, 405)
    head = f"GET /api/state HTTP/1.1\r\nHost: {page.host}\r\nX: {'y' * 70_000}\r\n\r\n".encode()
    assert said_to(console.port, head).startswith(b"HTTP/1.1 4")
    assert page.get("/api/state")[0] == 200


def test_too_many_messages_end_a_stream_and_a_stop_does_not(console: RunningConsole) -> None:
    page = console.page().open()
    page.say('{"stop": true}')
    time.sleep(0.2)
    assert not page.closed.is_set()
    for _ in range(400):
        try:
            page.say('{"life": 1}')
        except Exception:
            break
    assert page.closed.wait(5.0)
    page.close()


def test_requests_without_an_end_keep_nobody_out(console: RunningConsole, calm: Page) -> None:
    """Each has two seconds for all of its request, and gives way where there are too many of them."""
    with half_open(calm, 130) as there:
        began = time.monotonic()
        assert calm.request("POST", "/api/stop", b"{}")[0] == 200
        assert console.page().get("/api/state")[0] == 200, "nor a browser that comes with the link now"
        assert time.monotonic() - began < 1.0
        assert sum(is_open(one) for one in there) <= MOST_NEW
        time.sleep(max(0.0, REQUEST_WITHIN + 1.0 - (time.monotonic() - began)))
        assert not any(is_open(one) for number, one in enumerate(there) if number % 5)


def is_open(link: socket.socket) -> bool:
    link.setblocking(False)
    try:
        while link.recv(4096):
            pass
    except BlockingIOError:
        return True
    except OSError:
        pass
    return False


def test_too_many_requests_at_once_are_refused_in_json_and_a_stop_is_not() -> None:
    """In memory: requests that are never answered, from a browser with the token."""
    hangs, found = asyncio.Event(), []

    async def never(*_: object) -> None:
        await hangs.wait()

    async def all_of_it() -> None:
        cookie = await session_of(guard)
        guard._sessions = {name: Bucket(1e3, 1e3) for name in guard._sessions}
        waiting = [asyncio.create_task(asked(guard, "/api/state", cookie=cookie)) for _ in range(128)]
        await asyncio.sleep(0.0)
        found.extend(await asked(guard, "/api/state", cookie=cookie))
        stop = asyncio.create_task(asked(guard, "/api/stop", "POST", cookie=cookie))
        await asyncio.sleep(0.0)
        assert not stop.done(), "it is taken in"
        hangs.set()
        await asyncio.gather(*waiting, stop)
        assert await asked(guard, "/api/state", cookie=cookie) == []

    guard = guarded(never)
    asyncio.run(all_of_it())
    start, body = found
    assert dict(start["headers"])[b"content-type"] == b"application/json"
    assert "at once" in error_of(start["status"], body["body"])["what"]
    assert start["status"] == 503


def test_a_message_that_is_too_large_ends_the_connection(console: RunningConsole) -> None:
    page = console.page().open()
    page.say(json.dumps({"view": {"columns": ["x" * LARGEST_MESSAGE], "seconds": 10, "pixels": 100}}))
    assert page.closed.wait(5.0)
    page.close()


def test_a_viewer_that_does_not_read_is_dropped(console: RunningConsole) -> None:
    """It answers no ping either; another one is served meanwhile."""
    page = console.page()
    head = f"GET /stream HTTP/1.1\r\nHost: {page.host}\r\nOrigin: http://{page.host}\r\nCookie: {page.cookie}\r\n"
    with socket.create_connection(("127.0.0.1", console.port), 5.0) as link:
        link.sendall(f"{head}{UPGRADE}\r\n".encode())
        came = b""
        while b'{"tab":' not in came:  # it is a viewer from here on
            came += (more := link.recv(4096))
            assert more
        deadline = time.monotonic() + 60.0
        while page.get_json("/api/state")["you"]["viewers"]:
            assert time.monotonic() < deadline
            time.sleep(0.2)
        with contextlib.suppress(ConnectionResetError):
            while link.recv(4096):  # what was on its way, then the end of the connection
                pass


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--host", "0.0.0.0"], "can be reached from the network"),
        (["--host", "192.0.2.1"], "can be reached from the network"),
        (["--tls-cert", "x.pem"], "belong together"),
        (["--tls-cert", "x.pem", "--tls-key", "y.pem"], "there is no file x.pem"),
        (["--host", "192.0.2.1", "--insecure-lan"], "cannot listen"),
    ],
)
def test_an_address_of_the_network_asks_for_tls(
    options: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "rig.toml").write_text(RIG)
    assert run(["console", str(tmp_path / "rig.toml"), "--twin", "--no-open", "--out", str(tmp_path), *options]) == 2
    assert said in capsys.readouterr().err


def test_a_port_that_is_taken(console: RunningConsole, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "rig.toml").write_text(RIG)
    words = ["console", str(tmp_path / "rig.toml"), "--no-open", "--out", str(tmp_path), "--port", str(console.port)]
    assert run(words) == 2
    assert "cannot listen" in capsys.readouterr().err


def test_a_bucket_fills_again() -> None:
    bucket = Bucket(10.0, 5.0)
    assert [bucket.take(1.0) for _ in range(7)] == [True] * 5 + [False] * 2
    assert bucket.take(1.1)
    assert not bucket.take(1.1)
    assert not bucket.take(0.0), "a clock that goes back gives nothing"


def test_over_tls_the_cookie_is_for_tls_alone(tmp_path: Path) -> None:
    """With a certificate of its own, at this computer's own address."""
    program = shutil.which("openssl") or pytest.skip("openssl, which makes the certificate, is not installed")
    (tmp_path / "rig.toml").write_text(RIG)
    key, cert = tmp_path / "rig.key", tmp_path / "rig.pem"
    words = [program, "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-keyout", str(key), "-out", str(cert)]
    named = ["-subj", "/CN=rig", "-addext", "subjectAltName=IP:127.0.0.1"]
    subprocess.run([*words, *named], check=True, capture_output=True)
    options = ["--twin", "--tls-cert", str(cert), "--tls-key", str(key)]
    with running_console(tmp_path / "rig.toml", tmp_path / "out", *options, speaks=False) as console:
        context = ssl.create_default_context(cafile=str(cert))
        link = http.client.HTTPSConnection("127.0.0.1", console.port, timeout=30.0, context=context)
        link.request("GET", f"/?token={console.token}")
        answer = link.getresponse()
        answer.read()
        assert answer.status == 303
        cookie = answer.getheader("set-cookie", "")
        assert cookie.endswith("; Secure")
        link.request("GET", "/api/state", headers={"Cookie": cookie.partition(";")[0]})
        answer = link.getresponse()
        assert answer.status == 200
        assert json.loads(answer.read())["rig"]["drive"] == "twin"
        link.close()
