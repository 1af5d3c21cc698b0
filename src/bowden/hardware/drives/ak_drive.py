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
from bowden.core.signals import DriveReading, DriveState
from bowden.hardware.buses.link import BusPort, Links
from bowden.hardware.buses.unix_bus import REMOTE
from bowden.hardware.drives.ak_frames import (
    ENTER,
    EXIT,
    HIGHEST_KP,
    HIGHEST_POSITION,
    AkCommand,
    AkReply,
    error_text,
    pack_command,
    unpack_reply,
)
from bowden.hardware.drives.ak_parameters import (
    ROOM,
    AkParameters,
    check_parameters,
    check_range,
    fastest,
    largest_torque,
    model_of,
    motor_scale,
    reply_id,
)
from bowden.hardware.drives.checklist import refuse_torque
from bowden.hardware.drives.driver import LOST, Driver
from bowden.hardware.drives.findings import INERT, LOST_RANGE, LOST_TURNS, InertWatch
from bowden.hardware.drives.joint_encoder import joint_encoder_of
from bowden.hardware.drives.limited_range import LimitedRange, TurnCount, nearest
from bowden.hardware.drives.on_can import place
from bowden.hardware.ports import Power

MOST_UNANSWERED = 16
"""Commands that are waited for at most; what is older than these is lost."""
LISTENING = 1.0
"""So long the bus is listened to before anything is said on it: another master gives its commands in it [s]."""
TRIAL = 8
"""Cycles with gains of one step, before a drive counts as enabled."""
LEAST_KP = HIGHEST_KP / 4095.0
"""One step of kp [N·m/rad]."""
STRAIN = 0.05
"""Of the model's torque: more is a torque of which nothing was asked [–]."""
ASKED, GIVEN = 0.02, 0.1
"""Of the model's torque, from which on one counts as asked for; and of that, up to which none was given [–]."""
_LIMP = AkCommand(0.0, 0.0, 0.0, 0.0, 0.0)
"""No torque, but for the half step by which a field of an even number of codes misses zero."""


class Silence:
    """Our own: a drive that gives torque again with the next command must be switched off after it, and stays off.

    Args:
        watch: time without a word of ours after which the drive has taken its torque off [s].
    """

    def __init__(self, watch: float) -> None:
        self._watch, self._last = watch, -1.0

    def begin(self) -> None:
        """Nothing has been said yet."""
        self._last = -1.0

    def broken(self, now: float) -> bool:
        """Whether we were silent until `now` [s] for so long that the drive has, or may have, let go; we speak now."""
        last, self._last = self._last, now
        return last >= 0.0 and now - last >= _MARGIN * self._watch


_MARGIN = 0.9
"""Of the drive's own time: whether it has let go is not known this near to it, and then it counts as let go."""


