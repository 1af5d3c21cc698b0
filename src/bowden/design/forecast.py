"""What simulated runs of a rig and its law show of a live one: how far the joint may be off its reference, and whether
the supervisor would end it."""

import math

import numpy as np
from numpy.typing import NDArray

from bowden.control.law import Law
from bowden.core.units import DEGREES
from bowden.design.objections import slower
from bowden.design.trial import motion
from bowden.models.cable.sheath_path import constant_bend
from bowden.plants.plant import Plant
from bowden.records.trace import Trace
from bowden.rig.rig import Rig
from bowden.safety.faults import Fault
from bowden.safety.limits import Limits
from bowden.sim import ranges
from bowden.sim.rig_runs import run_of
from bowden.sim.run import simulate

Array = NDArray[np.float64]

HALF_AGAIN = 1.5
"""Error that lasts in a real run over that of the simulated one, at most, of what `play` does not explain: it covers
150 wearers who are not the one that was simulated, and benches with other slopes, dead zones and servos than the rig
says (docs/background/hazards.md)."""
_LONGEST, _MOVING = 60.0, 20.0
"""Of the rig's own run, and of the check's motion, of which the first strokes are the worst [s]."""
_SLOWER = (1.1, 1.25, 1.5, 2.0, 3.0, 5.0)
"""How many times as slow a reference is tried."""
_TRIED_TO = 0.9
"""Share of the limits of speed within which such a one has to stay: a run is not the simulated one [–]."""
_BLENDED = 1.0
"""In which a live run leads the joint to its reference [s]."""
_INSIDE = 0.5
"""How much further inside its range a joint is to stay than it just came out of it [°]."""
_HALVINGS = 12
"""Of the search for a bound: to 1/4000 of the largest error."""


def own_run(rig: Rig, law: Law) -> Trace:
    """The simulated run of the rig's own reference, cut off where it is long, of which `off_reference` and `foreseen`
    speak."""
    return run_of(_short(rig), law)


def off_reference(rig: Rig, law: Law, own: Trace | None = None) -> float:
    """`off_reference` of [limits], or, where that is as `Limits` has it: `play` and 1.5 times the error that simulated
    runs show for `off_reference_time`, the rig's own run and the check's motion at both ends of its bends [rad].

    A law that runs away in one of them gets no room for it: the limit stays as it is. Nor is it more than the stroke: a
    joint that stands still is seen.

    Args:
        rig: of one motor.
        law: with its gains.
        own: its `own_run`, where there is one.

    Raises:
        ParameterError: a setting that cannot be.
        StreamError: a recording of EMG that cannot be used.
    """
    limits, given = rig.supervisor_limits, Limits().off_reference
    if not np.isclose(limits.off_reference, given, rtol=1e-3):
        return limits.off_reference
    plant, stroke, traces = ranges.judged(rig), ranges.stroke(rig), [own_run(rig, law) if own is None else own]
    for bend in dict.fromkeys(ranges.bends(rig)):
        traces.append(_moved(plant, law, bend, stroke, rig.seed))
    if not all(trace.ended for trace in traces):
        return given
    shown = max(lasting_error(trace.error, rig.sample_time, limits.off_reference_time) for trace in traces)
    return min(limits.play + HALF_AGAIN * shown, max(given, stroke[1] - stroke[0]))


def foreseen(rig: Rig, law: Law, trace: Trace | None = None) -> str:
    """For what the supervisor would end a run of the rig's reference, and what to do; empty where for nothing.

    Args:
        rig: of one motor that moves a joint alone.
        law: with its gains.
        trace: of a simulated run, where there is one.
    """
    if rig.emg_run is not None or rig.pushing is not None:
        return ""
    fault, after, beyond = _ending(rig, own_run(rig, law) if trace is None else trace)
    if fault is None:
        return ""
    do = fault.remedy
    if fault == Fault.JOINT_OVER_TRAVEL:
        inside = math.ceil(beyond * DEGREES + _INSIDE)
        do = f"keep the reference {inside}° further inside joint_low_deg and joint_high_deg"
    else:
        slow = (slower(rig.reference, times) for times in _SLOWER)
        for said, reference in (one for one in slow if one is not None):
            easier = rig.replace(reference=reference)
            if _ending(easier, own_run(easier, law), _TRIED_TO)[0] is None:
                do = f"write {said} into [reference]"
                break
    return f"simulated under {law.name} it ends after {after:.3g} s: {fault.meaning} ({fault.detector}): {do}"


def _ending(rig: Rig, trace: Trace, share: float = 1.0) -> tuple[Fault | None, float, float]:
    """The fault that ends a simulated run first, when [s], and by how much its limit is passed there; of limits of
    speed a share counts."""
    limits, dt = rig.supervisor_limits, rig.sample_time
    begun = 0 if rig.initial_motor is None else round(_BLENDED / dt)  # a live run leads the joint to its reference
    joint, motor, target = (trace[name][begun:] for name in ("joint_measured", "motor_measured", "command"))
    if not trace.ended or len(joint) < 2:
        return None, 0.0, 0.0
    bridged, margin = round(limits.bridge_time / dt), limits.motor_margin
    steps = [np.abs(target[k:] - target[: len(target) - k]) for k in range(1, min(bridged + 1, len(target) - 1) + 1)]
    step = np.min([one[: len(steps[-1])] for one in steps], axis=0)  # what comes back while it is bridged is no step
    beyond = {
        Fault.JOINT_OVER_TRAVEL: _outside(joint, limits.joint_low, limits.joint_high),
        Fault.JOINT_OVER_SPEED: np.abs(_speed(joint, limits.speed_filter, dt)) - share * limits.joint_speed,
        Fault.MOTOR_OVER_TRAVEL: _outside(motor, limits.motor_low - margin, limits.motor_high + margin),
        Fault.MOTOR_OVER_SPEED: np.abs(_speed(motor, limits.speed_filter, dt)) - share * limits.motor_speed,
        Fault.TARGET_STEP: step - share * limits.target_speed * dt,
    }
    firsts = {fault: int(np.argmax(by > 0.0)) for fault, by in beyond.items() if (by > 0.0).any()}
    if not firsts:
        return None, 0.0, 0.0
    fault = min(firsts, key=lambda one: firsts[one])
    return fault, (begun + firsts[fault]) * dt, float(beyond[fault].max())


def _outside(angle: Array, low: float, high: float) -> Array:
    return np.maximum(low - angle, angle - high)


def _speed(angle: Array, smoothing: float, dt: float) -> Array:
    """As the supervisor filters it (`models.plausible.follow`) [rad/s]."""
    from scipy.signal import lfilter  # a second, which other uses need not wait for

    change = np.diff(angle, prepend=angle[0])
    return np.asarray(lfilter([1.0 / (smoothing + dt)], [1.0, -smoothing / (smoothing + dt)], change))


def _short(rig: Rig) -> Rig:
    return rig if rig.duration <= _LONGEST else rig.replace(duration=_LONGEST)


def _moved(plant: Plant, law: Law, bend: float, stroke: tuple[float, float], seed: int) -> Trace:
    begin = plant.resting_motor(stroke[0], bend)
    path = constant_bend(bend)
    return simulate(plant, law, motion(stroke, _MOVING), duration=_MOVING, bend=path, seed=seed, initial_motor=begin)


def lasting_error(error: Array, dt: float, time: float) -> float:
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
