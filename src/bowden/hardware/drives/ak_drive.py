"""A CubeMars AK drive in MIT mode as the live loop's `Drive`: a command a cycle, a reply to each, no thread, no wait.

The drive has no heartbeat, shows neither its mode nor that a command was refused, and gives torque again with the first
command after its timeout. So here:

- without power it is ordered to leave motor mode in every cycle, and is without torque once it has replied to that;
- with power it is entered with gains of one step and its own position for a target, and counts as enabled only when its
  torque in these cycles was what such gains give: one whose position has gone round its range would pull;
- a torque that is asked for and not given, for 20 ms, is an inert motor, or one that has left its mode;
- a silence of ours as long as its timeout is taken for a torque that it let go of, and it is not switched on again;
- a fault ends when the drive reports none: nothing resets it;
- a silence of its own may be a restart, after which its position is another: it has to be brought up again.
"""

import math

from bowden.core.errors import DriveError, ParameterError
from bowden.core.signals import DriveState
from bowden.hardware.buses.link import BusPort, Links
from bowden.hardware.buses.place import EXTENDED, REMOTE
from bowden.hardware.drives import ak_frames as frames
from bowden.hardware.drives.checklist import Conversation, Found, refuse_torque
from bowden.hardware.drives.driver import Driver
from bowden.hardware.drives.families import ak_mit
from bowden.hardware.drives.families.ak_mit import UPLOAD, AkParameters, command_id, model_of, reply_id
from bowden.hardware.drives.findings import INERT, LOST_RANGE, InertWatch
from bowden.hardware.drives.on_can import place
from bowden.hardware.drives.scale import LimitedRange, bounded_torque, found_scale, motor_limits, motor_scale
from bowden.hardware.ports import Power
from bowden.rig.families import FoundDevice

LISTENING = 1.0
"""So long the bus is listened to before anything is said on it: another master gives its commands in it [s]."""
TRIAL = 8
"""Cycles with gains of one step, before a drive counts as enabled."""
LEAST_KP = frames.HIGHEST_KP / 4095.0
"""One step of kp [N·m/rad]."""
STRAIN = 0.05
"""Of the model's torque: more is a torque of which nothing was asked [–]."""
ASKED, GIVEN = 0.02, 0.1
"""Of the model's torque, from which on one counts as asked for; and of that, up to which none was given [–]."""
_LIMP = frames.AkCommand(0.0, 0.0, 0.0, 0.0, 0.0)
"""No torque, but for the half step by which a field of an even number of codes misses zero."""


_MARGIN = 0.9
"""Of the drive's own time without a word of ours: whether it has let go is not known this near to it, and then it
counts as let go. It would give torque again with the next command: it is switched off with it, and stays off."""


