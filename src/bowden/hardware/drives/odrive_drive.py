"""An ODrive board on classic CAN as the live loop's `Drive`: packed and parsed by hand, no thread, never waiting.

A cycle sends one order and two questions, remote frames for the position and for the current, now and then for the
temperature in its place; the next cycle reads the answers, which are as old as the cycle. What the axis does stands in
the board's heartbeat alone, whose age is its sign of life.

- Orders feed the board's watchdog: a loop that hangs is a host that is gone, and the board goes to idle with an error.
- Before the first order with power that error is cleared by itself: nobody speaks to a board between its bring-up and
  the first cycle. Afterwards an operator's word alone clears it, like any other.
- Closed loop is asked for once, and again only after a while: a board that is asked while it is in it might begin anew.
- Power off is idle, in every cycle; a board that stays in closed loop for all that is sent its emergency stop.
- A silence of its own may be a restart, after which its limits and its position are others: it is brought up again.
"""

import math

from bowden.core.signals import EMERGENCY_STOP, DriveState
from bowden.hardware.buses.link import BusPort
from bowden.hardware.buses.unix_bus import REMOTE
from bowden.hardware.drives import odrive_frames as frames
from bowden.hardware.drives.checklist import Found
from bowden.hardware.drives.driver import Driver
from bowden.hardware.drives.families.odrive import OdriveParameters, scales_of, target_of
from bowden.hardware.drives.findings import LEFT, UNWATCHED, WATCH_EVERY
from bowden.hardware.drives.odrive_endpoints import ENABLED, TIMEOUT, endpoints_of
from bowden.hardware.drives.odrive_frames import (
    ESTOP,
    UNTOLD,
    WATCHDOG,
    AxisState,
    Beat,
    Cmd,
    code_of,
    identifier_of,
    unpack,
)
from bowden.hardware.drives.odrive_setup import SAME, is_foreign, set_up, state_of
from bowden.hardware.ports import Power

TURN = (*(Cmd.GET_IQ,) * 7, Cmd.GET_TEMPERATURE)
"""What a cycle asks for beside the position, in turn."""
AGAIN = 0.1
"""Between two requests for closed loop [s]."""
REFUSED = 5
"""Requests in vain after which the board has refused."""
DISOBEYED = 6
"""Heartbeats with closed loop after it was told to be idle, after which its emergency stop is used."""
_EIGHT = bytes(8)
_IDLE = frames.pack(Cmd.SET_AXIS_STATE, AxisState.IDLE)
_CLOSED_LOOP = frames.pack(Cmd.SET_AXIS_STATE, AxisState.CLOSED_LOOP_CONTROL)


