"""What the drivers of all families share: their end of the bus, bring-up, a cycle, the drive's state, and closing.

A driver packs and parses by hand, has no thread and never waits while a loop runs. What an angle, a state and an order
are on the wire is its family's. The bus is joined at the first bring-up, and left when one fails.
"""

import math
from abc import ABC, abstractmethod
from typing import Any, ClassVar

from bowden.core.signals import DriveReading, DriveState
from bowden.hardware.buses.link import BusPort, Links
from bowden.hardware.buses.opening import Frame
from bowden.hardware.buses.place import ERROR, REMOTE
from bowden.hardware.drives import canopen_frames as canopen
from bowden.hardware.drives.checklist import Found
from bowden.hardware.drives.findings import INERT, LOST_TURNS, LagWatch
from bowden.hardware.drives.joint_encoder import JointEncoder, has_encoder
from bowden.hardware.drives.on_can import place, require
from bowden.hardware.ports import Power, TorqueLeft


class Readings:
    """What has come, as a `DriveReading` in each cycle. Order in a cycle: `cycle`, what has arrived, `reading`."""

    def __init__(self) -> None:
        self.begin()

    def begin(self) -> None:
        """Nothing has come yet."""
        self.motor = self.joint = self.current = self.tension = self.temperature = self.joint_torque = math.nan
        self.motor_age = self.joint_age = math.inf
        self.error = 0
        """Last error that the drive reported; 0 for none."""
        self.emergency = self.foreign = 0.0
        """What is wrong in this cycle; frames in it that nobody but this host may send."""
        self.replied_at = self.sampled = math.nan
        """When the last reply came, whatever it said, the sign of life; when the last sample was taken [s]."""

    def cycle(self, now: float) -> None:
        """A cycle begins at `now` [s]: everything is one older."""
        self.motor_age += 1.0
        self.joint_age += 1.0
        self.emergency = self.foreign = 0.0
        if math.isnan(self.replied_at):
            self.replied_at = now  # of the first cycle: from here on it can be late

    def moved(self, motor: float, current: float, temperature: float, sampled: float) -> None:
        """The motor's angle [rad], current [A] and temperature [°C] came, taken at `sampled` [s]; NaN for none."""
        self.motor, self.motor_age = motor, 0.0
        self.current, self.temperature, self.sampled = current, temperature, sampled

    def turned(self, joint: float) -> None:
        """The joint's angle came [rad]."""
        self.joint, self.joint_age = joint, 0.0

    def failed(self, code: int) -> None:
        """The drive reports this error, 0 for none: an emergency when it changes."""
        if code and code != self.error:
            self.found(code)
        self.error = code

    def found(self, code: float) -> None:
        """Something is wrong in this cycle; of several the first is the cause."""
        self.emergency = self.emergency or float(code)

    def reading(self, now: float, state: DriveState, bus_errors: float) -> DriveReading:
        """The reading of this cycle at `now` [s]."""
        return DriveReading(
            self.motor, self.joint, self.current, self.tension, self.temperature, self.motor_age, self.joint_age,
            now - self.replied_at if math.isfinite(self.replied_at) else math.inf,
            float(state), self.emergency, float(bus_errors), self.foreign,
            0.0 if math.isnan(self.sampled) else now - self.sampled, self.joint_torque,
        )  # fmt: skip


LOST = 0.1
"""Silence of a drive after which it may have started again, with other limits and another position [s]."""
SETTLED = 10
"""Orders to follow the target, in a row, after which a drive is expected to do it, and every answer is to one."""
MOST_UNANSWERED = 16
"""Orders whose answers are waited for at most, but for those of a stall that goes on or has just ended: a drive, or a
computer that plays one, answers them all at once then. What is older than these is lost."""
CLOSING_CYCLES = 20
"""How often the power is told to go off at the end, `CLOSING_WAIT` apart, while the drive has not said that it is."""
CLOSING_WAIT = 2e-3
"""[s]"""


