"""The routes of a console, and uvicorn that serves them."""

import asyncio
import contextlib
import inspect
import json
import logging
import signal
import socket
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from pathlib import Path
from types import FrameType
from typing import Annotated, Any

import uvicorn
from pydantic import BaseModel, Field, FiniteFloat, ValidationError
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket, WebSocketDisconnect
from uvicorn.protocols.http.h11_impl import H11Protocol

from bowden.console.access import LARGEST_BODY, LARGEST_MESSAGE, PAGE_POLICY, Bucket, Guard, Refused, answer, document
from bowden.console.console import Console, Viewer
from bowden.console.earlier import KINDS
from bowden.console.stream import MOST_COLUMNS, PIXELS, SECONDS, Cursor
from bowden.core.errors import BowdenError, DriveError, note

REQUEST_WITHIN = 2.0
"""From a request's first byte to its last; a head that comes a byte a second is none [s]."""
MOST_NEW = 64
"""Connections that have not sent a whole request yet. The oldest gives way: a page sends its own at once."""


class Connection(H11Protocol):
    """uvicorn's, which would wait for a request for ever, and count what waits among the connections in use."""

    begun = -1.0
    """When it was made, until its first request is whole [s]."""
    _under_way = False
    """True if a part of a request has come."""
    _deadline: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Take it, in place of the oldest one without a request where there are too many."""
        super().connection_made(transport)
        self.begun = self.loop.time()
        self._expect(self.timeout_keep_alive)
        new = [one for one in self.connections if isinstance(one, Connection) and one.begun >= 0.0]
        if len(new) > MOST_NEW:
            oldest = min(new, key=lambda one: one.begun)
            oldest.begun = -1.0  # it is lost a moment later, and is not to be chosen twice
            oldest.transport.abort()

    def data_received(self, data: bytes) -> None:
        """A part of a request: the rest of it has its deadline from the first one on."""
        super().data_received(data)
        is_stream = self.transport.get_protocol() is not self  # which h11 then shows as a request without its body
        if is_stream or self.conn.their_state.__name__ not in ("IDLE", "SEND_BODY"):
            self.begun, self._under_way = -1.0, False
            self._expect(None)
        elif not self._under_way:
            self._under_way = True
            self._expect(REQUEST_WITHIN)

    def connection_lost(self, exc: Exception | None) -> None:
        """It has ended."""
        self._expect(None)
        super().connection_lost(exc)

    def _expect(self, seconds: float | None) -> None:
        """Close it after a time [s], unless more comes before; None for never."""
        if self._deadline is not None:
            self._deadline.cancel()
        self._deadline = None if seconds is None else self.loop.call_later(seconds, self.transport.abort)


TAB = "bowden-tab"
"""Header that says which page asks."""
_STATIC = Path(__file__).parent / "static"
_MOST_VIEWERS = 16
_SLOW = 1.0
"""A viewer whose socket takes nothing for this long is dropped [s]."""
_PING, _PONG = 0.5, 1.0
"""Between two pings of a page, and for its answer [s]: one to which nothing comes any more shows what is long over."""
_LOOPS = 0.2
"""Between two pictures of joint over motor [s]."""
_BUFFER = 65_536
"""Of the kernel's for what is sent to one page: a page that does not read is seen within a second [bytes]."""

Handler = Callable[[Request], Awaitable[Response]]