class OdriveDrive(Driver):
    """The drive of one motor; without a list of the board's endpoints there is none."""

    _drive: OdriveParameters
    turn = 1.0
    most_counts = frames.MOST_TURNS

    def _prepare(self) -> None:
        drive = self._drive
        self._endpoints, self._scales = endpoints_of(drive.endpoints), scales_of(drive)
        self._frames = drive.node_id << 5
        """Identifier of its frames, of command 0."""
        self._asks_position = self._frames | Cmd.GET_ENCODER_ESTIMATES | REMOTE
        self._asks = [self._frames | cmd | REMOTE for cmd in TURN]
        """Remote frames."""
        where = self._endpoints.where
        self._watch = {
            where[ENABLED].number: (where[ENABLED], 1.0),
            where[TIMEOUT].number: (where[TIMEOUT], drive.watchdog),
        }
        """Number → setting of the watchdog, and its value."""
        self._told = {identifier_of(drive.node_id, Cmd(cmd)): int(cmd) for cmd in frames.TOLD}
        """Identifier → command of what it tells."""

    def _find(self, port: BusPort) -> Found:
        return set_up(port, self._drive, self._endpoints)

    def _concerns(self, identifier: int) -> bool:
        return identifier >> 5 in (self._drive.node_id, frames.BROADCAST)

    def _is_foreign(self, identifier: int, data: bytes) -> bool:
        return is_foreign(self._drive.node_id, identifier, data)

    def _begin(self, found: Found | None) -> None:
        errors = 0 if found is None else found.error
        self._beat = Beat(errors, AxisState.IDLE)
        self._armed_with = 0  # errors that it had when it came to closed loop, of the time before
        self._untouched = True  # nothing with power has been ordered
        self._stopped = False  # by our own Estop
        self._asked_at, self._requests, self._disobeyed = -math.inf, 0, 0
        self._cycles = self._questions = 0
        self._asked_watch_at = -math.inf
        self._unwatched: set[int] = set()  # settings of the watchdog that are not as they were
        self._turns = self._before_turns = math.nan  # as read, as sent
        self._temperature = math.nan
        self._readings.failed(code_of(errors))  # one that was there before is no news

    def _take(self, identifier: int, data: bytes, now: float) -> bool:
        cmd, found, readings = self._told.get(identifier), self._found, self._readings
        if cmd is None or not data or found is None:
            return False
        if cmd == Cmd.HEARTBEAT and (beat := frames.unpack_beat(data)) is not None:
            readings.replied(now)
            self._disobeyed = self._disobeyed + 1 if beat.state != AxisState.IDLE and not self._asked else 0
            if beat.state == AxisState.CLOSED_LOOP_CONTROL != self._beat.state:
                self._armed_with = beat.errors
            self._beat = beat
            self._lost = self._lost or beat.state == AxisState.UNDEFINED
        elif cmd == Cmd.GET_ENCODER_ESTIMATES and (told := unpack(cmd, data)) is not None:
            self._check_turns(told[0], now)
            if not self._lost and abs(told[0]) <= 2.0 * frames.MOST_TURNS:
                self._turns = told[0]
                readings.moved(found.motor.angle(told[0]), readings.current, self._temperature, self._written)
        elif cmd == Cmd.GET_IQ and (told := unpack(cmd, data)) is not None:
            readings.current = self._drive.motor_direction * told[1] if math.isfinite(told[1]) else math.nan
        elif cmd == Cmd.GET_TEMPERATURE and (told := unpack(cmd, data)) is not None:
            self._temperature = told[0] if math.isfinite(told[0]) else math.nan
        elif cmd == Cmd.TX_SDO and (answer := frames.unpack_sdo(data)) is not None and answer[1] in self._watch:
            endpoint, wanted = self._watch[answer[1]]
            value = endpoint.unpack(answer[2])
            as_set = value is None or abs(value - wanted) <= SAME * wanted
            (self._unwatched.discard if as_set else self._unwatched.add)(endpoint.number)
        return True

    @property
    def _expired(self) -> bool:
        """Whether the board's one error is that nobody spoke to it before the first order with power."""
        return self._untouched and self._beat.errors == WATCHDOG

    def _counting_errors(self) -> int:
        """Those that count: of a board in closed loop those that came in it."""
        if self._expired:
            return 0
        if self._beat.state == AxisState.CLOSED_LOOP_CONTROL:
            return self._beat.errors & ~self._armed_with
        return self._beat.errors

    def _standing(self) -> DriveState:
        if self._found is None or self._lost:
            return DriveState.NOT_READY_TO_SWITCH_ON
        return state_of(self._beat, self._counting_errors())

    def _judge(self, now: float) -> None:
        self._check_silence(now)
        self._update_state(self._standing())
        readings, led = self._readings, self._state is DriveState.OPERATION_ENABLED
        errors = 0 if self._lost else self._counting_errors()
        pressed = errors & ESTOP and not self._stopped
        readings.failed(int(EMERGENCY_STOP) if pressed else code_of(errors))
        if self._asked and self._before is DriveState.OPERATION_ENABLED and not led and not readings.error:
            readings.found(LEFT)
        if self._asked and not led and self._requests > REFUSED:
            readings.found(UNTOLD)
        if self._unwatched and not self._lost:
            readings.found(UNWATCHED)
        self._check_inert(now)

    def _can_lead(self) -> bool:
        return self._state in (DriveState.SWITCH_ON_DISABLED, DriveState.OPERATION_ENABLED) and not self._expired

    def _lead(self, found: Found, counts: float, target: float, torque: float, now: float) -> None:
        self._untouched = False
        led = self._state is DriveState.OPERATION_ENABLED
        if not self._asked:
            self._requests, self._asked_at = 0, -math.inf
        if not led and now - self._asked_at >= AGAIN:
            self._requests, self._asked_at = self._requests + 1, now
            self._order(Cmd.SET_AXIS_STATE, _CLOSED_LOOP)
        if led:
            self._requests = 0
            sent = target_of(self._drive, found.limits, counts, self._before_turns, torque)
            self._target, self._before_turns, self._led = target, counts, self._led + 1
        else:
            sent = frames.Target(self._turns, 0.0, 0.0)
        self._order(Cmd.SET_INPUT_POS, frames.pack_target(sent, self._scales))

    def _relax(self, power: Power, now: float) -> None:
        """See `Driver._relax`; its quick stop is its emergency stop, an error until an operator's word."""
        self._requests, self._before_turns = 0, math.nan
        if self._disobeyed > DISOBEYED or (power is Power.QUICK_STOP and self._beat.state != AxisState.IDLE):
            self._disobeyed, self._stopped = 0, True
            self._order(Cmd.ESTOP, b"")
        self._order(Cmd.SET_AXIS_STATE, _IDLE)
        if self._expired or self._reset:
            self._order(Cmd.CLEAR_ERRORS, bytes(1))
            self._reset = self._stopped = False

    def _ask(self, now: float) -> None:
        self._send(self._asks_position, _EIGHT)
        if now - self._asked_watch_at >= WATCH_EVERY:
            self._questions, self._asked_watch_at = self._questions + 1, now
            self._order(Cmd.RX_SDO, frames.pack_sdo([*self._watch][self._questions % len(self._watch)]))
        else:
            self._send(self._asks[self._cycles % len(TURN)], _EIGHT)
        self._cycles += 1

    def _order(self, cmd: Cmd, data: bytes) -> None:
        self._send(self._frames | cmd, data)

    def reset_fault(self) -> None:
        """See `hardware.ports.Drive.reset_fault`; without effect where the board has no fault."""
        self._reset = self._state is DriveState.FAULT

    def _tell_off(self, number: int) -> None:
        """Idle; and where that does not help the emergency stop."""
        if number >= 2 * DISOBEYED:
            self._order(Cmd.ESTOP, b"")
        self._order(Cmd.SET_AXIS_STATE, _IDLE)

    def _torque_told(self, identifier: int, data: bytes) -> bool | None:
        if identifier != identifier_of(self._drive.node_id, Cmd.HEARTBEAT):
            return None
        beat = frames.unpack_beat(data)
        return None if beat is None else beat.state != AxisState.IDLE
