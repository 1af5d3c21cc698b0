"""A CiA 402 node that does harm, and a bus in memory with it on: written from the standards alone.

Nothing of the driver or of its twin is used here, so that what both of them misread alike can show. Sources: CiA 301
(SDO, NMT, SYNC, PDO, heartbeat, emergency), CiA 402-2 (state machine, 6040h, 6041h). What a node may do against its
host stands in `Attack`, one field a kind of harm.
"""

import struct
import time
from collections import deque
from dataclasses import dataclass

import can

NODE, HOST = 1, 127
GEAR, SLOPE = 5.0, 0.9
"""Motor counts a joint count, and joint over spool: both encoders have the same counts a turn."""
MILLISECOND = 1e-3

NOT_READY, DISABLED, READY, SWITCHED_ON, ENABLED, QUICK_STOP, FAULT = "nrsoeqf"
STATUSWORD = {
    NOT_READY: 0x0200,
    DISABLED: 0x0250,
    READY: 0x0231,
    SWITCHED_ON: 0x0233,
    ENABLED: 0x1237,
    QUICK_STOP: 0x0217,
    FAULT: 0x0218,
}
BOOTING, STOPPED, OPERATIONAL, PRE_OPERATIONAL = 0, 4, 5, 127
REBOOT = 0.05
"""[s]"""

OBJECTS: dict[tuple[int, int], tuple[int, int]] = {
    **{(0x1000, 0): (4, 0x0002_0192), (0x1016, 1): (4, 0), (0x1017, 0): (2, 0), (0x1029, 1): (1, 0)},
    **{(0x1018, sub): (4, 0x100 + sub) for sub in range(1, 5)},
    **{(0x1400 + n, 1): (4, (0x200 + 0x100 * n + NODE) | (0x8000_0000 if n else 0)) for n in range(4)},
    **{(0x1400 + n, 2): (1, 255) for n in range(4)},
    **{(0x1800 + n, 1): (4, (0x180 + 0x100 * n + NODE) | 0xC000_0000) for n in range(4)},
    **{(0x1800 + n, 2): (1, 255) for n in range(4)},
    **{(base + n, sub): (1 if sub == 0 else 4, 0) for base in (0x1600, 0x1A00) for n in range(4) for sub in range(9)},
    **{(0x6007, 0): (2, 0), (0x603F, 0): (2, 0), (0x6040, 0): (2, 0), (0x6041, 0): (2, 0)},
    **{(0x605A, 0): (2, 2), (0x605B, 0): (2, 1), (0x605C, 0): (2, 1), (0x605E, 0): (2, 2)},
    **{(0x6060, 0): (1, 1), (0x6061, 0): (1, 1), (0x6064, 0): (4, 0), (0x6065, 0): (4, 2**31)},
    **{(0x6076, 0): (4, 50_000), (0x6077, 0): (2, 0), (0x607A, 0): (4, 0), (0x607D, 1): (4, -(2**31))},
    **{(0x607D, 2): (4, 2**31 - 1), (0x607F, 0): (4, 50_000), (0x6080, 0): (4, 50_000)},
    **{
        (0x60FD, 0): (4, 0xFFFF_FFFF),
        (0x60C2, 1): (1, 1),
        (0x60C2, 2): (1, -3),
        (0x60E4, 2): (4, 0),
        (0x6502, 0): (4, 0x3A5),
    },
    **{(0x608F, 1): (4, 16384), (0x608F, 2): (4, 1), (0x6091, 1): (4, 1), (0x6091, 2): (4, 1)},
    **{(0x3160, 1): (2, 0), (0x3201, 1): (2, 300), (0x6079, 0): (4, 23_900)},
}
"""Index and sub-index → bytes and value after switching on; 6007h does nothing at a lost heartbeat until it is set."""


