"""The drive's parameters as a rig has them."""

from bowden.hardware.drive_parameters import DriveParameters
from bowden.sim.plant import Bench


def drive_parameters(bench: Bench) -> DriveParameters:
    """Gear, torque constant and cycle from the bench; the rest as `DriveParameters` has it."""
    return DriveParameters(
        gear=bench.motor.gear, torque_constant=bench.motor.torque_constant, sample_time=bench.sample_time
    )
