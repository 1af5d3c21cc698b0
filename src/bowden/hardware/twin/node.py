"""The one body of every drive's twin: its time, plant, power, restarts and faults. A family puts its protocol in front.

Frames come in and go out as numbers and bytes, and time is an argument.
"""

import math
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any, ClassVar

from bowden.core.signals import DriveState
from bowden.hardware.buses.place import ERROR
from bowden.hardware.drives.joint_encoder import has_encoder
from bowden.hardware.drives.scale import Scale, motor_scale
from bowden.hardware.twin.faults import BIT_ERROR, Faults, Outbox, Send
from bowden.hardware.twin.injection import Injection
from bowden.hardware.twin.plant import OFF, Doing, TwinPlant
from bowden.hardware.twin.sensor_node import JointEncoderNode

Journal = Callable[[float, str, str], None]
"""Takes what happened: time [s], event, detail. Every family says ``torque_on`` and ``torque_off``."""

HOTTEST = 110.0
"""Temperature at which the power stage protects itself [°C]."""
REBOOT_TIME = 0.3
"""[s]"""
STEP = 0.9e-3
"""The plant is moved on at every order, and without one after this [s]."""
SUPPLY = 24.0
"""[V]"""
LONGEST_STEP = 0.01
"""Time for which a setpoint is planned at once, at most [s]."""


