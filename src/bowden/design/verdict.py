"""What the check says of a rig's laws before they run; which law holds where another one does not, with what error.

Laws are checked one after the other, ours first, up to the first that holds: at most one check for each built-in law,
some half a minute where all of them are compiled anew. No clock ends it, so that the answer is the same on every
computer. On a suit, whose check takes tens of seconds, ours alone is looked at.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

from bowden.control import LAWS, Law
from bowden.core.caller import argument
from bowden.core.errors import BowdenError, ParameterError
from bowden.core.units import DEGREES
from bowden.design.advice import mending_gain
from bowden.design.check_rig import advice_for, check_laws, check_rig, judged
from bowden.design.rig_of_model import Chosen
from bowden.drawing.shown import listed, number
from bowden.rig.joints import RigJoint
from bowden.rig.rig import Rig
from bowden.sim import ranges
from bowden.sim.rig_runs import laws_of, run_of

if TYPE_CHECKING:
    from bowden.design.check_result import Check, VerdictName


OURS = "bowden"
"""The law that is looked at first, and that `bowden init` writes where it holds."""
LONGEST = 20.0
"""Of the run whose error is said [s]."""
_WORDS = {
    "holds": "holds",
    "little_margin": "has little margin",
    "limit_cycle": "swings at rest",
    "does_not_hold": "does not hold",
}


class OtherLaw(NamedTuple):
    """A law that holds."""

    law: str
    verdict: "VerdictName"
    rmse_deg: float
    """Over `seconds`, from rest."""
    seconds: float
    gains: Mapping[str, float] = MappingProxyType({})
    """Name → value of those that are not the rig's own: of `mended_law`."""

    def __str__(self) -> str:
        """The same in words.

        >>> str(OtherLaw("bowden", "holds", 0.0612, 20.0))
        'the law bowden holds here, with 0.0612° RMS over 20 s'
        """
        how = {"holds": "holds here", "little_margin": "stays bounded here, with little margin"}
        said = how.get(self.verdict, "stays bounded here, in a limit cycle")
        given = "".join(f" with {name} = {value:.3g}" for name, value in self.gains.items())
        return f"the law {self.law}{given} {said}, with {number(self.rmse_deg, '°')} RMS over {self.seconds:g} s"


def chosen_law(rig: Rig) -> Chosen:
    """The law to begin with on a rig, and why: ours where it holds, if need be with a gain of its choice changed.

    Else the first other law that holds.
    """
    ours = rig.with_law(OURS)
    law = ours.fitted()
    found = check_rig(ours, law)
    if isinstance(found, str) or found.verdict == "holds":
        why = "our own, which learns the cable while it runs; bowden check says that it holds here"
        if not isinstance(found, str) and found.cycle_confirmed and found.swing is not None:
            why += f", though at rest the joint swings by ±{found.swing * DEGREES:.2g}°"
        return Chosen(OURS, why)
    said = f"{_WORDS[found.verdict]} here: {found.reason}"
    gain = _mending(ours, law, found)
    if gain is not None and gain[0] in law.choices:
        why = f"our own, which learns the cable while it runs; with its usual {gain[0]} it {said}"
        return Chosen(OURS, why, dict([gain]))
    better = other_law(rig, [OURS])
    if better is None or (better.verdict != "holds" and found.verdict != "does_not_hold"):
        return Chosen(OURS, f"our own, though it {said}")
    return Chosen(better.law, f"since our own, {OURS}, {said}; {better}")


def mended_law(rig: Rig, law: Law) -> OtherLaw | None:
    """The rig's own law, with the gain that the check advises where it does not hold; None where that mends nothing.

    Args:
        rig: whose bench, bends and stroke count.
        law: with the rig's gains.
    """
    found = check_rig(rig, law)
    if isinstance(found, str):
        return None
    verdict, gains = found.verdict, {}
    if verdict != "holds":
        gain = _mending(rig, law, found)
        if gain is not None:
            verdict, gains = "holds", dict([gain])
    return None if verdict == "does_not_hold" else _with_error(rig, law.with_gains(**gains), verdict, gains)


def _mending(rig: Rig, law: Law, found: "Check") -> tuple[str, float] | None:
    """The gain that the check of a rig advises, and its value; None where no single one mends it."""
    return mending_gain(ranges.judged(rig), law, found, bends=ranges.bends(rig), stroke=ranges.stroke(rig))


def _with_error(rig: Rig, law: Law, verdict: "VerdictName", gains: Mapping[str, float]) -> OtherLaw | None:
    """What is said of a law, with its error; None where its run is unstable."""
    short = rig.replace(duration=min(rig.duration, LONGEST))
    rmse = run_of(short, law).metrics().rmse_deg
    return None if rmse is None else OtherLaw(law.name, verdict, rmse, short.duration, gains)


def other_law(rig: Rig, without: Collection[str]) -> OtherLaw | None:
    """The first law that holds, or else one that stays bounded; None where none does.

    Args:
        rig: whatever its own law is.
        without: names of laws that are known not to.
    """
    names = [OURS, *(name for name in LAWS if name != OURS and LAWS[name].choices)] if rig.worn is None else [OURS]
    names = [name for name in names if name not in without]
    bounded: OtherLaw | None = None
    for name in names:
        try:
            under = rig.with_law(name)
            law = under.fitted()
            checked = check_rig(under, law)
            if isinstance(checked, str) or checked.verdict == "does_not_hold":
                continue
            if checked.verdict != "holds" and bounded is not None:
                continue
            found = _with_error(under, law, checked.verdict, {})
        except BowdenError:  # a law that this rig cannot have is none to name
            continue
        if found is not None and found.verdict == "holds":
            return found
        bounded = bounded or found
    return bounded


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
