"""Many runs of the suit: figures of merit, and nothing else kept.

A run here is the run of `bowden.sim.suit.simulate_suit` to the last bit: the same compiled loop, into a block of memory
that the next run fills again. A minute of the suit takes a hundred times what a call takes, so that every run may have
one of its own.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from bowden.control.law import Law
from bowden.control.reference import Trajectory
from bowden.control.source import TABLE, Source
from bowden.core import metrics
from bowden.models.suit.load_cell import LoadCell
from bowden.plants.suit_parts import Suit
from bowden.sim.batch import LATE
from bowden.sim.faulty import Fault
from bowden.sim.many import SMALLEST_STROKE, Outcome
from bowden.sim.scenario import BendPath
from bowden.sim.suit_loop import RECORDED, SuitInputs, run_suit, state_fields, suit_inputs

Array = NDArray[np.float64]
T = TypeVar("T")

_ROWS = {name: row for row, name in enumerate(RECORDED)}
_TENSIONS = slice(_ROWS["flexor_tension"], _ROWS["extensor_motor_tension"] + 1)


class SuitCase(NamedTuple):
    """One suit on its wearer with all that happens to it, and the laws that are set against it with the same noise."""

    suit: Suit
    laws: tuple[Law, ...]
    reference: Trajectory
    bend: BendPath
    seed: int
    """As `bowden.sim.suit.simulate_suit` takes it."""
    initial_motor: float | None = None
    """Where the reference begins if it is not given [rad]."""
    fault: Fault | None = None
    sources: tuple[Source, ...] = ()
    """What makes the reference, one for each law; the table of `reference` itself where there are none."""
    cell: LoadCell | None = None
    """That the sources hear; the default one where it is not given."""


@dataclass(frozen=True)
class SuitRun:
    """A run that is over; its memory is the next one's as well."""

    inputs: SuitInputs
    reference: Array
    """Position and its derivatives as the source made them (3, n)."""
    record: Array
    """The columns of `RECORDED` (16, n); what comes after `lasted` is not of this run."""
    lasted: int
    """Cycles."""

    def __getitem__(self, name: str) -> Array:
        """A column of `RECORDED` (n,)."""
        column: Array = self.record[_ROWS[name]]
        return column

    @property
    def time(self) -> Array:
        """(n,) [s]"""
        return self.inputs.edges[:-1]

    @property
    def error(self) -> Array:
        """joint − reference, of the elbow itself (n,) [rad]."""
        return self["joint"] - self.reference[0]

    @property
    def ended(self) -> bool:
        """Whether it reached its end with finite numbers."""
        return self.lasted == len(self.time) and bool(np.isfinite(self["joint"]).all())


class SuitOutcome(NamedTuple):
    """What came of one run of the suit; NaN where a figure does not exist."""

    run: Outcome
    """Of the elbow itself: the reference's error, the motor's energy, whether it ran away."""
    shown_rmse: float
    """Of the elbow as its sensor shows it to the law, from rest [rad]."""
    largest_tension: float
    """Of both cables, at the arm and at the spool [N]."""
    largest_torque: float
    """Of the suit on the elbow, |interaction torque| [N·m]."""
    hottest_winding: float
    """[°C]"""


def simulate_suits(cases: Iterable[SuitCase], duration: float) -> Iterator[tuple[SuitOutcome, ...]]:
    """Run all laws of every case for `duration` [s]; an outcome for each law of each case, in their order.

    Raises:
        ParameterError: a duration or a part of a suit that cannot be.
    """
    return run_suits(cases, duration, outcome_of)


def run_suits(cases: Iterable[SuitCase], duration: float, look: Callable[[SuitRun], T]) -> Iterator[tuple[T, ...]]:
    """`simulate_suits` with what `look` makes of a run in place of its outcome."""
    block = np.empty((0, 0))
    for case in cases:
        inputs = suit_inputs(case.suit, case.reference, duration, case.bend, case.seed, case.initial_motor)
        cycles, found = len(inputs.edges) - 1, []
        for law, source in zip(case.laws, case.sources or (TABLE,) * len(case.laws), strict=True):
            rows = len(RECORDED) + sum(map(len, state_fields(law, source)))
            if block.shape[0] < rows or block.shape[1] != cycles:
                block = np.empty((rows, cycles))
            record, references = block[: len(RECORDED)], inputs.references.copy()
            lasted = run_suit(
                inputs, law, references, record, block[len(RECORDED) :], source=source, cell=case.cell, fault=case.fault
            )
            found.append(look(SuitRun(inputs, references, record, lasted)))
        yield tuple(found)


def outcome_of(run: SuitRun) -> SuitOutcome:
    """The figures of a run: those of `bowden.core.metrics`, and what the suit's own columns show."""
    nothing = float("nan")
    if not run.ended:
        return SuitOutcome(Outcome(float(run.lasted), 0.0, 0.0, *[nothing] * 8), *[nothing] * 4)
    time, error, (position, velocity, _) = run.time, run.error, run.reference
    late, peak = time >= LATE, float(np.max(np.abs(error)))
    # sums are NumPy's, not the dot product of a library whose order depends on its threads
    stroke, moved = max(float(np.ptp(position)), SMALLEST_STROKE), float(np.sum(velocity * velocity))
    motor = run.inputs.suit.motor
    powers = metrics.power(run["motor_velocity"], run["current"], motor.resistance, motor.torque_constant * motor.gear)
    commands = run["command"]
    mechanical, electrical = (metrics.energy(time, power) for power in powers)
    outcome = Outcome(
        cycles=float(run.lasted),
        ended=1.0,
        stable=float(peak <= stroke),
        rmse=metrics.rmse(error),
        rmse_after_10s=metrics.rmse(error[late]) if late.any() else nothing,
        peak=peak,
        lag=-float(np.sum(error * velocity)) / moved if moved > 0.0 else nothing,
        command_travel=float(np.abs(np.diff(commands, prepend=run.inputs.initial_motor)).sum()),
        largest_command=float(np.abs(commands).max()),
        mechanical_energy=mechanical,
        electrical_energy=electrical,
    )
    return SuitOutcome(
        run=outcome,
        shown_rmse=metrics.rmse(run["joint_measured"] - position),
        largest_tension=float(run.record[_TENSIONS].max()),
        largest_torque=float(np.abs(run["interaction_torque"]).max()),
        hottest_winding=float(run["winding_temperature"].max()),
    )
