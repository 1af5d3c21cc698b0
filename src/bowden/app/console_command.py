"""``bowden console``: a rig run from a browser."""

import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from bowden.app.command import Command
from bowden.app.console import folder_argument, print_json, say_note, seconds
from bowden.app.given_rig import read_given


def console(
    rig: Annotated[Path, typer.Argument(help="The rig; bowden init writes one.")],
    twin: Annotated[bool, typer.Option("--twin", help="Run on a twin, on a bus of its own.")] = False,
    channel: Annotated[str | None, typer.Option(help="The bus, in place of the rig's.")] = None,
    axis: Annotated[str | None, typer.Option(help="One axis alone, of a rig with several.")] = None,
    port: Annotated[int, typer.Option(min=0, max=65535, help="To listen at; 0 for a free one.")] = 0,
    host: Annotated[str, typer.Option(help="Address to listen at; another than this computer's own asks for TLS.")] = (
        "127.0.0.1"
    ),
    tls_cert: Annotated[Path | None, typer.Option(help="Certificate of TLS, as PEM.")] = None,
    tls_key: Annotated[Path | None, typer.Option(help="Its key.")] = None,
    insecure_lan: Annotated[
        bool,
        typer.Option("--insecure-lan", help="Listen at another address without TLS: who reads along can take over."),
    ] = False,
    out: Annotated[Path, typer.Option(parser=folder_argument, metavar="FOLDER", help="Folder for the logs.")] = Path(
        "out/console"
    ),
    no_open: Annotated[bool, typer.Option("--no-open", help="Open no browser.")] = False,
    json: Annotated[
        bool, typer.Option("--json", help="Print the link as one JSON document, and nothing else; open no browser.")
    ] = False,
) -> None:
    """Serve a page on which the rig is run: curves, checks, arming, stop, earlier runs.

    Prints one link with a token; who has it controls the rig. The page does not replace the hardware emergency stop.
    Ctrl-C ends the run in a controlled release, and the console.
    """
    from bowden.console.open import opened

    given = read_given(rig, axis, several=True).on_bus(channel)
    for note in given.notes:
        say_note(note)
    tls = None if tls_cert is None and tls_key is None else (tls_cert, tls_key)

    def announce(link: str) -> None:
        if json:
            print_json({"link": link, "rig": given.hash, "twin": twin, "seconds": seconds()})
        else:
            print(f"Console of {rig.name}: {link}")
        sys.stdout.flush()

    where: dict[str, Any] = {"host": host, "port": port, "tls": tls, "insecure": insecure_lan}
    opened(given, rig.name, twin=twin, out=out, **where, browse=not (no_open or json), announce=announce)


COMMANDS = (
    Command(
        "console",
        console,
        "Run a rig from a page in a browser.",
        (
            "bowden console rig.toml --twin",
            "bowden console rig.toml --port 8080 --no-open",
            "bowden console rig.toml --twin --json",
            "bowden console rig.toml --host 192.168.1.5 --tls-cert rig.pem --tls-key rig.key",
        ),
        place=65,
    ),
)
