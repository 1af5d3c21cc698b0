"""Plays between two branches that are scheduled by the cable's load, by its bend, or by both.

It is the generalised play of `bowden.models.cable.generalised_play`, whose mean branch a and half gap b go straight
from knot to knot. With every scheduling variable s scaled to 0…1 over the range in which it was seen, each ordinate is

    a(s) = a₀ + Σ over the variables of a₁·s + a₂·s² + …

and likewise b, which is nowhere below zero. Beyond 0…1 a power goes on along its tangent, and no variable counts
further than its range once more. Reaches and shares of the plays are the same at all loads: a slot is as much wider as
the gap is. Where both branches go the cable's way the joint never goes against the motor.

The elastic stretch of the cable under its tension T, T·L/(EA), makes a depend on the load, and friction μ·N, which is
proportional to the tension by the capstan's law, makes b grow with it. Source: the paper's Section 3.2 for the bend;
Kaneko, Wada, Maekawa and Tanie, ICRA 1991, 1252, for the load.
"""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.kernel import kernel, program
from bowden.models.cable.bouc_wen import BoucWen, saturation
from bowden.models.cable.generalised_play import STEEPEST, Branches
from bowden.models.cable.generalised_play import joint_angle as between_branches

Array = NDArray[np.float64]

VARIABLES = ("load", "bend")
"""What a cable may be scheduled by, in the order in which `ScheduledCable` has them."""


class ScheduledCable(NamedTuple):
    """Parameters of a scheduled cable with K knots, k plays and V variables; M = 1 + the sum of the degrees."""

    first: float
    """Motor angle of the first knot [rad]."""
    step: float
    """Between two knots [rad]."""
    middle: Array
    """Ordinates of a: of the base, then of each variable's powers (M, K) [rad]."""
    height: Array
    """Ordinates of b, likewise (M, K) [rad]."""
    reaches: Array
    """Half the slot of each play over b (k,) [–]."""
    shares: Array
    """Of the joint's motion that each play makes (k,) [–]."""
    low: Array
    """Least seen value of each variable (V,); its own unit."""
    high: Array
    """Largest seen value of each variable (V,); its own unit."""
    degree: NDArray[np.int64]
    """Highest power of each variable, from 1 on (V,)."""


@kernel
def fill_powers(values: Array, cable: ScheduledCable, found: Array) -> None:
    """The factors of the M rows of ordinates at `values` (V,) of the variables, into `found` (M,)."""
    found[0] = 1.0
    row = 1
    for v in range(values.size):
        s = (values[v] - cable.low[v]) / (cable.high[v] - cable.low[v])
        s = max(-1.0, min(2.0, s))
        inside = max(0.0, min(1.0, s))
        power = 1.0
        for m in range(1, cable.degree[v] + 1):
            found[row] = power * (inside + m * (s - inside))
            power *= inside
            row += 1


def powers(values: Sequence[float], cable: ScheduledCable) -> Array:
    """`fill_powers`: the factors of the ordinates (M,)."""
    found = np.empty(1 + int(cable.degree.sum()))
    fill_powers(np.array(values, dtype=np.float64), cable, found)
    return found


@kernel
def fill_branches(weights: Array, cable: ScheduledCable, bends: Array, gaps: Array, line: Array) -> None:
    """`branches_at` where the rows of ordinates have these `weights` (M,); `line` is slope, offset and curve (3,)."""
    count, span = bends.size, cable.step * (bends.size - 1)
    bends[:], gaps[:] = 0.0, 0.0
    for m in range(weights.size):
        for k in range(count):
            bends[k] += weights[m] * cable.middle[m, k]
            gaps[k] += weights[m] * cable.height[m, k]
    middle, last = 0.5 * (count - 1), count - 1.0
    rise, mean, curve = 0.0, 0.0, 0.0
    for k in range(count):
        rise += (k - middle) * bends[k]
        mean += bends[k] / count
        gaps[k] = max(gaps[k], 0.0)
    line[0] = 12.0 * rise / (count * (count * count - 1.0)) / cable.step
    line[1] = mean - line[0] * (cable.first + middle * cable.step)
    for k in range(count):
        bends[k] -= line[0] * (cable.first + k * cable.step) + line[1]
        curve += ((k - middle) ** 2 - (count * count - 1.0) / 12.0) * bends[k]
    curve *= last * last / span**2 * 180.0 / (count * (count * count - 1.0) * (count * count - 4.0))
    most = STEEPEST * abs(line[0]) / span
    line[2] = max(-most, min(most, curve))


@kernel
def branches_of(cable: ScheduledCable, bends: Array, gaps: Array, line: Array) -> Branches:
    """What `fill_branches` has filled."""
    high = cable.first + cable.step * (bends.size - 1)
    return Branches(line[0], bends, gaps, cable.first, high, cable.reaches, cable.shares, line[1], line[2])


