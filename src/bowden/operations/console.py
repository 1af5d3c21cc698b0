"""`console`: a rig run from a browser."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from bowden.operations.support.operation import Folder, GivenRig, Operation, Quiet, Switch
from bowden.operations.support.results import Result


@dataclass(frozen=True)
class ConsoleOpened(Result["ConsoleOpened"]):
    """A console that is served."""

    link: str
    """Opens the console in a browser; who has it controls the rig."""
    rig: str
    """Hash of the rig."""
    twin: bool
    """True if it runs on a twin of its own."""


def console(
    rig: GivenRig,
    *,
    twin: bool = False,
    channel: str | None = None,
    motor: str | None = None,
    port: Annotated[int, Switch(least=0, most=65535)] = 0,
    host: str = "127.0.0.1",
    tls_cert: Path | None = None,
    tls_key: Path | None = None,
    insecure_lan: bool = False,
    out: Folder = Path("out/console"),
    no_open: bool = False,
    quiet: Quiet = False,
) -> Iterator[ConsoleOpened]:
    """Run a rig from a page in a browser: curves, checks, arming, stop, earlier runs.

    Prints one link with a token; who has it controls the rig. The page does not replace the hardware emergency stop.
    Ctrl-C ends the run in a controlled release, and the console.

    Args:
        rig: the rig, with its [drive] and [limits]; ``bowden init`` writes one.
        twin: run on a twin, on a bus of its own.
        channel: the bus, in place of the rig's.
        motor: one motor alone, of a rig with several.
        port: port to listen at; 0 for a free one.
        host: address to listen at; another than this computer's own asks for TLS.
        tls_cert: certificate of TLS, as PEM.
        tls_key: private key of that certificate, as PEM.
        insecure_lan: listen at another address without TLS: anyone who reads the traffic can take over.
        out: folder for the logs.
        no_open: open no browser.

    Yields:
        The link.

    Raises:
        ParameterError: an address that needs TLS and has none.
        DriveError: an address or port that cannot be used.

    Examples:
        bowden console rig.toml --twin
        bowden console rig.toml --port 8080 --no-open
        bowden console rig.toml --twin --json
        bowden console rig.toml --host 192.168.1.5 --tls-cert rig.pem --tls-key rig.key
    """
    from bowden.console.open import opened
    from bowden.operations.support import given

    whole = given.of_motor(given.rig_of(rig), motor).on_bus(channel)
    notes = tuple(f"motor {one.name}: {text}" if one.name else text for one in whole.parts for text in one.rig.notes)
    links = opened(
        whole,
        given.name_of(whole),
        twin=twin,
        out=out,
        host=host,
        port=port,
        tls=None if tls_cert is None and tls_key is None else (tls_cert, tls_key),
        insecure=insecure_lan,
        browse=not (no_open or quiet),
    )
    for link in links:
        yield ConsoleOpened(link, whole.hash, twin, notes=notes)


OPERATIONS = (Operation("console", console, 65),)
