"""`simulate`: laws on a rig, checked before they run."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, overload

from bowden.control import Law
from bowden.core import arguments
from bowden.design.verdict import CheckVerdict, verdicts
from bowden.face import given
from bowden.face.given import GivenLaw, GivenRig
from bowden.face.in_turn import in_turn
from bowden.face.pair import simulated_pair
from bowden.face.progress import Progress
from bowden.records.trace import Trace
from bowden.records.traces import Traces
from bowden.rig.objections import refusals
from bowden.rig.one_run import run_of
from bowden.rig.rig import Rig


@dataclass(frozen=True)
class Simulated:
    """What came of some laws on one rig."""

    traces: Traces
    """Name of the law → its run; laws of one name get a number."""
    checked: list[CheckVerdict]
    """What the check made of each law before."""
    notes: tuple[str, ...]
    """What the user should know."""
    interrupted: bool
    """Whether an interruption ended it before the last law was done."""


def simulated(
    rig: Rig, laws: Sequence[Law], name: str, *, force: bool, progress: Progress = lambda what, share: None
) -> Simulated:
    """Check every law on a rig, and run them one after the other.

    An interruption before the first is done passes through.

    Args:
        rig: as it is to be simulated.
        laws: with the gains that the rig gives them.
        name: of the rig, for messages.
        force: run laws that do not hold, too.
        progress: called with what is being done and the share of the work that is behind.

    Raises:
        ParameterError: laws that do not hold, or fail; the message has the reasons and what to change.
    """
    progress(f"checking {', '.join(law.name for law in laws)} (compiled at first)", 0.0)
    checked = verdicts(rig, laws, name, force=force)
    pushing = rig.pushing.notes(list(laws), force=force) if rig.pushing else []
    notes = (*rig.notes, *refusals(rig), *pushing, *(verdict.note for verdict in checked if verdict.note))
    found, interrupted = in_turn(laws, lambda i: run_of(rig, laws[i]), progress)
    return Simulated(Traces(found), checked, notes, interrupted)


@overload
def simulate(  # type: ignore[overload-overlap]
    rig: GivenRig,
    laws: GivenLaw | None = None,
    *,
    preset: str | None = None,
    duration: float | None = None,
    seed: int | None = None,
    force: bool = False,
) -> Trace: ...


@overload
def simulate(
    rig: GivenRig,
    laws: Sequence[GivenLaw],
    *,
    preset: str | None = None,
    duration: float | None = None,
    seed: int | None = None,
    force: bool = False,
) -> Traces: ...


def simulate(
    rig: GivenRig,
    laws: Any = None,
    *,
    preset: str | None = None,
    duration: float | None = None,
    seed: int | None = None,
    force: bool = False,
) -> Trace | Traces:
    """Simulate a law, or several laws side by side, on a rig.

    Every law is checked first, as `bowden.check` does it. A law that does not hold is refused.

    Args:
        rig: a `Rig`, or the path of a rig.toml; with two motors on one joint (docs/pair.md), both are simulated as one.
        laws: a key of `LAWS`, ``FILE.py:NAME`` or a `Law`; or a list of these. The rig's law by default.
        preset: a named set of gains, for every law of this run.
        duration: in place of the rig's [s].
        seed: of the encoders' noise and of a random bend, in place of the rig's.
        force: run laws that do not hold, too.

    Returns:
        The trace. For a list of laws: a dictionary, name of the law → trace, which shows and draws all of them. Of two
        motors on one joint it is a dictionary for one law too, name of the axis → trace, and for a list of laws
        ``law-axis`` → trace.

    Raises:
        ParameterError: a rig, law or setting that cannot be used, or a law that does not hold.

    >>> from bowden.rig.rig import Rig
    >>> trace = simulate(Rig(duration=5.0), "uncompensated")
    >>> trace.metrics().peak_deg > 1.0
    True
    >>> list(simulate(Rig(duration=5.0), ["uncompensated", "adaptive"]))
    ['uncompensated', 'adaptive']
    """
    whole = given.rig_of(rig, "simulate", pair=True)
    force = arguments.flag(force, "simulate: force")
    changes = {"duration": duration, "seed": seed}
    whole = whole.replace(**{name: value for name, value in changes.items() if value is not None})
    listed = given.several(laws)
    if whole.pair.there:
        return _of_pair(whole, laws, listed, preset, force=force, entire=duration is not None)
    with given.in_words_of_python():
        fitted = [given.under(whole, law, preset, "simulate").fitted() for law in (listed or [laws])]
        found = simulated(whole.offline(whole=duration is not None), fitted, given.name_of(whole), force=force)
    given.tell(found.notes)
    if found.interrupted:
        raise KeyboardInterrupt
    return found.traces if listed is not None else next(iter(found.traces.values()))


def _of_pair(
    rig: Rig, law: Any, listed: Sequence[Any] | None, preset: str | None, *, force: bool, entire: bool
) -> Traces:
    """`simulate` of two motors on one joint."""
    with given.in_words_of_python():
        rigs = [given.under(rig, one, preset, "simulate") for one in (listed or [law])]
        found = simulated_pair(rigs, given.name_of(rig), force=force, whole=entire)
    given.tell(found.notes)
    if found.interrupted:
        raise KeyboardInterrupt
    return found.together if listed is not None else next(iter(found.runs.values()))
