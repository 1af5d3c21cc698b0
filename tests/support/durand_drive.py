"""A CiA 402 drive on a CiA 301 stack that this project did not write (durand), as a process on a bus.

``python -m support.durand_drive CHANNEL``: says ``ready`` once it is there, and ends with its standard input. SDO, PDO,
NMT, SYNC, heartbeat and emergency are durand's; written here from CiA 402-2 is what it has not: the state machine, the
consumer of the host's heartbeat, and a motor behind it. Nothing of the package's driver or twin is used.
"""

import contextlib
import struct
import sys
import threading
import time
from typing import Any

import can
from durand import CANBusNetwork, MinimalNode, Record, Variable, set_scheduler
from durand import DatatypeEnum as Kind
from durand.scheduler import SyncScheduler

from bowden.hardware.buses.unix_bus import UnixBus

NODE, GEAR, SLOPE, LAG = 1, 5.0, 0.9, 0.02
"""Number; motor counts a joint count, and joint over spool, both encoders with the same counts a turn; time constant of
the motor [s]."""
STATUSWORD = {"off": 0x0250, "ready": 0x0231, "on": 0x0233, "enabled": 0x1237, "stopping": 0x0217, "fault": 0x0218}
SIZES = {
    (1, False): Kind.UNSIGNED8,
    (2, False): Kind.UNSIGNED16,
    (4, False): Kind.UNSIGNED32,
    (1, True): Kind.INTEGER8,
    (2, True): Kind.INTEGER16,
    (4, True): Kind.INTEGER32,
}

PLAIN: dict[int, tuple[int, bool, int]] = {
    **{0x6007: (2, True, 0), 0x603F: (2, False, 0), 0x6040: (2, False, 0), 0x6041: (2, False, STATUSWORD["off"])},
    **{0x605A: (2, True, 2), 0x605B: (2, True, 1), 0x605C: (2, True, 1), 0x605E: (2, True, 2)},
    **{0x6060: (1, True, 1), 0x6061: (1, True, 1), 0x6064: (4, True, 0), 0x6065: (4, False, 2**31)},
    **{0x6076: (4, False, 50_000), 0x6077: (2, True, 0), 0x6079: (4, False, 23_900), 0x607A: (4, True, 0)},
    **{
        0x607F: (4, False, 50_000),
        0x6080: (4, False, 50_000),
        0x60FD: (4, False, 0xFFFF_FFFF),
        0x6502: (4, False, 0x3A5),
    },
}
"""Index → bytes, whether it has a sign, value after switching on."""
RECORDS: dict[int, dict[int, tuple[int, bool, int]]] = {
    0x1016: {1: (4, False, 0)},
    0x1029: {1: (1, False, 0)},
    0x3160: {1: (2, True, 0)},
    0x3201: {1: (2, True, 300)},
    0x607D: {1: (4, True, -(2**31)), 2: (4, True, 2**31 - 1)},
    0x608F: {1: (4, False, 16384), 2: (4, False, 1)},
    0x6091: {1: (4, False, 1), 2: (4, False, 1)},
    0x60C2: {1: (1, False, 1), 2: (1, True, -3)},
    0x60E4: {1: (4, True, 0), 2: (4, True, 0)},
}


