"""The twin of a CubeMars AK drive in MIT mode, and of the joint's encoder beside it (`sensor_node`).

It replies to every frame of eight bytes, in motor mode or not. Its torque is that of the manual's law,
τ = kp·(p − x) + kd·(v − ẋ) + t, within the model's range. The plant behind it has a servo of its own, which is taken
for this law with the rig's gains k and d: it is given the target at which it accelerates as τ would,

    x + (τ + d·ẋ − load)/k

where the load is the cable's, for a servo that would bear it without giving way. Where the plant's gives way by itself
there is none, and k and d are its own: with the rig's it would give a torque smaller or larger than the law's, by the
ratio of both stiffnesses, and the driver would take it for an inert motor.

What the manual does not say, and is chosen here: its timeout takes the gains away until the next command, as in the
firmware from which its own comes (`CAN_TIMEOUT` there); an error ends motor mode, and is in the replies until the
order to leave it has come for a tenth of a second; after a restart its position is that of the rotor in the turn
nearest to zero.
"""

import math
from collections.abc import Mapping
from typing import Any, ClassVar

from bowden.core.signals import DriveState
from bowden.hardware.drives import ak_frames as frames
from bowden.hardware.drives.families.ak_mit import (
    UPLOADS,
    AkParameters,
    command_id,
    model_of,
    reply_id,
    torque_per_ampere,
)
from bowden.hardware.twin.injection import UNCOUNTED
from bowden.hardware.twin.node import HOTTEST, TwinNode
from bowden.hardware.twin.plant import FOLLOW, OFF, Doing

OVER_CURRENT, OVER_TEMPERATURE = 2, 1
"""Error codes of the faults that the twin finds itself, or is given by a number that is none of the drive's."""
KICK = 20e-3
"""How long it pulls towards a target that it remembers, where that is injected [s]."""
CLEARED = 0.1
"""How long a drive in error must be ordered to leave motor mode [s]."""
IDLE = frames.AkCommand(0.0, 0.0, 0.0, 0.0, 0.0)


