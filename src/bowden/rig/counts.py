"""From encoder counts to the angles in which a law works, and from its command back to counts."""

import math
from typing import Annotated, NamedTuple

from bowden.core.quantity import Quantity
from bowden.core.units import DEGREES
from bowden.models.suit.suit_angle import SpoolMap, spool_map
from bowden.plants.counting import NOT_SAID, Counting
from bowden.plants.identified import IdentifiedCable
from bowden.plants.presets.bench import default_bench
from bowden.rig.rig import Rig


class Counts(NamedTuple):
    """How the encoders of a rig's log count: motor = direction·(count·n − zero), joint = count·n − zero."""

    motor_direction: Annotated[float, Quantity("-1 where the law counts the motor the other way round")]
    motor_count: Annotated[float, Quantity("one count of the motor's encoder", "rad")]
    motor_zero: Annotated[float, Quantity("motor angle of the log at which the law has zero", "rad")]
    joint_count: Annotated[float, Quantity("one count of the joint's encoder", "rad")]
    joint_zero: Annotated[float, Quantity("joint angle of the log at which the law has zero", "rad")]

    def formulas(self) -> list[tuple[str, str]]:
        """Signal and formula, for a person."""
        sign = "-" if self.motor_direction < 0.0 else ""
        motor = f"{sign}({self.motor_count:.6g}·counts{_plus(-self.motor_zero)})"
        return [
            ("motor [rad]", motor),
            ("joint [rad]", f"{self.joint_count:.6g}·counts{_plus(-self.joint_zero)}"),
            ("target [counts]", f"({sign}command{_plus(self.motor_zero)})/{self.motor_count:.6g}"),
        ]

    def notes(self) -> str:
        """The rig's own numbers behind the formulas."""
        turned = "the other way round than its encoder" if self.motor_direction < 0.0 else "as its encoder does"
        motor, joint = (f"{zero * DEGREES:.4g}°" for zero in (self.motor_zero, self.joint_zero))
        return (
            f"The law counts the motor {turned}; zero is at {motor} of the motor's encoder and {joint} of the joint's."
        )


def _plus(number: float) -> str:
    return f" {'-' if number < 0.0 else '+'} {abs(number):.6g}" if number else ""


def counts_of(rig: Rig) -> Counts | SpoolMap:
    """How the encoders of a rig's log count; on a suit how its spool turns with the elbow.

    One count is the resolution of the rig's encoder; of an ideal one it is a radian.
    """
    if rig.worn is not None:
        return spool_map(rig.worn.geometry, rig.worn.spool_radius)
    cable = rig.cable
    counting = cable.counting if isinstance(cable, IdentifiedCable) else Counting()
    return Counts(
        counting.direction * (-1.0 if rig.turned else 1.0),
        rig.motor_encoder.resolution or 1.0,
        counting.motor_zero,
        rig.joint_encoder.resolution or 1.0,
        counting.joint_zero,
    )


def guessed(rig: Rig) -> str:
    """Which encoders' counts are those of the paper's bench, round another cable than its own, and no log said so.

    Empty where none are.
    """
    if rig.worn is not None or rig.plant is not None or rig.cable == default_bench().cable:
        return ""
    said = rig.cable.encoders if isinstance(rig.cable, IdentifiedCable) else NOT_SAID
    bench = default_bench().joint_encoder.resolution
    sides = [
        side
        for side, encoder in (("motor", rig.motor_encoder), ("joint", rig.joint_encoder))
        if not getattr(said, side) and math.isclose(encoder.resolution, bench, rel_tol=1e-6)
    ]
    if not sides:
        return ""
    keys = " and ".join(f"encoder.{side}.resolution_deg" for side in sides)
    return (
        f"the {2.0 * math.pi / bench:.0f} counts a turn of {' and '.join(sides)} are guessed; "
        f"unless yours have as many, set {keys} in the rig to 360 over your counts a turn"
    )


def motor_angle(counts: Counts, n: float) -> float:
    """The motor's angle [rad] where its encoder, which counts as in the rig's log, shows `n`."""
    return counts.motor_direction * (counts.motor_count * n - counts.motor_zero)


def joint_angle(counts: Counts, n: float) -> float:
    """The joint's angle [rad] where its encoder, which counts as in the rig's log, shows `n`."""
    return counts.joint_count * n - counts.joint_zero


def motor_counts(counts: Counts, angle: float) -> float:
    """What the motor's encoder shows at an angle [rad], not rounded."""
    return (counts.motor_direction * angle + counts.motor_zero) / counts.motor_count
