"""A run of the suit once more in MuJoCo: the tensions of its trace pull MuJoCo's tendons, and the elbow should move alike.

MuJoCo is given the trace's tensions, and as torques the wearer's muscles and what flesh and straps damp (the trace's
interaction torque without the tensions' share). How a tension turns the elbow, weight, inertia and the passive elbow
are MuJoCo's own.
"""

import math
from collections.abc import Mapping
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import LogError
from bowden.core.trace import Trace
from bowden.models.arm import Arm
from bowden.models.geometry import SuitGeometry, extensor_moment_arm, flexor_moment_arm
from bowden.sim.arm_check import Motion
from bowden.sim.mujoco_arm import MujocoArm

Array = NDArray[np.float64]
Part = TypeVar("Part", SuitGeometry, Arm)

NEEDED = ("joint", "joint_velocity", "flexor_tension", "extensor_tension", "interaction_torque", "wearer_torque")
"""Columns of `bowden.sim.suit` that a replay takes."""


def parts_of(trace: Trace) -> tuple[SuitGeometry, Arm]:
    """Geometry and arm of the suit that made a trace.

    Raises:
        LogError: the trace is not of a suit.
    """
    plant = trace.settings.get("plant")
    plant = plant if isinstance(plant, Mapping) else {}
    return _part(SuitGeometry, plant.get("geometry")), _part(Arm, plant.get("arm"))


def replay(trace: Trace, substeps: int = 1) -> Motion:
    """The same run in MuJoCo, from the trace's first sample on.

    Args:
        trace: of `bowden.sim.suit.simulate_suit`.
        substeps: MuJoCo's steps in one sample.

    Raises:
        BowdenError: MuJoCo is not installed.
        LogError: the trace is not of a suit, or it ran away.
    """
    geometry, arm = parts_of(trace)
    missing = [name for name in NEEDED if name not in trace.columns]
    if missing or not all(np.isfinite(trace[name]).all() for name in NEEDED):
        raise LogError(
            f"no replay of a trace {'without ' + ', '.join(missing) if missing else 'that is not finite to its end'}",
            expected="a stable run of the suit",
        )
    joint, flexor, extensor = trace["joint"], trace["flexor_tension"], trace["extensor_tension"]
    arms = np.array([(flexor_moment_arm(x, geometry), extensor_moment_arm(x, geometry)) for x in joint.tolist()])
    given = flexor * arms[:, 0] + extensor * arms[:, 1]
    other = trace["wearer_torque"] + trace["interaction_torque"] - given
    time = trace.time
    step = float(time[1] - time[0]) / substeps
    count = (len(time) - 1) * substeps
    middles = time[0] + (np.arange(count) + 0.5) * step
    pulled = np.column_stack([np.interp(middles, time, part) for part in (flexor, extensor)]).clip(0.0)

    def tensions(now: float) -> tuple[float, float]:
        k = math.floor(now / step)
        return float(pulled[k, 0]), float(pulled[k, 1])

    model = MujocoArm(geometry, arm, step)
    start = (float(joint[0]), float(trace["joint_velocity"][0]))
    theirs = model.move(start, tensions, count, np.interp(middles, time, other))
    return Motion("run of the suit", time, joint, theirs[::substeps])


def _part(kind: type[Part], given: Any) -> Part:
    try:
        return kind(**{name: float(value) for name, value in given.items()})
    except (AttributeError, TypeError, ValueError) as error:
        raise LogError(
            f"the trace does not say its suit's {kind.__name__}", expected="a trace of the suit", do="simulate a suit"
        ) from error
