"""The faults that the twin has at a time, and what they do to its encoders, its PDOs and all that it sends."""

import math
import random
from collections import deque
from collections.abc import Callable

from bowden.hardware.buses.place import ERROR
from bowden.hardware.twin.injection import KINDS, Injection
from bowden.hardware.twin.plant import TwinPlant

NO_NUMBER = float(-(2**31))
"""Counts that stand for none."""

SPIKE_EVERY = 10
"""Cycles from one spike to the next."""


class Faults:
    """Injected faults."""

    def __init__(self) -> None:
        self._lasting: list[Injection] = []
        self._moments: list[Injection] = []
        self._held: dict[tuple[str, str], float] = {}
        self._random = random.Random(0)
        self._cycles = {"motor": 0, "joint": 0}
        self._queued = 0  # frames that the host's queue holds
        self._load = math.nan  # that a stuck cell keeps, and a slow one
        self._load_until = -math.inf  # for so long a slow one does

    def inject(self, injection: Injection) -> None:
        """Take a fault in; one that happens once does so at its start."""
        (self._moments if KINDS[injection.name].moment else self._lasting).append(injection)

    def clear(self) -> None:
        """No faults any more."""
        self._lasting, self._moments, self._held = [], [], {}

    def active(self, name: str, now: float, side: str = "") -> Injection | None:
        """The fault of that name if it is there at `now` [s]."""
        for injection in self._lasting:
            if injection.name == name and injection.side == side and injection.active(now):
                return injection
        return None

    def names(self, now: float) -> list[str]:
        """All that are there at `now` [s]."""
        return [f"{one.name} {one.side}".rstrip() for one in self._lasting if one.active(now)]

    def due(self, now: float) -> list[Injection]:
        """Those that happen once, and now."""
        due = [injection for injection in self._moments if injection.start <= now]
        if due:
            self._moments = [injection for injection in self._moments if injection.start > now]
        return due

    def drops_pdo(self, now: float) -> bool:
        """True if this PDO is lost."""
        dropped = self.active("dropped_pdos", now)
        return dropped is not None and self._random.random() < dropped.amount

    def swallows(self, now: float) -> bool:
        """True if a frame of the host is left in its queue, since nothing goes over the bus."""
        full = self.active("queue_full", now) is not None
        self._queued = self._queued + 1 if full else 0
        return full

    def off_bus(self, now: float) -> bool:
        """True if the bus takes no frame: no node acknowledges, or the host's queue has no room."""
        full = self.active("queue_full", now)
        return self.active("bus_off", now) is not None or (full is not None and self._queued >= full.amount)

    def destroys(self, now: float) -> bool:
        """True if this frame is destroyed by a bit error: every node of the bus sees an error frame in its place."""
        errors = self.active("bit_errors", now)
        return errors is not None and self._random.random() < errors.amount

    def load(self, value: float, full_scale: float, now: float) -> float:
        """What a load cell says of a load, as its faults make it [N or N·m].

        Args:
            value: true.
            full_scale: at which it saturates.
            now: [s]
        """
        drift, end = self.active("load_drift", now), self.active("load_saturated", now)
        if drift:
            value += drift.amount * (now - drift.start)
        if self.active("load_sign", now):
            value = -value
        if end:
            value = math.copysign(full_scale, end.amount)
        slow = self.active("load_slow", now)
        if slow or self.active("load_stuck", now):
            if math.isnan(self._load) or (slow and now >= self._load_until):
                self._load, self._load_until = value, now + (1.0 / slow.amount if slow else math.inf)
            value = self._load
        else:
            self._load = math.nan
        return max(-full_scale, min(full_scale, value))

    def damage(self, bench: TwinPlant, now: float) -> None:
        """Tear the plant's cable, or give it slack, where that is injected."""
        slack = self.active("slack_cable", now)
        bench.torn = bool(self.active("broken_cable", now))
        bench.slack = math.radians(slack.amount) if slack else 0.0

    def encoder(self, side: str, counts: float, step: float, now: float) -> float:
        """The counts of one encoder as its faults make them.

        Args:
            side: ``motor`` or ``joint``.
            counts: true ones.
            step: angle of one count [rad].
            now: [s]
        """
        if not self._lasting:
            return counts
        self._cycles[side] += 1
        for name in ("encoder_frozen", "encoder_flipped"):
            if not self.active(name, now, side):
                self._held.pop((name, side), None)
            else:
                held = self._held.setdefault((name, side), counts)
                counts = held if name == "encoder_frozen" else 2.0 * held - counts
        offset, spike = self.active("encoder_offset", now, side), self.active("encoder_spike", now, side)
        if offset:
            counts += math.radians(offset.amount) / step
        if spike and self._cycles[side] % SPIKE_EVERY == 0:
            counts += math.radians(spike.amount) / step
        end = self.active("position_saturated", now) if side == "motor" else None
        if end:
            counts = math.copysign(math.inf, end.amount)  # the node has its own ends
        counts = 0.0 if self.active("encoder_zero", now, side) else counts
        return NO_NUMBER if self.active("encoder_nan", now, side) else counts


Send = Callable[[int, bytes], None]
"""Puts a frame on the bus: identifier, with the flags of `buses.place`, and data."""

BIT_ERROR = 0x08
"""Error class of an error frame: violation in the protocol (Linux, `linux/can/error.h`, CAN_ERR_PROT)."""


class Outbox:
    """Where a node's frames go out.

    Args:
        send: puts a frame on the bus.
        faults: of the drive.
    """

    def __init__(self, send: Send, faults: Faults) -> None:
        self._send, self._faults = send, faults
        self._waiting: deque[tuple[float, int, bytes]] = deque()

    def emit(self, identifier: int, data: bytes, now: float) -> None:
        """A frame that comes when something happens: an answer, a heartbeat, an emergency."""
        if not self._faults.active("silence", now):
            self._put(identifier, data, now)

    def emit_cyclic(self, identifier: int, data: bytes, now: float) -> None:
        """A frame with readings, of every cycle; those alone are lost or late."""
        if self._faults.active("silence", now) or self._faults.drops_pdo(now):
            return
        late, short = self._faults.active("late_pdos", now), self._faults.active("short_frames", now)
        data = data[: int(short.amount)] if short else data
        if late:
            self._waiting.append((now + 1e-3 * late.amount, identifier, data))
        else:
            self._put(identifier, data, now)

    def _put(self, identifier: int, data: bytes, now: float) -> None:
        if self._faults.destroys(now):
            identifier, data = ERROR | BIT_ERROR, bytes(8)
        self._send(identifier, data)

    def tick(self, now: float) -> None:
        """Send what has waited long enough."""
        while self._waiting and self._waiting[0][0] <= now:
            _, identifier, data = self._waiting.popleft()
            self._put(identifier, data, now)
