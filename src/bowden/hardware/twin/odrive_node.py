"""The twin of an ODrive board on classic CAN, and of the joint's encoder beside it (`sensor_node`).

Its motor follows as the rig's servo does, whatever the gains are: in position control the input, or the filter of input
mode POS_FILTER. In any other control mode it gives no torque.

What the documentation of firmware 0.6, whose source is closed, does not say, and is chosen here as in the public
firmware 0.5: the watchdog runs while the board is idle, too (``watchdog_idle=0`` for one in which it does not), and its
error stays until it is cleared; a board with an active error does not come to closed loop. The watchdog is fed by the
fewest frames that its maker's examples say: axis states and inputs.
"""

import math
from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple

from bowden.core.signals import DriveState
from bowden.hardware.buses.place import REMOTE
from bowden.hardware.drives import odrive_endpoints as settings
from bowden.hardware.drives import odrive_frames as frames
from bowden.hardware.drives.families.odrive import OdriveParameters
from bowden.hardware.drives.odrive_drive import state_of
from bowden.hardware.drives.odrive_endpoints import endpoints_of
from bowden.hardware.drives.odrive_frames import ESTOP, WATCHDOG, AxisState, Beat, Cmd, unpack
from bowden.hardware.twin.faults import NO_NUMBER
from bowden.hardware.twin.injection import UNCOUNTED
from bowden.hardware.twin.node import HOTTEST, SUPPLY, TwinNode
from bowden.hardware.twin.plant import FOLLOW, OFF, Doing

ARMING_TIME = 5e-3
"""From a request for closed loop to it; a stated choice [s]."""
OVERSPEED = 1.2
"""vel_limit_tolerance: share of its speed limit at which it protects itself [–]."""
DRV_FAULT, MISSING_ESTIMATE, OVER_TEMPERATURE, TOO_FAST = 0x20, 0x8, 0x4000, 0x8000
"""Flags of errors that the twin finds itself, or is given."""
ENCODER_EVERY = "axis0.config.can.encoder_msg_rate_ms"
FILTER = "axis0.controller.config.input_filter_bandwidth"
POS_FILTER = 3
WATCHDOG_IDLE, FIRST_STATE = "watchdog_idle", "axis_state"
"""Options that are no settings: whether the watchdog runs while the board is idle; the state after power-up."""
SET_BY: Mapping[int, tuple[str, str]] = {
    Cmd.SET_CONTROLLER_MODE: (settings.CONTROL_MODE, settings.INPUT_MODE),
    Cmd.SET_LIMITS: (settings.VELOCITY_LIMIT, settings.CURRENT_LIMIT),
}
"""Command → the settings that its fields are."""
FED_BY = frozenset((Cmd.SET_AXIS_STATE, Cmd.SET_INPUT_POS, Cmd.SET_INPUT_VEL, Cmd.SET_INPUT_TORQUE))


class Told(NamedTuple):
    """Readings of the board's sensors."""

    position: float
    """[turns]"""
    velocity: float
    """[turns/s]"""
    current: float
    """[A]"""


