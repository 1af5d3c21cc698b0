"""A console is opened: where it listens, and the link that leads to it."""

import contextlib
import ipaddress
import socket
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from bowden.console.access import Guard
from bowden.console.console import Console
from bowden.console.runs import TerminalRun
from bowden.console.server import application, listening, serve, server
from bowden.core.errors import ParameterError, note
from bowden.core.files import output_folder
from bowden.rig.rig import Rig

if TYPE_CHECKING:
    from bowden.live.session import Session

_HERE = ("127.0.0.1", "localhost", "::1")
_SWITCH = 1e-3
"""Longest time that one thread keeps the interpreter from the one that holds the run [s]."""


def opened(
    rig: Rig,
    name: str,
    *,
    twin: bool,
    out: Path,
    host: str,
    port: int,
    tls: tuple[Path | None, Path | None] | None,
    insecure: bool,
    browse: bool,
) -> Iterator[str]:
    """Serve a rig's console until a signal ends it.

    Args:
        rig: the rig.
        name: of its file.
        twin: whether it runs on a twin of its own.
        out: folder of the logs.
        host: address to listen at.
        port: 0 for a free one.
        tls: certificate and key.
        insecure: listen at another address than this computer's own without TLS.
        browse: open a browser.

    Yields:
        The link, once it can be opened.

    Raises:
        ParameterError: an address that needs TLS and has none.
        DriveError: an address or port that cannot be used.
        OutputError: a folder that cannot be made.
    """
    files = _checked(host, tls, insecure=insecure)
    output_folder(out)
    out.mkdir(parents=True, exist_ok=True)
    at = listening(host, port)
    where = at.getsockname()[1]
    console = Console(rig, name, twin=twin, out=out)
    guard = Guard(application(console), names(host), where, secure=files is not None, clock=time.monotonic)
    shown = names(host)[0] if host in ("0.0.0.0", "::") else host
    place = f"{f'[{shown}]' if ':' in shown else shown}:{where}"
    link = f"{'http' if files is None else 'https'}://{place}/?token={guard.token}"
    yield link
    if host not in _HERE:
        how = "without TLS: who reads along in this network can take the rig over" if files is None else "with TLS"
        note(f"reachable from the network at {host}, {how}")
    note("the page does not replace the hardware emergency stop")
    if browse:
        threading.Thread(target=_browse, args=(link,), daemon=True).start()
    before = sys.getswitchinterval()
    sys.setswitchinterval(_SWITCH)
    try:
        serve(server(console, guard, files), at)
    finally:
        sys.setswitchinterval(before)
        at.close()


@contextlib.contextmanager
def beside(session: "Session", name: str, *, twin: bool, notes: Sequence[str]) -> Iterator[None]:
    """Serve pages that look on at a run of a terminal, and may stop it; prints the link.

    Args:
        session: that goes on.
        name: of the rig's file.
        twin: whether it runs on a twin of its own.
        notes: what the terminal has shown.

    Raises:
        DriveError: no port is free.
    """
    run = TerminalRun(session, notes)
    console = Console(session.live.logged, name, twin=twin, out=session.log.parent, terminal=run)
    at = listening(_HERE[0], 0)
    where = at.getsockname()[1]
    guard = Guard(application(console), _HERE, where, secure=False, clock=time.monotonic)
    made = server(console, guard)
    thread = threading.Thread(target=made.run, kwargs={"sockets": [at]}, name="console", daemon=True)
    print(f"Console of {name}: http://{_HERE[0]}:{where}/?token={guard.token}", file=sys.stderr, flush=True)
    thread.start()
    try:
        yield
    finally:
        made.should_exit = True
        thread.join(_ENDS)
        at.close()


_ENDS = 6.0
"""A server is given this long to end; the run has ended by then, or goes on to be released [s]."""


def names(host: str) -> tuple[str, ...]:
    """Hosts by which a console that listens at `host` is reached."""
    if host in _HERE:
        return _HERE
    if host in ("0.0.0.0", "::"):
        return (socket.gethostname(), socket.getfqdn(), *_HERE, host)
    return (host, *_HERE)


def _checked(host: str, tls: tuple[Path | None, Path | None] | None, *, insecure: bool) -> tuple[Path, Path] | None:
    """The files of TLS; None without it.

    Raises:
        ParameterError: it is wanted and not there.
    """
    if tls is not None:
        if tls[0] is None or tls[1] is None:
            raise ParameterError(
                "--tls-cert and --tls-key belong together", expected="both", do="give the other one too"
            )
        for path in (tls[0], tls[1]):
            if not path.is_file():
                raise ParameterError(f"there is no file {path}", expected="a PEM file", do="correct the path")
        return tls[0], tls[1]
    with contextlib.suppress(ValueError):
        if ipaddress.ip_address(host).is_loopback:
            return None
    if host == "localhost" or insecure:
        return None
    raise ParameterError(
        f"--host {host} can be reached from the network",
        expected="--tls-cert and --tls-key with it",
        do="give both, or --insecure-lan: then who reads along in the network can take the rig over",
    )


def _browse(link: str) -> None:
    import webbrowser

    with contextlib.suppress(Exception):
        webbrowser.open(link)