@dataclass(frozen=True)
class Attack:
    """What the node does; times count from its first SYNC in operation [s]."""

    keeps_torque: bool = False
    """Once enabled it stays so, whatever it is told, NMT too."""
    lies: bool = False
    """Together with the former: its statusword says what was asked for."""
    enables_itself: float = float("inf")
    """From then on it is enabled, whatever it is told."""
    vanishes: float = float("inf")
    """Nothing comes from it any more, and nothing reaches it; it does as it was told last."""
    reboots_at_question: int = 0
    """Restarts after having answered so many SDO requests."""
    watches: bool = True
    """Whether its heartbeat consumer does anything."""
    forgets: tuple[tuple[int, int], ...] = ()
    """Objects that are as after switching on again once NMT has started it."""
    foreign: tuple[tuple[int, bytes], ...] = ()
    """Frames of another master, one each millisecond."""
    foreign_from: float = 0.0
    """0: from switching on."""
    objects: tuple[tuple[tuple[int, int], int], ...] = ()
    """Values that are otherwise after switching on."""
    current_stuck: float = float("inf")
    """From then on it tells one and the same torque."""
    load: int = 600
    """Of the cable on the motor, in thousandths of the rated torque, in the direction of lower counts."""
    joint_stuck: float = float("inf")
    """From then on its joint encoder stands still."""
    dithers: bool = False
    """What is stuck goes to and fro by a count."""
    endless_text: bool = False
    """The upload of its name, 1008h, never ends."""
    stops: float = float("inf")
    """Its emergency stop is pressed: every digital input opens."""
    stops_itself: float = float("inf")
    """It goes into safe torque off, in one emergency frame and a fault."""
    hides_inputs: float = float("inf")
    """It tells its digital inputs no more, and all else as before."""
    doubles: float = float("inf")
    """From then on a second device of its number answers each SYNC too, with the same position."""
    unwatched: float = float("inf")
    """Somebody has switched off its heartbeat consumer by then, over another port than this bus."""
    loses_answer: int = 0
    """Its answer to that SDO request is lost."""


