"""A CAN bus in this process and at a time of one's own, with any twins' nodes at its other end."""

import math
from collections import deque
from collections.abc import Callable
from typing import Any, Protocol

import can

from bowden.core.clock import SECOND
from bowden.core.signals import DriveReading, DriveState
from bowden.hardware.buses.link import BusPort, Links
from bowden.hardware.buses.place import BusPlace
from bowden.hardware.buses.unix_bus import flagged, message_of
from bowden.hardware.ports import Drive, Power
from bowden.hardware.twin.bench import TwinBench
from bowden.hardware.twin.faults import Faults
from bowden.hardware.twin.injection import parse
from bowden.hardware.twin.plant import OFF, TwinPlant
from bowden.models.cable.sheath_path import constant_bend
from bowden.models.drive.encoder import Encoder
from bowden.plants.presets.bench import bench
from bowden.rig.families import family_of


def asking(drive: Any, **changed: Any) -> Any:
    """A drive's parameters with other values, of its own or of what the rig asks for."""
    own = {name: changed.pop(name) for name in drive._fields if name in changed}
    return drive._replace(**own, needs=drive.needs._replace(**changed))


class Node(Protocol):
    """Who is on the bus."""

    def receive(self, identifier: int, data: bytes, now: float) -> None: ...

    def tick(self, now: float) -> None: ...


class MemoryBus(can.BusABC):
    """Time stands still but for `advance` and for waits for a frame; it is the clock of who waits, as well."""

    def __init__(self) -> None:
        self.time = 100.0
        """[s]"""
        self.sent: list[tuple[float, int, bytes]] = []
        """All that the host has sent: time, identifier, data."""
        self.journal: list[tuple[float, str, str]] = []
        self.faults: Faults | None = None
        self._nodes: list[Node] = []
        self._frames: deque[can.Message] = deque()
        self.channel_info = "bus in memory"
        super().__init__(channel="memory")

    def attach(self, node: Node) -> None:
        """Let a node take part."""
        self._nodes.append(node)
        self.advance(1e-3)

    def put(self, identifier: int, data: bytes) -> None:
        """A frame from a node, or from whoever else is on the bus."""
        if self.faults and (self.faults.active("bus_off", self.time) or self.faults.active("queue_full", self.time)):
            return
        self._frames.append(message_of(identifier, data))

    def note(self, time: float, event: str, detail: str) -> None:
        """Keep what happened."""
        self.journal.append((time, event, detail))

    def advance(self, span: float) -> None:
        """Let `span` [s] pass in ticks."""
        for _ in range(max(1, round(span / 1e-3))):
            self.time += min(span, 1e-3)
            for node in self._nodes:
                node.tick(self.time)

    def now(self) -> int:
        """See `TimeSource`."""
        return round(self.time * SECOND)

    def sleep_until(self, deadline: int) -> None:
        """See `TimeSource`."""
        self.advance(max(0.0, deadline / SECOND - self.time))

    def send_frame(self, identifier: int, data: bytes) -> None:
        """Send a frame as the host."""
        self.send(can.Message(arbitration_id=identifier, data=data, is_extended_id=False))

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Hand a frame to all nodes."""
        self.sent.append((self.time, msg.arbitration_id, bytes(msg.data)))
        if self.faults and self.faults.off_bus(self.time):
            raise can.CanOperationError("no other node on the bus acknowledges")
        if self.faults and self.faults.swallows(self.time):
            return
        for node in self._nodes:
            node.receive(flagged(msg), b"" if msg.is_remote_frame else bytes(msg.data), self.time)

    @property
    def port(self) -> BusPort:
        """The host's end, for whoever is brought up alone."""
        return Links(self, self).join(BusPlace("memory", "", 0), "any node", lambda _: True)

    def drain(self) -> list[can.Message]:
        """All frames that wait."""
        waiting, self._frames = list(self._frames), deque()
        return waiting

    def close(self) -> None:
        """Let go of it."""
        self.shutdown()

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """The next frame, for which time passes."""
        ends = self.time + (timeout or 0.0)
        while not self._frames and self.time < ends:
            self.advance(1e-3)
        return self._frames.popleft() if self._frames else None


class DrivenBus(MemoryBus):
    """A bus with a drive's twin on it, `node`, and a driver that is its host."""

    node: Any
    drive: Drive

    def run(self, cycles: int, power: Power, speed: float = 0.0, target: float = math.nan) -> list[DriveReading]:
        """So many cycles; the target goes on at a speed [rad/s] from one that is given, or from where the motor is."""
        found, start = [], target
        for k in range(cycles):
            found.append(self.drive.read(self.time))
            start = found[-1].motor if math.isnan(start) else start
            self.drive.write(start + 1e-3 * k * speed if not math.isnan(start) else 0.0, power, self.time)
            self.advance(1e-3)
        return found

    def inject(self, text: str, lasting: float = math.inf) -> None:
        self.node.faults.inject(parse(text)._replace(start=self.time, end=self.time + lasting))


def bench_at(now: float, encoder: Encoder | None = None) -> TwinBench:
    """The bench with its motor at 0.1 rad, and with another encoder of the motor where one is given."""
    rig = bench()
    rig = rig if encoder is None else rig._replace(motor_encoder=encoder)
    return TwinBench(rig, constant_bend(rig.sheath.bend), 1.0, 0, 0.1, now)


class DriverLoop(DrivenBus):
    """A driver of any family against its twin.

    Args:
        drive: parameters of the family.
        overrides: what of the twin is otherwise than usual.
        plant: what is behind the twin, at a time [s].
    """

    def __init__(self, drive: Any, overrides: Any = None, plant: Callable[[float], TwinPlant] = bench_at) -> None:
        super().__init__()
        self.node = family_of(drive).node()(drive, plant(self.time), self.put, self.note, overrides)
        self.faults = self.node.faults
        self.attach(self.node)
        self.drive = family_of(drive).open(drive, Links(self, self))

    def up(self) -> "DriverLoop":
        """Brought up, and following."""
        self.drive.bring_up()
        self.run(20, Power.OFF)
        self.sent.clear()
        assert self.run(40, Power.ON)[-1].drive_state == DriveState.OPERATION_ENABLED
        return self

    @property
    def powered(self) -> bool:
        return bool(self.node.bench.doing != OFF)

    @property
    def events(self) -> list[str]:
        return [event for _, event, _ in self.journal]
