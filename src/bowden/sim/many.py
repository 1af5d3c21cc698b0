"""Many closed loops, one after the other: their figures of merit, and nothing else kept.

A run here is that of `bowden.sim.run.simulate`, by the same compiled loop, whose states are not recorded. Sums are
NumPy's, not the dot product of a library whose order depends on its threads.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.control import user_law
from bowden.control.law import Law
from bowden.control.source import TABLE, Source
from bowden.core.quantity import Quantity
from bowden.records import metrics
from bowden.records.metrics import LATE
from bowden.sim.run import Case, Ready

Array = NDArray[np.float64]


class Outcome(NamedTuple):
    """What came of one run; NaN where a figure does not exist. The last four are of a suit."""

    cycles: Annotated[float, Quantity("how many control cycles it lasted")]
    ended: Annotated[
        float, Quantity("1 where it reached its end: no command beyond 1000 rad, nothing that is no number; else 0")
    ]
    stable: Annotated[
        float,
        Quantity("1 where, too, the joint was never further from the reference than its whole stroke (5° at least)"),
    ]
    rmse: Annotated[float, Quantity("root of the mean square of joint − reference, from rest", "rad")]
    rmse_after_10s: Annotated[float, Quantity("the same without the first ten seconds", "rad")]
    peak: Annotated[float, Quantity("largest |joint − reference|", "rad")]
    lag: Annotated[
        float,
        Quantity(
            "−∫e·v dt / ∫v² dt with the reference's velocity v: the delay that explains most of a small error", "s"
        ),
    ]
    command_travel: Annotated[float, Quantity("total variation of the command", "rad")]
    largest_command: Annotated[float, Quantity("largest |command|", "rad")]
    mechanical_energy: Annotated[float, Quantity("∫Pm dt of the motor, Eq. 18", "J")]
    electrical_energy: Annotated[float, Quantity("∫Pe dt of the motor, Eq. 18", "J")]
    shown_rmse: Annotated[
        float, Quantity("RMSE from rest of the elbow as its sensor shows it to the law; `rmse` is the elbow's", "rad")
    ] = math.nan
    largest_tension: Annotated[float, Quantity("of both cables, at the arm and at the spool", "N")] = math.nan
    largest_torque: Annotated[float, Quantity("of the suit on the elbow, as a size", "N·m")] = math.nan
    hottest_winding: Annotated[float, Quantity("of the motor", "°C")] = math.nan


_TENSIONS = ("flexor_tension", "flexor_motor_tension", "extensor_tension", "extensor_motor_tension")


class _Run(NamedTuple):
    """What a run recorded, as far as it lasted; the next one writes over it."""

    lasted: int
    """[cycles]"""
    rows: dict[str, Array]
    """Name → values (n,)."""
    references: Array
    """(3, n)"""


def simulate_many(cases: Iterable[Case], duration: float) -> Iterator[tuple[Outcome, ...]]:
    """Run all laws of every case for `duration` [s]; an outcome for each law of each case, in their order.

    Cases are taken from the iterable as they are needed.

    Raises:
        ParameterError: a duration or setting that cannot be, or a user's own plant or law that gives no number.
    """
    for ready, runs in _runs(cases, duration):
        yield tuple(_outcome(ready, run) for run in runs)


def _runs(cases: Iterable[Case], duration: float) -> Iterator[tuple[Ready, Iterator[_Run]]]:
    ready: Ready | None = None
    for case in cases:
        ready = Ready(case, duration, ready)
        yield ready, (_checked(ready, law, case.source_of(i)) for i, law in enumerate(case.laws))


def _checked(ready: Ready, law: Law, source: Source) -> _Run:
    """A run in which a plant or a law of the user's own gave numbers."""
    run = _run(ready, law, source)
    if (ready.dynamics.file or user_law.is_own(law)) and not _ended(run):
        ready.trace(law, source)  # refuses what was none
    return run


