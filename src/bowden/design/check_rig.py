"""The check of what a rig says: of one law over the bends and the stroke of its run, or of all motors of a joint."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from bowden.control import Law, user_law
from bowden.core.units import DEGREES
from bowden.rig.drive import SURE_INTEGRAL
from bowden.rig.families import family_of
from bowden.rig.joints import RigJoint
from bowden.rig.rig import Rig
from bowden.sim import ranges
from bowden.sim.rig_runs import cabled_joint_of, joint_ranges

if TYPE_CHECKING:
    from bowden.design.check_result import Check


def judged(joint: RigJoint, laws: Sequence[Law]) -> "Check":
    """What is found of a joint.

    Args:
        joint: of a rig.
        laws: of each of its motors.

    Raises:
        NoNumberError: a law of one's own gives no number at rest.
    """
    from bowden.design.check import check
    from bowden.design.joint_check import check_joint

    rig = joint.first
    with user_law.explained(laws[0]):
        if joint.shared:
            bends, stroke = joint_ranges(joint)
            return check_joint(cabled_joint_of(joint), laws, bends=bends, stroke=stroke, seed=rig.seed)
        return check(ranges.judged(rig), laws[0], bends=ranges.bends(rig), stroke=ranges.stroke(rig), seed=rig.seed)


def check_laws(joint: RigJoint, laws: Sequence[Law]) -> "Check | str":
    """The same, or why nothing could be found."""
    from bowden.design.linearise import NoNumberError

    try:
        return judged(joint, laws)
    except NoNumberError as error:
        return error.what


def check_rig(rig: Rig, law: Law) -> "Check | str":
    """The same of a rig with one motor."""
    return check_laws(rig.each_joint[0], [law])


class Advice(NamedTuple):
    """What to change, in words; empty where nothing is to be mended."""

    text: str
    of_rig: bool = False
    """It changes the rig, where no gains would do."""


def advice_for(joint: RigJoint, law: Law, found: "Check") -> Advice:
    """What to change about a joint, or about its laws.

    Args:
        joint: of a rig.
        law: of its first motor.
        found: by the check.
    """
    if joint.shared:
        alone = ", ".join(f"--motor {name}" for name in joint.names)
        return Advice("" if found.holds else f"check each alone ({alone}), and lower the gains of all alike")
    from bowden.design.advice import advise

    rig = joint.first
    if integral := missing_integral(rig, law, found):
        return Advice(integral, of_rig=found.verdict != "holds")
    with user_law.explained(law):
        return Advice(advise(ranges.judged(rig), law, found, bends=ranges.bends(rig), stroke=ranges.stroke(rig)))


_MUCH_BETTER = 0.5
"""Largest error of the trials with an integral over that without, below which the integral is worth naming [–]."""


def missing_integral(rig: Rig, law: Law, found: "Check | str") -> str:
    """That the drive of a suit has no integral, and what one would do; empty where the law does as well without.

    Args:
        rig: with one motor.
        law: of the rig.
        found: by the check of it, or why nothing could be found.
    """
    if rig.worn is None or rig.worn.motor.integral > 0.0 or rig.pushing is not None:
        return ""
    with_one = check_rig(rig.replace(suit=rig.suit._replace(drive_integral=SURE_INTEGRAL)), law)
    if isinstance(with_one, str) or with_one.verdict != "holds" or with_one.peak is None:
        return ""
    seen = ""
    if not isinstance(found, str) and found.peak is not None:
        if found.verdict == "holds" and not with_one.peak < _MUCH_BETTER * found.peak:
            return ""
        seen = f" (in the trials by {found.peak * DEGREES:.3g}°, with one by {with_one.peak * DEGREES:.3g}°)"
    what = "the position loop of the suit's drive has no integral, so friction in the gears holds the arm off target"
    if not family_of(rig.drive).integrates:
        return f"{what}{seen}; a drive of the family {rig.drive.family} can have none: take another for a suit"
    return (
        f"{what}{seen}; write drive_integral_per_s = {SURE_INTEGRAL:g} into [suit], with which the law {law.name} "
        "holds, and set the same integral in the drive"
    )
