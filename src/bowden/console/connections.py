"""Connections to the console: a deadline for each request, and few places for those that have sent none."""

import asyncio

from uvicorn.protocols.http.h11_impl import H11Protocol

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