class AkDrive(Driver):
    """The drive of one motor.

    Args:
        parameters: of the drive, the joint's encoder and the bus.
        links: the buses of this process; of its own where none are given.

    Raises:
        ParameterError: parameters that make no sense.
    """

    def __init__(self, parameters: AkParameters, links: Links | None = None) -> None:
        check_parameters(parameters)
        self._drive = parameters
        self._model, self._reply_id = model_of(parameters), reply_id(parameters)
        super().__init__(parameters, place(parameters), links, joint_encoder_of(parameters))
        self._scale = motor_scale(parameters)
        self._range = LimitedRange(2.0 * HIGHEST_POSITION)
        self._turns = TurnCount(2.0 * math.pi / self._model.gear, fastest(parameters, self._scale))
        self._silence = Silence(parameters.watchdog)
        self._inert = InertWatch(math.inf)  # what gives no torque at all is inert, moving or not
        self._begin(DriveState.NOT_READY_TO_SWITCH_ON)

    def _find(self, port: BusPort) -> str:
        drive = self._drive
        port.listen(
            LISTENING, lambda identifier, data: self._commands(identifier, data) or self._is_it(identifier, data)
        )
        first = self._ask(port)
        if abs(first.torque) > STRAIN * self._model.torque:
            do = "end the master that holds it, or switch the drive off"
            raise refuse_torque(f"node {drive.node_id}", f"motor mode, with {first.torque:.3g} N·m", do)
        replies = [first, *(self._ask(port) for _ in range(4))]
        moved = max(abs(reply.position - first.position) for reply in replies)
        if any(reply.at_end for reply in replies) or moved > 0.5:
            said = ", ".join(f"{reply.position:.3f}" for reply in replies)
            raise DriveError(
                f"the position of node {drive.node_id} is {said} rad",
                expected="a motor that stands still, within its range",
                do="bring the motor near its zero by hand; check drive.model and the drive's encoder",
            )
        last = replies[-1]
        home = 0.0
        if drive.home == "here":
            home = last.position
        elif drive.home == "hint":
            turn = 2.0 * math.pi / self._model.gear
            wanted = motor_scale(drive).counts(drive.motor_hint)
            home = last.position - nearest(last.position, turn, wanted)
        self._scale = motor_scale(drive, home)
        try:
            check_range(drive, self._scale, "as it counts them now")
        except ParameterError as error:
            raise DriveError(error.what, expected=error.expected, do=error.do) from error
        said = (
            f"{drive.model} in MIT mode at node {drive.node_id}, with a CAN timeout of {1e3 * drive.watchdog:g} ms by "
        )
        said += "[drive], which no frame shows"
        if last.error:
            said += f"; in fault, {error_text(last.error)}"
        self._begin(DriveState.FAULT if last.error else DriveState.SWITCH_ON_DISABLED)
        self._range.follow(last.position)
        return said

    def _ask(self, port: BusPort) -> AkReply:
        """Tell the drive to leave motor mode, in which it should not be, and take its reply.

        Raises:
            DriveError: none, or one without an error code.
        """
        drive = self._drive
        for _ in range(2):
            self._send(EXIT)
            frame = port.wait_for(lambda identifier, data: identifier == self._reply_id, drive.answer_timeout)
            if frame is None:
                continue
            reply = unpack_reply(frame[1], self._model)
            if reply is None:
                raise DriveError(
                    f"node {drive.node_id} replies with {len(frame[1])} bytes",
                    expected="eight, with temperature and error code",
                    do="see to a later firmware: one that reports no error is not run",
                )
            if reply.number == drive.node_id:
                return reply
        raise DriveError(
            f"no drive replies as node {drive.node_id}",
            expected=f"an AK drive in MIT mode, whose replies have the identifier {self._reply_id:03X}h",
            do="switch the drive on; check cable, bit rate and termination; set MIT mode and its number with its "
            "maker's tool, and reply_id in [drive] to its CAN Master ID",
        )

    def _concerns(self, identifier: int) -> bool:
        return identifier in (self._drive.node_id, self._reply_id)

    def _is_it(self, identifier: int, data: bytes) -> bool:
        """Whether a frame is a reply of this drive."""
        return identifier == self._reply_id and len(data) == 8 and data[0] == self._drive.node_id

    def _commands(self, identifier: int, data: bytes) -> bool:
        """Whether a frame is one that only this host may send."""
        plain = identifier & ~REMOTE
        cut = 0 < len(data) < 8 and data[0] == self._drive.node_id  # of a reply, since no drive obeys so few bytes
        return plain == self._drive.node_id and not self._is_it(identifier, data) and not cut

    def _begin(self, state: DriveState) -> None:
        """Nothing has been read or sent yet, and the drive is in that state."""
        self._reset_to(state)
        self._entered = False
        self._unanswered = self._until_off = self._trial = 0
        self._position = math.nan  # of the drive, over the ends of its range
        self._speed = self._torque = self._expected = 0.0
        self._stuck = (
            math.nan,
            math.nan,
        )  # the torque that the drive reports, and what was expected when it reported it first
        self._replied_at = math.nan
        self._range.begin()
        self._turns.begin()
        self._silence.begin()
        self._inert.begin()

    def read(self, now: float) -> DriveReading:
        """See `hardware.ports.Drive.read`."""
        readings = self._readings
        readings.cycle(now)
        for identifier, data in self._host.take_all() if self._up else ():
            if self._is_it(identifier, data):
                reply = unpack_reply(data, self._model)
                if reply is not None:
                    self._take(reply, now)
            elif self._commands(identifier, data):
                readings.meant()
            else:
                self._read_joint(identifier, data, now)
        self._lost = self._lost or now - self._replied_at > LOST
        if self._lost:
            readings.motor = math.nan
        self._update_state(self._standing())
        return readings.reading(now, self._state, self._host.errors)

    def _take(self, reply: AkReply, now: float) -> None:
        """A reply of the drive."""
        drive, readings = self._drive, self._readings
        if self._unanswered == 0:
            readings.meant()  # it answers somebody else
        self._unanswered = max(0, self._unanswered - 1)
        self._until_off = max(0, self._until_off - 1)
        self._replied_at = now
        readings.replied(now)
        if self._lost:
            return  # whatever it says: its position may be another
        readings.failed(reply.error)
        self._torque, self._speed = reply.torque, reply.velocity
        if reply.at_end:  # neither this end nor the other
            if self._entered:
                readings.found(LOST_RANGE)
            return
        self._position = self._range.follow(reply.position)
        if self._turns.lost(self._position, now):
            self._lost = True
            readings.found(LOST_TURNS)
            return
        current = drive.motor_direction * reply.torque / (drive.gear * drive.torque_constant)
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
        least, most = ASKED * self._model.torque, min(self._model.torque, largest_torque(self._drive))
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

    def write(self, target: float, power: Power, now: float, torque: float = 0.0) -> None:
        """See `hardware.ports.Drive.write`.

        It has no quick stop: that is power off. A target that is no number, or beyond the drive's range, is never sent:
        the torque goes off. There is none before the drive has sent its position.
        """
        if not self._up:
            return
        broken = self._silence.broken(now)
        self._fell = self._has_fallen(power) or (broken and self._entered and power is not Power.OFF)
        position = self._scale.counts(target)
        fine = abs(position) <= HIGHEST_POSITION - ROOM and not (math.isnan(self._position) or self._lost)
        on = power is Power.ON and fine and not self._fell and not self._readings.error
        self._asked = on
        if not on:
            self._leave_motor_mode()
        elif not self._entered:
            self._entered, self._trial = True, TRIAL
            self._inert.begin()
            self._send(ENTER)
            self._follow(self._position, LEAST_KP, 0.0, 0.0)
        elif self._trial > 0 or self._state is not DriveState.OPERATION_ENABLED:
            self._follow(self._position, LEAST_KP, 0.0, 0.0)
        else:
            drive, most = self._drive, self._drive.torque_offset
            pushed = max(-most, min(most, torque)) if math.isfinite(torque) else 0.0
            self._follow(position, drive.stiffness, drive.damping, drive.motor_direction * pushed)
        self._written = now
        self._sync_encoder()

    def _follow(self, position: float, stiffness: float, damping: float, torque: float) -> None:
        """A command; what the drive should make of it is kept."""
        held = max(ROOM - HIGHEST_POSITION, min(HIGHEST_POSITION - ROOM, position))
        self._expected = stiffness * (held - self._position) - damping * self._speed + torque
        self._send(pack_command(AkCommand(held, 0.0, stiffness, damping, torque), self._model))

    def _leave_motor_mode(self) -> None:
        """Once without gains, so that none are left for the next time; and out of motor mode, in every cycle."""
        if self._entered:
            self._send(pack_command(_LIMP, self._model))
            self._until_off = self._unanswered + 1
        self._entered, self._expected = False, 0.0
        self._send(EXIT)

    def _tell_off(self, number: int) -> None:
        """The order to leave motor mode; before the first one, once, no gains."""
        if number == 0:
            self._send(pack_command(_LIMP, self._model))
        self._send(EXIT)

    def _torque_told(self, identifier: int, data: bytes) -> bool | None:
        reply = unpack_reply(data, self._model) if self._is_it(identifier, data) else None
        return None if reply is None else abs(reply.torque) > STRAIN * self._model.torque

    def _send(self, data: bytes) -> None:
        self._unanswered = min(MOST_UNANSWERED, self._unanswered + 1)
        self._host.send(self._drive.node_id, data)
