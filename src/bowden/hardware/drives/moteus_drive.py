"""A mjbots moteus board over CAN-FD as the live loop's `Drive`: packed and parsed by hand, no thread, never waiting.

A cycle sends one frame, a command with the questions, and the next cycle reads its reply. There is no heartbeat: the
age of the last reply stands for it. Each command has the watchdog's time in it: a loop that hangs is a host that is
gone, and the board goes into mode timeout, which it leaves by a stop alone. Stopping would clear a fault, so a board in
fault is asked and not commanded.
"""

import math

from bowden.core.signals import DriveState
from bowden.hardware.buses.link import BusPort
from bowden.hardware.buses.unix_bus import EXTENDED
from bowden.hardware.drives import moteus_frames as frames
from bowden.hardware.drives.checklist import Found
from bowden.hardware.drives.driver import SETTLED, Driver
from bowden.hardware.drives.families.moteus import MoteusParameters, command_of
from bowden.hardware.drives.findings import LEFT, UNWATCHED
from bowden.hardware.drives.limited_range import LimitedRange
from bowden.hardware.drives.moteus_frames import TIMED_OUT, BoardMode
from bowden.hardware.drives.moteus_setup import SAME_TIME, WITHOUT_TORQUE, is_answer, is_foreign, set_up, state_of
from bowden.hardware.ports import Power

_NO_FLAGS = ~EXTENDED & 0xFFFF_FFFF


class MoteusDrive(Driver):
    """The drive of one motor."""

    _drive: MoteusParameters
    most_counts = frames.MOST_TURNS

    def _prepare(self) -> None:
        drive = self._drive
        self.turn = drive.output_ratio
        self._answer = frames.identifier_of(drive.node_id, drive.host_id, drive.can_prefix)
        self._cycle = frames.CommandFrames(drive.joint_source)
        self._joint_turns = LimitedRange(1.0)
        to_board = frames.identifier_of(drive.host_id, drive.node_id, drive.can_prefix, reply=True)
        self._to_board = frames.flagged(to_board)

    def _find(self, port: BusPort) -> Found:
        return set_up(port, self._drive)

    def _concerns(self, identifier: int) -> bool:
        return is_answer(self._drive, identifier) or is_foreign(self._drive, identifier)

    def _is_foreign(self, identifier: int, data: bytes) -> bool:
        return is_foreign(self._drive, identifier)

    def _begin(self, found: Found | None) -> None:
        self._mode_state = self._state
        self._turns = math.nan  # the target of the cycle before
        self._timed_out = False
        self._joint_turns.begin()
        if found is not None and found.joint is not None:
            self._readings.failed(found.error)  # one that was there before is no news
            self._joint_turns.follow(found.joint.counts(self._drive.joint_home))

    def _take(self, identifier: int, data: bytes, now: float) -> bool:
        if identifier & _NO_FLAGS != self._answer:
            return False
        reply, found = self._cycle.reply(data), self._found
        if reply is None or found is None or found.joint is None:
            return True
        readings, drive = self._readings, self._drive
        readings.replied(now)
        self._check_turns(reply.position, now)
        readings.moved(
            found.motor.angle(reply.position) if math.isfinite(reply.position) else math.nan,
            drive.motor_direction * reply.q_current if math.isfinite(reply.q_current) else math.nan,
            math.nan if reply.temperature == frames.NO_INT8 else float(reply.temperature),
            self._written,
        )
        if reply.validity >> 2 * drive.joint_source & 1:
            readings.turned(found.joint.angle(self._joint_turns.follow(_within_a_turn(reply.joint))))
        self._timed_out = reply.mode == BoardMode.TIMEOUT
        readings.failed((reply.fault & 0xFF or LEFT) if reply.mode == BoardMode.FAULT else 0)
        if self._led >= SETTLED and not abs(reply.timeout - drive.watchdog) <= SAME_TIME:
            readings.found(UNWATCHED)
        self._mode_state = state_of(reply.mode)
        return True

    def _judge(self, now: float) -> None:
        self._check_silence(now)
        state = DriveState.NOT_READY_TO_SWITCH_ON if self._lost else self._mode_state
        self._update_state(state)
        if self._asked and self._before is DriveState.OPERATION_ENABLED is not state and state is not DriveState.FAULT:
            self._readings.found(TIMED_OUT if self._timed_out else LEFT)
        self._check_inert(now)

    def _lead(self, found: Found, counts: float, target: float, torque: float, now: float) -> None:
        """See `Driver._lead`; the target of a board that is not in position mode is none, by which it stays."""
        led = self._state is DriveState.OPERATION_ENABLED
        sent = (counts, self._turns, torque) if led else (math.nan, self._turns, 0.0)
        self._put(self._cycle.command(command_of(self._drive, found.limits, *sent)))
        self._led += 1
        self._target, self._turns = (target, counts) if led else (math.nan, math.nan)
        self._reset = False

    def _relax(self, power: Power, now: float) -> None:
        keep = self._state is DriveState.FAULT and not self._reset
        self._put(self._cycle.ask if keep else self._cycle.stop)
        self._turns, self._reset = math.nan, False

    def _tell_off(self, number: int) -> None:
        self._put(self._cycle.ask if self._state is DriveState.FAULT else self._cycle.stop)

    def _torque_told(self, identifier: int, data: bytes) -> bool | None:
        reply = self._cycle.reply(data) if is_answer(self._drive, identifier) else None
        return None if reply is None else reply.mode not in WITHOUT_TORQUE

    def _put(self, data: bytes) -> None:
        self._send(self._to_board, data)


def _within_a_turn(turns: float) -> float:
    """A reading of an encoder that measures a part of a turn; what is none, or no such part, is none."""
    return turns if -1.0 <= turns <= 1.0 else math.nan