class OdriveNode(TwinNode):
    """The board."""

    _drive: OdriveParameters

    lacks: ClassVar[Mapping[str, str]] = {
        "doubled_pdos": UNCOUNTED,
        **dict.fromkeys(("saturated", "position_saturated"), "its numbers are floating-point, which have no ends"),
        "kick": "it begins at its own position",
    }

    def _prepare(self) -> None:
        self._endpoints = endpoints_of(self._drive.endpoints)
        self._set: dict[str, float] = {}

    def _power_up(self) -> None:
        if self._set:  # it was on before, and has lost its turns, or its position
            turns = self._position()
            self._shift -= round(turns) if self._set[settings.ABSOLUTE] else turns
        self._fed = self._ready
        self._arming = math.inf
        self.active = self.disarmed = 0
        drive, speed = self._drive, self._speed_limit()
        self._set = {
            settings.ENABLED: 1.0,
            settings.TIMEOUT: drive.watchdog,
            settings.BEAT_EVERY: 1e3 * drive.heartbeat,
            ENCODER_EVERY: 10.0,
            settings.VELOCITY_SCALE: float(drive.velocity_scale),
            settings.TORQUE_SCALE: float(drive.torque_scale),
            settings.CONTROL_MODE: 3.0,
            settings.INPUT_MODE: 1.0,
            settings.VELOCITY_LIMIT: 1.001 * speed if math.isfinite(speed) else 500.0,
            settings.VELOCITY_LIMITED: 1.0,
            settings.CIRCULAR: 0.0,
            settings.ABSOLUTE: float(drive.home != "here"),
            settings.CURRENT_LIMIT: self.bench.current_limit,
            settings.TORQUE_CONSTANT: drive.needs.torque_constant,
            settings.LOAD_ENCODER: 13.0,
            settings.MOTOR_ENCODER: 13.0,
            FILTER: 20.0,
            WATCHDOG_IDLE: 1.0,
            FIRST_STATE: float(AxisState.IDLE),
        }
        named = {name: value for name, value in self._overrides.items() if isinstance(name, str)}
        self._set |= {name: value for name, value in named.items() if value is not None}
        self.state = AxisState(int(self._set[FIRST_STATE]))
        self._input = frames.Target(0.0, 0.0, 0.0)
        self._setpoint, self._speed = 0.0, 0.0  # [turns], [turns/s]
        self._next_beat = self._next_estimate = self._ready

    def _standing(self) -> tuple[DriveState, int, dict[str, Any]]:
        errors = self._errors
        return state_of(Beat(errors, self.state), errors), errors, {"axis_state": int(self.state)}

    @property
    def _errors(self) -> int:
        return self.active | self.disarmed

    def receive(self, identifier: int, data: bytes, now: float) -> None:
        """A frame from the bus; `buses.place.REMOTE` marks a question, and so does a frame without data."""
        if self._is_destroyed(now):
            return
        plain = identifier & ~REMOTE
        number, cmd = plain >> 5, plain & 0x1F
        mine = plain <= frames.HIGHEST_ID and number in (self._drive.node_id, frames.BROADCAST)
        if self._encoder is not None and not mine and not identifier & REMOTE:
            self._encoder.receive(identifier, data, now)
        if not mine or not self._is_receiving(now):
            return
        self.host = now
        asked = bool(identifier & REMOTE) or not data
        if cmd in FED_BY and not identifier & REMOTE:
            self._move(now)  # up to here under the order before
            self._fed = now
        if cmd == Cmd.RX_SDO:
            self._answer(data, now)
        elif cmd in frames.TOLD or cmd == Cmd.ADDRESS:
            if asked:
                self._tell(cmd, now)
        elif not identifier & REMOTE and not self.faults.active("commands_ignored", now):
            self._obey(cmd, data, now)

    def _obey(self, cmd: int, data: bytes, now: float) -> None:
        """An order."""
        if cmd == Cmd.ESTOP:
            self._fail(ESTOP, now)
        elif cmd == Cmd.SET_AXIS_STATE and (state := unpack(cmd, data)) is not None:
            self._request(state[0], now)
        elif cmd == Cmd.CLEAR_ERRORS:
            self.active = self.disarmed = 0
        elif cmd in SET_BY and (values := unpack(cmd, data)) is not None:
            for name, value in zip(SET_BY[cmd], values, strict=True):
                self._change(name, float(value))
        elif cmd == Cmd.SET_INPUT_POS:
            scales = self._set[settings.VELOCITY_SCALE] or 1.0, self._set[settings.TORQUE_SCALE] or 1.0
            target = frames.unpack_target(data, scales)
            if target is not None and all(math.isfinite(value) for value in target):
                self._input = target

    def _change(self, name: str, value: float) -> None:
        """Set what a frame sets, unless an option keeps it as it is."""
        if name not in self._overrides:
            self._set[name] = value

    def _request(self, state: int, now: float) -> None:
        """Set_Axis_State: idle, and closed loop of a board without an error; nothing else is played."""
        if state == AxisState.IDLE:
            self._arming = math.inf
            self._enter(AxisState.IDLE, now)
        elif state == AxisState.CLOSED_LOOP_CONTROL and not self.active and self.state is AxisState.IDLE:
            self._arming = now + ARMING_TIME

    def _arm(self, now: float) -> None:
        self._arming = math.inf
        self.disarmed = 0
        self._setpoint, self._speed = self._position(), 0.0
        self._input = frames.Target(self._setpoint, 0.0, 0.0)
        self._enter(AxisState.CLOSED_LOOP_CONTROL, now)

    def _entered(self, before: Any, now: float, why: str) -> None:
        self._power(now, on=self.state is AxisState.CLOSED_LOOP_CONTROL, why=why)

    def _stop(self, now: float, why: str) -> None:
        self._enter(AxisState.IDLE, now, why)

    def _code_of(self, amount: int) -> int:
        return 1 << amount - 1 if 0 < amount <= 32 else DRV_FAULT

    def _fail(self, flag: int, now: float) -> None:
        """Torque off at once."""
        if not self.active & flag:
            self._journal(now, "fault", f"0x{flag:X}")
        self.active |= flag
        self._arming = math.inf
        if self.state is not AxisState.IDLE:
            self.disarmed |= flag
            self._enter(AxisState.IDLE, now, f"error 0x{flag:X}")

    def _send_cyclic(self, now: float) -> None:
        beat, estimate = 1e-3 * self._set[settings.BEAT_EVERY], 1e-3 * self._set[ENCODER_EVERY]
        if self._booted and beat > 0.0 and now >= self._next_beat:
            self._next_beat = max(self._next_beat + beat, now)
            self._emit(Cmd.HEARTBEAT, frames.pack(Cmd.HEARTBEAT, self._errors, self.state), now)
        if self._booted and estimate > 0.0 and now >= self._next_estimate:
            self._next_estimate = max(self._next_estimate + estimate, now)
            self._tell(Cmd.GET_ENCODER_ESTIMATES, now)
        self._outbox.tick(now)

    def _watch(self, now: float) -> None:
        if self.faults.active("emergency_stop", now):
            self._fail(ESTOP, now)
        if now >= self._arming:
            self._arm(now)
        armed = self.state is AxisState.CLOSED_LOOP_CONTROL
        if self.faults.active("watch_off", now):
            self._set[settings.ENABLED] = 0.0
        limit = max(self._set[settings.TIMEOUT], self.patience if armed else 0.0)
        runs = self._set[settings.ENABLED] and (armed or self._set[WATCHDOG_IDLE])
        if runs and now >= self._ready and now - self._fed >= limit:
            self._fail(WATCHDOG, now)

    def _command_motor(self, now: float, span: float) -> Doing:
        bench = self.bench
        self._watch(now)
        armed = self.state is AxisState.CLOSED_LOOP_CONTROL
        gives = armed and self._set[settings.CONTROL_MODE] == frames.POSITION_CONTROL
        doing = self._follow_or_inert(now, FOLLOW if gives else OFF)
        if doing == FOLLOW:
            self._plan(span)
            bench.command = self._scale.angle(self._setpoint - self._shift)
            if bench.torque_offset is not None:
                bench.torque_offset = self._drive.motor_direction * self._input.torque * self._drive.needs.gear
        return doing

    def _protect(self, now: float) -> None:
        if self.state is not AxisState.CLOSED_LOOP_CONTROL:
            return
        if self.faults.active("encoder_nan", now, "motor"):
            self._fail(MISSING_ESTIMATE, now)
        elif self.bench.temperature >= HOTTEST:
            self._fail(OVER_TEMPERATURE, now)
        elif abs(self._velocity()) > OVERSPEED * self._set[settings.VELOCITY_LIMIT]:
            self._fail(TOO_FAST, now)

    def _plan(self, span: float) -> None:
        """Move the setpoint on, as the input mode has it."""
        if self._set[settings.INPUT_MODE] == POS_FILTER:
            damping = 2.0 * self._set[FILTER]
            pull = 0.25 * damping**2 * (self._input.position - self._setpoint)
            self._speed += span * (pull + damping * (self._input.velocity - self._speed))
            self._setpoint += span * self._speed
        else:
            self._setpoint = self._input.position

    def _sample(self, now: float) -> None:
        """Through the encoder's noise, with the faults that are there at `now` [s]."""
        turns = self._scale.counts(self.bench.read_encoders()[1]) + self._shift
        turns = self.faults.encoder("motor", turns, abs(self._scale.step), now)
        current = self._drive.motor_direction * self._current(now)
        self._history.append(Told(math.nan if turns == NO_NUMBER else turns, self._velocity(), current))

    def _tell(self, cmd: int, now: float) -> None:
        """What the board is asked for."""
        if cmd in (Cmd.GET_ENCODER_ESTIMATES, Cmd.GET_IQ):
            self._sample(now)
        told = self._delayed(now)
        if cmd == Cmd.GET_ENCODER_ESTIMATES and told is not None:
            self._emit_cyclic(cmd, frames.pack(cmd, told.position, told.velocity), now)
        elif cmd == Cmd.GET_IQ and told is not None:
            self._emit_cyclic(cmd, frames.pack(cmd, told.current, told.current), now)
        elif cmd == Cmd.GET_TEMPERATURE:
            self._emit_cyclic(cmd, frames.pack(cmd, self.bench.temperature, math.nan), now)
        elif cmd == Cmd.GET_VERSION:
            released = dict(zip(("firmware_minor", "firmware_revision"), self._endpoints.firmware[1:], strict=True))
            firmware = (0, *(int(self._set.get(name, given)) for name, given in released.items()))
            protocol = int(self._set.get("protocol", frames.PROTOCOL))
            self._emit(cmd, frames.pack(cmd, protocol, *self._endpoints.hardware, *firmware, 0), now)
        elif cmd == Cmd.GET_ERROR:
            self._emit(cmd, frames.pack(cmd, self.active, self.disarmed), now)
        elif cmd == Cmd.GET_BUS_VOLTAGE_CURRENT:
            self._emit(cmd, frames.pack(cmd, SUPPLY, 0.1 * abs(self.bench.current)), now)
        elif cmd == Cmd.ADDRESS:
            self._emit(cmd, bytes((self._drive.node_id, *b"bowden", 0)), now)

    def _answer(self, data: bytes, now: float) -> None:
        """RxSdo: what is read is told; what is written is set and confirmed, as firmware 0.6.11 does."""
        asked = frames.unpack_sdo(data)
        if asked is None:
            return
        operation, number, value = asked
        for name, endpoint in self._endpoints.where.items():
            if endpoint.number == number and self._overrides.get(name, 0.0) is not None:
                given = endpoint.unpack(value) if operation == frames.WRITE else None
                if given is not None:
                    self._change(name, given)
                self._emit(Cmd.TX_SDO, frames.pack_sdo(number, endpoint.pack(self._set[name])), now)

    def _emit(self, cmd: int, data: bytes, now: float) -> None:
        self._outbox.emit(self._drive.node_id << 5 | cmd, data, now)

    def _emit_cyclic(self, cmd: int, data: bytes, now: float) -> None:
        self._outbox.emit_cyclic(self._drive.node_id << 5 | cmd, data, now)
        if self.faults.active("foreign_replies", now):
            other = (self._drive.node_id + 1) % 62
            self._outbox.emit_cyclic(other << 5 | cmd, data, now)
