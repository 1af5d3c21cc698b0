"""`twin`: a digital twin of a rig's drive in a process of its own, and faults injected into a running one."""

import math
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from bowden.core.documented import Documented
from bowden.operations.support.operation import GivenRig, Operation, Switch
from bowden.operations.support.results import Result

if TYPE_CHECKING:
    from bowden.rig.rig import Rig

_AFTER_PARENT = 5.0
"""[s]"""
_TOLD = ("meaning", "side", "amount", "unit", "moment")
"""What is listed of a fault."""


@dataclass(frozen=True)
class TwinStarted(Result["TwinStarted"]):
    """A twin, once it runs."""

    address: dict[str, str]
    """Where its drive is, as its family tells it: interface, channel, node."""
    control: str
    """Socket at which it is talked to."""
    rig: str
    """Hash of the rig."""
    realtime: bool
    """True if it has real-time priority."""


@dataclass(frozen=True)
class TwinState(Documented):
    """The state of a twin."""

    time: float
    """Its clock, the computer's monotonic one [s]."""
    pid: int
    """Its process."""
    state: str
    """State of the drive: SWITCH_ON_DISABLED, OPERATION_ENABLED, FAULT and so on."""
    torque: bool
    """True if the motor may have torque."""
    error_code: int
    """Error code of the fault that it is in; 0 for none."""
    motor: float
    """Angle of the motor at the spool, of a suit in the joint's coordinate [rad]."""
    motor_velocity: float
    """Velocity of the spool [rad/s]."""
    joint: float
    """Angle of the joint [rad]."""
    command: float
    """The target that it follows [rad]."""
    tension: float
    """Tension of the cable at the spool [N]."""
    current: float
    """Current of the motor [A]."""
    interaction: float | None
    """Torque of a suit on the elbow, flexing positive; null of a bench [N·m]."""
    temperature: float
    """Temperature of the power stage [°C]."""
    last_heartbeat: float | None
    """When the host's sign of life came last, on the twin's clock; null for never [s]."""
    unsent: int
    """Frames that the bus did not take."""
    longest_wait: float
    """Longest time between two looks at the bus [s]."""
    faults: tuple[str, ...]
    """Those that are there now."""
    processor_share: float
    """Share of one processor that it used since it began [–]."""
    nmt: int | None = None
    """State of a CANopen drive on the bus, by its heartbeat; null for others."""
    syncs: int | None = None
    """SYNCs of the host that a CANopen drive has received; null for others."""


@dataclass(frozen=True)
class TwinJournal(Result["TwinJournal"]):
    """The state of a running twin, after a fault was given or ended."""

    twin: TwinState


@dataclass(frozen=True)
class TwinFault(Documented):
    """A fault that a twin can be given."""

    fault: str
    """Text that injects it."""
    meaning: str
    side: bool
    """True if the name is followed by joint or motor."""
    amount: float | None
    """How much where nothing is said; null where there is nothing to say."""
    unit: str
    """Unit of the amount."""
    moment: bool
    """True if it happens once, false if it persists."""


@dataclass(frozen=True)
class TwinFaults(Result["TwinFaults"]):
    """Faults of a twin."""

    faults: tuple[TwinFault, ...]