class PatientBus(UnixBus):
    """What nobody acknowledges is lost, as a controller that tries again finds nobody either."""

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a frame, if anybody is there."""
        with contextlib.suppress(can.CanError):
            super().send(msg, timeout)


class DurandDrive:
    """The drive's application."""

    def __init__(self, bus: can.BusABC) -> None:
        self.network = CANBusNetwork(bus)
        self.node: Any = MinimalNode(self.network, NODE)
        self.lock = threading.RLock()
        self.state, self.motor, self.moved, self.control = "off", 1000.0, time.monotonic(), 0
        self.heard: float | None = None
        found = self.node.object_dictionary
        found.write(0x1000, 0, 0x0002_0192)
        for index, (size, signed, value) in PLAIN.items():
            found[index] = Variable(SIZES[size, signed], "rw", value)
        for index, subs in RECORDS.items():
            record = Record()
            for sub, (size, signed, value) in subs.items():
                record[sub] = Variable(SIZES[size, signed], "rw", value)
            found[index] = record
        found.update_callbacks[(0x6060, 0)].add(lambda mode: found.write(0x6061, 0, mode))
        found.download_callbacks[(0x1016, 1)].add(self._watch)
        found.download_callbacks[(0x6040, 0)].add(self._command)
        self.node.sync.callbacks.add(self._synchronise)
        self.node.nmt.state_callbacks.add(self._nmt)

    def _get(self, index: int, sub: int = 0) -> int:
        return int(self.node.object_dictionary.read(index, sub))

    def _set(self, index: int, sub: int, value: int) -> None:
        self.node.object_dictionary.write(index, sub, value)

    def _watch(self, value: int) -> None:
        with self.lock:
            self.heard = None
            if value >> 16 & 0x7F:
                self.network.add_subscription(0x700 + (value >> 16 & 0x7F), self._beat)

    def _beat(self, _: int, data: bytes) -> None:
        self.heard = time.monotonic()

    def _nmt(self, state: Any) -> None:
        with self.lock:
            if int(state) != 5 and self.state in ("enabled", "stopping"):
                self._go("off")

    def _go(self, state: str) -> None:
        if state != self.state:
            print(f"state {state} {time.monotonic():.6f}", flush=True)
        self.state = state
        self._set(0x6041, 0, STATUSWORD[state])

    def _command(self, word: int) -> None:
        """CiA 402-2, the state machine's transitions by the controlword."""
        with self.lock:
            rises, self.control = word & ~self.control & 0x80, word
            if self.state == "fault":
                if rises:
                    self._set(0x603F, 0, 0)
                    self._go("off")
            elif not word & 0x02:
                self._go("off")
            elif not word & 0x04:
                self._go("stopping" if self.state == "enabled" else "off")
            elif word & 0x07 == 0x06:
                self._go("ready")
            elif self.state == "ready" and word & 0x07 == 0x07:
                self._go("on")
            elif self.state in ("on", "enabled"):
                self._go("enabled" if word & 0x0F == 0x0F else "on")

    def _synchronise(self) -> None:
        with self.lock:
            self._move()

    def _move(self) -> None:
        now = time.monotonic()
        share = min(1.0, (now - self.moved) / LAG)
        self.moved = now
        if self.state == "enabled":
            self.motor += share * (self._get(0x607A) - self.motor)
        elif self.state == "stopping":
            self._go("off")
        self._set(0x6064, 0, round(self.motor))
        self._set(0x60E4, 2, round(SLOPE * self.motor / GEAR))

    def tick(self) -> None:
        """Look whether the host is still there."""
        with self.lock:
            limit = 1e-3 * (self._get(0x1016, 1) & 0xFFFF)
            if limit and self.heard is not None and time.monotonic() - self.heard > limit:
                self.heard = None
                self.network.send(0x080 + NODE, struct.pack("<HB5x", 0x8130, 0x11))
                if self._get(0x6007) == 1:
                    self._set(0x603F, 0, 0x8130)
                    self._go("fault")
                elif self._get(0x6007):
                    self._go("off")


def main() -> None:
    """The process."""
    scheduler = SyncScheduler()
    set_scheduler(scheduler)
    threading.Thread(target=scheduler.run, daemon=True).start()
    bus = PatientBus(sys.argv[1], create=True)
    drive = DurandDrive(bus)
    over = threading.Event()
    threading.Thread(target=lambda: (sys.stdin.read(), over.set()), daemon=True).start()
    print("ready", flush=True)
    while not over.wait(1e-3):
        drive.tick()
    drive.network.stop()
    bus.shutdown()


if __name__ == "__main__":
    main()
