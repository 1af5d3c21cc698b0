"""Who may ask: the token, cookies, `Host` and `Origin`, headers of every answer, and limits of size and rate.

It stands before everything else as one ASGI application round another, so that no route can be forgotten.
"""

import hmac
import ipaddress
import json
import secrets
from collections.abc import Callable
from typing import Any

from starlette.datastructures import Headers, QueryParams
from starlette.requests import ClientDisconnect, Request, cookie_parser
from starlette.responses import JSONResponse, RedirectResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from bowden.core.errors import BowdenError, SafetyError

COOKIE = "bowden_console_{port}"
"""Name of the session's cookie. Browsers send a host's cookies to each of its ports: each console has its own name."""
LARGEST_BODY = 16_384
"""Of a request [bytes]."""
LARGEST_MESSAGE = 4096
"""Of a message of a page's WebSocket [bytes]."""
_FIELDS = 8
"""Of a query that is looked at."""
_MOST_SESSIONS = 64
"""Browsers at a time; the one that came first gives way."""
_MOST_AT_ONCE = 128
"""Requests that are being answered; a stop is taken beside them."""
_WILDCARDS = ("0.0.0.0", "::")

POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self' data:; "
    "frame-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""Of the page: nothing inline, nothing from elsewhere."""
PAGE_POLICY = (
    "sandbox; default-src 'none'; style-src 'unsafe-inline'; img-src data:; font-src data:; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'self'"
)
"""Of a log's page: no script, an origin of its own, styles and pictures that are in it."""
_HEADERS = {
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cache-control": "no-store",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "permissions-policy": "camera=(), microphone=(), geolocation=()",
}


class Bucket:
    """Token bucket: `rate` events a second, and `burst` events at once."""

    def __init__(self, rate: float, burst: float) -> None:
        self._rate, self._burst, self._left, self._at = rate, burst, burst, 0.0

    def take(self, now: float) -> bool:
        """True if an event is allowed at `now` [s]; it then counts."""
        self._left = min(self._burst, self._left + self._rate * max(0.0, now - self._at))
        self._at = now
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True


class Refused(BowdenError):
    """A request that is not granted; with its status.

    Args:
        status: of HTTP.
        what: why.
        expected: what was expected.
        do: what to do.
    """

    def __init__(self, status: int, what: str, *, expected: str = "", do: str = "") -> None:
        super().__init__(what, expected=expected, do=do)
        self.status = status


def parts_of(error: BowdenError) -> dict[str, str]:
    """An error in its three parts."""
    return {"what": error.what, "expected": error.expected, "do": error.do}


def answer(error: BowdenError, headers: dict[str, str] | None = None) -> JSONResponse:
    """An error as the answer to a request."""
    status = error.status if isinstance(error, Refused) else 409 if isinstance(error, SafetyError) else 400
    return JSONResponse({"error": parts_of(error)}, status, headers)


def document(text: bytes | str) -> dict[str, Any]:
    """The JSON object that a text is.

    Raises:
        Refused: it is none.
    """
    try:
        found = json.loads(text, parse_constant=_no_constant)
    except (ValueError, RecursionError):
        found = None
    if not isinstance(found, dict):
        raise Refused(400, "the request is no JSON object", expected="an object such as {}", do="reload the page")
    return found


def _no_constant(name: str) -> None:
    raise ValueError(name)


