"""A CiA 402 drive over CANopen as the live loop's `Drive`: packed and parsed by hand, no thread, never waiting.

A cycle sends RPDO 1 and then the SYNC at which the drive takes it and samples TPDO 1 and 2, which the next cycle reads.
Our heartbeat goes out from within `write` alone: a loop that hangs is a host that is gone, and the drive acts on it.
"""

import math

from bowden.core.signals import EMERGENCY_STOP, DriveState
from bowden.hardware.buses.link import BusPort
from bowden.hardware.buses.place import REMOTE
from bowden.hardware.drives import canopen_frames as frames
from bowden.hardware.drives import canopen_setup as setup
from bowden.hardware.drives.checklist import Found
from bowden.hardware.drives.cia402 import WITH_TORQUE, Controlword, controlword, decode
from bowden.hardware.drives.driver import Driver
from bowden.hardware.drives.emergencies import SAFE_TORQUE_OFF
from bowden.hardware.drives.families.cia402 import DriveParameters, load_of
from bowden.hardware.drives.findings import UNWATCHED, WATCH_EVERY
from bowden.hardware.drives.scale import bounded_torque
from bowden.hardware.ports import Power, TorqueLeft

MOST_INPUTS_AGE = 10
"""Cycles for which the digital inputs may be missing; after that the emergency stop counts as pressed, by a node that
sends the rest: one that sends nothing is not there, which its age shows."""
MOST_ANGLES_AGE = 5
"""Cycles in which a node that is there has sent both angles."""

MOST_DUE = 64
"""TPDO 1 of this drive that may still come, at most, but for those of a stall that goes on or has just ended: later
ones are stale by every limit."""
SPARE, REFILL = 8.0, 0.05
"""TPDO 1 that may come beyond one for each SYNC, as after a bit error at a frame's end, whose repetition is received
twice; and how soon these are forgiven, a cycle. A second device that sends as often is found within nine cycles."""
WATCH = ((0x1016, 1), (0x6007, 0))
"""What the watch over us rests on: the heartbeat consumer, and what the drive does without one; asked for by turns."""

REPEAT = 10e-3
"""Until the drive has confirmed an order to its brake it is repeated so often [s]."""


