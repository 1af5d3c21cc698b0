"""`check` and `simulate` of two motors on one joint."""

from collections.abc import Sequence
from dataclasses import dataclass

from bowden.control import Law, user_law
from bowden.core.errors import ParameterError
from bowden.design.check import Check
from bowden.design.linearise import NoNumberError
from bowden.design.pair_check import check_pair, with_advice
from bowden.design.verdict import CheckVerdict, verdict_of
from bowden.face.in_turn import in_turn
from bowden.face.progress import Progress
from bowden.records.traces import Traces
from bowden.rig.pair_plant import agonist_of, pair_plant_of, pair_ranges, run_of_pair
from bowden.rig.rig import Rig


@dataclass(frozen=True)
class SimulatedPair:
    """What came of some laws on one joint."""

    runs: dict[str, Traces]
    """Name of the law → the trace of each axis by its name; laws of one name get a number."""
    checked: list[CheckVerdict]
    """What the check made of each law before."""
    notes: tuple[str, ...]
    """What the user should know."""
    interrupted: bool
    """Whether an interruption ended it before the last law was done."""

    @property
    def together(self) -> Traces:
        """All traces, by ``law-axis``."""
        return Traces({f"{law}-{axis}": trace for law, run in self.runs.items() for axis, trace in run.items()})


def pair_laws(rig: Rig) -> tuple[Law, Law]:
    """The laws of both axes with the gains that the rig gives them, the agonist's first."""
    one, other = (rig.axis(name).fitted() for name in rig.pair.names)
    return one, other


def checked_pair(rig: Rig) -> Check:
    """The check of both motors on their joint, with its advice."""
    pair, laws, (bends, stroke) = pair_plant_of(rig), pair_laws(rig), pair_ranges(rig)
    with user_law.explained(laws[0]):
        found = check_pair(pair, laws, bends=bends, stroke=stroke, seed=rig.axis(rig.pair.agonist).seed)
    return with_advice(found, pair)


def simulated_pair(
    rigs: Sequence[Rig],
    name: str,
    *,
    force: bool,
    whole: bool = False,
    progress: Progress = lambda what, share: None,
) -> SimulatedPair:
    """Check laws on one joint, and run them one after the other.

    An interruption before the first is done passes through.

    Args:
        rigs: one rig, under each of the laws.
        name: of the rig, for messages.
        force: run laws that do not hold, too.
        whole: see `Rig.offline`.
        progress: called with what is being done and the share of the work that is behind.

    Raises:
        ParameterError: laws that do not hold, or fail; the message has the reasons.
    """
    laws = [pair_laws(rig) for rig in rigs]
    progress(f"checking {', '.join(one.name for one, _ in laws)} (compiled at first)", 0.0)
    checks = [_checked(rig) for rig in rigs]
    failing = [
        f"{one.name} fails the check on {name}: {found.reason}; {found.advice}"
        for (one, _), found in zip(laws, checks, strict=True)
        if not isinstance(found, str) and not found.holds
    ]
    if failing and not force:
        raise ParameterError("; ".join(failing) + "; or run it anyway with --force")
    verdicts = [verdict_of(one, found, name) for (one, _), found in zip(laws, checks, strict=True)]
    notes = (*agonist_of(rigs[0]).notes, *(verdict.note for verdict in verdicts if verdict.note))
    firsts = [one for one, _ in laws]
    runs, interrupted = in_turn(firsts, lambda i: run_of_pair(rigs[i], laws[i], whole=whole), progress)
    return SimulatedPair(runs, verdicts, notes, interrupted)


def _checked(rig: Rig) -> "Check | str":
    """The check, or why a law of the user's own cannot be judged."""
    try:
        return checked_pair(rig)
    except NoNumberError as error:
        return error.what
