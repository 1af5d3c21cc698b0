"""What was confirmed by hand, in a terminal."""

from bowden.operations.confirm import Confirmation
from bowden.views.text import Call


def show_confirm(found: Confirmation, call: Call) -> None:
    """The angles by encoders and by hand."""
    angles = f"joint {found.joint_deg:.1f}°, motor {found.motor_deg:.1f}°, by hand {round(found.told_deg, 9):g}°"
    print(f"Confirmed: {angles}.")
