"""The holding brake in a live run: it stands between the supervisor's last word and the drive.

It may hold in a run under the law alone. In a release, a preflight and a stop it is released before anything else: the
target that the drive is sent waits until the shaft is free, and then follows the supervisor's no faster than a release
moves. With the torque off it is released too, so that no limb hangs on a brake that nobody watches.

A drive that holds by its brake has its power stage off on our order, and so no current. The supervisor is shown what
that is: a drive that holds its target. Every other state of the drive is shown as it is.
"""

from bowden.core.signals import DriveReading, DriveState, Power
from bowden.hardware.ports import BrakedDrive
from bowden.models.drive.holding_brake import ENGAGING, FREE, HELD, HoldingBrake, brake_begin, brake_step
from bowden.safety.faults import Reaction
from bowden.safety.limits import Limits
from bowden.safety.state import Mode, Verdict

COLUMNS = {"brake.phase": "1", "brake.target": "rad"}
"""Column → unit of what a run with a brake records: its phase, and the target that the drive was sent."""

_ALIVE = 1e-9
"""Steps of the current that is shown while there is none: that it does not change is then no sign of a dead sensor
[A]."""


class BrakeHold:
    """The brake of one motor.

    Args:
        drive: that has it.
        brake: of the rig.
        limits: of its supervisor, which say how fast a target may move.
        period: length of a cycle [s].
    """

    def __init__(self, drive: BrakedDrive, brake: HoldingBrake, limits: Limits, period: float) -> None:
        self._drive, self._brake, self._period = drive, brake, period
        self._runs, self._lowers = limits.motor_speed, limits.lowering
        self._state, self._begun, self._shown, self._asked = brake_begin(0.0), False, 0, 0.0

    def write(self, verdict: Verdict, motor: float, now: float, torque: float) -> None:
        """Tell the drive what to do with its brake, and the rest as `hardware.ports.Drive.write`.

        Args:
            verdict: of the supervisor.
            motor: as it was read [rad].
            now: [s]
            torque: offset [N·m].
        """
        target, power = self._step(verdict, motor)
        self._drive.set_brake(self._state.phase in (ENGAGING, HELD))
        self._drive.write(target, power, now, torque)

    def _step(self, verdict: Verdict, motor: float) -> tuple[float, Power]:
        """Target [rad] and power; no current is taken away before the drive says that its brake is set."""
        power = verdict.power
        if power != Power.ON:
            self._state, self._begun = brake_begin(verdict.target), False
            return verdict.target, power
        if not self._begun:
            self._state, self._begun, self._asked = brake_begin(verdict.target), True, verdict.target
        running = verdict.mode == Mode.RUNNING and verdict.reaction == Reaction.NONE
        sure = (
            self._drive.brake_confirmed
            or self._state.phase == FREE
            or self._state.since + self._period < self._brake.engage_delay
        )
        asked = abs(verdict.target - self._asked) / self._period  # of a release, which no catching up may outdo
        self._asked = verdict.target
        speed = self._runs if running else max(self._lowers, asked)
        self._state = brake_step(self._brake, self._state, verdict.target, motor, running and sure, speed, self._period)
        return self._state.sent, Power.READY if self._state.phase == HELD else power

    def shown(self, reading: DriveReading) -> DriveReading:
        """The reading as the supervisor gets it."""
        if not self._begun or self._state.phase in (FREE, ENGAGING) or reading.drive_state != DriveState.SWITCHED_ON:
            return reading
        self._shown = (self._shown + 1) % 3
        return reading._replace(
            drive_state=float(DriveState.OPERATION_ENABLED), current=reading.current + _ALIVE * self._shown
        )

    def row(self) -> tuple[float, float]:
        """The values of `COLUMNS` in this cycle."""
        return self._state.phase, self._state.sent
