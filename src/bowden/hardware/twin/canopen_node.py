"""The twin of a CiA 402 drive as a node of the bus: NMT, heartbeats, SDO, PDOs at SYNC, state machine, faults."""

import math
from collections.abc import Callable, Mapping
from typing import Any, ClassVar, NamedTuple

from bowden.core.signals import DriveState
from bowden.hardware.drives import canopen_frames as frames
from bowden.hardware.drives.cia402 import WITH_TORQUE, encode, step
from bowden.hardware.drives.emergencies import HEARTBEAT_LOST, SAFE_TORQUE_OFF
from bowden.hardware.drives.families.cia402 import DriveParameters, joint_scale, load_range
from bowden.hardware.twin.node import HOTTEST, TwinNode
from bowden.hardware.twin.objects import Key, Objects, SdoAnswers, dictionary, overridden
from bowden.hardware.twin.plant import BRAKE, FOLLOW, Doing, torque_on_joint

LIMIT_ERROR, LAG_ERROR, OVER_TEMPERATURE = 0x8A82, 0x8611, 0x4210
"""Codes of the faults that the twin finds itself."""
ALL_RELEASED = 0xFFFF_FFFF
"""60FDh where no contact is open."""
STANDSTILL = 1e-6
"""Speed at which a quick stop is over [rad/s]."""

RATED_CURRENT = 4.0
"""Of the twin's motor; a stated choice [A]."""


class PdoSample(NamedTuple):
    """What both transmit PDOs tell, but for the statusword."""

    motor: int
    """[counts]"""
    torque: int
    """[‰ of the rated torque]"""
    joint: int
    """[counts]"""
    analog: int
    """[mV]"""
    temperature: int
    """[0.1 °C]"""


