"""What `bowden check` says of the laws of a run, asked before anything is simulated."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bowden.control import Law, user_law
from bowden.core.caller import argument
from bowden.core.errors import ParameterError
from bowden.design.advised_check import checked_pair
from bowden.design.check_rig import check_rig, pair_laws
from bowden.design.linearise import NoNumberError
from bowden.design.other_law import other_law
from bowden.rig.rig import Rig
from bowden.sim import ranges

if TYPE_CHECKING:
    from bowden.design.check_result import Check, VerdictName


@dataclass(frozen=True)
class CheckVerdict:
    """What the check makes of one law."""

    name: "VerdictName | None"
    """None where the check cannot judge the law."""
    note: str
    """For standard error; empty where the law holds."""


def verdicts(rig: Rig, laws: Sequence[Law], name: str, *, force: bool) -> list[CheckVerdict]:
    """Check every law over the bends and the stroke of the run.

    A law of the user's own that the check cannot judge, since it gives no number at rest, is let through with a note.

    Args:
        rig: of the run.
        laws: to check.
        name: the file's name, for messages.
        force: let laws that do not hold through, with a note.

    Raises:
        ParameterError: laws that do not hold; the message has the reasons and what to change.
    """
    checks = [check_rig(rig, law) for law in laws]
    pairs = zip(laws, checks, strict=True)
    failing = [(law, found) for law, found in pairs if not isinstance(found, str) and found.verdict == "does_not_hold"]
    if failing and not force:
        said = [f"{law.name} fails the check on {name}: {_why(rig, law, found)}" for law, found in failing]
        others = f" (of {len(laws)} laws, none was run)" if laws[1:] else ""
        better = other_law(rig, [law.name for law, _ in failing])
        instead = "" if better is None else f"; {better} ({argument('law', better.law)})"
        raise ParameterError("; ".join(said) + f"{instead}; {_ANYWAY.format(argument('force', True))}{others}")
    return [verdict_of(law, found, name) for law, found in zip(laws, checks, strict=True)]


_ANYWAY = "or run it anyway with {}"


def pair_verdicts(rigs: Sequence[Rig], name: str, *, force: bool) -> list[CheckVerdict]:
    """The same of two motors on one joint.

    Args:
        rigs: one rig, under each of the laws.
        name: the file's name, for messages.
        force: let laws that do not hold through, with a note.

    Raises:
        ParameterError: laws that do not hold; the message has the reasons and what to change.
    """
    laws = [pair_laws(rig)[0] for rig in rigs]
    checks: list[Check | str] = []
    for rig in rigs:
        try:
            checks.append(checked_pair(rig))
        except NoNumberError as error:
            checks.append(error.what)
    failing = [
        f"{law.name} fails the check on {name}: {found.reason}; {found.advice}"
        for law, found in zip(laws, checks, strict=True)
        if not isinstance(found, str) and not found.holds
    ]
    if failing and not force:
        raise ParameterError("; ".join([*failing, _ANYWAY.format(argument("force", True))]))
    return [verdict_of(law, found, name) for law, found in zip(laws, checks, strict=True)]


def _why(rig: Rig, law: Law, found: "Check") -> str:
    """The reason, and what to change."""
    from bowden.design.advice import advise

    with user_law.explained(law):
        advice = advise(ranges.judged(rig), law, found, bends=ranges.bends(rig), stroke=ranges.stroke(rig))
    return f"{found.reason}; {advice}"


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