def _run(ready: Ready, law: Law, source: Source, allowed: float = np.inf) -> _Run:
    block = ready.scratch()
    block[:3] = ready.inputs.references
    lasted, rows = ready.run(law, source, block[:3], block[3:], allowed)
    return _Run(lasted, rows, block[:3])


def _ended(run: _Run) -> bool:
    """True if a run reached its end with finite numbers."""
    return run.lasted == run.references.shape[1] and bool(np.isfinite(run.rows["joint"] - run.references[0]).all())


def _outcome(ready: Ready, run: _Run) -> Outcome:
    if not _ended(run):
        return Outcome(float(run.lasted), 0.0, 0.0, *[math.nan] * 8)
    time, (reference, velocity, _), rows, motor = ready.inputs.time, run.references, run.rows, ready.case.plant.motor
    error, commands, late = rows["joint"] - reference, rows["command"], time >= LATE
    moved = float(np.sum(velocity * velocity))
    powers = metrics.power(
        rows["motor_velocity"], rows["current"], motor.resistance, motor.torque_constant * motor.gear
    )
    mechanical, electrical = (metrics.energy(time, power) for power in powers)
    return Outcome(
        cycles=float(run.lasted),
        ended=1.0,
        stable=float(metrics.is_stable(reference, rows["joint"])),
        rmse=metrics.rmse(error),
        rmse_after_10s=metrics.rmse(error[late]) if late.any() else math.nan,
        peak=float(np.max(np.abs(error))),
        lag=-float(np.sum(error * velocity)) / moved if moved > 0.0 else math.nan,
        command_travel=float(np.abs(np.diff(commands, prepend=ready.initial)).sum()),
        largest_command=float(np.abs(commands).max()),
        mechanical_energy=mechanical,
        electrical_energy=electrical,
        **_of_suit(run),
    )


def _of_suit(run: _Run) -> dict[str, float]:
    rows = run.rows
    if "interaction_torque" not in rows:
        return {}
    return {
        "shown_rmse": metrics.rmse(rows["joint_measured"] - run.references[0]),
        "largest_tension": float(max(rows[name].max() for name in _TENSIONS)),
        "largest_torque": float(np.abs(rows["interaction_torque"]).max()),
        "hottest_winding": float(rows["winding_temperature"].max()),
    }


_SURELY = 1.0 + 1e-9
"""A sum of squares that is larger by this share is larger in whatever order it is taken."""


class Course:
    """Runs on which one set of gains after the other is tried: what they are given over time is made once.

    Args:
        cases: each without a law.
        duration: of each run [s].

    Raises:
        ParameterError: a duration or setting that cannot be.
    """

    def __init__(self, cases: Sequence[Case], duration: float) -> None:
        self._ready: list[Ready] = []
        for case in cases:
            self._ready.append(Ready(case, duration, self._ready[-1] if self._ready else None))
        self.spans = tuple(float(np.std(ready.inputs.references[0])) for ready in self._ready)
        """RMSE of each run for a joint that rests in the middle of what is asked of it [rad]."""

    def errors(
        self, laws: Sequence[Law], order: Sequence[int] = (), limit: float = np.inf, *, at_once: bool = True
    ) -> tuple[float, ...]:
        """RMSE of every run from rest [rad], as far as the limit asks for it.

        Args:
            laws: for each run its own.
            order: of the runs; as they stand if it is empty.
            limit: an error above it need not be known, and what comes after it is not run [rad].
            at_once: whether a run, too, is given up as soon as its error must be larger.

        Returns:
            For each run its RMSE; infinite where it did not end, or was given up, and 0 where it was not run.
        """
        found = [0.0] * len(self._ready)
        for i in order or range(len(found)):
            ready = self._ready[i]
            allowed = limit * limit * len(ready.inputs.time) * _SURELY if at_once else np.inf
            run = _run(ready, laws[i], TABLE, allowed)
            found[i] = metrics.rmse(run.rows["joint"] - run.references[0]) if _ended(run) else np.inf
            if found[i] > limit:
                break
        return tuple(found)
