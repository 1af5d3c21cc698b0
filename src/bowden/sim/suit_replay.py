"""A run of the suit once more in MuJoCo: the tensions of its trace pull MuJoCo's tendons; does the elbow move alike?

MuJoCo is given the trace's tensions, and as torques the wearer's muscles and what flesh and straps damp (the trace's
interaction torque without the tensions' share). How a tension turns the elbow, weight, inertia and the passive elbow
are MuJoCo's own.
"""

import math
from collections.abc import Mapping
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import LogError, ParameterError
from bowden.models.suit.arm import Arm
from bowden.models.suit.geometry import SuitGeometry, extensor_moment_arm, flexor_moment_arm
from bowden.records.trace import Trace
from bowden.sim.arm_check import ArmMotion
from bowden.sim.mujoco_arm import MujocoArm

Array = NDArray[np.float64]
Part = TypeVar("Part", SuitGeometry, Arm)

NEEDED = ("joint", "joint_velocity", "flexor_tension", "extensor_tension", "interaction_torque", "wearer_torque")
"""Columns of a suit's trace that a replay takes."""


def parts_of(trace: Trace) -> tuple[SuitGeometry, Arm]:
    """Geometry and arm of the suit that made a trace.

    Raises:
        LogError: the trace is not of a suit.
    """
    plant = trace.settings.get("plant")
    plant = plant if isinstance(plant, Mapping) else {}
    return _part(SuitGeometry, plant.get("geometry")), _part(Arm, plant.get("arm"))


def replay(trace: Trace, window: float = 2.0) -> ArmMotion:
    """The same run in MuJoCo.

    Under tensions that do not answer to it an elbow near the top runs off, as a pencil on its tip does, whichever model
    computes it. So MuJoCo starts again with the trace's angle and speed after each `window`. It has no stops: where the
    elbow is at them MuJoCo waits, and its angle is NaN.

    Args:
        trace: of `bowden.sim.run.simulate` on a suit.
        window: how long MuJoCo goes on by itself [s].

    Raises:
        BowdenError: MuJoCo is not installed.
        LogError: the trace is not of a suit, ran away, or is at the elbow's stops for more than half of its time.
        ParameterError: a window that is shorter than a sample.
    """
    geometry, arm = parts_of(trace)
    _check(trace)
    time, joint, velocity = trace.time, trace["joint"], trace["joint_velocity"]
    step = float(time[1] - time[0])
    if not step <= window < math.inf:
        raise ParameterError(f"replay: a window of {window:g} s", expected=f"{step:g} s or more")
    tensions = np.stack([trace["flexor_tension"], trace["extensor_tension"]])
    arms = np.array([(flexor_moment_arm(x, geometry), extensor_moment_arm(x, geometry)) for x in joint.tolist()]).T
    other = trace["wearer_torque"] + trace["interaction_torque"] - (tensions * arms).sum(axis=0)
    pulled = 0.5 * (tensions[:, 1:] + tensions[:, :-1])  # in the middle of each step
    torque = 0.5 * (other[1:] + other[:-1])

    model, theirs, length = MujocoArm(geometry, arm, step), np.full(len(time), np.nan), round(window / step)
    for first, last in _windows(trace, length):
        part = pulled[:, first:last]

        def given(now: float, part: Array = part) -> tuple[float, float]:
            k = int(now / step)
            return float(part[0, k]), float(part[1, k])

        start = (float(joint[first]), float(velocity[first]))
        theirs[first : last + 1] = model.move(start, given, last - first, torque[first:last])
    return ArmMotion("suit", time, joint, theirs)


def _windows(trace: Trace, length: int) -> list[tuple[int, int]]:
    """First and last sample of each stretch of at most `length` steps in which the elbow is off its stops."""
    low, high = trace.settings["plant"].get("stops", (-math.inf, math.inf))
    free = (trace["joint"] > low) & (trace["joint"] < high)
    if free.mean() < 0.5:
        raise LogError(
            "no replay of a run in which the elbow is mostly at its stops", expected="a run that stays between them"
        )
    edges = np.flatnonzero(np.diff(np.r_[False, free, False].astype(int)))
    return [
        (first, min(first + length, end - 1))
        for begin, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)
        for first in range(begin, end - 1, length)
    ]


def _check(trace: Trace) -> None:
    missing = [name for name in NEEDED if name not in trace.columns]
    if missing:
        raise LogError(f"no replay of a trace without {', '.join(missing)}", expected="a trace of the suit")
    if len(trace) < 2 or not all(np.isfinite(trace[name]).all() for name in NEEDED):
        raise LogError("no replay of a run that is not finite to its end", expected="a stable run of the suit")


def _part(kind: type[Part], given: Any) -> Part:
    try:
        return kind(**{name: float(value) for name, value in given.items()})
    except (AttributeError, TypeError, ValueError) as error:
        raise LogError(
            f"the trace does not say its suit's {kind.__name__}", expected="a trace of the suit", do="simulate a suit"
        ) from error
