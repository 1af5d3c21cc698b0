"""What the twin measures at a SYNC, with the faults of its sensors."""

import math

from bowden.hardware.drives import canopen_frames as frames
from bowden.hardware.drives.parameters import DriveParameters, joint_scale, load_range, motor_scale
from bowden.hardware.twin.faults import Faults
from bowden.hardware.twin.plant import TwinPlant, torque_on_joint

RATED_CURRENT = 4.0
"""Of the twin's motor; a stated choice [A]."""

Sampled = tuple[frames.Motion, frames.Sensors]
"""Both transmit PDOs; the statusword is put in later."""


class Sampler:
    """The drive's sensors.

    Args:
        drive: encoders and scales, as the rig has them.
        bench: what is measured.
        faults: of the sensors.
    """

    def __init__(self, drive: DriveParameters, bench: TwinPlant, faults: Faults) -> None:
        self._drive, self._bench, self._faults = drive, bench, faults
        self._motor, self._joint = motor_scale(drive), joint_scale(drive)

    def sample(self, now: float) -> Sampled:
        """Through the encoders' noise, with the faults that are there at `now` [s]."""
        bench, faults = self._bench, self._faults
        joint, motor = bench.read_encoders()
        counts = faults.encoders(
            self._motor.counts(motor), self._joint.counts(joint), abs(self._motor.step), abs(self._joint.step), now
        )
        flows = faults.active("over_current", now)
        return self._packed(counts[0], counts[1], flows.amount if flows else bench.current, now)

    def spool_torque(self, share: int) -> float:
        """A torque in thousandths of the rated one, with the sign of the counts, at the spool [N·m]."""
        drive = self._drive
        return 1e-3 * share * RATED_CURRENT * drive.torque_constant * drive.gear * drive.motor_direction

    def true(self) -> Sampled:
        """Without noise and faults."""
        bench = self._bench
        now = -math.inf  # before any fault
        return self._packed(self._motor.counts(bench.motor), self._joint.counts(bench.joint), bench.current, now)

    def _packed(self, motor: float, joint: float, current: float, now: float) -> Sampled:
        drive, bench = self._drive, self._bench
        scale, millivolts = drive.tension_scale or drive.torque_scale, 0.0
        if scale:
            load = bench.tension if drive.tension_scale else torque_on_joint(bench)
            load = self._faults.load(load, load_range(drive), now)
            millivolts = max(-drive.analog_range, min(drive.analog_range, load / scale + drive.tension_zero))
        return (
            frames.Motion(0, _int(motor, 31), _int(1e3 * drive.motor_direction * current / RATED_CURRENT, 15)),
            frames.Sensors(_int(joint, 31), _int(millivolts, 15), _int(10.0 * bench.temperature, 15)),
        )


def _int(value: float, bits: int) -> int:
    """The nearest whole number that this many bits and a sign hold; the least of them for what is no number."""
    if math.isnan(value):
        return -(1 << bits)
    return int(max(-(1 << bits), min((1 << bits) - 1, _half_up(value))))


def _half_up(value: float) -> float:
    """Half up, as an encoder counts; infinite stays infinite."""
    return math.floor(value + 0.5) if math.isfinite(value) else value
