"""The joint along a recorded motion of the motor, by each model that is fitted to a log.

The motion begins where the log did: `initial_h` and `initial_lag` are the state at its first sample.
"""

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import ParameterError
from bowden.models.cable import scheduled as scheduling
from bowden.models.cable.bouc_wen import BoucWen
from bowden.models.cable.bouc_wen_sensitivity import hysteresis
from bowden.models.cable.generalised_play import Branches, joint_angle, with_curve
from bowden.models.cable.prandtl_ishlinskii import plays

Array = NDArray[np.float64]
Parameters = Mapping[str, float]


def line(given: Parameters, motor: Array) -> Array:
    """joint = slope·motor + offset."""
    return given["slope"] * motor + given["offset"]


def play(given: Parameters, motor: Array) -> Array:
    """joint = slope·z + offset."""
    before = motor[0] + given["initial_lag"]  # a play that was pushed from there stands at z
    slots = plays(np.concatenate([[before], motor]), np.array([given["half_width"]]))
    return np.asarray(given["slope"] * slots[1:, 0] + given["offset"])


def prandtl_ishlinskii(given: Parameters, motor: Array) -> Array:
    """joint = slope·motor + Σ weight_i·z_i + offset."""
    count = sum(name.startswith("weight_") for name in given)
    widths = np.array([given[f"half_width_{i}"] for i in range(1, count + 1)])
    weights = np.array([given[f"weight_{i}"] for i in range(1, count + 1)])
    slots = slots_along(motor, widths, given["initial_lag"])
    return np.asarray(given["slope"] * motor + slots @ weights + given["offset"])


def slots_along(motor: Array, widths: Array, lag: float) -> Array:
    """zᵢ (n, k), each slot pushed to the first sample from motor[0] + `lag`."""
    return plays(np.concatenate([[motor[0] + lag], motor]), widths)[1:]


def bouc_wen(given: Parameters, motor: Array) -> Array:
    """joint = slope·motor + offset + Σ static_k·T_k(u) + (hysteresis_gain + Σ hysteresis_gain_k·T_k(u))·h."""
    h = hysteresis(motor, float(given["initial_h"]), cable_of(given))
    joint = given["slope"] * motor + given["offset"] + given["hysteresis_gain"] * h
    static, heights = degrees_of(given)
    if static > 1 or heights > 0:
        u = (motor - given["static_centre"]) / given["static_half_range"]
        for k in range(2, static + 1):
            joint = joint + given[f"static_{k}"] * chebyshev(u, k)
        for k in range(1, heights + 1):
            joint = joint + given[f"hysteresis_gain_{k}"] * chebyshev(np.clip(u, -1.0, 1.0), k) * h
    return np.asarray(joint)


def cable_of(given: Parameters) -> BoucWen:
    """The Bouc–Wen cable for simulation and control; static terms, where there are any, are left out."""
    return BoucWen(**{name: float(given[name]) for name in BoucWen._fields})


def degrees_of(given: Parameters) -> tuple[int, int]:
    """Highest degree of the static terms (1: none) and of the loop's height (0: none)."""
    static = max((int(name[7:]) for name in given if name.startswith("static_") and name[7:].isdigit()), default=1)
    return static, sum(name.startswith("hysteresis_gain_") for name in given)


def chebyshev(u: Array, degree: int) -> Array:
    """T_k(u) inside ±1, its tangent outside."""
    inside = np.clip(u, -1.0, 1.0)
    tangent = degree**2 * np.sign(inside) ** (degree + 1)  # T_k'(±1)
    return np.asarray(np.cos(degree * np.arccos(inside)) + tangent * (u - inside))


def generalised_play(given: Parameters, motor: Array) -> Array:
    """Plays between two branches: `bowden.models.cable.generalised_play`."""
    return joint_angle(motor, given["initial_lag"], branches_of(given))


def whole_slope(parameters: Parameters) -> float:
    """Joint motion per motor motion with all plays taken up, below 0 of a model that runs backwards [rad/rad].

    Args:
        parameters: of an identified model, by name; one of `DISTRIBUTED` has no slope among them.
    """
    return parameters["slope"] + sum(value for name, value in parameters.items() if name.startswith("weight_"))


def branches_of(given: Parameters) -> Branches:
    """The generalised play of reported parameters, by name; as it was recorded, not turned round.

    Raises:
        KeyError: one is missing.
    """
    bends, gaps, reaches, shares = (
        np.array(numbered(given, name), dtype=np.float64) for name in ("bend_", "gap_", "reach_", "share_")
    )
    ends = float(given["first_node"]), float(given["last_node"])
    return with_curve(Branches(float(given["slope"]), bends, gaps, *ends, reaches, shares, float(given["offset"]), 0.0))


def numbered(given: Parameters, prefix: str, first: int = 1) -> list[float]:
    """The values of prefix1, prefix2, … in this order."""
    count = sum(key.startswith(prefix) and key.removeprefix(prefix).isdigit() for key in given)
    return [given[f"{prefix}{k}"] for k in range(first, first + count)]


PREDICTED: Mapping[str, Callable[[Parameters, Array], Array]] = {
    "line": line,
    "play": play,
    "bouc_wen": bouc_wen,
    "bouc_wen_static": bouc_wen,
    "prandtl_ishlinskii": prandtl_ishlinskii,
    "generalised_play": generalised_play,
}
"""Every model's name that is fitted to a log, from the simplest on → the joint along a motion (n,) → (n,) [rad]."""

NAMES = tuple(PREDICTED)
"""Every family's name that is fitted to a log, from the simplest on."""
SCHEDULED = "scheduled"
"""The model of several logs, whose loop changes with the load or the bend (`bowden.models.cable.scheduled`)."""
DISTRIBUTED = ("sliding", "lumped_coulomb", "lumped_dahl")
"""Models of a tendon with friction all along its sheath (`bowden.plants.friction_cables`); no log is fitted to them."""
KNOWN = (*NAMES, *DISTRIBUTED, SCHEDULED)
"""Every model that a cable may have."""


def joint_along(name: str, parameters: Parameters, motor: Array) -> Array:
    """Joint angle along a recorded motion of the motor, by a model that is fitted to logs: (n,) [rad] → (n,) [rad].

    Raises:
        ParameterError: an unknown model, or a parameter that is missing.
    """
    if name == SCHEDULED:
        cable, values = scheduled_of(parameters)
        return scheduling.joint_angle(np.ascontiguousarray(motor, dtype=np.float64), cable, values)
    if name not in PREDICTED:
        raise ParameterError(f"there is no cable model {name!r}", expected=f"one of {', '.join(KNOWN)}")
    try:
        return PREDICTED[name](parameters, np.ascontiguousarray(motor, dtype=np.float64))
    except KeyError as error:
        raise ParameterError(f"cable model {name!r} has no parameter {error.args[0]!r}") from None


def scheduled_of(parameters: Parameters) -> tuple[scheduling.ScheduledCable, tuple[float, ...]]:
    """A scheduled cable, and where it is looked at."""
    try:
        return scheduling.cable_of(parameters)
    except KeyError as error:
        raise ParameterError(f"cable model {SCHEDULED!r} has no parameter {error.args[0]!r}") from None
