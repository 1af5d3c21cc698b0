"""A network between a page and its console that can be halted, delayed and cut; it needs no rights of its own.

What is halted is not read, so that the sender's buffers fill as they do where nobody acknowledges its packets; when it
goes on, all of it comes late, as TCP has it. What is dropped is dropped by the kernel, packet by packet, before TCP
sees it: both ends send it again, ever more slowly, until the filter is taken away.
"""

import collections
import contextlib
import ctypes
import socket
import struct
import threading
import time

UP, DOWN = "up", "down"
"""From the page to the console, and back."""
_BUFFER = 8192
"""Of the kernel's, for what is on its way [bytes]."""
_LOOK = 0.005
"""[s]"""
_ATTACH, _DETACH = 26, 27
"""SO_ATTACH_FILTER and SO_DETACH_FILTER of Linux, which Python does not name."""
_NO_PACKET = struct.pack("HBBI", 0x06, 0, 0, 0)
"""A filter of one instruction: return 0, of each packet no byte is kept."""


class BadNetwork:
    """Forwards connections to a port of this computer.

    Args:
        to: the port.
    """

    def __init__(self, to: int) -> None:
        self._to = to
        self.halted: frozenset[str] = frozenset()
        """Directions in which nothing is forwarded."""
        self.delay = 0.0
        """By which everything comes later [s]."""
        self._links: list[socket.socket] = []
        self._at = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._at.getsockname()[1]
        """To connect to."""
        self._over = threading.Event()
        threading.Thread(target=self._accept, daemon=True).start()

    def cut(self) -> None:
        """End every connection at once, with no word of farewell."""
        for link in self._links:
            with contextlib.suppress(OSError):
                link.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
                link.shutdown(socket.SHUT_RDWR)
            link.close()
        self._links.clear()

    def drop(self) -> None:
        """Drop each packet that comes from either end, acknowledgements too."""
        program = ctypes.create_string_buffer(_NO_PACKET, len(_NO_PACKET))
        for link in self._links:
            if link.fileno() >= 0:  # it has not ended
                link.setsockopt(socket.SOL_SOCKET, _ATTACH, struct.pack("HP", 1, ctypes.addressof(program)))

    def mend(self) -> None:
        """Forward as before; what was held back comes now, what was dropped when it is sent again."""
        self.halted, self.delay = frozenset(), 0.0
        for link in self._links:
            with contextlib.suppress(OSError):  # it has ended, or nothing is dropped
                link.setsockopt(socket.SOL_SOCKET, _DETACH, 0)

    def close(self) -> None:
        """End."""
        self._over.set()
        self._at.close()
        self.cut()

    def _accept(self) -> None:
        while not self._over.is_set():
            try:
                page, _ = self._at.accept()
            except OSError:
                return
            with contextlib.suppress(OSError):
                console = socket.socket()
                for end in (page, console):
                    end.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER)
                    end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                console.connect(("127.0.0.1", self._to))
                self._links += [page, console]
                for way, ends in ((UP, (page, console)), (DOWN, (console, page))):
                    threading.Thread(target=self._forward, args=(way, *ends), daemon=True).start()

    def _forward(self, way: str, of: socket.socket, to: socket.socket) -> None:
        """One direction of one connection, until it ends."""
        waiting: collections.deque[tuple[float, bytes]] = collections.deque()
        of.settimeout(_LOOK)
        try:
            while True:
                if way in self.halted:
                    time.sleep(_LOOK)
                    continue
                with contextlib.suppress(TimeoutError):
                    content = of.recv(65_536)
                    if not content:
                        break
                    waiting.append((time.monotonic() + self.delay, content))
                while waiting and waiting[0][0] <= time.monotonic():
                    to.sendall(waiting.popleft()[1])
        except OSError:
            pass
        for end in (of, to):
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
            end.close()