class AkNode(TwinNode):
    """The drive."""

    _drive: AkParameters

    lacks: ClassVar[Mapping[str, str]] = {
        "doubled_pdos": UNCOUNTED,
        "watch_off": "its CAN timeout is set with its maker's tool, over another port",
        "emergency_stop": "an AK drive has no input for it, and its supply is cut: inject reboot, or silence",
        "encoder_nan motor": "its position has no number that means none",
    }

    def _prepare(self) -> None:
        self._model = model_of(self._drive)
        self.turn = 2.0 * math.pi / self._model.gear
        self._v3, self._command_id = self._drive.board == "v3", command_id(self._drive)
        self._moded, self._kicks_until = self._v3, -math.inf  # towards the target that it remembers

    def _power_up(self) -> None:
        self._error, self._leaving, self._command = 0, math.nan, IDLE
        self._next_upload = self._ready
        if math.isfinite(self._ready):
            self._shift -= self.turn * round(self._position() / self.turn)

    @property
    def _gains(self) -> bool:
        """True if the command gives a torque; half a step of it is what no command can leave out."""
        half = 0.51 * 2.0 * self._model.torque / 4095.0
        return self._command.kp > 0.0 or self._command.kd > 0.0 or abs(self._command.torque) > half

    def _standing(self) -> tuple[DriveState, int, dict[str, Any]]:
        state = DriveState.SWITCH_ON_DISABLED if not self._moded else DriveState.OPERATION_ENABLED
        return DriveState.FAULT if self._error else state, self._error, {}

    def receive(self, identifier: int, data: bytes, now: float) -> None:
        """See `TwinNode.receive`."""
        if self._is_destroyed(now):
            return
        if self._encoder is not None and identifier != self._command_id:
            self._encoder.receive(identifier, data, now)
        if identifier != self._command_id or len(data) != 8 or not self._is_receiving(now):
            return
        self._move(now)  # up to here under the command before
        self.host = now
        command = frames.unpack_command(data, self._model)
        if self.faults.active("commands_ignored", now):
            pass  # and what it does not obey counts for its timeout: nothing says otherwise
        elif self._v3:
            self._obey_v3(command, now)
        elif data == frames.ENTER:
            self._enter_mode(now)
        elif data == frames.EXIT:
            self._told_to_leave(now)
        elif data == frames.ZERO:
            self._shift -= self._position()
        elif command is not None and self._moded and now >= self._kicks_until:
            self._command = command
        self._order(now)
        if not self._v3:
            self._reply(now)

    def _obey_v3(self, command: frames.AkCommand | None, now: float) -> None:
        """A command to a board that is in no mode: torque is what it says."""
        if command is None or now < self._kicks_until:
            return
        gave = self._gains
        self._command = IDLE if self._error else command
        kick = self.faults.active("kick", now)
        if kick and self._gains and not gave:
            self._kick(kick.amount, now)
        if self._error and command.kp == command.kd == 0.0:
            self._told_to_leave(now)

    def _send_cyclic(self, now: float) -> None:
        if self._v3 and self._booted and now >= self._next_upload:
            self._next_upload = max(self._next_upload + 1.0 / UPLOADS, now)
            self._reply(now)
        self._outbox.tick(now)

    def _kick(self, degrees: float, now: float) -> None:
        """Pull towards a target that it remembers, for a moment."""
        place = self._position() + math.radians(degrees)
        self._command = frames.AkCommand(place, 0.0, self._drive.stiffness, self._drive.damping, 0.0)
        self._kicks_until = now + KICK

    def _code_of(self, amount: int) -> int:
        return amount if amount <= 0xFF else OVER_CURRENT

    def _watch(self, now: float) -> None:
        limit = max(self._drive.watchdog, self.patience)
        if self._drive.watchdog > 0.0 and now - self.host >= limit and self._gains:
            self._command = IDLE
            self._journal(now, "timeout", "")
            self._order(now)

    def _enter_mode(self, now: float) -> None:
        if self._error or self._moded:
            return
        self._moded = True
        self._journal(now, "state", DriveState.OPERATION_ENABLED.name)
        kick = self.faults.active("kick", now)
        if kick:
            self._kick(kick.amount, now)

    def _told_to_leave(self, now: float) -> None:
        self._stop(now, DriveState.SWITCH_ON_DISABLED.name)
        if self._error and math.isnan(self._leaving):
            self._leaving = now
        if now - self._leaving >= CLEARED and self.bench.temperature < HOTTEST:
            self._error, self._leaving = 0, math.nan

    def _stop(self, now: float, why: str) -> None:
        """Out of motor mode; the command stays, as the gains of one before do when it is entered again."""
        if self._moded:
            self._journal(now, "state", DriveState.SWITCH_ON_DISABLED.name)
        self._moded = self._v3
        self._command = IDLE if self._v3 else self._command
        self._order(now, why)

    def _fail(self, code: int, now: float) -> None:
        self._error, self._leaving = code, math.nan
        self._journal(now, "fault", f"0x{code:02X}")
        self._stop(now, DriveState.FAULT.name)

    def _order(self, now: float, why: str = "no gains") -> None:
        """Whether the motor may have torque, by mode and gains."""
        self._power(now, on=self._moded and self._gains, why=why)

    def _command_motor(self, now: float, span: float) -> Doing:
        bench = self.bench
        self._order(now)
        doing = self._follow_or_inert(now, FOLLOW if self._powered else OFF)
        if doing == FOLLOW:
            bench.command = self._scale.angle(self._position() + self._reach() - self._shift)
            if bench.torque_offset is not None:
                bench.torque_offset = self._drive.motor_direction * self._command.torque
        return doing

    def _protect(self, now: float) -> None:
        if self.bench.temperature >= HOTTEST and not self._error:
            self._fail(OVER_TEMPERATURE, now)

    def _reach(self) -> float:
        """How far ahead of the motor its servo's target is [rad]."""
        drive, bench = self._drive, self.bench
        stiffness, damping = bench.servo_gains or (drive.stiffness, drive.damping)
        torque = self._asked() + damping * drive.motor_direction * bench.velocity
        if bench.torque_offset is None:
            torque -= drive.motor_direction * bench.tension * bench.physics.spool_radius
        else:
            torque -= self._command.torque  # which the plant gives beside its servo
        return torque / stiffness

    def _asked(self) -> float:
        """The torque of the drive's law, within its range [N·m]."""
        command, speed = self._command, self._drive.motor_direction * self.bench.velocity
        torque = command.kp * (command.position - self._position()) + command.kd * (command.velocity - speed)
        return max(-self._model.torque, min(self._model.torque, torque + command.torque))

    def _torque(self) -> float:
        """What the drive gives at its output shaft [N·m]."""
        drive, bench = self._drive, self.bench
        if bench.doing == OFF:
            return 0.0
        if bench.torque_offset is None:
            return self._asked()
        return drive.motor_direction * bench.current * drive.needs.gear * drive.needs.torque_constant

    def _reply(self, now: float) -> None:
        """What is measured, with the faults of the sensors."""
        drive, bench, faults, model = self._drive, self.bench, self.faults, self._model
        flows = faults.active("over_current", now)
        position = self._scale.counts(bench.read_encoders()[1]) + self._shift
        position = faults.encoder("motor", position, 1.0, now)
        if math.isinf(position):
            position = math.copysign(
                frames.HIGHEST_POSITION - 1e-6, position
            )  # begins again at the other end from there on
        torque = self._torque()
        if flows:
            torque = drive.motor_direction * flows.amount * drive.needs.gear * drive.needs.torque_constant
        velocity = drive.motor_direction * bench.velocity
        if faults.active("saturated", now):
            velocity, torque = model.velocity, model.torque
        temperature = max(-128, min(127, round(bench.temperature))) + drive.temperature_zero
        self._history.append(frames.AkReply(drive.node_id, position, velocity, torque, temperature, self._error, False))
        sent = self._delayed(now)._replace(error=self._error)
        ratio = torque_per_ampere(drive)
        self._outbox.emit_cyclic(reply_id(drive), frames.pack_reply(sent, model, ratio), now)
        if faults.active("foreign_replies", now):
            other = sent._replace(number=drive.node_id % 127 + 1, position=1.0)
            identifier = other.number if drive.reply_id < 0 else drive.reply_id
            self._outbox.emit(identifier, frames.pack_reply(other, model, ratio), now)