class TwinNode(ABC):
    """One drive of any family; what its family makes of a frame and of its state say the abstract methods.

    Args:
        drive: parameters of the family, as the rig has them.
        bench: behind the drive.
        send: puts a frame on the bus.
        journal: takes what happened.
        overrides: what of the drive, or of the joint's encoder beside it, is otherwise than usual; None takes it away.
    """

    lacks: ClassVar[Mapping[str, str]] = {}
    """Faults that a drive of this family cannot have, as ``reboot`` or ``encoder_nan motor`` → why."""
    state: Any
    """Of its family's own machine, where that has one."""
    turn: float = 1.0
    """What `turns_lost` moves the drive's position by, in the drive's unit."""

    def __init__(
        self,
        drive: Any,
        bench: TwinPlant,
        send: Send,
        journal: Journal,
        overrides: Mapping[Any, Any] | None = None,
    ) -> None:
        self._drive, self._overrides, self.bench, self.faults = drive, dict(overrides or {}), bench, Faults()
        self._send, self._journal, self._outbox = send, journal, Outbox(send, self.faults)
        self._encoder: JointEncoderNode | None = None
        if has_encoder(drive):
            objects = {key: value for key, value in self._overrides.items() if isinstance(key, tuple)}
            self._encoder = JointEncoderNode(drive, lambda: bench.read_encoders()[0], self.faults, send, objects)
        self._scale = motor_scale(drive)
        self._prepare()
        self._history: deque[Any] = deque(maxlen=1000)  # of samples
        self._shift = 0.0  # between the drive's position and the plant's, in the drive's unit
        self.patience = 0.0
        """How long a silent host is waited for while there is torque [s]; 0: no longer than the drive itself does."""
        self.scenario_noted = False
        """True if the sheath's motion has begun, or somebody has said when it does."""
        self.host = -math.inf
        """When the host last sent something [s]."""
        self._powered, self._booted = False, False
        self._ready = self._moved = -math.inf
        self._power_up()

    @abstractmethod
    def receive(self, identifier: int, data: bytes, now: float) -> None:
        """A frame from the bus; an extended identifier, and a remote frame, have the flags of `buses.place`."""

    @abstractmethod
    def _prepare(self) -> None:
        """What does not change while it is on."""

    @abstractmethod
    def _power_up(self) -> None:
        """Everything as after switching on."""

    @abstractmethod
    def _stop(self, now: float, why: str) -> None:
        """Without torque, as by itself."""

    @abstractmethod
    def _fail(self, code: int, now: float) -> None:
        """An error of its own, or one that is injected."""

    @abstractmethod
    def _watch(self, now: float) -> None:
        """What happens with time: the watchdog over the host, an emergency stop, the way to torque."""

    @abstractmethod
    def _command_motor(self, now: float, span: float) -> Doing:
        """What the motor does from now on, whose target is set; a `span` [s] has passed since the last time."""

    @abstractmethod
    def _protect(self, now: float) -> None:
        """See to the drive's own limits."""

    @abstractmethod
    def _standing(self) -> tuple[DriveState, int, dict[str, Any]]:
        """State, error code, 0 for none, and what else this family knows of itself."""

    def _enter(self, state: Any, now: float, why: str = "") -> None:
        """Another state, of a family whose states have names."""
        if state is not self.state:
            before, self.state = self.state, state
            self._journal(now, "state", state.name)
            self._entered(before, now, why or state.name)

    def _entered(self, before: Any, now: float, why: str) -> None:
        """What comes with a state that was not there before: torque, or none."""
        return

    def _boot(self, now: float) -> None:
        """It has started, which some families say on the bus."""
        self._journal(now, "boot", "")

    def _send_cyclic(self, now: float) -> None:
        """What goes out by itself: frames that wait, of some families a heartbeat."""
        self._outbox.tick(now)

    def status(self) -> dict[str, Any]:
        """What the drive knows of itself, for `bowden twin --status`: its state, a name of `core.signals.DriveState`;
        whether the motor may have torque; its error code; when the host last sent something [s]; and what else this
        family has.
        """
        state, error, rest = self._standing()
        return {
            "state": state.name,
            "torque": self.bench.doing != OFF,
            "error_code": error,
            "last_heartbeat": self.host if math.isfinite(self.host) else None,
            **rest,
        }

    def tick(self, now: float) -> None:
        """Let time pass: faults, watchdog, plant, what is sent by itself, frames that wait."""
        if now >= self._ready and not self._booted:
            self._booted = True
            self._boot(now)
        for injection in self.faults.due(now):
            self._apply_event(injection, now)
        self._watch(now)
        if now - self._moved >= STEP:
            self._move(now)
        if self._encoder is not None:
            self._encoder.tick(now)
        self._send_cyclic(now)

    def _apply_event(self, injection: Injection, now: float) -> None:
        """A fault that happens once."""
        if injection.name == "reboot":
            self._journal(now, "reboot", "")
            self._restart(now, "reboot")
        elif injection.name == "mode_left":
            self._stop(now, "by itself")
        elif injection.name == "turns_lost":
            self._shift += injection.amount * self.turn
        else:
            self._fail(self._code_of(int(injection.amount)), now)

    def _code_of(self, amount: int) -> int:
        """The family's error for a code that was injected."""
        return amount & 0xFFFF

    def _restart(self, now: float, why: str) -> None:
        """Lose the supply for a moment."""
        self._stop(now, why)
        self._ready, self._booted = now + REBOOT_TIME, False
        self._power_up()

    def _is_receiving(self, now: float) -> bool:
        """True if it takes a frame in."""
        return now >= self._ready and not self.faults.active("deaf", now)

    def _is_destroyed(self, now: float) -> bool:
        """True if a bit error destroys this frame of the host."""
        if self.faults.destroys(now):
            self._send(ERROR | BIT_ERROR, bytes(8))
            return True
        return False

    def _power(self, now: float, *, on: bool, why: str = "") -> None:
        """The motor may have torque from now on, or has none; the journal says when that changes."""
        if on and not self._powered:
            if not self.scenario_noted:
                self.scenario_noted = True
                self.bench.start_scenario(now)
            self._journal(now, "torque_on", "")
        elif not on:
            self.bench.advance(now)
            if self._powered:
                since = 1e3 * (now - self.host)
                self._journal(now, "torque_off", f"{why}; {since:.3f} ms after the host's last frame")
            self.bench.doing = OFF
        self._powered = on

    def _move(self, now: float) -> None:
        """Move the plant on, and see to the drive's own limits."""
        bench, span, self._moved = self.bench, min(LONGEST_STEP, now - self._moved), now
        self.faults.damage(bench, now)
        bench.doing = self._command_motor(now, span)
        bench.advance(now)
        if hot := self.faults.active("over_temperature", now):
            bench.temperature = hot.amount
        self._protect(now)

    def _follow_or_inert(self, now: float, doing: Doing) -> Doing:
        """What is wanted of the motor, or nothing of an inert one."""
        return OFF if self.faults.active("inert", now) else doing

    def _position(self) -> float:
        """Of the motor, as the drive counts it."""
        return self._scale.counts(self.bench.motor) + self._shift

    def _velocity(self) -> float:
        """Of the motor, in the drive's unit a second."""
        velocity = self.bench.velocity * self._scale.steepest(-math.inf, math.inf) / self._scale.step
        return velocity if math.isfinite(velocity) else 0.0

    def _speed_limit(self) -> float:
        """Of the drive, in its unit a second; infinite where the plant has none."""
        return self.bench.speed_limit / abs(self._scale.step)

    def _encoders(self, joint: Scale, now: float) -> tuple[float, float]:
        """What the motor's encoder and the joint's at the drive count, through their noise and their faults."""
        angles, faults = self.bench.read_encoders(), self.faults
        motor = faults.encoder("motor", self._scale.counts(angles[1]), abs(self._scale.step), now)
        return motor, faults.encoder("joint", joint.counts(angles[0]), abs(joint.step), now)

    def _current(self, now: float) -> float:
        """Of the motor, as it is reported [A]."""
        flows = self.faults.active("over_current", now)
        return flows.amount if flows else self.bench.current

    def _delayed(self, now: float) -> Any:
        """The newest sample, or, where its faults are such, one from before; None where there is none."""
        back = self.faults.active("delayed_readings", now)
        return self._history[-min(len(self._history), 1 + int(back.amount if back else 0))] if self._history else None