def branches_at(values: Sequence[float], cable: ScheduledCable) -> Branches:
    """The generalised play at `values` (V,) of the variables."""
    (bends, gaps), line = np.empty((2, cable.middle.shape[1])), np.empty(3)
    program(fill_branches)(powers(values, cable), cable, bends, gaps, line)
    return branches_of(cable, bends, gaps, line)


def joint_angle(motor: Array, cable: ScheduledCable, values: Sequence[float]) -> Array:
    """Joint angle along a recorded motion at fixed `values` (V,) of the variables (n,) [rad], every play centred."""
    return between_branches(motor, 0.0, branches_at(values, cable))


def turned(cable: ScheduledCable) -> ScheduledCable:
    """The same cable with its motor counted the other way."""
    last = cable.first + (cable.middle.shape[1] - 1) * cable.step
    return cable._replace(
        first=-last,
        middle=np.ascontiguousarray(cable.middle[:, ::-1]),
        height=np.ascontiguousarray(cable.height[:, ::-1]),
    )


def line_of(cable: ScheduledCable, values: Sequence[float]) -> tuple[float, float, float]:
    """Slope [rad/rad] and offset [rad] of the line through a's knots, and the mean of b [rad], at `values` (V,)."""
    found = branches_at(values, cable)
    return found.slope, found.offset, float(found.gaps.mean())


def bouc_wen_at(cable: ScheduledCable, values: Sequence[float], like: BoucWen) -> BoucWen:
    """The plain Bouc–Wen cable with the slope, the offset and the dead zone at `values` (V,).

    Its loop is that of `like`, drawn out along the motor as its dead zone is longer: |αh|·h* is the mean of b, and
    ρ changes as one over the dead zone.
    """
    slope, offset, height = line_of(cable, values)
    height = -math.copysign(height, slope)
    gain = height / float(saturation(like))
    wider = abs(gain / slope) / abs(like.hysteresis_gain / like.slope)
    found = like._replace(slope=slope, offset=offset, rate=like.rate / wider)
    return found._replace(hysteresis_gain=height / float(saturation(found)))


def cable_of(parameters: Mapping[str, float]) -> tuple[ScheduledCable, tuple[float, ...]]:
    """A cable and the values of its variables from parameters by name; see `parameters_of`.

    Raises:
        KeyError: a parameter that is missing.
    """
    count = sum(name.startswith("middle_") and name.count("_") == 1 for name in parameters)
    if "reach_1" not in parameters:
        raise KeyError("reach_1")
    plays_of = sum(name.startswith("reach_") for name in parameters)
    variables = [name for name in VARIABLES if f"{name}_low" in parameters]
    degrees = [sum(key.startswith(f"middle_1_{name}_") for key in parameters) for name in variables]
    rows = _rows(variables, degrees)
    found = ScheduledCable(
        first=parameters["knot_first"],
        step=parameters["knot_step"],
        middle=np.array([[parameters[f"middle_{k}{row}"] for k in range(1, count + 1)] for row in rows]),
        height=np.array([[parameters[f"height_{k}{row}"] for k in range(1, count + 1)] for row in rows]),
        reaches=np.array([parameters[f"reach_{i}"] for i in range(1, plays_of + 1)]),
        shares=np.array([parameters[f"share_{i}"] for i in range(1, plays_of + 1)]),
        low=np.array([parameters[f"{name}_low"] for name in variables]),
        high=np.array([parameters[f"{name}_high"] for name in variables]),
        degree=np.array(degrees, dtype=np.int64),
    )
    return found, tuple(parameters[name] for name in variables)


def parameters_of(cable: ScheduledCable, variables: Sequence[str], values: Sequence[float]) -> dict[str, float]:
    """The parameters of a cable by name, with the values of its variables (V,) at which it is to be looked at.

    ``load`` and ``bend`` are where it is; ``load_low`` and ``load_high`` between what it was seen. ``middle_3`` is the
    third ordinate of a, ``middle_3_load_2`` what the square of the scaled load adds to it; ``height_…`` are those of b.
    """
    found: dict[str, float] = {}
    for v, name in enumerate(variables):
        found |= {name: float(values[v]), f"{name}_low": float(cable.low[v]), f"{name}_high": float(cable.high[v])}
    found |= {"knot_first": float(cable.first), "knot_step": float(cable.step)}
    for i, (reach, share) in enumerate(zip(cable.reaches, cable.shares, strict=True), 1):
        found |= {f"reach_{i}": float(reach), f"share_{i}": float(share)}
    for what, table in (("middle", cable.middle), ("height", cable.height)):
        for row, ordinates in zip(_rows(variables, cable.degree), table, strict=True):
            found |= {f"{what}_{k}{row}": float(value) for k, value in enumerate(ordinates, 1)}
    return found


def _rows(variables: Sequence[str], degrees: Sequence[int] | NDArray[np.int64]) -> list[str]:
    """What stands behind an ordinate's number in its name, for each row."""
    return [""] + [
        f"_{name}_{power}" for name, degree in zip(variables, degrees, strict=True) for power in range(1, degree + 1)
    ]
