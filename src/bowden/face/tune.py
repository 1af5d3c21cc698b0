"""`tune`: gains with margins for a rig."""

import contextlib
from collections.abc import Callable, Collection, Iterator
from dataclasses import replace

from bowden.control import Law, user_law
from bowden.core import arguments
from bowden.design.processes import Mapper, two_workers
from bowden.design.tune import BrokenOff, Tuning
from bowden.design.tune import tune as search
from bowden.design.tune_runs import TuningRuns
from bowden.face import given
from bowden.face.given import GivenLaw, GivenRig
from bowden.rig import ranges
from bowden.rig.given_law import LawFile
from bowden.rig.given_plant import PlantFile
from bowden.rig.rig import Rig

Progress = Callable[[str, float], None]


def tune(
    rig: GivenRig,
    law: GivenLaw | None = None,
    *,
    preset: str | None = None,
    seed: int = 0,
    generations: int | None = None,
    progress: Progress = lambda what, share: None,
) -> Tuning:
    """Find gains that keep 6 dB and 45° over the sheath's bends, and follow best in the worst of nine runs.

    Args:
        rig: a `Rig`, or the path of a rig.toml (which is left as it is).
        law: a key of `LAWS`, ``FILE.py:NAME`` or a `Law`; the rig's by default.
        preset: a named set of gains of that law, to begin with.
        seed: of the search; with the same seed the result is the same.
        generations: of the search, whose time grows with them; 32 at 1 kHz.
        progress: called with what is being done and the share of the work that is behind.

    Returns:
        The tuning: ``rig``, the rig with the law and these gains; ``gains`` that changed; margins and errors.

    Raises:
        ParameterError: a rig, law or setting that cannot be used, or no gains that hold: with the nearest rig for which
            there are some.
        BrokenOff: interrupted, a KeyboardInterrupt that carries the best gains so far as its ``tuning``.

    >>> tuning = tune(Rig(), "adaptive", generations=2)
    >>> tuning.rig.gains == tuning.gains, tuning.found.verdict
    (True, 'holds')
    """
    whole = given.under(given.rig_of(rig, "tune"), law, preset, "tune")
    seed = arguments.whole(seed, "tune: seed", 0)
    if generations is not None:
        generations = arguments.whole(generations, "tune: generations", 1)
    arguments.function(progress, "tune: progress", arguments.PROGRESS)
    given.tell(whole.notes)
    with given.in_words_of_python(), workers_for(whole) as workers:
        return tuned(whole, whole.fitted(), seed=seed, generations=generations, workers=workers, progress=progress)


def tuned(
    rig: Rig,
    law: Law,
    *,
    seed: int,
    workers: Mapper,
    progress: Progress,
    generations: int | None = None,
    runs: TuningRuns | None = None,
    fixed: Collection[str] = (),
) -> Tuning:
    """The tuning of a law of a rig, which the tuning then has with these gains.

    Args:
        rig: whose bench, bends and stroke count.
        law: with the gains from which the search starts.
        seed: of the search.
        workers: how a function is mapped over many gains.
        progress: called with what is being done and the share of the work that is behind.
        generations: see `tune`.
        runs: by whose largest error gains are judged; nine on the rig where they are not given.
        fixed: gains that are left as they begin.
    """

    def with_rig(found: Tuning) -> Tuning:
        return replace(found, given=rig.replace(gains={**rig.gains, **found.gains}))

    try:
        with user_law.explained(law):
            found = search(
                rig.cabled,
                law,
                bends=bends_of(rig),
                stroke=ranges.stroke(rig),
                seed=seed,
                generations=generations,
                runs=runs,
                fixed=fixed,
                workers=workers,
                report=progress,
            )
    except BrokenOff as broken:
        raise BrokenOff(with_rig(broken.tuning)) from None
    return with_rig(found)


def bends_of(rig: Rig) -> tuple[float, float]:
    """Smallest and largest bend to tune for [rad]: a sheath that nobody moves in the rig is moved in use."""
    low, high = ranges.bends(rig)
    return (low, high) if high > low else (low, 2.0 * low)


@contextlib.contextmanager
def workers_for(rig: Rig) -> Iterator[Mapper]:
    """A `map` for the search: over two processes, where they can be handed the rig's law and plant."""
    law, plant = rig.law, rig.plant
    if isinstance(law, str | LawFile) and (plant is None or isinstance(plant, PlantFile)):
        with two_workers(law, plant) as workers:
            yield workers
    else:  # a law or a plant of this process alone
        yield map
