"""A hysteresis loop of free shape whose shape is scheduled by the cable's load, by its bend, or by both.

    joint = f(motor, s) + g(motor, s)·h,    h = Σ ηᵢ·(motor − zᵢ),    Σ ηᵢ·rᵢ = 1

f is the middle of the loop and g half its height, each drawn straight between knots that lie evenly over the motor's
range; beyond it f goes on straight and g stays. zᵢ are play operators of fixed half-widths rᵢ that all loads share, so
that h runs from −1 (the motor has fallen far enough) to 1 (it has risen) by a curve that does not change with the load.
With every scheduling variable s scaled to 0…1 over the range in which it was seen, each ordinate is

    f(s) = f₀ + Σ over the variables of f₁·s + f₂·s² + …

and likewise g. Beyond 0…1 a power goes on along its tangent, and no variable counts further than its range once more.

The elastic stretch of the cable under its tension T, T·L/(EA), makes f depend on the load, and friction μ·N, which is
proportional to the tension by the capstan's law, makes g grow with it. Source: the paper's Section 3.2 for the bend;
Kaneko, Wada, Maekawa and Tanie, ICRA 1991, 1252, for the load.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.kernel import kernel
from bowden.models.cable.bouc_wen import BoucWen, saturation
from bowden.models.cable.prandtl_ishlinskii import plays

Array = NDArray[np.float64]

VARIABLES = ("load", "bend")
"""Variables that may schedule a cable, in the order in which `ScheduledCable` has them."""


class ScheduledCable(NamedTuple):
    """Parameters of a scheduled cable with K knots, k plays and V variables; M = 1 + the sum of the degrees."""

    first: float
    """Motor angle of the first knot [rad]."""
    step: float
    """Between two knots [rad]."""
    middle: Array
    """Ordinates of f: of the base, then of each variable's powers (M, K) [rad]."""
    height: Array
    """Ordinates of g, likewise (M, K) [rad]."""
    half_widths: Array
    """rᵢ (k,) [rad]."""
    shares: Array
    """ηᵢ (k,) [1/rad]."""
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
def straight(motor: float, first: float, step: float, ordinates: Array, weights: Array, outward: float) -> float:
    """Rows of ordinates (M, K), summed with `weights` (M,), between the two knots round a motor angle.

    `outward` is 1 where the line goes on beyond the knots, and 0 where it stays.
    """
    last = ordinates.shape[1] - 1
    place = (motor - first) / step
    inside = max(0.0, min(float(last), place))
    k = min(int(inside), last - 1)
    part = inside - k + outward * (place - inside)
    found = 0.0
    for m in range(weights.size):
        found += weights[m] * (ordinates[m, k] + part * (ordinates[m, k + 1] - ordinates[m, k]))
    return found


def hats(motor: Array, first: float, step: float, count: int, outward: float) -> Array:
    """How much of each knot's ordinate there is at each motor angle (n, count), as `straight` has it."""
    place = (motor - first) / step
    inside = np.clip(place, 0.0, count - 1.0)
    k = np.minimum(inside.astype(np.intp), count - 2)
    part = inside - k + outward * (place - inside)
    found, rows = np.zeros((len(motor), count)), np.arange(len(motor))
    found[rows, k], found[rows, k + 1] = 1.0 - part, part
    return found


def joint_angle(motor: Array, cable: ScheduledCable, values: Sequence[float]) -> Array:
    """Joint angle along a recorded motion at fixed `values` (V,) of the variables (n,) [rad], every play centred."""
    count, weights = cable.middle.shape[1], powers(values, cable)
    memory = (motor[:, None] - plays(motor, cable.half_widths)) @ cable.shares
    middle = hats(motor, cable.first, cable.step, count, 1.0) @ (weights @ cable.middle)
    height = hats(motor, cable.first, cable.step, count, 0.0) @ (weights @ cable.height)
    return np.asarray(middle + height * memory)


