"""The rows of a run as live data for Foxglove, by a process of its own that reads the ring: nobody waits for it.

Topics, schemas and bytes are those of the log (`live.mcap_log`), so that a layout made for one fits the other. A
topic to which nobody has subscribed costs nothing. ``python -P -m bowden.live.foxglove_process RING PORT`` says as a
line of JSON on standard output where it listens, and ends with its standard input. Protocol: Foxglove WebSocket, by the
package foxglove-sdk.
"""

import contextlib
import json
import select
import socket
import sys
import threading
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path

from bowden.core.errors import ParameterError
from bowden.live import child

HOST = "127.0.0.1"
"""It listens at this computer alone: the protocol has no password."""
PERIOD = 0.02
"""Between two looks at the ring [s]."""
_ENDS = 5.0
"""The process is given this long to end [s]."""


@contextlib.contextmanager
def served(ring: Path, port: int, waiting: Callable[[], None] = lambda: None) -> Iterator[str]:
    """Serve a ring's rows while it is open; the address, for Foxglove's *Open connection*.

    Args:
        ring: path of the run's.
        port: where to listen; 0 for any that is free.
        waiting: called again and again while the process starts, which takes longer than an operator may be silent.

    Raises:
        ParameterError: the package is missing, or the port is taken.
    """
    require(port)
    process = child.started("bowden.live.foxglove_process", str(ring), str(port), stderr=None)
    assert process.stdout is not None
    try:
        while not select.select([process.stdout], [], [], PERIOD)[0]:
            waiting()
        said = json.loads(process.stdout.readline() or '{"error": "its process ended"}')
        if "error" in said:
            raise _taken(port, said["error"])
        yield f"ws://{HOST}:{said['port']}"
    finally:
        child.end(process, _ENDS)


def require(port: int) -> None:
    """Refuse what cannot be served, before anything is begun.

    Raises:
        ParameterError: the package is missing, or the port is none, or taken.
    """
    if not 0 <= port <= 65535:
        raise ParameterError(f"--foxglove is {port}", expected="a port from 0 to 65535", do="correct it")
    if find_spec("foxglove") is None:
        raise ParameterError(
            "live data for Foxglove need the package foxglove-sdk", do="pip install 'bowden[foxglove]'"
        )
    with socket.socket() as tried:
        tried.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # as the server does
        try:
            tried.bind((HOST, port))
        except OSError as error:
            raise _taken(port, error.strerror) from error


def _taken(port: int, why: str | None) -> ParameterError:
    return ParameterError(f"cannot serve live data at port {port}: {why}", do="name another port, or 0 for any")


def main() -> int:
    """The process."""
    import foxglove

    from bowden.live.mcap_log import Packing, declarations, stamps_of, topics
    from bowden.live.ring import RingReader

    reader = RingReader(Path(sys.argv[1]), from_now=True)
    description = reader.description
    try:
        server = foxglove.start_server(name="bowden", host=HOST, port=int(sys.argv[2]))
    except Exception as error:  # whatever the library raises for a port that is taken
        print(json.dumps({"error": " ".join(str(error).split())}), flush=True)
        return 2
    found = topics(description.columns, description.units)
    packing, time = Packing(found), description.columns.index("time")
    channels = [
        foxglove.Channel(
            channel.topic,
            schema=foxglove.Schema(name=schema.name, encoding=schema.encoding, data=schema.data),
            message_encoding=channel.message_encoding,
        )
        for schema, channel in declarations(found)[: len(found)]
    ]
    print(json.dumps({"port": server.port}), flush=True)
    over = threading.Event()

    def wait_for_the_end() -> None:
        sys.stdin.read()
        over.set()

    threading.Thread(target=wait_for_the_end, daemon=True).start()
    while not (over.wait(PERIOD) or reader.closed):
        rows = reader.read().rows
        if not len(rows):
            continue
        stamps = stamps_of(description.start_utc_ns, rows[:, time]).tolist()
        for place, channel in enumerate(channels):
            if channel.has_sinks():
                for message, stamp in zip(packing.messages(place, rows), stamps, strict=True):
                    channel.log(message, log_time=stamp)
    server.stop()
    return 0


if __name__ == "__main__":
    sys.exit(main())