def application(console: Console) -> Starlette:
    """The routes."""

    @contextlib.asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncIterator[None]:
        asyncio.get_running_loop().set_exception_handler(_broken)
        await console.begin()
        ticking = asyncio.get_running_loop().create_task(console.keep_ticking())
        try:
            yield
        finally:
            ticking.cancel()
            await console.close()

    def posted(path: str, act: Callable[[str, dict[str, Any]], Any], *, controls: bool = False) -> Route:
        """A request of a page with a JSON object: answered in words, or by the news where there is no word."""

        async def handler(request: Request) -> Response:
            tab, given = _tab(request), document(await request.body())
            if controls:
                console.require_control(tab)
            found = act(tab, given)
            found = await found if inspect.isawaitable(found) else found
            if isinstance(found, str):
                return JSONResponse({"answer": found})
            console.renew()
            return await state(request)

        return route(path, handler, "POST")

    def got(path: str, find: Callable[[Request], Any]) -> Route:
        """What a page asks for: a document, the page of a log or a step, or a frame of curves."""

        async def handler(request: Request) -> Response:
            found = find(request)
            found = await found if inspect.isawaitable(found) else found
            if isinstance(found, Path):
                return FileResponse(found, media_type="text/html", headers={"content-security-policy": PAGE_POLICY})
            if isinstance(found, bytes):
                return Response(found, media_type="application/octet-stream")
            return JSONResponse(found)

        return route(path, handler)

    async def state(request: Request) -> Response:
        return JSONResponse(console.for_viewer(_tab(request)))

    async def download(request: Request) -> Response:
        run, kind = request.path_params["run"], request.path_params["kind"]
        file = await console.earlier.download(run, kind)
        return FileResponse(file, media_type=KINDS[kind], filename=f"{run}.{kind}")

    async def stream(socket_: WebSocket) -> None:
        await _stream(console, socket_)

    def route(path: str, handler: Handler, method: str = "GET") -> Route:
        return Route(path, _explained(handler), methods=[method])

    earlier = console.earlier

    return Starlette(
        routes=[
            route("/", _page),
            Mount("/static", StaticFiles(directory=_STATIC)),
            route("/api/state", state),
            posted("/api/control", lambda tab, given: console.control(tab, given.get("take"))),
            posted("/api/settings", lambda _, given: console.change(given), controls=True),
            posted("/api/check", lambda *_: console.begin_check(), controls=True),
            posted("/api/request", lambda tab, given: console.request(tab, given.get("request"), given.get("seen"))),
            posted("/api/stop", lambda *_: console.stop()),
            posted("/api/gain", lambda tab, given: console.set_gain(tab, given.get("name"), given.get("value"))),
            posted("/api/inject", lambda _, given: console.inject(given.get("fault")), controls=True),
            posted("/api/path", lambda tab, given: console.step(tab, given.get("step"))),
            got("/api/path/{step}.html", lambda asked: console.path.page(asked.path_params["step"])),
            got("/api/runs", lambda asked: earlier.listed(asked.query_params.get("search", "")[:200])),
            got("/api/runs/{run}", lambda asked: earlier.details(asked.path_params["run"])),
            route("/api/runs/{run}/log.{kind}", download),
            got("/api/runs/{run}/page.html", lambda asked: earlier.page(asked.path_params["run"])),
            got("/api/runs/{run}/curves", lambda asked: earlier.curves(asked.path_params["run"], asked.query_params)),
            WebSocketRoute("/stream", stream),
        ],
        lifespan=lifespan,
        exception_handlers={404: _unknown, 405: _unknown, 500: _failed},
    )


def _tab(request: Request) -> str:
    return request.headers.get(TAB, "")[:64]


def _explained(handler: Handler) -> Handler:
    """An error as JSON in its three parts, never a traceback."""

    async def explained(request: Request) -> Response:
        try:
            return await handler(request)
        except BowdenError as error:
            return answer(error)

    return explained


async def _unknown(request: Request, error: Exception) -> Response:
    return answer(Refused(404, "there is nothing under this address", do="open the console's page"))


async def _failed(request: Request, error: Exception) -> Response:
    return answer(Refused(500, "the console failed to answer", do="see the terminal that started it"))


async def _page(request: Request) -> Response:
    return FileResponse(_STATIC / "index.html")


async def _stream(console: Console, page: WebSocket) -> None:
    """One page's connection: what it says is taken in one task, what it sees is sent by another."""
    if len(console.viewers) >= _MOST_VIEWERS:
        full = Refused(503, "too many pages look on", expected=f"at most {_MOST_VIEWERS}", do="close one of them")
        await page.send_denial_response(answer(full))
        return
    await page.accept()
    viewer = Viewer()
    console.see(viewer)
    sending = asyncio.create_task(_send(console, viewer, page))
    taking = asyncio.create_task(_take(console, viewer, page))
    try:
        await asyncio.wait({sending, taking}, return_when=asyncio.FIRST_COMPLETED)
    finally:
        console.leave(viewer)
        for task in (sending, taking):
            task.cancel()
        found = await asyncio.gather(sending, taking, return_exceptions=True)
        for one in found:
            if isinstance(one, Exception) and not isinstance(one, WebSocketDisconnect | TimeoutError | RuntimeError):
                note(f"a page was dropped: {type(one).__name__}")
        with contextlib.suppress(Exception):
            await asyncio.wait_for(page.close(1008), _SLOW)


async def _take(console: Console, viewer: Viewer, page: WebSocket) -> None:
    """What a page says, until it says something that it never would."""
    bucket = Bucket(60.0, 120.0)
    while True:
        received = await page.receive()
        if received["type"] == "websocket.disconnect":
            return
        text = received.get("text")
        if text is None or len(text) > LARGEST_MESSAGE:
            return
        try:
            message = _Message.model_validate_json(text)
        except ValidationError:
            if '"stop"' in text:
                console.stop()  # whatever else is wrong with the message
            return
        if message.stop:
            console.stop()  # nothing is waited for: signs of life come the same way
        elif not bucket.take(time.monotonic()):
            return
        elif message.life is not None:
            console.lease.sign(viewer.tab, message.life, console.owner.clock.now())
        elif message.view is not None:
            view = message.view
            seconds, pixels = _within(view.seconds, SECONDS), _within(view.pixels, PIXELS)
            viewer.asked = (view.columns, seconds, round(pixels), view.xy, view.number)
        else:
            return