class CanopenNode(TwinNode):
    """The drive."""

    _drive: DriveParameters

    lacks: ClassVar[Mapping[str, str]] = {
        "kick": "it takes its target with the order that enables it",
        "mode_left": "it says so in its statusword: inject drive_fault",
        "foreign_replies": "its frames have numbers of their own",
        "saturated": "its PDOs have no fields that end so soon",
        "joint_silence": "the joint's encoder hangs on the drive: inject encoder_frozen joint",
        "turns_lost": "its counter is its encoder's: inject encoder_offset motor",
        **dict.fromkeys(
            ("load_half", "load_doubled"), "a load cell at the drive's input sends no frames: inject load_stuck"
        ),
        "load_silence": "a load cell at the drive's input sends nothing by itself: inject load_stuck",
    }

    def _prepare(self) -> None:
        self.syncs, self._joint = 0, joint_scale(self._drive)

    def _power_up(self) -> None:
        self.nmt, self.state, self.error = frames.BOOT_UP, DriveState.NOT_READY_TO_SWITCH_ON, 0
        self._control, self._target = 0, 0
        self._pending: tuple[int, int, int] | None = None
        self._watching = False
        self._lagging_since = math.nan
        self._inputs = ALL_RELEASED
        self._next_heartbeat = -math.inf
        rated = RATED_CURRENT * self._drive.needs.torque_constant
        objects = dictionary(self._drive, self.bench, self._scale, rated)
        entries = overridden(objects, self._overrides)
        current = {key: value for key, value in self._current_values().items() if key not in self._overrides}
        self.objects = Objects(entries, self._written, current)
        self._sdo = SdoAnswers(self.objects)
        self._see_outputs(self._ready)

    def _current_values(self) -> dict[Key, Callable[[], int]]:
        return {
            (0x6041, 0): lambda: self._statusword(),
            (0x603F, 0): lambda: self.error,
            (0x6061, 0): lambda: self.objects[0x6060, 0],
            (0x6064, 0): lambda: self._true().motor,
            (0x60FD, 0): lambda: self._inputs,
            (0x6077, 0): lambda: self._true().torque,
            (0x60E4, 2): lambda: self._true().joint,
            (0x3160, 1): lambda: self._true().analog,
            (0x3201, 1): lambda: self._true().temperature,
        }

    def _standing(self) -> tuple[DriveState, int, dict[str, Any]]:
        return self.state, self.error, {"nmt": self.nmt, "syncs": self.syncs}

    def receive(self, cob_id: int, data: bytes, now: float) -> None:
        """See `TwinNode.receive`."""
        if not self._is_receiving(now):
            return
        node = self._drive.node_id
        if cob_id == frames.SYNC and not data:
            self._synchronise(now)
        elif cob_id in (frames.RPDO1 + node, frames.NMT) and self.faults.active("commands_ignored", now):
            pass
        elif cob_id == frames.RPDO1 + node and self.nmt == frames.OPERATIONAL:
            if (told := frames.ORDER.unpack(data, 3 if self.objects[0x1600, 0] == 3 else 2)) is not None:
                control, target, *torque = told
                self._pending = control, target, torque[0] if torque else 0
        elif cob_id == frames.SDO_REQUEST + node and self.nmt in (frames.OPERATIONAL, frames.PRE_OPERATIONAL):
            answer = self._sdo.answer(data)
            if answer is not None:
                self._emit(frames.SDO_ANSWER, answer, now)
        elif cob_id == frames.NMT and len(data) == 2 and data[1] in (0, node):
            self._obey(data[0], now)
        elif cob_id == frames.HEARTBEAT + (self.objects[0x1016, 1] >> 16 & 0x7F) and self.objects[0x1016, 1]:
            self.host, self._watching = now, True

    def _boot(self, now: float) -> None:
        self._journal(now, "boot", "")
        self.nmt, self.state = frames.PRE_OPERATIONAL, DriveState.SWITCH_ON_DISABLED
        self._emit(frames.HEARTBEAT, bytes((frames.BOOT_UP,)), now)

    def _send_cyclic(self, now: float) -> None:
        if self._booted and self.objects[0x1017, 0] and now >= self._next_heartbeat:
            self._next_heartbeat = max(self._next_heartbeat + 1e-3 * self.objects[0x1017, 0], now)
            self._emit(frames.HEARTBEAT, bytes((self.nmt,)), now)
        self._outbox.tick(now)

    def _emit(self, kind: int, data: bytes, now: float) -> None:
        self._outbox.emit(kind + self._drive.node_id, data, now)

    def _see_emergency_stop(self, now: float) -> None:
        """Pressed, it opens every digital input and the safe torque off."""
        pressed = self.faults.active("emergency_stop", now) is not None
        self._inputs = 0 if pressed else ALL_RELEASED
        if pressed and self._booted and self.state is not DriveState.FAULT:
            self._fail(SAFE_TORQUE_OFF, now)

    def _watch(self, now: float) -> None:
        if self.faults.active("watch_off", now):
            self.objects.change((0x1016, 1), 0)
        self._watch_host(now)
        self._see_emergency_stop(now)

    def _watch_host(self, now: float) -> None:
        """The heartbeat consumer, 1016h, and what 6007h wants when the host has fallen silent."""
        limit = 1e-3 * (self.objects[0x1016, 1] & 0xFFFF)
        if not limit:
            self._watching = False
        if self.state in WITH_TORQUE:
            limit = max(limit, self.patience)
        if self._watching and now - self.host >= limit:
            self._watching = False
            option = self.objects[0x6007, 0]
            if self.objects[0x1029, 1] == 0 and self.nmt == frames.OPERATIONAL:
                self.nmt, self._pending = frames.PRE_OPERATIONAL, None
            if option == 1:
                self._fail(HEARTBEAT_LOST, now)
            elif option:  # 2, disable voltage; 3, quick stop
                self._emit(frames.EMERGENCY, frames.pack_emergency(HEARTBEAT_LOST, 0x11), now)
                self._enter(step(self.state, 0x00 if option == 2 else 0x02, edge=False), now)

    def _synchronise(self, now: float) -> None:
        """At a SYNC: the target that came before it takes effect, and everything is sampled and sent."""
        self.syncs += 1
        if self.nmt != frames.OPERATIONAL:
            return
        self._move(now)  # up to here under the target of the SYNC before
        if self._pending is not None:
            control, self._target, torque = self._pending
            self._pending = None
            self._written((0x60B2, 0), torque)
            self._command(control, now)
        self._history.append(self._sample(now))
        motor, torque, *sensors = self._delayed(now)
        sensors, node = sensors[: max(2, self.objects[0x1A01, 0])], self._drive.node_id
        if self.objects[0x1800, 1] >> 31 == 0:
            for _ in range(2 if self.faults.active("doubled_pdos", now) else 1):
                motion = frames.MOTION.pack(self._statusword(), motor, torque)
                self._outbox.emit_cyclic(frames.TPDO1 + node, motion, now)
        if self.objects[0x1801, 1] >> 31 == 0:
            self._outbox.emit_cyclic(frames.TPDO2 + node, frames.SENSORS.pack(*sensors), now)
        if self.objects[0x1802, 1] >> 31 == 0:
            self._outbox.emit_cyclic(frames.TPDO3 + node, frames.INPUTS.pack(self._inputs), now)

    def _command(self, control: int, now: float) -> None:
        """A controlword: one step of the state machine, and what it means for the motor."""
        edge = bool(control & 0x80 and not self._control & 0x80)
        self._control = control
        hot = self.bench.temperature >= HOTTEST
        self._enter(step(self.state, control, edge, fault_gone=not hot), now)

    def _entered(self, before: Any, now: float, why: str) -> None:
        if before is DriveState.FAULT:
            self.error = 0
            self._emit(frames.EMERGENCY, frames.pack_emergency(0, 0), now)
        if self.state is DriveState.OPERATION_ENABLED:
            self._power(now, on=True)
        elif before in WITH_TORQUE and self.state not in WITH_TORQUE:
            self._power(now, on=False, why=why)

    def _stop(self, now: float, why: str) -> None:
        self._power(now, on=False, why=why)

    def _fail(self, code: int, now: float) -> None:
        """Into fault: torque off at once, as 605Eh is 0, or braking first."""
        self.error = code
        self._journal(now, "fault", f"0x{code:04X}")
        self._emit(frames.EMERGENCY, frames.pack_emergency(code, 1), now)
        if self.state is DriveState.OPERATION_ENABLED and self.objects[0x605E, 0] != 0:
            self._enter(DriveState.FAULT_REACTION_ACTIVE, now)
        elif self._booted:
            self._enter(DriveState.FAULT, now)

    def _command_motor(self, now: float, span: float) -> Doing:
        if self.state is DriveState.OPERATION_ENABLED:
            low, high = self.objects[0x607D, 1], self.objects[0x607D, 2]
            if not low < high or low <= self._target <= high:
                self.bench.command = self._scale.angle(self._target)
                return self._follow_or_inert(now, FOLLOW)
            self._fail(LIMIT_ERROR, now)
        elif self.state in (DriveState.QUICK_STOP_ACTIVE, DriveState.FAULT_REACTION_ACTIVE):
            return BRAKE
        return self.bench.doing

    def _protect(self, now: float) -> None:
        bench = self.bench
        if bench.doing == BRAKE and abs(bench.velocity) <= STANDSTILL:
            quick = self.state is DriveState.QUICK_STOP_ACTIVE
            if not (quick and self.objects[0x605A, 0] >= 5):  # 5 to 8 stay, with torque
                self._enter(DriveState.SWITCH_ON_DISABLED if quick else DriveState.FAULT, now)
        self._check_lag(now)
        if bench.temperature >= HOTTEST and self.state is DriveState.OPERATION_ENABLED:
            self._fail(OVER_TEMPERATURE, now)

    def _check_lag(self, now: float) -> None:
        """6065h, following error window, and 6066h, how long it may last [ms]."""
        lag = abs(self._target - self._scale.counts(self.bench.motor))
        if self.state is not DriveState.OPERATION_ENABLED or lag <= self.objects[0x6065, 0]:
            self._lagging_since = math.nan
        elif math.isnan(self._lagging_since):
            self._lagging_since = now
        if now - self._lagging_since >= 1e-3 * self.objects[0x6066, 0]:
            self._fail(LAG_ERROR, now)

    def _obey(self, order: int, now: float) -> None:
        """NMT node control; leaving operational takes the torque off."""
        if order in (frames.NMT_RESET_NODE, frames.NMT_RESET_COMMUNICATION):
            self._restart(now, "NMT reset")
            return
        state = frames.STATE_AFTER.get(order)
        if state is None:
            return
        self.nmt = state
        self._journal(now, "nmt", str(state))
        if state != frames.OPERATIONAL:
            self._pending = None
            if self.state in WITH_TORQUE:
                self._enter(DriveState.SWITCH_ON_DISABLED, now)

    def _written(self, key: Key, value: int) -> None:
        if key == (0x6040, 0):
            self._pending = (value, self._target, 0)
        elif key == (0x607A, 0):
            self._target = value
        elif key[0] == 0x60FE:
            self._see_outputs(self._moved)
        elif key == (0x60B2, 0) and self.bench.torque_offset is not None:
            drive = self._drive
            rated = RATED_CURRENT * drive.needs.torque_constant * drive.needs.gear * drive.motor_direction
            self.bench.torque_offset = 1e-3 * value * rated  # at the spool, of thousandths [N·m]

    def _see_outputs(self, now: float) -> None:
        """Bit 0 of 60FEh, where its mask has it: a brake that a 1 releases holds until then."""
        output = self._drive.brake_output
        if output == "none":
            return
        bit = bool(self.objects[0x60FE, 1] & self.objects[0x60FE, 2] & 1)
        engaged = bit == (output == "set")
        if engaged != self.bench.brake_set:
            self.bench.brake_set = engaged
            if math.isfinite(now):
                self._journal(now, "brake", "engaged" if engaged else "released")

    def _statusword(self) -> int:
        return encode(self.state) | (0x1000 if self.state is DriveState.OPERATION_ENABLED else 0)

    def _sample(self, now: float) -> PdoSample:
        """What is measured at a SYNC, through the encoders' noise, with the faults that are there at `now` [s]."""
        return self._packed(*self._encoders(self._joint, now), self._current(now), now)

    def _true(self) -> PdoSample:
        """The same without noise and faults."""
        bench = self.bench
        return self._packed(self._scale.counts(bench.motor), self._joint.counts(bench.joint), bench.current, -math.inf)

    def _packed(self, motor: float, joint: float, current: float, now: float) -> PdoSample:
        drive, bench = self._drive, self.bench
        scale, millivolts = drive.tension_scale or drive.torque_scale, 0.0
        if scale:
            load = bench.tension if drive.tension_scale else torque_on_joint(bench)
            load = self.faults.load(load, load_range(drive), now)
            millivolts = max(-drive.analog_range, min(drive.analog_range, load / scale + drive.tension_zero))
        torque = _int(1e3 * drive.motor_direction * current / RATED_CURRENT, 15)
        angles = _int(motor, 31), torque, _int(joint, 31)
        return PdoSample(*angles, _int(millivolts, 15), _int(10.0 * bench.temperature, 15))


def _int(value: float, bits: int) -> int:
    """The nearest whole number that this many bits and a sign hold; the least of them for what is no number."""
    if math.isnan(value):
        return -(1 << bits)
    half_up = math.floor(value + 0.5) if math.isfinite(value) else value  # as an encoder counts
    return int(max(-(1 << bits), min((1 << bits) - 1, half_up)))