class Driver(ABC):
    """The driver of one motor; see `hardware.ports.Drive`.

    Args:
        parameters: of the family: the drive, the joint's encoder and the bus.
        links: the buses of this process; of its own where none are given.

    Raises:
        ParameterError: parameters that make no sense.
    """

    synced: ClassVar[bool] = False
    """True if the drive itself waits for a SYNC in each cycle."""
    turn: float = math.inf
    """Of the motor, in the drive's unit; infinite of a drive that cannot lose count of turns."""
    most_counts: float = math.inf
    """Either way, in the drive's unit: a target beyond is never sent."""

    def __init__(self, parameters: Any, links: Links | None = None) -> None:
        require(parameters)
        drive = self._drive = parameters
        self._encoder = JointEncoder(drive) if has_encoder(drive) else None
        self._syncs_encoder = self._encoder is not None and self._encoder.synced
        self._place, self._node, self._links = place(drive), f"node {drive.node_id}", links or Links()
        self._port: BusPort | None = None
        self._errors = 0
        self._readings, self._up = Readings(), False
        self._found: Found | None = None
        self.serial = ""
        """See `hardware.ports.serial_of`."""
        self._prepare()
        self._start(None)

    @abstractmethod
    def _prepare(self) -> None:
        """What does not change while it is on."""

    @abstractmethod
    def _concerns(self, identifier: int) -> bool:
        """True if a frame is of this drive, or one that only its host may send."""

    @abstractmethod
    def _find(self, port: BusPort) -> Found:
        """Find, check and configure the drive."""

    @abstractmethod
    def _begin(self, found: Found | None) -> None:
        """Nothing has been read or sent yet, of a drive as bring-up found it; None of one that is still to be found."""

    @abstractmethod
    def _take(self, identifier: int, data: bytes, now: float) -> bool:
        """Take in what the drive says; whether the frame was one of it."""

    @abstractmethod
    def _is_foreign(self, identifier: int, data: bytes) -> bool:
        """True if a frame is one that nobody but this host may send."""

    @abstractmethod
    def _standing(self) -> DriveState:
        """Where the drive is in this cycle."""

    def _judge(self, now: float) -> None:
        """What it does not say itself, of the state that it is in now, and was in the cycle before."""
        return

    @abstractmethod
    def _lead(self, found: Found, counts: float, target: float, torque: float, now: float) -> None:
        """The order with power: to the mode in which the drive follows, and there to the target.

        Until it is in that mode it is sent to where it is, so that enabling moves nothing. A torque offset goes out
        only with the order to follow the target, to a drive that does, and within the rig's bound.

        Args:
            found: at bring-up.
            counts: the target, in the drive's unit.
            target: [rad]
            torque: offset at the spool [N·m].
            now: [s]
        """

    @abstractmethod
    def _relax(self, power: Power, now: float) -> None:
        """The order without: torque off, or `Power.QUICK_STOP` of a drive that has one."""

    def _ask(self, now: float) -> None:
        """What the drive is asked for after the order; of most families it is asked with it."""
        return

    @abstractmethod
    def _tell_off(self, number: int) -> None:
        """Order the torque off; so often has it been ordered before."""

    @abstractmethod
    def _torque_told(self, identifier: int, data: bytes) -> bool | None:
        """What a frame says of the torque; None of one that says nothing of it."""

    def bring_up(self) -> str:
        """See `hardware.ports.Drive.bring_up`; may be called again after a failure or a restart of the drive."""
        self._up, self._found = False, None
        if self._port is None:
            self._port = self._links.join(
                self._place, self._node, self._wants, synced=self.synced or self._syncs_encoder, restore=self._restore
            )
        else:
            self._port.take_all()  # and forget it
        try:
            found = self._found = self._find(self._port)
            self.serial = found.serial
            self._start(found)
            said = found.identity
            if self._encoder is not None:
                said += f"; joint: {self._encoder.bring_up(self._port)}"
        except BaseException:
            self._leave()
            raise
        self._up = True
        return said

    def _wants(self, identifier: int) -> bool:
        plain = identifier & ~REMOTE
        ours = self._concerns(plain) or (self._encoder is not None and self._encoder.wants(plain))
        return ours or bool(identifier & ERROR)

    def _restore(self) -> None:
        """Be as it was brought up, after another drive on this bus was; see `BusPort.disturbed`."""
        return

    def _start(self, found: Found | None) -> None:
        """Nothing has been read or sent yet, and the drive is as bring-up found it, or is still to be found."""
        self._state = self._before = DriveState.NOT_READY_TO_SWITCH_ON if found is None else found.state
        self._asked = False  # whether the cycle before asked for operation
        self._fell = False  # it has left operation by itself: it is not switched on again before power off is wanted
        self._lost = False  # it may have started again
        self._reset = False  # an operator's word for the fault
        self._led = 0  # orders to follow the target, in a row
        self._unanswered, self._most_unanswered = 0, float(MOST_UNANSWERED)
        self._target = self._written = math.nan  # of the cycle before [rad], [s]
        self._counted = math.nan, math.nan  # its position when it came last, and when that was [s]
        needs, least = self._drive.needs, 0.0 if found is None else self._least_current(found)
        self._lag = LagWatch(needs.current_limit, needs.lag_current, needs.lag_time, least)
        self._readings.begin()
        self._begin(found)

    def _least_current(self, found: Found) -> float:
        """One step of the current as the drive tells it [A]."""
        return 0.0

    def read(self, now: float) -> DriveReading:
        """See `hardware.ports.Drive.read`."""
        readings = self._readings
        readings.cycle(now)
        for identifier, data in self._take_all() if self._up else ():
            if self._take(identifier, data, now):
                continue
            if self._is_foreign(identifier, data):
                readings.foreign += 1.0
            elif self._encoder is not None:
                self._read_joint(self._encoder, identifier, data, now)
        self._check_silence(now)
        self._before, self._state = self._state, self._standing()
        self._judge(now)
        self._check_inert(now)
        return readings.reading(now, self._state, self.errors)

    def _read_joint(self, encoder: JointEncoder, identifier: int, data: bytes, now: float) -> None:
        """A frame that is not the drive's."""
        angle = encoder.take(identifier, data, now)
        if angle is not None:
            self._readings.turned(angle)
        elif encoder.foreign(identifier & ~REMOTE):
            self._readings.foreign += 1.0

    def _take_all(self) -> list[Frame]:
        """The frames that are there, with the flags of `buses.place`, and no more than a cycle may read; error
        frames are counted and left out.
        """
        found = [] if self._port is None else self._port.take_all()
        for frame in found:
            if frame[0] & ERROR:
                self._errors += sum(bool(one[0] & ERROR) for one in found)
                return [one for one in found if not one[0] & ERROR]
        return found

    @property
    def errors(self) -> float:
        """Error frames, and frames that could not be sent or read."""
        return float(self._errors + (self._port.errors if self._port else 0))

    def _check_turns(self, position: float, now: float) -> None:
        """One that has lost count of its motor's turns is another than was brought up.

        What it reports is what it controls: it pulls at once, as far as it is wrong. So what one reading of an encoder
        might be forgiven is not here: a change of half a turn that the motor is too slow for, where the rig says how
        fast that may be.
        """
        (last, at), self._counted = self._counted, (position, now)
        fastest = math.inf if self._found is None else self._found.limits.speed
        if abs(position - last) > max(0.5 * self.turn, 1.5 * fastest * (now - at)):
            self._lost = True
            self._readings.found(LOST_TURNS)

    def _check_silence(self, now: float) -> None:
        """One that has been silent for `LOST` may have started again: its position may be another."""
        self._lost = self._lost or now - self._readings.replied_at > LOST
        if self._lost:
            self._readings.motor = math.nan

    def _ordered(self) -> None:
        """An order has gone out that the drive answers; see `_answered`."""
        age = self._readings.motor_age
        most = MOST_UNANSWERED + (age if math.isfinite(age) else 0.0)
        self._most_unanswered = max(self._most_unanswered - 1.0, most)
        self._unanswered = min(int(self._most_unanswered), self._unanswered + 1)

    def _answered(self) -> None:
        """The drive has answered an order: somebody else's where none of ours is open."""
        self._readings.foreign += float(self._unanswered == 0)
        self._unanswered = max(0, self._unanswered - 1)

    def _has_fallen(self, power: Power, now: float) -> bool:
        """True if the drive has left operation by itself and must not be switched on again as if nothing was.

        A drive whose master was silent for a moment may be without torque when the master is back; switching it on
        again would be a restart that nobody ordered. It is forgotten when the master itself has wanted the power off.
        """
        enabled = DriveState.OPERATION_ENABLED
        left = self._asked and self._before is enabled and self._state is not enabled
        self._fell = power is not Power.OFF and (self._fell or left)
        return self._fell

    def _check_inert(self, now: float) -> None:
        """Whether the motor does not follow a target that it is to follow."""
        readings, led = self._readings, self._state is DriveState.OPERATION_ENABLED and self._led >= SETTLED
        fresh = readings.motor_age == 0.0
        if self._lag.inert(readings.motor, self._target, readings.current, now, led=led, fresh=fresh):
            readings.found(INERT)

    def write(self, target: float, power: Power, now: float, torque: float = 0.0) -> None:
        """See `hardware.ports.Drive.write`.

        A target that is no number, or beyond what the drive counts, is never sent: the torque goes off. There is none
        before the drive has sent its position. A drive that has left operation by itself, as when its watchdog has run
        out, is not switched on again before `Power.OFF` has been wanted.
        """
        found = self._found
        if found is None or not self._up:
            return
        fallen = self._has_fallen(power, now)
        counts = found.motor.counts(target) if math.isfinite(target) else math.nan
        fine = abs(counts) <= self.most_counts and math.isfinite(self._readings.motor) and not self._lost
        if power is Power.ON and fine and not fallen and self._can_lead():
            self._lead(found, counts, target, torque, now)
            self._asked = True
        else:
            self._relax(power, now)
            self._asked, self._led, self._target = False, 0, math.nan
        self._ask(now)
        self._written = now
        if self._syncs_encoder:
            self._sync()

    def _can_lead(self) -> bool:
        """True if the drive's own state lets it be ordered to follow."""
        return self._state is not DriveState.FAULT

    def _send(self, identifier: int, data: bytes) -> None:
        """Send a frame, see `buses.opening.putter`; what cannot be sent is counted."""
        if self._port is not None:
            self._port.send(identifier, data)

    def _sync(self) -> None:
        """Send CANopen's SYNC, see `BusPort.sync`."""
        if self._port is not None:
            self._port.sync(canopen.SYNC)

    def reset_fault(self) -> None:
        """See `hardware.ports.Drive.reset_fault`; without effect where the drive has no fault."""
        self._reset = True

    def close(self) -> TorqueLeft:
        """See `hardware.ports.Drive.close`; what the drive says after the second order is its word."""
        left = TorqueLeft.OFF
        if self._up and self._port is not None:
            left = self._power_off(self._port)
            self._let_go(left)
            if self._encoder is not None:
                self._send(canopen.NMT, bytes((canopen.NMT_STOP, self._encoder.node_id)))
        self._up = False
        self._leave()
        return left

    def _power_off(self, port: BusPort) -> TorqueLeft:
        """Tell the drive to take its torque off until it says that it has none, and what it said.

        What it says of the time before the second order does not count.
        """
        port.synced, left = False, TorqueLeft.UNKNOWN
        port.take_all()  # and forget it
        for k in range(CLOSING_CYCLES):
            self._tell_off(k)
            frame = port.wait_for(
                lambda identifier, data: self._torque_told(identifier, data) is not None, CLOSING_WAIT
            )
            if frame is not None and k > 0:
                left = TorqueLeft.ON if self._torque_told(*frame) else TorqueLeft.OFF
            if left is TorqueLeft.OFF:
                break
        return left

    def _let_go(self, left: TorqueLeft) -> None:
        """The last word to the drive, given what it has said; of most families there is none."""
        return

    def _leave(self) -> None:
        """Let go of the bus; safe to call twice."""
        if self._port is not None:
            self._errors += self._port.errors
            self._port.leave()
        self._port = None
