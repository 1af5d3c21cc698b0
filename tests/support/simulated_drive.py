"""A drive without a bus: the twin's bench as the live loop's `Drive` in the loop's own process, at any clock's time."""

import math

from bowden.core.signals import DriveReading, DriveState
from bowden.hardware.ports import Power, TorqueLeft
from bowden.hardware.twin.plant import BRAKE, FOLLOW, OFF, TwinPlant

_NEXT = {
    Power.OFF: (DriveState.SWITCH_ON_DISABLED, OFF),
    Power.READY: (DriveState.SWITCHED_ON, OFF),
    Power.QUICK_STOP: (DriveState.QUICK_STOP_ACTIVE, BRAKE),
    Power.ON: (DriveState.OPERATION_ENABLED, FOLLOW),
}
"""Wanted power → the drive's state, and what the motor does; reached within the cycle."""


class SimulatedDrive:
    """Takes the target and samples at the moment of `write`, as a drive does at its SYNC; `read` tells that sample.

    Args:
        bench: at the clock's time.
    """

    def __init__(self, bench: TwinPlant) -> None:
        self._bench = bench
        self._power = Power.OFF
        self._joint, self._motor = bench.read_encoders()
        self._age, self._sampled = 0.0, math.nan

    def bring_up(self) -> str:
        """See `hardware.ports.Drive.bring_up`."""
        return "a simulated drive"

    def read(self, now: float) -> DriveReading:
        """See `hardware.ports.Drive.read`."""
        state, _ = _NEXT[self._power]
        bench, age = self._bench, self._age
        self._age += 1.0
        return DriveReading(
            *(self._motor, self._joint, bench.current, bench.tension, bench.temperature, age, age),
            *(0.0, float(state), 0.0, 0.0, 0.0, now - self._sampled),
        )

    def write(self, target: float, power: Power, now: float, torque: float = 0.0) -> None:
        """See `hardware.ports.Drive.write`."""
        self._bench.advance(now)
        self._joint, self._motor = self._bench.read_encoders()
        self._age, self._sampled, self._power = 0.0, now, power
        self._bench.doing, self._bench.command = _NEXT[power][1], target
        if self._bench.torque_offset is not None:
            self._bench.torque_offset = torque

    @property
    def brake_confirmed(self) -> bool:
        """See `hardware.ports.BrakedDrive.brake_confirmed`."""
        return True

    def set_brake(self, engaged: bool) -> None:
        """See `hardware.ports.BrakedDrive.set_brake`."""
        self._bench.brake_set = engaged

    def reset_fault(self) -> None:
        """See `hardware.ports.Drive.reset_fault`; it has none."""

    def close(self) -> TorqueLeft:
        """See `hardware.ports.Drive.close`."""
        self._power, self._bench.doing = Power.OFF, OFF
        return TorqueLeft.OFF