class AkDrive(Driver):
    """The drive of one motor."""

    _drive: AkParameters
    most_counts = frames.HIGHEST_POSITION - ak_mit.ROOM

    def _prepare(self) -> None:
        self._model, self._reply_id = model_of(self._drive), reply_id(self._drive)
        self._v3, self._command_id = self._drive.board == "v3", command_id(self._drive)
        self._told_by = self._model, self._drive.node_id, ak_mit.torque_per_ampere(self._drive)
        self._scale, self._first = motor_scale(self._drive), math.nan
        self._range = LimitedRange(2.0 * frames.HIGHEST_POSITION)
        self.turn = 2.0 * math.pi / self._model.gear
        self._inert = InertWatch(math.inf)  # what gives no torque at all is inert, moving or not

    def _find(self, port: BusPort) -> Found:
        drive = self._drive
        bus = Conversation(port, drive.node_id, self._is_others, drive.answer_timeout)
        bus.listen(LISTENING)
        first = self._replied(bus)
        if abs(first.torque) > STRAIN * self._model.torque:
            do = "end the master that holds it, or switch the drive off"
            raise refuse_torque(bus.name, f"motor mode, with {first.torque:.3g} N·m", do)
        replies = [first, *(self._replied(bus) for _ in range(4))]
        moved = max(abs(reply.position - first.position) for reply in replies)
        if any(reply.at_end for reply in replies) or moved > 0.5:
            said = ", ".join(f"{reply.position:.3f}" for reply in replies)
            raise DriveError(
                f"the position of {bus.name} is {said} rad",
                expected="a motor that stands still, within its range",
                do="bring the motor near its zero by hand; check drive.model and the drive's encoder",
            )
        last = replies[-1]
        scale = self._scale = found_scale(drive, last.position, self.turn)
        try:
            ak_mit.check_range(drive, scale, "as it counts them now")
        except ParameterError as error:
            raise DriveError(error.what, expected=error.expected, do=error.do) from error
        who = f"{drive.model}{', board V3,' if self._v3 else ''} in MIT mode at {bus.name}, with a CAN timeout of "
        who += f"{1e3 * drive.watchdog:g} ms by [drive], which no frame shows"
        who += f"; in fault, {frames.error_text(last.error)}" if last.error else ""
        self._first = last.position
        state = DriveState.FAULT if last.error else DriveState.SWITCH_ON_DISABLED
        return Found(who, scale, None, motor_limits(drive, scale), state, last.error, "")

    def _is_others(self, identifier: int, data: bytes) -> bool:
        """Whether a frame that comes before we have said anything is of another master, or an answer to one."""
        return self._is_foreign(identifier, data) or (not self._v3 and self._is_it(identifier, data))

    def _replied(self, bus: Conversation) -> frames.AkReply:
        """Tell the drive to leave motor mode, in which it should not be, and take its reply.

        Raises:
            DriveError: none, or one without an error code.
        """
        drive = self._drive
        order = self._command_id, frames.pack_command(_LIMP, self._model) if self._v3 else frames.EXIT
        for _ in range(2):
            data = bus.ask(order, lambda identifier, data: data if identifier == self._reply_id else None, 1)
            if data is None:
                continue
            reply = frames.unpack_reply(data, *self._told_by)
            if reply is None:
                raise DriveError(
                    f"{bus.name} replies with {len(data)} bytes",
                    expected="eight, with temperature and error code",
                    do="see to a later firmware: one that reports no error is not run",
                )
            if reply.number == drive.node_id:
                return reply
        if self._v3:
            raise DriveError(
                f"no board V3 tells its state as {bus.name}",
                expected=f"frames {self._reply_id & ~EXTENDED:X}h, {ak_mit.UPLOADS:g} a second",
                do="switch the drive on; check cable and bit rate; set its number and CAN feedback rate with its "
                "maker's tool, or board in [drive]",
            )
        upload = EXTENDED | UPLOAD << 8 | drive.node_id
        if bus.wait(drive.answer_timeout, lambda identifier, _: identifier == upload or None):
            raise DriveError(
                f"{bus.name} uploads its state by itself (frames {upload & ~EXTENDED:X}h): it is in servo mode, or "
                "is a board V3",
                expected="a board V1 or V2 in MIT mode",
                do='set MIT mode with its maker\'s tool; or board = "v3" in [drive]',
            )
        raise DriveError(
            f"no drive replies as {bus.name}",
            expected=f"an AK drive in MIT mode, whose replies have the identifier {self._reply_id:03X}h",
            do="switch the drive on; check cable, bit rate and termination; set MIT mode and its number with its "
            "maker's tool, and reply_id in [drive] to its CAN Master ID",
        )

    def _concerns(self, identifier: int) -> bool:
        number = self._drive.node_id
        if self._v3:
            return bool(identifier & EXTENDED) and identifier & 0xFF == number
        return identifier in (number, self._reply_id, EXTENDED | UPLOAD << 8 | number)

    def _is_it(self, identifier: int, data: bytes) -> bool:
        """Whether a frame is a reply of this drive."""
        return identifier == self._reply_id and len(data) == 8 and (self._v3 or data[0] == self._drive.node_id)

    def _is_foreign(self, identifier: int, data: bytes) -> bool:
        plain = identifier & ~REMOTE
        if self._v3:  # whatever its mode, an order to it of anybody
            return bool(plain & EXTENDED) and plain & 0xFF == self._drive.node_id and plain >> 8 & 0xFF <= 8
        cut = 0 < len(data) < 8 and data[0] == self._drive.node_id  # of a reply, since no drive obeys so few bytes
        return plain == self._drive.node_id and not self._is_it(identifier, data) and not cut

    def _begin(self, found: Found | None) -> None:
        self._entered = False
        self._until_off = self._trial = 0
        self._position = math.nan  # of the drive, over the ends of its range
        self._speed = self._torque = self._expected = 0.0
        self._stuck = math.nan, math.nan  # the reported torque, and what was expected when it was reported first
        self._range.begin()
        if found is not None:
            self._range.follow(self._first)
        self._spoke = math.nan  # when we did [s]
        self._inert.begin()

    def _take(self, identifier: int, data: bytes, now: float) -> bool:
        if not self._is_it(identifier, data):
            return False
        reply = frames.unpack_reply(data, *self._told_by)
        if reply is not None:
            self._take_reply(reply, now)
        return True

    def _take_reply(self, reply: frames.AkReply, now: float) -> None:
        """A reply of the drive."""
        drive, readings = self._drive, self._readings
        if not self._v3:
            self._answered()
        self._until_off = max(0, self._until_off - 1)
        readings.replied_at = now
        if self._lost:
            return  # whatever it says: its position may be another
        readings.failed(reply.error)
        self._torque, self._speed = reply.torque, reply.velocity
        if reply.at_end:  # neither this end nor the other
            if self._entered:
                readings.found(LOST_RANGE)
            return
        self._position = self._range.follow(reply.position)
        self._check_turns(self._position, now)
        if self._lost:
            return
        current = drive.motor_direction * reply.torque / (drive.needs.gear * drive.needs.torque_constant)
        temperature = float((reply.temperature + 128) % 256 - 128 if drive.temperature_zero == 0 else reply.temperature)
        sampled = now if math.isnan(self._written) else self._written
        readings.moved(self._scale.angle(self._position), current, temperature - drive.temperature_zero, sampled)
        if self._entered:
            self._try(now)

    def _try(self, now: float) -> None:
        """Whether the torque is what was asked for: none in the trial, and some after it."""
        if self._trial > 0:
            self._trial -= 1
            if abs(self._torque) > STRAIN * self._model.torque:
                self._readings.found(LOST_RANGE)
                self._fell = True
            return
        # at its largest current a drive tells the same torque, and gives what it can
        least, most = ASKED * self._model.torque, min(self._model.torque, ak_mit.largest_torque(self._drive))
        expected = max(-most, min(most, self._expected))
        if self._torque != self._stuck[0]:
            self._stuck = (self._torque, expected)
        in_vain = abs(expected) >= least and abs(self._torque) <= GIVEN * abs(expected)
        in_vain = in_vain or abs(expected - self._stuck[1]) >= least  # reported, and always the same
        if self._inert.inert(self._position, now, in_vain=in_vain):
            self._readings.found(INERT)
            self._fell = True

    def _standing(self) -> DriveState:
        """Where the drive is, of what was sent and answered."""
        if not self._up:
            return DriveState.NOT_READY_TO_SWITCH_ON
        if self._lost and self._until_off == 0 and not self._entered:
            return DriveState.NOT_READY_TO_SWITCH_ON
        if self._entered:
            if self._readings.error:
                return DriveState.FAULT_REACTION_ACTIVE
            return DriveState.SWITCHED_ON if self._trial > 0 else DriveState.OPERATION_ENABLED
        if self._until_off > 0:  # it has not said so yet: then it is not so
            return self._state
        return DriveState.FAULT if self._readings.error else DriveState.SWITCH_ON_DISABLED

    def _has_fallen(self, power: Power, now: float) -> bool:
        silent, self._spoke = now - self._spoke >= _MARGIN * self._drive.watchdog, now
        self._fell = super()._has_fallen(power, now) or (silent and self._entered and power is not Power.OFF)
        return self._fell

    def _can_lead(self) -> bool:
        return not self._readings.error

    def _lead(self, found: Found, counts: float, target: float, torque: float, now: float) -> None:
        if not self._entered:
            self._entered, self._trial = True, TRIAL
            self._inert.begin()
            self._order(frames.ENTER)
        elif self._trial == 0 and self._state is DriveState.OPERATION_ENABLED:
            drive = self._drive
            pushed = drive.motor_direction * bounded_torque(torque, drive)
            self._follow(counts, drive.stiffness, drive.damping, pushed)
            return
        self._follow(self._position, LEAST_KP, 0.0, 0.0)

    def _relax(self, power: Power, now: float) -> None:
        """Once without gains, so that none are left for the next time; and out of motor mode, in every cycle.

        It has no quick stop: that is power off.
        """
        if self._entered:
            self._order(frames.pack_command(_LIMP, self._model))
            self._until_off = 2 if self._v3 else self._unanswered + 1
        self._entered, self._expected = False, 0.0
        self._order(frames.EXIT)

    def _follow(self, position: float, stiffness: float, damping: float, torque: float) -> None:
        """A command; what the drive should make of it is kept."""
        held = max(ak_mit.ROOM - frames.HIGHEST_POSITION, min(frames.HIGHEST_POSITION - ak_mit.ROOM, position))
        self._expected = stiffness * (held - self._position) - damping * self._speed + torque
        self._order(frames.pack_command(frames.AkCommand(held, 0.0, stiffness, damping, torque), self._model))

    def _tell_off(self, number: int) -> None:
        """The order to leave motor mode; before the first one, once, no gains."""
        if number == 0:
            self._order(frames.pack_command(_LIMP, self._model))
        self._order(frames.EXIT)

    def _torque_told(self, identifier: int, data: bytes) -> bool | None:
        reply = frames.unpack_reply(data, *self._told_by) if self._is_it(identifier, data) else None
        return None if reply is None else abs(reply.torque) > STRAIN * self._model.torque

    def _order(self, data: bytes) -> None:
        """A command; of a V3, which has no other order, those that are one go out as a command without gains."""
        if self._v3 and data in (frames.ENTER, frames.EXIT):
            if data == frames.ENTER:
                return
            data = frames.pack_command(_LIMP, self._model)
        if not self._v3:
            self._ordered()
        self._send(self._command_id, data)


