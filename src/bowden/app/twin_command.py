"""``bowden twin``: a digital twin of a rig's drive in a process of its own, and faults injected into a running one."""

import math
import os
import shlex
import signal
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bowden.app.command import Command
from bowden.app.console import print_json, seconds
from bowden.app.given_rig import read_given, shortened
from bowden.core.errors import ParameterError

if TYPE_CHECKING:
    from bowden.rig.rig import Rig

_AFTER_PARENT = 5.0
"""[s]"""
_TOLD = ("meaning", "side", "amount", "unit", "moment")
"""What `--inject list --json` has of a fault."""


def twin(
    rig: Annotated[Path, typer.Argument(help="The rig; bowden init writes one. A log runs as its own.")],
    inject: Annotated[
        str | None, typer.Option(help="A fault for the running twin, e.g. 'encoder_frozen joint'; 'list' shows all.")
    ] = None,
    after: Annotated[float, typer.Option(help="Inject after this many seconds.")] = 0.0,
    lasting: Annotated[float | None, typer.Option("--for", help="End the fault after this many seconds.")] = None,
    clear: Annotated[bool, typer.Option("--clear", help="End all faults of the running twin.")] = False,
    status: Annotated[bool, typer.Option("--status", help="Show the state of the running twin.")] = False,
    channel: Annotated[str | None, typer.Option(help="The bus, in place of the rig's.")] = None,
    interface: Annotated[str | None, typer.Option(help="python-can's name of that bus, in place of the rig's.")] = None,
    axis: Annotated[str | None, typer.Option(help="The axis, of a rig with several: a twin is one drive.")] = None,
    duration: Annotated[float | None, typer.Option(help="Length of the scenario's sheath motion in seconds.")] = None,
    object_: Annotated[
        list[str] | None,
        typer.Option("--object", help="An object of a CANopen drive: 6502:0=0x25, or 6502:0=none. May be repeated."),
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")] = False,
    until_orphaned: Annotated[bool, typer.Option("--until-orphaned", hidden=True)] = False,
) -> None:
    """Run a digital twin of the rig's drive until Ctrl-C, or give a running one a fault."""
    if inject == "list":
        _list(json)
        return
    given = shortened(_given(rig, axis), duration).on_bus(channel, interface)
    talks = bool(inject or clear or status)
    if not given.pair.there or talks:
        given = given.axis(axis if given.axes else None)
        _ = given.drive_parameters  # which refuses what makes no sense together
    if not 0.0 <= after < math.inf or not (lasting is None or 0.0 < lasting < math.inf):
        raise ParameterError(f"--after is {after:g}, --for {lasting}", expected="a time from now, and one above 0")
    if not inject and (after or lasting is not None):
        raise ParameterError("--after and --for belong to a fault", expected="--inject FAULT together with them")
    if talks and object_:
        raise ParameterError(
            "--object belongs to a twin that is being started",
            expected="--object without --inject, --clear or --status",
        )
    if talks:
        _talk(given, inject, after, lasting, clear, json)
    else:
        words = shlex.join([str(rig), *(["--channel", channel] if channel else [])])
        _run(given, object_ or [], words, json, until_orphaned)


def _talk(rig: "Rig", inject: str | None, after: float, lasting: float | None, clear: bool, json: bool) -> None:
    from bowden.hardware.twin.control import TwinControl
    from bowden.hardware.twin.injection import OF_LOAD_CELL, parse
    from bowden.rig.families import family_of

    limits = rig.supervisor_limits
    if inject and parse(inject).name in OF_LOAD_CELL and not (limits.measures_tension or limits.measures_torque):
        raise ParameterError(
            f"{inject} is of a load cell, and the rig has none", expected="another fault, or [load_cell] in the rig"
        )
    with TwinControl(family_of(rig.drive).control(rig.drive)) as running:
        if clear:
            running.clear()
        if inject:
            running.inject(inject, after, lasting)
        found = running.status()
    if json:
        print_json({"twin": found, "seconds": seconds()})
    else:
        faults = ", ".join(found["faults"]) or "none"
        print(f"twin: {found['state'].lower().replace('_', ' ')}, motor {found['motor']:.4f} rad; faults: {faults}")


def _list(json: bool) -> None:
    """What a twin can be given."""
    from bowden.hardware.twin.injection import KINDS

    if json:
        kinds = [{"fault": name} | {key: getattr(kind, key) for key in _TOLD} for name, kind in KINDS.items()]
        print_json({"faults": kinds, "seconds": seconds()})
        return
    for name, kind in KINDS.items():
        side = " joint|motor" if kind.side else ""
        amount = "" if kind.amount is None else f" [{kind.amount:g} {kind.unit}]"
        print(f"{name + side + amount:36} {kind.meaning}")


def _given(rig: Path, axis: str | None) -> "Rig":
    """The rig of a file or a log, or packed on standard input."""
    from bowden.rig.rig import Rig

    return Rig.unpack(sys.stdin.buffer.read()) if rig == Path("-") else read_given(rig, axis, several=True)


def _run(rig: "Rig", objects: list[str], words: str, json: bool, until_orphaned: bool) -> None:
    from bowden.core.clock import SECOND, MonotonicClock
    from bowden.hardware.twin.of_rig import PlayedDrive, attach_load_cell, twin_pair_of, twin_plant_of
    from bowden.hardware.twin.twin import raise_priority
    from bowden.live.left_behind import sweep
    from bowden.rig.families import family_of

    monotonic = MonotonicClock()

    def clock() -> float:
        return monotonic.now() / SECOND

    if rig.pair.there:
        axes, played = [rig.axis(name) for name in rig.pair.names], [*twin_pair_of(rig, clock())]
    else:
        axes, played = [rig], [PlayedDrive(rig.drive_parameters, twin_plant_of(rig, clock()))]
    twins = [family_of(one.drive).twin(one.drive, one.plant, clock, objects) for one in played]
    for twin, one in zip(twins, axes, strict=True):
        attach_load_cell(twin, one)
    running, drive = twins[0], played[0].drive
    family = family_of(drive)

    def stop() -> None:
        for one in twins:
            one.stop()

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda *_: stop())
    if until_orphaned:
        threading.Thread(target=_watch_parent, args=(os.getppid(), stop), daemon=True).start()
    realtime = raise_priority()
    where = {**family.address(drive), "control": str(running.path)}
    if json:
        print_json(where | {"rig": rig.hash, "realtime": realtime, "seconds": seconds()})
    else:
        print(f"twin: {', '.join(f'{key} {value}' for key, value in where.items())}")
        print(f"It runs until Ctrl-C. In another terminal: bowden run {words}, or bowden twin {words} --status")
        if not realtime:
            print("bowden: note: no real-time priority; allow it with: ulimit -r 50", file=sys.stderr)
    sys.stdout.flush()
    others = [threading.Thread(target=twin.run) for twin in twins[1:]]
    for thread in others:
        thread.start()
    try:
        running.run()
    finally:
        stop()
        for thread in others:
            thread.join()
    if until_orphaned:
        sweep()  # the folder of this bus, where nobody else has lived to remove it


def _watch_parent(parent: int, stop: Callable[[], None]) -> None:
    """End the twin some time after the process that started it: a loop that is left may still release its cable."""
    forever = threading.Event()
    while os.getppid() == parent:
        forever.wait(0.5)
    forever.wait(_AFTER_PARENT)
    stop()


COMMANDS = (
    Command(
        "twin",
        twin,
        "Run a digital twin of a rig's drive, and give it faults.",
        (
            "bowden twin rig.toml",
            "bowden twin rig.toml --status",
            "bowden twin rig.toml --inject 'encoder_frozen joint' --after 2 --for 0.5",
        ),
        place=130,
    ),
)
