"""What was calibrated by hand, in a terminal."""

from bowden.operations.calibrate import JointCalibration
from bowden.views.text import Call, say_next


def show_calibrate_joint(found: JointCalibration, call: Call) -> None:
    """What was written, and what comes next."""
    poses = ", ".join(f"{one:g}°" for one in found.poses_deg)
    print(f"[joint_sensor] of {call['rig']} is written, by poses at {poses}; noise {found.noise_deg:.2f}°")
    say_next("run", call["rig"], "--twin")
