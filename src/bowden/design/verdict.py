"""What `bowden check` says of the laws of a joint, with its advice; and of those of a run, before it begins."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from bowden.control import Law
from bowden.core.caller import argument
from bowden.core.errors import ParameterError
from bowden.design.check_rig import advice_for, check_laws, judged
from bowden.design.other_law import other_law
from bowden.drawing.shown import listed
from bowden.rig.joints import RigJoint
from bowden.sim.joint_of_rig import laws_of

if TYPE_CHECKING:
    from bowden.design.check_result import Check, VerdictName


def checked(joint: RigJoint) -> "Check":
    """The check of a joint's own laws, with its advice, and with the law that holds better where its own does not.

    Raises:
        NoNumberError: a law of one's own gives no number at rest.
    """
    laws = laws_of(joint)
    found = judged(joint, laws)
    advice, of_rig = advice_for(joint, laws[0], found)
    found = replace(found, of_rig=of_rig)
    better = None if found.holds or joint.shared else other_law(joint.first, [laws[0].name])
    if better is None:
        return replace(found, advice=advice)
    return replace(found, advice=listed((advice, str(better)), "; "), instead=better.law)


@dataclass(frozen=True)
class CheckVerdict:
    """What the check makes of one law."""

    name: "VerdictName | None"
    """None where the check cannot judge the law."""
    note: str
    """For standard error; empty where the law holds."""


def verdicts(joint: RigJoint, laws: Sequence[Sequence[Law]], name: str, *, force: bool) -> list[CheckVerdict]:
    """Check every law over the bends and the stroke of the run.

    A law of the user's own that the check cannot judge, since it gives no number at rest, is let through with a note.

    Args:
        joint: of the run's rig.
        laws: to check, each as all of the joint's motors have it.
        name: the file's name, for messages.
        force: let laws that do not hold through, with a note.

    Raises:
        ParameterError: laws that do not hold; the message has the reasons and what to change.
    """
    checks = [check_laws(joint, own) for own in laws]
    both = [(own[0], found) for own, found in zip(laws, checks, strict=True)]
    failing = [(law, found) for law, found in both if not isinstance(found, str) and not found.holds]
    if failing and not force:
        said = "; ".join(
            f"{law.name} fails the check on {name}: {found.reason}; {advice_for(joint, law, found).text}"
            for law, found in failing
        )
        others = f" (of {len(laws)} laws, none was run)" if laws[1:] else ""
        better = None if joint.shared else other_law(joint.first, [law.name for law, _ in failing])
        instead = "" if better is None else f"; {better} ({argument('law', better.law)})"
        raise ParameterError(f"{said}{instead}; or run it anyway with {argument('force', True)}{others}")
    return [verdict_of(law, found, name) for law, found in both]


def verdict_of(law: Law, found: "Check | str", rig: str) -> CheckVerdict:
    """What a check makes of a law, in a note.

    Args:
        law: that was checked.
        found: by the check, or why it cannot judge the law.
        rig: its name, for messages.
    """
    if isinstance(found, str):
        return CheckVerdict(None, f"{law.name} cannot be checked ({found}) and runs unchecked")
    forced = argument("force", True)
    said = {
        "holds": "",
        "little_margin": f"{law.name} has little margin on {rig}: {found.reason}",
        "limit_cycle": f"{law.name} swings at rest on {rig}: {found.reason}",
        "does_not_hold": f"{law.name} fails the check on {rig}, and runs because of {forced}: {found.reason}",
    }
    return CheckVerdict(found.verdict, said[found.verdict])