HIGHEST = 0x7F
"""Numbers that are tried; on a bus with CANopen they are nobody's."""
BETWEEN = 2e-3
"""From one to the next [s]."""


def probe(drive: AkParameters, links: Links) -> list[FoundDevice]:
    """Which drives there are: each number is told to leave motor mode, without torque, and who replies is there.

    Such a drive says nothing of itself before it is told something, so that there is no question without an order; this
    is the one with which nothing can move. It is not given where somebody uses these identifiers already: an AK drive
    under another master, or devices of another protocol. Boards V3 tell their state by themselves: nothing is said.

    Args:
        drive: with the bus; its model's ranges are taken for all, and its `reply_id` where it has one.
        links: the buses of this process.

    Raises:
        DriveError: the bus cannot be used, or somebody uses these identifiers.
    """
    model, v3, found = model_of(drive), drive.board == "v3", dict[int, frames.AkReply]()

    def looked_at(identifier: int, data: bytes) -> None:
        number = identifier & 0xFF
        reply = frames.unpack_reply(data, model, number, ak_mit.torque_per_ampere(drive))
        if reply is None or data == frames.EXIT:
            return
        told = (EXTENDED | UPLOAD << 8 | number,) if v3 else (reply.number, reply_id(drive))
        if identifier in told and (v3 or 0 < reply.number <= HIGHEST):
            found[reply.number] = reply

    with links.join(place(drive), f"node {drive.node_id}", lambda _: True) as port:
        bus = Conversation(port, drive.node_id, lambda identifier, _: not v3 and 0 < identifier <= HIGHEST)
        bus.wait(LISTENING, looked_at)
        if bus.foreign is not None:
            raise DriveError(
                f"somebody uses the identifiers of AK drives already (a frame {bus.foreign:03X}h)",
                expected="a bus on which nobody commands them",
                do="end the other program first, or give devices of another protocol a bus of their own",
            )
        for number in () if v3 else range(1, HIGHEST + 1):
            port.send_now(number, frames.EXIT)
            bus.wait(BETWEEN, looked_at)
        bus.wait(0.0 if v3 else drive.answer_timeout, looked_at)
    return [
        FoundDevice(
            number,
            "AK drive in MIT mode",
            f"at {one.position:.3f} rad of its range, {frames.error_text(one.error) if one.error else 'no error'}",
            "FAULT" if one.error else "SWITCH_ON_DISABLED",
        )
        for number, one in sorted(found.items())
    ]