class _View(BaseModel, strict=True):
    """What a page wants to see."""

    columns: Annotated[list[str], Field(max_length=MOST_COLUMNS)]
    seconds: FiniteFloat
    pixels: FiniteFloat
    number: Annotated[int, Field(ge=0, lt=2**32)] = 0
    xy: bool = False


class _Message(BaseModel, strict=True):
    """What a page says: one of the three."""

    stop: bool = False
    life: int | None = None
    """Grows from one sign of life to the next."""
    view: _View | None = None


def _within(value: float, ends: tuple[float, float]) -> float:
    return min(max(value, ends[0]), ends[1])


async def _send(console: Console, viewer: Viewer, page: WebSocket) -> None:
    """States, or that the last one still holds, and frames, each as it is when the one before is on its way.

    A page that takes none is dropped.
    """

    async def text(value: Any) -> None:
        await asyncio.wait_for(page.send_text(json.dumps(value, separators=(",", ":"))), _SLOW)

    await text({"tab": viewer.tab})
    sent, stamped, watch, asked = -1, 0, None, None
    controls = None
    cursor: Cursor | None = None
    while True:
        ticked = console.ticked
        number, _ = console.newest
        holds = console.lease.look(console.owner.clock.now()).holder == viewer.tab
        if number != sent or holds != controls:
            sent, controls, stamped = number, holds, console.stamp
            await text({"state": console.for_viewer(viewer.tab), "beat": stamped})
        elif console.stamp != stamped:
            stamped = console.stamp
            await text({"beat": stamped})
        if console.watch is not watch or viewer.asked is not asked:
            watch, asked, cursor = console.watch, viewer.asked, None
        if watch is not None and asked is not None:
            if cursor is None:
                columns, seconds, pixels, loop, view = asked
                cursor = Cursor(watch.view(columns, seconds, pixels, loop=loop), view)
            for frame in (watch.frame(cursor), watch.loop_frame(cursor, _LOOPS)):
                if frame is not None:
                    await asyncio.wait_for(page.send_bytes(frame), _SLOW)
        await ticked.wait()


def _broken(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
    """What broke outside of any request; of a connection a line is enough: by then it is ended, and its page gone."""
    if "transport" not in context:
        loop.default_exception_handler(context)
        return
    note(f"a connection was ended: {type(context.get('exception')).__name__}")


def _without_traceback(record: logging.LogRecord) -> bool:
    """Of bytes that are no text, which is what some client sent, uvicorn would show where it found them."""
    if record.exc_info and isinstance(record.exc_info[1], UnicodeDecodeError):
        record.exc_info = None
    return True


class _Server(uvicorn.Server):
    """Asks for the end of the run before anything else, when a signal comes."""

    def __init__(self, config: uvicorn.Config, console: Console) -> None:
        super().__init__(config)
        self._console = console

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """A signal."""
        self._console.owner.end()
        super().handle_exit(sig, frame)


def listening(host: str, port: int) -> socket.socket:
    """A socket that listens there; 0 for a free port.

    Raises:
        DriveError: it cannot.
    """
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    found = socket.socket(family, socket.SOCK_STREAM)
    try:
        found.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        found.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _BUFFER)  # what it accepts has the same
        found.bind((host, port))
        found.listen(64)  # from here on whoever opens the link waits, and is not refused
    except OSError as error:
        found.close()
        raise DriveError(
            f"cannot listen at {host}, port {port}: {error.strerror}", do="choose another --port"
        ) from error
    return found


def server(console: Console, guard: Guard, tls: tuple[Path, Path] | None = None) -> uvicorn.Server:
    """Who serves a console.

    Args:
        console: of a rig.
        guard: round its application.
        tls: certificate and key.
    """
    config = uvicorn.Config(
        guard,
        log_config=None,
        log_level="error",
        access_log=False,
        ws="websockets-sansio",
        ws_max_size=LARGEST_MESSAGE,
        ws_per_message_deflate=False,
        ws_ping_interval=_PING,
        ws_ping_timeout=_PONG,
        h11_max_incomplete_event_size=LARGEST_BODY,
        http=Connection,
        timeout_keep_alive=15,
        timeout_graceful_shutdown=3,
        server_header=False,
        date_header=False,
        lifespan="on",
        ssl_certfile=None if tls is None else str(tls[0]),
        ssl_keyfile=None if tls is None else str(tls[1]),
    )
    logging.getLogger("uvicorn.error").addFilter(_without_traceback)
    return _Server(config, console)


def serve(made: uvicorn.Server, at: socket.socket) -> None:
    """Serve until a signal ends it; comes back when the run has been ended."""
    before = signal.signal(signal.SIGHUP, made.handle_exit)
    try:
        made.run(sockets=[at])
    finally:
        signal.signal(signal.SIGHUP, before)