class Guard:
    """All that is checked before a request is looked at.

    Args:
        inner: the application.
        names: hosts by which this console is reached; any address as well, where it listens at all of them.
        port: at which it listens.
        secure: whether it speaks TLS.
        clock: seconds that only grow.
    """

    def __init__(
        self, inner: ASGIApp, names: tuple[str, ...], port: int, *, secure: bool, clock: Callable[[], float]
    ) -> None:
        self.token = secrets.token_urlsafe(32)
        """What the link has."""
        self._inner, self._clock, self._port, self._secure = inner, clock, port, secure
        self._cookie = COOKIE.format(port=port)
        self._names = frozenset(name.lower() for name in names if name not in _WILDCARDS)
        self._anywhere = not {*names}.isdisjoint(_WILDCARDS)
        self._sessions: dict[bytes, Bucket] = {}
        self._going = 0
        self._strangers = Bucket(10.0, 30.0)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """One request or connection."""
        if scope["type"] == "lifespan":
            await self._inner(scope, receive, send)
            return
        send = _with_headers(send)
        try:
            cookie = self._check(scope)
            body = await _body(scope, receive)
        except Refused as refused:
            if scope["type"] == "websocket":
                await receive()
            await answer(refused, {"connection": "close"})(scope, receive, send)
            return
        if cookie:
            await RedirectResponse("/", 303, {"set-cookie": cookie})(scope, receive, send)
        elif scope["type"] == "http":
            self._going += 1
            try:
                await self._inner(scope, _given(body, receive), send)
            finally:
                self._going -= 1
        else:
            await self._inner(scope, receive, send)

    def _check(self, scope: Scope) -> str:
        """The cookie to be set, for a link with the right token; empty for a request that may pass.

        Raises:
            Refused: anything else.
        """
        headers = Headers(scope=scope)
        host = headers.getlist("host")
        if len(host) != 1 or not self._known(host[0]):
            raise Refused(421, "this console is not reached by that name", do="open the link that it printed")
        changes = scope["type"] == "websocket" or scope["method"] not in ("GET", "HEAD")
        if changes:
            origin, wanted = headers.getlist("origin"), f"{'https' if self._secure else 'http'}://{host[0]}".lower()
            if len(origin) != 1 or origin[0].lower() != wanted:
                raise Refused(
                    403, "the request comes from another page than the console's", do="open the console's link"
                )
        bucket = self._session(headers.getlist("cookie"))
        if bucket is None:
            return self._stranger(scope)
        stops = scope.get("path") == "/api/stop"
        if not stops and not bucket.take(self._clock()):
            raise Refused(429, "too many requests", expected="at most 40 a second", do="wait a moment")
        if not stops and self._going >= _MOST_AT_ONCE:
            raise Refused(503, "too many requests at once", expected=f"at most {_MOST_AT_ONCE}", do="wait a moment")
        if scope["type"] == "http" and changes:
            if scope["method"] != "POST":
                raise Refused(405, "this method is not known here", expected="GET or POST", do="reload the page")
            kind = headers.get("content-type", "").partition(";")[0].strip().lower()
            if kind != "application/json":
                raise Refused(
                    415, "the request is no JSON", expected="content-type: application/json", do="reload the page"
                )
        return ""

    def _known(self, host: str) -> bool:
        """True if a `Host` names this console: a foreign name that leads here is a page that plays with DNS."""
        name, colon, port = host.rpartition(":")
        if not colon or host.endswith("]"):
            name, port = host, "443" if self._secure else "80"
        name = name.strip("[]").lower()
        if port != str(self._port):
            return False
        if name in self._names:
            return True
        try:
            ipaddress.ip_address(name)
        except ValueError:
            return False
        return self._anywhere

    def _session(self, cookies: list[str]) -> Bucket | None:
        """The limit of the session that a cookie names; None where there is none."""
        found, given = None, cookie_parser(";".join(cookies)).get(self._cookie, "").encode("latin-1", "replace")
        for known, bucket in self._sessions.items():  # all of them, in a time that says nothing
            if hmac.compare_digest(known, given):
                found = bucket
        return found

    def _stranger(self, scope: Scope) -> str:
        if not self._strangers.take(self._clock()):
            raise Refused(429, "too many requests without a session", do="wait a moment, then open the console's link")
        few = scope["query_string"].count(b"&") < _FIELDS  # many take long to parse, and signs of life wait meanwhile
        token = QueryParams(scope["query_string"]).get("token", "") if few else ""
        opens = scope["type"] == "http" and scope["method"] == "GET" and scope["path"] == "/"
        if not (opens and hmac.compare_digest(token.encode("latin-1", "replace"), self.token.encode())):
            raise Refused(
                401,
                "this browser has no session with the console",
                expected="its token",
                do="open the link that it printed",
            )
        value = secrets.token_urlsafe(32)
        while len(self._sessions) >= _MOST_SESSIONS:
            self._sessions.pop(next(iter(self._sessions)))
        self._sessions[value.encode()] = Bucket(40.0, 120.0)
        return f"{self._cookie}={value}; HttpOnly; SameSite=Strict; Path=/{'; Secure' if self._secure else ''}"


async def _body(scope: Scope, receive: Receive) -> bytes:
    """The whole body of a request, which is small.

    Raises:
        Refused: it is not.
    """
    body = b""
    if scope["type"] == "http" and scope["method"] == "POST":
        try:
            async for piece in Request(scope, receive).stream():
                body += piece
                if len(body) > LARGEST_BODY:
                    raise Refused(
                        413, "the request is too large", expected=f"at most {LARGEST_BODY} bytes", do="shorten it"
                    )
        except ClientDisconnect:
            raise Refused(400, "the request has no end", do="reload the page") from None
    return body


def _given(body: bytes, receive: Receive) -> Receive:
    """The body that was read already, then what comes after it."""
    waiting = [body]

    async def give() -> Message:
        if waiting:
            return {"type": "http.request", "body": waiting.pop(), "more_body": False}
        return await receive()

    return give


def _with_headers(send: Send) -> Send:
    """Every answer with the headers that protect it."""

    async def sent(message: Message) -> None:
        if message["type"] == "http.response.start":
            there = {name.lower() for name, _ in message.get("headers", [])}
            wanted = {"content-security-policy": POLICY, **_HEADERS}
            more = [(name.encode(), value.encode()) for name, value in wanted.items() if name.encode() not in there]
            message = {**message, "headers": [*message.get("headers", []), *more]}
        await send(message)

    return sent
