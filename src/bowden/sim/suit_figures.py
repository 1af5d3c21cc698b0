"""Figures of a suit's run: those of any run, and what wears the suit and its wearer out."""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from bowden.records import metrics
from bowden.records.metrics import LATE
from bowden.records.trace import Trace
from bowden.sim.many import Case, Outcome

_TENSIONS = ("flexor_tension", "flexor_motor_tension", "extensor_tension", "extensor_motor_tension")


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


def simulate_suits(cases: Iterable[Case], duration: float) -> Iterator[tuple[SuitOutcome, ...]]:
    """Run all laws of every case for `duration` [s]; an outcome for each law of each case, in their order.

    Each run is a trace of its own: a minute of the suit takes a hundred times what its trace does.

    Raises:
        ParameterError: a duration or a part of a suit that cannot be.
    """
    for case in cases:
        yield tuple(suit_outcome(case.trace(i, duration)) for i in range(len(case.laws)))


def suit_outcome(trace: Trace) -> SuitOutcome:
    """The figures of a suit's trace."""
    run, nothing = outcome_of(trace), float("nan")
    if not run.ended:
        return SuitOutcome(run, *[nothing] * 4)
    return SuitOutcome(
        run=run,
        shown_rmse=metrics.rmse(trace["joint_measured"] - trace["reference"]),
        largest_tension=float(max(trace[name].max() for name in _TENSIONS)),
        largest_torque=float(np.abs(trace["interaction_torque"]).max()),
        hottest_winding=float(trace["winding_temperature"].max()),
    )


def outcome_of(trace: Trace) -> Outcome:
    """The figures of a batch's run, of a trace."""
    lasted, nothing = int(np.isfinite(trace["joint"]).sum()), float("nan")
    if not trace.ended:
        return Outcome(float(lasted), 0.0, 0.0, *[nothing] * 8)
    time, error, velocity, commands = trace.time, trace.error, trace["reference_velocity"], trace["command"]
    late, moved = time >= LATE, float(np.sum(velocity * velocity))
    mechanical, electrical = (metrics.energy(time, power) for power in trace.power())
    # sums are NumPy's, not the dot product of a library whose order depends on its threads
    return Outcome(
        cycles=float(lasted),
        ended=1.0,
        stable=float(trace.stable),
        rmse=metrics.rmse(error),
        rmse_after_10s=metrics.rmse(error[late]) if late.any() else nothing,
        peak=float(np.max(np.abs(error))),
        lag=-float(np.sum(error * velocity)) / moved if moved > 0.0 else nothing,
        command_travel=float(np.abs(np.diff(commands, prepend=trace.settings["initial_motor"])).sum()),
        largest_command=float(np.abs(commands).max()),
        mechanical_energy=mechanical,
        electrical_energy=electrical,
    )