class CanopenDrive(Driver):
    """The drive of one motor."""

    _drive: DriveParameters
    synced = True

    def _prepare(self) -> None:
        parameters = self._drive
        node, host = parameters.node_id, parameters.host_id
        self._pushed = parameters.needs.torque_offset > 0.0
        self._has_stop = parameters.emergency_stop_input >= 0
        self._tpdo1, self._tpdo2, self._tpdo3 = frames.TPDO1 + node, frames.TPDO2 + node, frames.TPDO3 + node
        self._beats, self._emergencies = frames.HEARTBEAT + node, frames.EMERGENCY + node
        self._rpdo, self._heartbeat = frames.RPDO1 + node, frames.HEARTBEAT + host
        self._answers, self._questions = frames.SDO_ANSWER + node, frames.SDO_REQUEST + node
        self._watched = WATCH if parameters.brake_output == "none" else (*WATCH, (setup.OUTPUTS, 1))
        self._watch_as_set = {
            0x1016: (setup.heartbeat_consumer(parameters),),
            0x6007: (setup.FAULT_SIGNAL, setup.DISABLE_VOLTAGE),
        }
        self._ours = frames.of_the_host(node, host)

    def _find(self, port: BusPort) -> Found:
        found = setup.set_up(port, self._drive)
        port.disturbed()
        return found

    def _restore(self) -> None:
        if self._port is not None and self._found is not None and self._found.state is not DriveState.FAULT:
            setup.restore(self._port, self._drive)

    def _concerns(self, identifier: int) -> bool:
        return identifier & 0x7F == self._drive.node_id or identifier in self._ours

    def _is_foreign(self, identifier: int, data: bytes) -> bool:
        return identifier & ~REMOTE in self._ours

    def _begin(self, found: Found | None) -> None:
        self._statusword_state, self._operational = self._state, found is not None
        self._sent = int(Controlword.DISABLE_VOLTAGE)
        self._counts = 0  # the motor's position, as it came last
        self._stop_released, self._inputs_age = True, 0
        self._heartbeat_sent = -math.inf
        self._due, self._most = SPARE, float(MOST_DUE)  # TPDO 1 that may come, and how many they may become
        self._questioned, self._questioned_at = 0, -math.inf  # about the watch
        self._unwatched: set[int] = set()  # objects that are not as they were set
        self._brake = False  # whether it is to hold; bring-up has released it
        self._brake_confirmed, self._brake_at = True, -math.inf

    def _least_current(self, found: Found) -> float:
        return abs(self._current(1, found))

    def _current(self, torque: int, found: Found) -> float:
        """Of a torque in thousandths of the rated one [A]."""
        drive = self._drive
        return drive.motor_direction * torque * 1e-3 * found.rated_torque / drive.needs.torque_constant

    def _take(self, cob_id: int, data: bytes, now: float) -> bool:
        readings, drive, found = self._readings, self._drive, self._found
        if found is None or found.joint is None:
            return False
        if cob_id == self._tpdo1 and (motion := frames.unpack_tpdo1(data)) is not None:
            self._counts = motion.position
            self._statusword_state = decode(motion.statusword)
            current = self._current(motion.torque, found)
            readings.moved(found.motor.angle(motion.position), current, readings.temperature, self._written)
            self._due -= 1.0
            if self._due < 0.0:  # not the drive's: it sends one for each SYNC
                self._due = 0.0
                readings.meant()
        elif cob_id == self._tpdo2 and (sensors := frames.unpack_tpdo2(data)) is not None:
            readings.turned(found.joint.angle(sensors.joint))
            readings.temperature = math.nan if sensors.temperature is None else 0.1 * sensors.temperature
            if drive.tension_scale != 0.0:
                readings.tension = load_of(drive, sensors.analog)
            elif drive.torque_scale != 0.0:
                readings.joint_torque = load_of(drive, sensors.analog)
        elif cob_id == self._beats and (state := frames.unpack_heartbeat(data)) is not None:
            readings.replied(now)
            self._operational = self._operational and state == frames.OPERATIONAL
        elif cob_id == self._emergencies and (code := frames.unpack_emergency(data)):
            readings.found(EMERGENCY_STOP if code == SAFE_TORQUE_OFF else code)
        elif cob_id == self._tpdo3 and (inputs := frames.unpack_tpdo3(data)) is not None and self._has_stop:
            self._stop_released, self._inputs_age = bool(inputs >> drive.emergency_stop_input & 1), 0
        elif cob_id == self._answers and frames.unpack_sdo_written(data) == setup.OUTPUTS:
            self._brake_confirmed = True
        elif cob_id == self._answers and (said := frames.unpack_sdo_value(data)) is not None:
            self._see_watch(*said)
        else:
            return False
        return True

    def _judge(self, now: float) -> None:
        readings = self._readings
        there = max(readings.motor_age, readings.joint_age) <= MOST_ANGLES_AGE
        missing = self._inputs_age > MOST_INPUTS_AGE and there
        if self._has_stop and (missing or not self._stop_released):
            readings.stopped()
        self._inputs_age += 1
        self._update_state(self._statusword_state if self._operational else DriveState.NOT_READY_TO_SWITCH_ON)
        self._check_inert(now)
        if self._unwatched and self._operational:
            readings.found(UNWATCHED)
        readings.sampled = self._written

    def _see_watch(self, index: int, value: int) -> None:
        """What the drive says of an object of its watch over us; one that has started again says it at bring-up."""
        if index == setup.OUTPUTS:
            self._brake_confirmed = self._brake_confirmed and value == setup.brake_bits(
                self._drive, engaged=self._brake
            )
        if index in self._watch_as_set and self._operational:
            (self._unwatched.discard if value in self._watch_as_set[index] else self._unwatched.add)(index)

    def write(self, target: float, power: Power, now: float, torque: float = 0.0) -> None:
        """See `hardware.ports.Drive.write`.

        Until operation is enabled the target sent is the position itself, so that enabling moves nothing. A target
        that is no number, or beyond the drive's counts, is never sent: the torque goes off. There is none before the
        drive has sent its position. A drive that has left
        operation by itself is not switched on again before `Power.OFF` has been wanted. A torque offset goes out only
        with the order to follow the target, to a drive that does, and within the rig's bound.
        """
        if not self._up or self._found is None:
            return
        fallen = self._has_fallen(power, now)
        counts = self._found.motor.counts(target)
        if math.isnan(self._readings.motor):
            power = min(power, Power.READY)
        if not -frames.INT32 <= counts <= frames.INT32 - 1:
            power, counts = Power.OFF, float(self._counts)
        wanted = Power.OFF if fallen else power
        if self._state is not DriveState.OPERATION_ENABLED:
            counts = float(self._counts)
        self._sent = controlword(self._state, wanted, self._reset and self._sent != Controlword.FAULT_RESET)
        if self._sent == Controlword.FAULT_RESET or self._state is not DriveState.FAULT:
            self._reset = False
        led = self._state is DriveState.OPERATION_ENABLED and self._sent == Controlword.ENABLE_OPERATION
        self._asked = self._sent == Controlword.ENABLE_OPERATION
        self._target, self._led = (target, self._led + 1) if led else (math.nan, 0)
        self._order(self._sent, round(counts), torque if led else 0.0)
        due = self._due + (1.0 + REFILL if self._due < SPARE else 1.0)
        age = self._readings.motor_age  # a drive that stalls answers all that was asked at once, later
        self._most = max(self._most - REFILL, MOST_DUE + age if SPARE < age < math.inf else MOST_DUE)
        self._written, self._due = now, min(due, self._most)
        if power is Power.OFF:
            self.set_brake(False)
        if not self._brake_confirmed and now - self._brake_at >= REPEAT:
            self._brake_at = now
            self._send(self._questions, brake_order(self._drive, engaged=self._brake))
        elif now - self._questioned_at >= WATCH_EVERY:  # after the SYNC, which it does not delay
            self._questioned, self._questioned_at = self._questioned + 1, now
            self._send(self._questions, frames.pack_sdo_read(*self._watched[self._questioned % len(self._watched)]))
        if now - self._heartbeat_sent >= self._drive.heartbeat_time - 0.5 * self._drive.needs.sample_time:
            self._heartbeat_sent = now
            self._send(self._heartbeat, _OPERATIONAL)

    def _order(self, control: int, counts: int, torque: float = 0.0) -> None:
        """RPDO 1 and the SYNC at which it is taken; the torque is at the spool [N·m]."""
        drive, share = self._drive, None
        if self._pushed and self._found is not None:
            most = drive.needs.gear * self._found.rated_torque
            share = round(1e3 * drive.motor_direction * bounded_torque(torque, drive) / most)
            share = max(-frames.INT16, min(frames.INT16 - 1, share))
        self._send(self._rpdo, frames.pack_rpdo1(control, counts, share))
        self._sync()

    @property
    def brake_confirmed(self) -> bool:
        """See `hardware.ports.BrakedDrive.brake_confirmed`."""
        return self._brake_confirmed

    def set_brake(self, engaged: bool) -> None:
        """See `hardware.ports.BrakedDrive.set_brake`."""
        if engaged != self._brake and self._drive.brake_output != "none":
            self._brake, self._brake_confirmed, self._brake_at = engaged, False, -math.inf

    def _tell_off(self, number: int) -> None:
        if number == 0 and self._brake:
            self._send(self._questions, brake_order(self._drive, engaged=False))
        self._order(Controlword.DISABLE_VOLTAGE, self._counts)

    def _torque_told(self, identifier: int, data: bytes) -> bool | None:
        motion = frames.unpack_tpdo1(data) if identifier == self._tpdo1 else None
        return None if motion is None else decode(motion.statusword) in WITH_TORQUE

    def _let_go(self, left: TorqueLeft) -> None:
        """It stops watching our heartbeat only once it has said that it has no torque; and it is stopped."""
        if left is TorqueLeft.OFF and self._port is not None:
            self._send(self._questions, frames.pack_sdo_write(0x1016, 1, 0, 4))
            answered = self._port.wait_for  # not by a node that NMT has stopped
            answered(lambda cob_id, _: cob_id == self._answers, self._drive.answer_timeout)
        self._send(frames.NMT, bytes((frames.NMT_STOP, self._drive.node_id)))


def brake_order(drive: DriveParameters, *, engaged: bool) -> bytes:
    """The SDO download that engages or releases the brake."""
    return frames.pack_sdo_write(setup.OUTPUTS, 1, setup.brake_bits(drive, engaged=engaged), 4)


_OPERATIONAL = bytes((frames.OPERATIONAL,))
