"""The twin's process, of a drive of any family: a bus, the node, the control socket, and the clock that drives them.

Waits, never spins.
"""

import contextlib
import gc
import math
import os
import select
from collections import deque
from collections.abc import Callable, Iterator
from typing import Any

import can

from bowden.core.errors import DriveError, ParameterError
from bowden.hardware.buses.opening import Frame, claim, open_bus, putter, received
from bowden.hardware.buses.place import ERROR, REMOTE, BusPlace
from bowden.hardware.twin.control import ControlServer, control_path
from bowden.hardware.twin.faults import Faults, Send
from bowden.hardware.twin.injection import OF_CABLE, OF_LOAD_CELL, Injection, parse
from bowden.hardware.twin.joint_stream import JointSensorTwin
from bowden.hardware.twin.node import Journal, TwinNode
from bowden.hardware.twin.plant import TwinPlant
from bowden.hardware.twin.sensor_node import SensorNode
from bowden.hardware.twin.serial_port import bus_of_twin
from bowden.rig.settings import JointSensor

TICK = 1e-3
"""Longest wait [s]."""

PRIORITY = 20
"""Real-time priority that the twin takes where it may: below the loop's [–]."""

MOST_PATIENCE = 5.0
"""Longest that it waits for a host that is silent [s]."""

MOST_ENTRIES = 500
"""Entries of the journal in one answer."""