class HostileNode:
    """The node; `out` takes its frames."""

    def __init__(self, attack: Attack, out: deque[tuple[int, bytes]]) -> None:
        self.attack, self._out = attack, out
        self.motor, self.now = 1000.0, 0.0
        """Counts, time [s]."""
        self.off_since = 0.0
        """Since when there is no torque; infinite while there is [s]."""
        self.heartbeat_at = -1.0
        """Of the host's last [s]."""
        self._questions, self._begun = 0, float("inf")
        self._joint = self._torque = 0
        self._start()

    def _start(self) -> None:
        self.objects = {key: value for key, (_, value) in OBJECTS.items()} | dict(self.attack.objects)
        self.state, self.nmt, self._said = DISABLED, PRE_OPERATIONAL, DISABLED
        self._pending: tuple[int, int] | None = None
        self._control, self._next_heartbeat, self._watching = 0, 0.0, False
        self._silent_until = self.now
        self._emit(0x700 + NODE, b"\0")

    @property
    def torque(self) -> bool:
        """Whether the motor turns, whatever the node says."""
        return self.state in (ENABLED, QUICK_STOP)

    def _emit(self, cob_id: int, data: bytes) -> None:
        if self.now - self._begun < self.attack.vanishes:
            self._out.append((cob_id, data))

    def receive(self, cob_id: int, data: bytes) -> None:
        """A frame from the host."""
        if self.now - self._begun >= self.attack.vanishes or self.now < self._silent_until:
            return
        if cob_id == 0x000 and len(data) == 2 and data[1] in (0, NODE):
            self._obey(data[0])
        elif cob_id == 0x080 and self.nmt == OPERATIONAL:
            self._sync()
        elif cob_id == 0x200 + NODE and self.nmt == OPERATIONAL and len(data) >= 6:
            self._pending = struct.unpack_from("<Hi", data)
        elif cob_id == 0x600 + NODE and self.nmt != STOPPED and len(data) == 8:
            self._answer(data)
        elif cob_id == 0x700 + (self.objects[0x1016, 1] >> 16 & 0x7F) and self.objects[0x1016, 1] & 0xFFFF:
            self.heartbeat_at, self._watching = self.now, True

    def tick(self) -> None:
        """A millisecond passes."""
        self.now += MILLISECOND
        if self.now - MILLISECOND < self._silent_until <= self.now:
            self._start()
        if self.now < self._silent_until:
            return
        since = self.now - self._begun
        if since >= self.attack.enables_itself and self.state != ENABLED and since < self.attack.vanishes:
            self._go(ENABLED)
            self.objects[0x607A, 0] = round(self.motor) + 3000
        if since >= self.attack.stops:
            self.objects[0x60FD, 0] = 0
        if since - MILLISECOND < self.attack.stops_itself <= since:
            self.objects[0x603F, 0] = 0x8A88
            self._emit(0x080 + NODE, struct.pack("<HB5x", 0x8A88, 0x01))
            self._go(FAULT)
        limit = (self.objects[0x1016, 1] & 0xFFFF) * MILLISECOND
        if self._watching and limit and self.now - self.heartbeat_at >= limit:
            self._watching = False
            self._host_is_lost()
        if self.torque:
            self.motor += 0.05 * (self.objects[0x607A, 0] - self.motor)
        period = self.objects[0x1017, 0] * MILLISECOND
        if period and self.now >= self._next_heartbeat:
            self._next_heartbeat = self.now + period
            self._emit(0x700 + NODE, bytes((self.nmt,)))

    def _host_is_lost(self) -> None:
        if not self.attack.watches:
            return
        if self.objects[0x1029, 1] == 0 and self.nmt == OPERATIONAL:
            self.nmt = PRE_OPERATIONAL
        option = self.objects[0x6007, 0]
        if option:
            self._emit(0x080 + NODE, struct.pack("<HB5x", 0x8130, 0x11))
        if option == 1:
            self.objects[0x603F, 0] = 0x8130
            self._go(FAULT)
        elif option:
            self._go(DISABLED)

    def _go(self, state: str) -> None:
        self._said = state
        keeps = self.attack.keeps_torque or self.now - self._begun >= self.attack.enables_itself
        if keeps and self.torque and state != ENABLED:
            return
        self.off_since = float("inf") if state in (ENABLED, QUICK_STOP) else min(self.off_since, self.now)
        self.state = state

    def _obey(self, order: int) -> None:
        if order in (0x81, 0x82):
            self._reboot()
            return
        state = {0x01: OPERATIONAL, 0x02: STOPPED, 0x80: PRE_OPERATIONAL}.get(order)
        if state is None:
            return
        self.nmt = state
        if state == OPERATIONAL:
            for key in self.attack.forgets:
                self.objects[key] = OBJECTS[key][1]
        elif self.torque:
            self._go(DISABLED)

    def _reboot(self) -> None:
        self.state, self.nmt, self.off_since = NOT_READY, BOOTING, min(self.off_since, self.now)
        self._silent_until = self.now + REBOOT

    def _sync(self) -> None:
        if self._begun > self.now:
            self._begun = self.now
        if self._pending is not None:
            control, self.objects[0x607A, 0] = self._pending
            self._pending = None
            self._control_word(control)
        said = self._said if self.attack.lies else self.state
        since = self.now - self._begun
        if since < self.attack.joint_stuck:
            self._joint = round(SLOPE * self.motor / GEAR)
        if since < self.attack.current_stuck:
            lag = max(-20_000.0, min(20_000.0, self.objects[0x607A, 0] - self.motor))
            self._torque = self.torque * round(self.attack.load + 0.02 * self.motor + 0.1 * lag)
        flip = self.attack.dithers * round(self.now / MILLISECOND) % 2
        joint, torque = self._joint + flip * (since >= self.attack.joint_stuck), self._torque
        torque += flip * (since >= self.attack.current_stuck)
        if since >= self.attack.unwatched:
            self.objects[0x1016, 1] = 0
        for _ in range(2 if since >= self.attack.doubles else 1):
            self._emit(0x180 + NODE, struct.pack("<Hih", STATUSWORD[said], round(self.motor), torque))
        self._emit(0x280 + NODE, struct.pack("<ihh", joint, 0, 300))
        if not self.objects[0x1802, 1] >> 31 and self.now - self._begun < self.attack.hides_inputs:
            self._emit(0x380 + NODE, struct.pack("<I", self.objects[0x60FD, 0]))

    def _control_word(self, word: int) -> None:
        rises, self._control = word & ~self._control & 0x80, word
        state = self._said if self.attack.keeps_torque and self.attack.lies else self.state
        if state == FAULT:
            if rises:
                self.objects[0x603F, 0] = 0
                self._go(DISABLED)
        elif not word & 0x02:
            self._go(DISABLED)
        elif not word & 0x04:
            self._go(QUICK_STOP if state in (ENABLED, QUICK_STOP) else DISABLED)
        elif state == QUICK_STOP:
            pass
        elif word & 0x07 == 0x06:
            self._go(READY)
        elif state == READY:
            self._go(SWITCHED_ON)
        elif state in (SWITCHED_ON, ENABLED):
            self._go(ENABLED if word & 0x0F == 0x0F else SWITCHED_ON)

    def _answer(self, request: bytes) -> None:
        """SDO: expedited both ways; a text, where it never ends, in segments."""
        self._questions += 1
        command, index, sub = struct.unpack_from("<BHB", request)
        key, answer = (index, sub), b""
        if command >> 5 == 3:  # the next segment of what never ends
            answer = bytes((command & 0x10,)) + b"endless"
        elif key == (0x1008, 0) and self.attack.endless_text and command >> 5 == 2:
            answer = struct.pack("<BHB4x", 0x40, index, sub)
        elif command == 0x80:
            return
        elif key not in OBJECTS:
            answer = struct.pack("<BHBI", 0x80, index, sub, 0x0602_0000)
        elif command >> 5 == 2:
            size, value = OBJECTS[key][0], self._value(key)
            answer = struct.pack("<BHB", 0x43 | (4 - size) << 2, index, sub)
            answer += (value % (1 << 8 * size)).to_bytes(size, "little").ljust(4, b"\0")
        else:
            size = 4 - (command >> 2 & 3)
            self.objects[key] = int.from_bytes(request[4 : 4 + size], "little")
            if key == (0x6060, 0):
                self.objects[0x6061, 0] = self.objects[key]
            answer = struct.pack("<BHB4x", 0x60, index, sub)
        if self._questions != self.attack.loses_answer:
            self._emit(0x580 + NODE, answer)
        if self._questions == self.attack.reboots_at_question:
            self._reboot()

    def _value(self, key: tuple[int, int]) -> int:
        if key == (0x6041, 0):
            return STATUSWORD[self._said if self.attack.lies else self.state]
        if key == (0x6064, 0):
            return round(self.motor)
        if key == (0x60E4, 2):
            return round(SLOPE * self.motor / GEAR)
        return self.objects[key]


