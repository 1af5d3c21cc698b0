"""How far the joint may be off its reference in a run, by what simulated runs of the same rig and law show."""

import numpy as np
from numpy.typing import NDArray

from bowden.control.law import Law
from bowden.design.trial import motion
from bowden.plants.plant import Plant
from bowden.records.trace import Trace
from bowden.rig import ranges
from bowden.rig.one_run import run_of
from bowden.rig.rig import Rig
from bowden.safety.limits import Limits
from bowden.sim.run import simulate
from bowden.sim.scenario import constant_bend

HALF_AGAIN = 1.5
"""Error that lasts in a real run over that of the simulated one, at most, of what `play` does not explain: it covers
150 wearers who are not the one that was simulated, and benches with other slopes, dead zones and servos than the rig
says (docs/background/safety.md)."""
_LONGEST, _MOVING = 60.0, 20.0
"""Of the rig's own run, and of the check's motion, of which the first strokes are the worst [s]."""
_HALVINGS = 12
"""Of the search for a bound: to 1/4000 of the largest error."""


def off_reference(rig: Rig, law: Law) -> float:
    """`off_reference` of [limits], or, where that is as `Limits` has it: `play` and 1.5 times the error that simulated
    runs show for `off_reference_time`, the rig's own run and the check's motion at both ends of its bends [rad].

    A law that runs away in one of them gets no room for it: the limit stays as it is. Nor is it more than the stroke: a
    joint that stands still is seen.

    Raises:
        ParameterError: a setting that cannot be.
        StreamError: a recording of EMG that cannot be used.
    """
    limits, given = rig.supervisor_limits, Limits().off_reference
    if not np.isclose(limits.off_reference, given, rtol=1e-3):
        return limits.off_reference
    plant, stroke, traces = ranges.judged(rig), ranges.stroke(rig), [run_of(_short(rig), law)]
    for bend in dict.fromkeys(ranges.bends(rig)):
        traces.append(_moved(plant, law, bend, stroke, rig.seed))
    if not all(trace.ended for trace in traces):
        return given
    shown = max(lasting_error(trace.error, rig.sample_time, limits.off_reference_time) for trace in traces)
    return min(limits.play + HALF_AGAIN * shown, max(given, stroke[1] - stroke[0]))


def _short(rig: Rig) -> Rig:
    return rig if rig.duration <= _LONGEST else rig.replace(duration=_LONGEST)


def _moved(plant: Plant, law: Law, bend: float, stroke: tuple[float, float], seed: int) -> Trace:
    begin = plant.resting_motor(stroke[0], bend)
    path = constant_bend(bend)
    return simulate(plant, law, motion(stroke, _MOVING), duration=_MOVING, bend=path, seed=seed, initial_motor=begin)


def lasting_error(error: NDArray[np.float64], dt: float, time: float) -> float:
    """The smallest bound beyond which |error| (n,) is never `time` [s] longer than it is within, as the supervisor
    counts it [rad].

    >>> round(lasting_error(np.repeat([0.0, 5.0, 1.0], [100, 50, 200]), 0.01, 1.0), 2)
    1.0
    >>> round(lasting_error(np.repeat([0.0, 5.0, 1.0], [100, 50, 200]), 0.01, 0.4), 2)
    5.0
    """
    size = np.abs(error)
    low, high = 0.0, float(size.max())
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        counted = np.cumsum(np.where(size > middle, dt, -dt))
        worst = np.max(counted - np.minimum(np.minimum.accumulate(counted), 0.0))
        low, high = (middle, high) if worst > time else (low, middle)
    return high