def twin(
    rig: GivenRig,
    *,
    inject: str | None = None,
    after: float = 0.0,
    lasting: Annotated[float | None, Switch(name="--for")] = None,
    clear: bool = False,
    status: bool = False,
    channel: str | None = None,
    interface: str | None = None,
    motor: str | None = None,
    duration: float | None = None,
    object_: Annotated[list[str] | None, Switch(name="--object")] = None,
    until_orphaned: Annotated[bool, Switch(hidden=True)] = False,
) -> Iterator[TwinStarted | TwinJournal | TwinFaults]:
    """Run a digital twin of a rig's drive until Ctrl-C, or give a running one faults.

    Args:
        rig: the rig, or the log of a run; ``bowden init`` writes one.
        inject: a fault for the running twin, e.g. 'encoder_frozen joint'; 'list' shows all.
        after: inject after this many seconds.
        lasting: end the fault after this many seconds.
        clear: end all faults of the running twin.
        status: show the state of the running twin.
        channel: the bus, in place of the rig's.
        interface: python-can's name of that bus, in place of the rig's.
        motor: the motor, of a rig with several: a twin is one drive.
        duration: length of the scenario's sheath motion in seconds.
        object_: an object of a CANopen drive: 6502:0=0x25, or 6502:0=none. May be repeated.
        until_orphaned: end some time after the process that started it.

    Yields:
        Where it is; or the state of the running one, or what there is.

    Raises:
        DriveError: a bus that cannot be used, or no twin that runs.
        ParameterError: options that do not go together.

    Examples:
        bowden twin rig.toml
        bowden twin rig.toml --status
        bowden twin rig.toml --inject 'encoder_frozen joint' --after 2 --for 0.5
    """
    from bowden.core.caller import argument
    from bowden.core.errors import ParameterError
    from bowden.operations.support.given import of_motor, rig_of
    from bowden.rig.rig import Rig

    if inject == "list":
        from bowden.hardware.twin.injection import KINDS

        listed = (TwinFault(name, *(getattr(kind, key) for key in _TOLD)) for name, kind in KINDS.items())
        yield TwinFaults(tuple(listed))
        return
    packed = rig == Path("-")
    whole = of_motor(Rig.unpack(sys.stdin.buffer.read()) if packed else rig_of(rig), motor)
    whole = (whole if duration is None else whole.replace(duration=duration)).on_bus(channel, interface)
    talks = bool(inject or clear or status)
    if len(whole.each_joint) > 1 or talks:
        whole = whole.only()
    if not whole.motors:
        _ = whole.drive_parameters  # which refuses what makes no sense together
    if not 0.0 <= after < math.inf or not (lasting is None or 0.0 < lasting < math.inf):
        what = f"{argument('after').rstrip('=')} is {after:g}, {argument('lasting').rstrip('=')} {lasting}"
        raise ParameterError(what, expected="a time from now, and one above 0")
    if not inject and (after or lasting is not None):
        what = f"{argument('after')} and {argument('lasting')} belong to a fault"
        raise ParameterError(what, expected=f"{argument('inject', 'FAULT')} together with them")
    if talks and object_:
        raise ParameterError(
            f"{argument('object_')} belongs to a twin that is being started",
            expected=f"it without {argument('inject')}, {argument('clear', True)} or {argument('status', True)}",
        )
    if talks:
        yield _talk(whole, inject, after, lasting, clear)
    else:
        yield from _run(whole, object_ or [], until_orphaned)


def _talk(rig: "Rig", inject: str | None, after: float, lasting: float | None, clear: bool) -> TwinJournal:
    from bowden.core.errors import ParameterError
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
        said = running.status()
        known = {one.name: said[one.name] for one in fields(TwinState)}  # a family says more of its own
        return TwinJournal(TwinState(**{**known, "faults": tuple(said["faults"])}))


def _run(rig: "Rig", objects: list[str], until_orphaned: bool) -> Iterator[TwinStarted]:
    from bowden.core.clock import SECOND, MonotonicClock
    from bowden.hardware.joint_stream import of_twin
    from bowden.hardware.twin.of_rig import attach_load_cell, played
    from bowden.hardware.twin.twin import raise_priority
    from bowden.live.left_behind import sweep
    from bowden.rig.families import family_of

    monotonic = MonotonicClock()

    def clock() -> float:
        return monotonic.now() / SECOND

    (joint,) = rig.each_joint
    drives = played(joint, clock())
    twins = [family_of(drive).twin(drive, plant, clock, objects) for drive, plant in drives]
    for twin, motor in zip(twins, joint.motors, strict=True):
        attach_load_cell(twin, motor.rig)
        if motor.rig.joint_sensor.sensed and motor.rig is joint.first:
            twin.sense(of_twin(motor.rig.joint_sensor, motor.rig.drive), motor.rig.seed)
    running, drive = twins[0], drives[0][0]

    def stop() -> None:
        for one in twins:
            one.stop()

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda *_: stop())
    if until_orphaned:
        threading.Thread(target=_watch_parent, args=(os.getppid(), stop), daemon=True).start()
    realtime = raise_priority()
    slow = () if realtime else ("no real-time priority; allow it with: ulimit -r 50",)
    yield TwinStarted(dict(family_of(drive).address(drive)), str(running.path), rig.hash, realtime, notes=slow)
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


OPERATIONS = (Operation("twin", twin, 130),)
