"""The readings of a drive of any family, made of what has come of it.

Of one that has no heartbeat, emergency frame and PDOs the age of its sign of life is that of its last reply; its error
code is an emergency when it changes; a sample is as old as the command that it answers.
"""

import math

from bowden.core.signals import EMERGENCY_STOP, DriveReading, DriveState


class Readings:
    """What has come, as a `DriveReading` in each cycle. Order in a cycle: `cycle`, what has arrived, `reading`."""

    def __init__(self) -> None:
        self.begin()

    def begin(self) -> None:
        """Nothing has come yet."""
        self.motor = self.joint = self.current = self.tension = self.temperature = self.joint_torque = math.nan
        self.motor_age = self.joint_age = math.inf
        self._error = 0
        self._emergency = self._foreign = 0.0
        self.replied_at = self.sampled = math.nan

    def cycle(self, now: float) -> None:
        """A cycle begins at `now` [s]: everything is one older."""
        self.motor_age += 1.0
        self.joint_age += 1.0
        self._emergency = self._foreign = 0.0
        if math.isnan(self.replied_at):
            self.replied_at = now  # of the first cycle: from here on it can be late

    def replied(self, now: float) -> None:
        """A reply has come, whatever it says: the sign of life."""
        self.replied_at = now

    def moved(self, motor: float, current: float, temperature: float, sampled: float) -> None:
        """The motor's angle [rad], current [A] and temperature [°C] came, taken at `sampled` [s]; NaN for none."""
        self.motor, self.motor_age = motor, 0.0
        self.current, self.temperature, self.sampled = current, temperature, sampled

    def turned(self, joint: float) -> None:
        """The joint's angle came [rad]."""
        self.joint, self.joint_age = joint, 0.0

    def failed(self, code: int) -> None:
        """The drive reports this error, 0 for none: an emergency when it changes."""
        if code and code != self._error:
            self.found(code)
        self._error = code

    def found(self, code: float) -> None:
        """Something is wrong in this cycle; of several the first is the cause."""
        self._emergency = self._emergency or float(code)

    def stopped(self) -> None:
        """The emergency stop is pressed, which comes before everything else."""
        self._emergency = EMERGENCY_STOP

    def meant(self) -> None:
        """A frame came that nobody but this host may send."""
        self._foreign += 1.0

    @property
    def error(self) -> int:
        """What the drive reported last; 0 for none."""
        return self._error

    def reading(self, now: float, state: DriveState, bus_errors: float) -> DriveReading:
        """The reading of this cycle at `now` [s]."""
        return DriveReading(
            self.motor, self.joint, self.current, self.tension, self.temperature, self.motor_age, self.joint_age,
            now - self.replied_at if math.isfinite(self.replied_at) else math.inf,
            float(state), self._emergency, float(bus_errors), self._foreign,
            0.0 if math.isnan(self.sampled) else now - self.sampled, self.joint_torque,
        )  # fmt: skip