class HostileBus(can.BusABC):
    """The bus with the node at its other end; time stands still but for `pass_time` and waiting for frames."""

    def __init__(self, attack: Attack = Attack()) -> None:
        self.frames: deque[tuple[int, bytes]] = deque()
        self.node = HostileNode(attack, self.frames)
        self.channel_info = "hostile node in memory"
        self.modes: list[object] = []
        """Of the run on it, for the tests."""
        super().__init__(channel="hostile")

    @property
    def time(self) -> float:
        """[s]"""
        return self.node.now

    def pass_time(self, span: float = MILLISECOND) -> None:
        """So much time passes for the node and whoever else is on the bus [s]."""
        attack = self.node.attack
        for _ in range(round(span / MILLISECOND)):
            self.node.tick()
            begun = self.node.now - self.node._begun >= attack.foreign_from
            if attack.foreign and (begun or attack.foreign_from == 0.0):
                cob_id, data = attack.foreign[round(self.time / MILLISECOND) % len(attack.foreign)]
                self.frames.append((cob_id, data))
                self.node.receive(cob_id, data)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Hand a frame to the node."""
        self.node.receive(msg.arbitration_id, bytes(msg.data))

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if not self.frames and timeout != 0.0:
            begin = time.monotonic()
            time.sleep(5e-5)  # bring-up waits by the clock
            self.pass_time(max(MILLISECOND, time.monotonic() - begin))
        if not self.frames:
            return None, False
        cob_id, data = self.frames.popleft()
        return can.Message(arbitration_id=cob_id, data=data, is_extended_id=False), False