def turned(cable: ScheduledCable) -> ScheduledCable:
    """The same cable with its motor counted the other way: f(−motor), and h changes its sign."""
    last = cable.first + (cable.middle.shape[1] - 1) * cable.step
    return cable._replace(
        first=-last,
        middle=np.ascontiguousarray(cable.middle[:, ::-1]),
        height=np.ascontiguousarray(-cable.height[:, ::-1]),
    )


def line_of(cable: ScheduledCable, values: Sequence[float]) -> tuple[float, float, float]:
    """Slope [rad/rad] and offset [rad] of the line through f's knots, and the mean of g [rad], at `values` (V,)."""
    weights, count = powers(values, cable), cable.middle.shape[1]
    knots = cable.first + cable.step * np.arange(count)
    middle, centred = weights @ cable.middle, knots - knots.mean()
    slope = float(centred @ middle / (centred @ centred))
    return slope, float(middle.mean() - slope * knots.mean()), float((weights @ cable.height).mean())


def bouc_wen_at(cable: ScheduledCable, values: Sequence[float], like: BoucWen) -> BoucWen:
    """The plain Bouc–Wen cable with the slope, the offset and the dead zone at `values` (V,).

    Its loop is that of `like`, drawn out along the motor as its dead zone is longer: αh·h* is the mean of g, and
    ρ changes as one over the dead zone.
    """
    slope, offset, height = line_of(cable, values)
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
    plays_of = sum(name.startswith("eta_") for name in parameters)
    variables = [name for name in VARIABLES if f"{name}_low" in parameters]
    degrees = [sum(key.startswith(f"middle_1_{name}_") for key in parameters) for name in variables]
    rows = _rows(variables, degrees)
    found = ScheduledCable(
        first=parameters["knot_first"],
        step=parameters["knot_step"],
        middle=np.array([[parameters[f"middle_{k}{row}"] for k in range(1, count + 1)] for row in rows]),
        height=np.array([[parameters[f"height_{k}{row}"] for k in range(1, count + 1)] for row in rows]),
        half_widths=np.array([parameters[f"half_width_{i}"] for i in range(1, plays_of + 1)]),
        shares=np.array([parameters[f"eta_{i}"] for i in range(1, plays_of + 1)]),
        low=np.array([parameters[f"{name}_low"] for name in variables]),
        high=np.array([parameters[f"{name}_high"] for name in variables]),
        degree=np.array(degrees, dtype=np.int64),
    )
    return found, tuple(parameters[name] for name in variables)


def parameters_of(cable: ScheduledCable, variables: Sequence[str], values: Sequence[float]) -> dict[str, float]:
    """The parameters of a cable by name, with the values of its variables (V,) at which it is to be looked at.

    ``load`` and ``bend`` are where it is; ``load_low`` and ``load_high`` between what it was seen. ``middle_3`` is the
    third ordinate of f, ``middle_3_load_2`` what the square of the scaled load adds to it; ``height_…`` are those of g.
    """
    found: dict[str, float] = {}
    for v, name in enumerate(variables):
        found |= {name: float(values[v]), f"{name}_low": float(cable.low[v]), f"{name}_high": float(cable.high[v])}
    found |= {"knot_first": float(cable.first), "knot_step": float(cable.step)}
    for i, (width, share) in enumerate(zip(cable.half_widths, cable.shares, strict=True), 1):
        found |= {f"half_width_{i}": float(width), f"eta_{i}": float(share)}
    for what, table in (("middle", cable.middle), ("height", cable.height)):
        for row, ordinates in zip(_rows(variables, cable.degree), table, strict=True):
            found |= {f"{what}_{k}{row}": float(value) for k, value in enumerate(ordinates, 1)}
    return found


def _rows(variables: Sequence[str], degrees: Sequence[int] | NDArray[np.int64]) -> list[str]:
    """Suffix of an ordinate's name, for each row."""
    return [""] + [
        f"_{name}_{power}" for name, degree in zip(variables, degrees, strict=True) for power in range(1, degree + 1)
    ]
