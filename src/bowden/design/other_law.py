"""Which law holds on a rig where another one does not, and with what error.

Laws are checked one after the other, ours first, up to the first that holds; so the time is that of a few checks. On a
suit, whose check takes tens of seconds, ours alone is looked at.
"""

from collections.abc import Collection
from typing import TYPE_CHECKING, NamedTuple

from bowden.control import LAWS
from bowden.core.errors import BowdenError
from bowden.core.shown import number
from bowden.design.check_rig import check_rig
from bowden.rig.one_run import run_of
from bowden.rig.rig import Rig

if TYPE_CHECKING:
    from bowden.design.check import VerdictName

OURS = "bowden"
"""The law that is looked at first, and that `bowden init` writes where it holds."""
LONGEST = 20.0
"""Of the run whose error is said [s]."""


class OtherLaw(NamedTuple):
    """A law that holds."""

    law: str
    verdict: "VerdictName"
    rmse_deg: float
    """Over `seconds`, from rest."""
    seconds: float

    def __str__(self) -> str:
        """The same in words.

        >>> str(OtherLaw("bowden", "holds", 0.0612, 20.0))
        'the law bowden holds here, with 0.0612° RMS over 20 s'
        """
        how = {"holds": "holds here", "little_margin": "stays bounded here, with little margin"}
        said = how.get(self.verdict, "stays bounded here, in a limit cycle")
        return f"the law {self.law} {said}, with {number(self.rmse_deg, '°')} RMS over {self.seconds:g} s"


def chosen_law(rig: Rig) -> tuple[str, str]:
    """The law to begin with on a rig, and why: ours where it holds, else the first that does."""
    ours = rig.with_law(OURS)
    found = check_rig(ours, ours.fitted())
    if isinstance(found, str) or found.verdict == "holds":
        return OURS, "our own, which learns the cable while it runs; bowden check says that it holds here"
    said = f"the law {OURS} {found.verdict}: {found.reason}"
    better = other_law(rig, [OURS])
    if better is None or (better.verdict != "holds" and found.verdict != "does_not_hold"):
        return OURS, f"though {said}"
    return better.law, f"since {said}; {better}"


def other_law(rig: Rig, without: Collection[str]) -> OtherLaw | None:
    """The first law that holds, or else one that stays bounded; None where none does.

    Args:
        rig: whatever its own law is.
        without: names of laws that are known not to.
    """
    names = [OURS, *(name for name in LAWS if name != OURS and LAWS[name].choices)]
    bounded: OtherLaw | None = None
    for name in names if rig.worn is None else [OURS]:
        if name in without:
            continue
        try:
            under = rig.with_law(name)
            law = under.fitted()
            checked = check_rig(under, law)
            if isinstance(checked, str) or checked.verdict == "does_not_hold":
                continue
            verdict = checked.verdict
            if verdict != "holds" and bounded is not None:
                continue
            short = under.replace(duration=min(under.duration, LONGEST))
            rmse = run_of(short, law).metrics().rmse_deg
        except BowdenError:  # a law that this rig cannot have is none to name
            continue
        if rmse is None:
            continue
        found = OtherLaw(name, verdict, rmse, short.duration)
        if verdict == "holds":
            return found
        bounded = found
    return bounded
