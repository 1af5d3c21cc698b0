"""Draw the arm of docs/suit-3d.md: ``python docs/images/make_arm.py``; needs the extra ``bowden[mujoco]``.

Tensions are those that hold forearm and hand of 75 kg and 1.75 m. Another driver of OpenGL gives other pixels.
"""

from pathlib import Path

from bowden.models.suit.arm import Arm
from bowden.models.suit.geometry import SuitGeometry
from bowden.report.arm_pictures import write_series

if __name__ == "__main__":
    write_series(Path(__file__).with_name("arm.png"), SuitGeometry(), Arm())