class Twin:
    """A drive and a bench in this process, on a bus with others.

    Args:
        place: of its bus.
        node_id: its number there.
        clock: the time [s].
        make_node: makes the drive, of what sends its frames and of what takes its journal.

    Raises:
        DriveError: the bus or the control socket cannot be used, or has a twin of this number already.
    """

    def __init__(
        self, place: BusPlace, node_id: int, clock: Callable[[], float], make_node: Callable[[Send, Journal], TwinNode]
    ) -> None:
        self._place, self._clock = place, clock
        self.path = control_path(place.interface, place.channel, node_id)
        self._claim = claim(place.interface, place.channel, f"node {node_id}")
        self._bus: can.BusABC | None = None
        try:
            self._bus = bus_of_twin(place, create=True)
            self._control = ControlServer(self.path)
        except BaseException:
            self._claim.close()
            if self._bus is not None:
                self._bus.shutdown()
            raise
        self._journal: deque[tuple[float, str, str]] = deque(maxlen=20_000)
        self._node = make_node(self._send, self._note)
        self._beside: SensorNode | None = None
        self._sensor: JointSensorTwin | None = None
        self._own_bus: can.BusABC | None = None
        self._unsent, self._longest_wait, self._ticked = 0, 0.0, clock()
        self._began, self._began_cpu = clock(), sum(os.times()[:2])
        self._stopping = False

    def attach(self, make: Callable[[TwinPlant, Faults, Send], SensorNode], place: BusPlace | None = None) -> None:
        """Put a device beside the drive, with the same plant and faults.

        Args:
            make: the device, of plant, faults and what sends its frames.
            place: its bus, where it has one of its own.

        Raises:
            DriveError: that bus cannot be used.
        """
        if place is not None:
            self._own_bus = open_bus(place, create=True)
        send = self._send if place is None else self._send_apart
        self._beside = make(self._node.bench, self._node.faults, send)

    def sense(self, sensor: JointSensor, seed: int) -> None:
        """Put the twin of a joint's sensor that is no encoder beside the drive.

        Raises:
            StreamError: see `JointSensorTwin`.
        """
        bench = self._node.bench
        self._sensor = JointSensorTwin(sensor, lambda: bench.joint, self._node.faults, seed)

    def stop(self) -> None:
        """Let `run` end; for signal handlers."""
        self._stopping = True

    def run(self) -> None:
        """Be a drive until `stop`."""
        try:
            while not self._stopping:
                self._once()
        finally:
            self.close()

    def close(self) -> None:
        """Leave the bus."""
        if self._bus is not None:
            self._bus.shutdown()
            self._bus = None
        if self._own_bus is not None:
            self._own_bus.shutdown()
            self._own_bus = None
        if self._sensor is not None:
            self._sensor.close()
        self._control.close()
        self._claim.close()

    def _once(self) -> None:
        """Wait for a frame, at most one tick, and let everything have its time."""
        self._join_or_leave(self._clock())
        if self._bus is None:
            select.select([], [], [], TICK)  # without a bus to wait at
        else:
            beside = self._beside if self._own_bus is None else None
            for identifier, data in _waiting(self._bus, TICK):
                if not identifier & ERROR and not self._node.faults.swallows(self._clock()):
                    for node in (self._node, beside) if beside is not None else (self._node,):
                        node.receive(identifier, data, self._clock())
        if self._own_bus is not None and self._beside is not None:
            for identifier, data in _waiting(self._own_bus, 0.0):
                if not identifier & (ERROR | REMOTE):
                    self._beside.receive(identifier, data, self._clock())
        now = self._clock()
        self._longest_wait, self._ticked = max(self._longest_wait, now - self._ticked), now
        self._node.tick(now)
        if self._beside is not None:
            self._beside.tick(now)
        if self._sensor is not None:
            self._sensor.tick(now)
        self._control.answer(lambda request: self._answer(request, self._clock()))

    def _join_or_leave(self, now: float) -> None:
        """A controller that is bus-off neither receives nor acknowledges: it is not there."""
        off = self._node.faults.off_bus(now)
        if off and self._bus is not None:
            self._bus.shutdown()
            self._bus = None
            self._note(now, "bus_off", "")
        elif not off and self._bus is None:
            with contextlib.suppress(DriveError):
                self._bus = bus_of_twin(self._place, create=False)
                self._note(now, "bus_on", "")

    def _send_apart(self, cob_id: int, data: bytes) -> None:
        """A frame of the device beside, on its own bus."""
        if self._own_bus is not None:
            with contextlib.suppress(can.CanError, OSError):
                putter(self._own_bus, fd=False)(cob_id, data)

    def _send(self, cob_id: int, data: bytes) -> None:
        if self._bus is None or self._node.faults.active("queue_full", self._clock()):
            return
        try:
            putter(self._bus, fd=self._place.fd)(cob_id, data)
        except (can.CanError, OSError):
            self._unsent += 1

    def _note(self, now: float, event: str, detail: str) -> None:
        self._journal.append((now, event, detail))

    def _answer(self, request: dict[str, Any], now: float) -> dict[str, Any]:
        match request.get("do"):
            case "status":
                return self._status(now)
            case "journal":
                since = float(request.get("since", -1.0))
                recent = [entry for entry in self._journal if entry[0] > since][-MOST_ENTRIES:]
                return {"journal": [{"time": time, "event": event, "detail": said} for time, event, said in recent]}
            case "inject":
                injection = parse(str(request.get("fault", "")))
                self._refuse(injection)
                after, lasting = float(request.get("after") or 0.0), request.get("lasting")
                end = math.inf if lasting is None else now + after + float(lasting)
                self._node.faults.inject(injection._replace(start=now + after, end=end))
                self._note(now, "inject", str(request["fault"]))
                return {"time": now + after}
            case "wait":
                self._node.patience = min(float(request.get("seconds") or 0.0), MOST_PATIENCE)
                return {"time": now}
            case "clear":
                self._node.faults.clear()
                self._note(now, "clear", "")
                return {"time": now}
            case "scenario":
                at = now if request.get("at") is None else float(request["at"])
                self._node.scenario_noted = True
                self._node.bench.start_scenario(at)
                self._note(now, "scenario", f"{at:.6f}")
                return {"time": at}
        raise ValueError(f"do is {request.get('do')!r}; expected status, journal, inject, wait, clear or scenario")

    def _refuse(self, fault: Injection) -> None:
        """Refuse what the drive cannot have, and what the plant has no inside for.

        Raises:
            ParameterError: with why.
        """
        named = f"{fault.name} {fault.side}".rstrip()
        of_beside = self._beside is not None and fault.name in OF_LOAD_CELL
        of_beside = of_beside or (self._sensor is not None and fault.name == "joint_silence")
        if named in self._node.lacks and not of_beside:
            raise ParameterError(f"{named}: {self._node.lacks[named]}", expected="another fault")
        if fault.name in OF_CABLE and not self._node.bench.has_cable:
            raise ParameterError(
                f"{fault.name} is of a cable, and what moves here is a plant of your own", expected="another fault"
            )

    def _status(self, now: float) -> dict[str, Any]:
        node, bench = self._node, self._node.bench
        ran = now - self._began
        return {
            "time": now,
            "pid": os.getpid(),
            **node.status(),
            "motor": bench.motor,
            "motor_velocity": bench.velocity,
            "joint": bench.joint,
            "command": bench.command,
            "tension": bench.tension,
            "current": bench.current,
            "interaction": bench.interaction,
            "temperature": bench.temperature,
            "unsent": self._unsent,
            "longest_wait": self._longest_wait,
            "faults": node.faults.names(now),
            "processor_share": (sum(os.times()[:2]) - self._began_cpu) / ran if ran > 0.0 else 0.0,
        }


def _waiting(bus: can.BusABC, timeout: float) -> Iterator[Frame]:
    """The frames that are there, a tick's worth; the first of them is waited for, at most `timeout` [s]."""
    for _ in range(64):
        try:
            frame = received(bus, timeout)
        except (can.CanError, OSError):
            return
        if frame is None:
            return
        yield frame
        timeout = 0.0


def raise_priority() -> bool:
    """Run under SCHED_FIFO where that is allowed; whether it is. Garbage is collected now, and never again."""
    gc.collect()
    gc.freeze()
    gc.disable()
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    except (AttributeError, OSError):
        return False
    return True
