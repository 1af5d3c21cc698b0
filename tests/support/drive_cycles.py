"""Cycles of a drive at 1 kHz, without a loop around it."""

import math
import time

from bowden.core.signals import DriveReading
from bowden.hardware.ports import Drive, Power


def cycles(drive: Drive, count: int, power: Power, swing: float = 0.0) -> list[DriveReading]:
    """So many cycles at 1 kHz, late as this machine is; the target swings from where the motor was."""
    readings: list[DriveReading] = []
    start, centre = time.monotonic(), math.nan
    for k in range(count):
        time.sleep(max(0.0, start + 1e-3 * k - time.monotonic()))
        now = time.monotonic()
        readings.append(drive.read(now))
        if math.isnan(centre):
            centre = readings[-1].motor
        target = centre + swing * (1.0 - math.cos(2.0 * math.pi * 1e-3 * k))
        drive.write(0.0 if math.isnan(target) else target, power, now)
    return readings
