"""The parameters of identified cables: their units and meanings, what they may be, and how they are shown."""

import math
import re
from collections.abc import Mapping
from typing import Any

from bowden.core.errors import ParameterError
from bowden.core.units import DEGREES

_MEANINGS = (
    (
        r"slope",
        "rad/rad",
        "αφ: joint motion per motor motion outside the play; of a stack, plus the sum of its weights",
    ),
    (r"offset", "rad", "joint angle at motor angle 0 without hysteresis"),
    (r"half_width(_\d+)?", "rad", "half the motor's travel lost at a reversal"),
    (r"weight_\d+", "rad/rad", "share of the play of that half-width"),
    (r"bend_\d+", "rad", "distance of the mean of both branches from the straight line at that node"),
    (r"gap_\d+", "rad", "half the distance between the branches at that node, in joint angle"),
    (r"reach_\d+", "1", "half the slot of that play over the gap"),
    (r"share_\d+", "1", "of the joint's motion that that play makes"),
    (r"(first|last)_node", "rad", "motor angle of that node; the others lie evenly between them"),
    (r"initial_lag", "rad", "where the play stood beside the motor at the log's start"),
    (r"hysteresis_gain", "rad", "αh: joint motion per unit of h"),
    (r"hysteresis_gain_\d+", "rad", "the same, for the Chebyshev polynomial of that degree in the motor"),
    (r"rate", "1/rad", "ρ: how fast h follows the motor"),
    (r"shape", "1", "σ: how much faster h falls than it rose"),
    (r"exponent", "1", "n: how sharply h saturates"),
    (r"initial_h", "1", "h at the log's start"),
    (r"static_\d+", "rad", "coefficient of the Chebyshev polynomial of that degree in the motor"),
    (r"static_centre", "rad", "motor angle at the middle of the fitted range"),
    (r"load", "as given", "at which the cable is looked at, in the unit in which it was identified"),
    (r"load_(low|high)", "as given", "least or largest load among the logs"),
    (r"bend_(low|high)", "rad", "least or largest bend among the logs"),
    (r"knot_first", "rad", "motor angle of the first knot"),
    (r"knot_step", "rad", "motor angle between two knots"),
    (r"eta_\d+", "1/rad", "η of the play of that half-width"),
    (r"middle_\d+", "rad", "f, the middle of the loop at that knot, at the least load and bend"),
    (r"middle_\d+_(load|bend)_[12]", "rad", "what that power of the scaled load or bend adds to it"),
    (r"height_\d+", "rad", "g, half the height of the loop at that knot, at the least load and bend"),
    (r"height_\d+_(load|bend)_[12]", "rad", "what that power of the scaled load or bend adds to it"),
    (r"length", "m", "L, of the sheath"),
    (r"stiffness", "N", "EA, of tendon and sheath in series: force per strain"),
    (r"friction", "1", "μ, between tendon and sheath"),
    (
        r"bend",
        "rad",
        "total bend: of a tendon, θ₀, when its sheath's relative width is 1; else where the cable is looked at",
    ),
    (r"motor_radius", "m", "r_m, of the spool"),
    (r"joint_radius", "m", "r_j, of the pulley"),
    (r"spring", "N·m/rad", "stiffness of the spring that pulls the joint back"),
    (r"pretension", "N·m", "torque of that spring at joint angle zero"),
    (r"slack", "m", "tendon to be taken up before it is taut, at motor angle zero"),
    (r"elements", "1", "n, into how many the sheath is cut"),
    (r"density", "kg/m", "of the tendon"),
    (r"inertia", "kg·m²", "of the joint"),
    (r"damping", "N·m·s/rad", "of the joint"),
    (r"presliding", "m", "z₀, how far a node gives before it slides"),
    (r"step", "s", "longest step of the calculation"),
    (r"static_half_range", "rad", "half the fitted range; the polynomials' argument is (motor − centre)/half range"),
)


_RANGES: Mapping[str, tuple[float, float]] = {
    "rad": (-1e4, 1e4),
    "rad/rad": (-100.0, 100.0),
    "1/rad": (-1e6, 1e6),
    "1": (-1e4, 1e4),
    "as given": (-1e9, 1e9),
    "half_width": (0.0, 1e4),
    "half_width_1": (0.0, 1e4),
    "gap_1": (0.0, 1e4),
    "reach_1": (0.0, 1e4),
    "share_1": (0.0, 1e4),
    "rate": (1e-6, 1e6),
    "exponent": (0.01, 50.0),
    "static_half_range": (1e-6, 1e4),
    "knot_step": (1e-6, 1e4),
    "length": (1e-3, 100.0),
    "stiffness": (1.0, 1e9),
    "friction": (0.0, 5.0),
    "bend": (1e-6, 63.0),
    "motor_radius": (1e-4, 1.0),
    "joint_radius": (1e-4, 1.0),
    "spring": (0.0, 1e4),
    "pretension": (-1e3, 1e3),
    "slack": (-10.0, 10.0),
    "elements": (1.0, 1000.0),
    "density": (1e-9, 10.0),
    "inertia": (1e-9, 100.0),
    "damping": (0.0, 1e3),
    "presliding": (1e-9, 1.0),
    "step": (1e-7, 1e-2),
}
"""Parameter, numbered ones by their first, or else unit → least and largest value: wide for any cable, and its model
is finite."""
LEAST_SLOPE = 1e-4
"""Of all parts of a model together, either way: a law divides by it [rad/rad]."""
MOST_PARAMETERS = 1000
"""Of one model: each play takes its time in every cycle."""


def check_parameters(name: str, given: Mapping[str, Any], where: str) -> None:
    """Refuse a model that no cable has.

    Args:
        name: of the model.
        given: its parameters.
        where: they stand, for messages.

    Raises:
        ParameterError: an unknown parameter, one that is no number or out of its range, or too many.
    """
    if len(given) > MOST_PARAMETERS:
        raise ParameterError(
            f"{where}: {name} has {len(given)} parameters",
            expected=f"at most {MOST_PARAMETERS}",
            do="identify the cable again",
        )
    for key, value in given.items():
        unit, _ = meaning(key)
        scheduled = key == "bend" and "bend_low" in given  # then it is a place between two, in their unit
        low, high = _RANGES.get("bend_low" if scheduled else re.sub(r"_\d+$", "_1", key)) or _RANGES[unit]
        if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
            raise ParameterError(
                f"{where}: {key} of {name} is {value!r}",
                expected=f"a number from {low:g} to {high:g} ({unit})",
                do="correct it, or identify the cable again",
            )


def meaning(parameter: str) -> tuple[str, str]:
    """Unit and meaning of a parameter.

    >>> meaning("rate")
    ('1/rad', 'ρ: how fast h follows the motor')

    Raises:
        ParameterError: no model has a parameter of that name.
    """
    for pattern, unit, text in _MEANINGS:
        if re.fullmatch(pattern, parameter):
            return unit, text
    raise ParameterError(f"no model has a parameter {parameter!r}")


def parameter_lines(parameters: Mapping[str, float], spreads: Mapping[str, float]) -> list[tuple[str, str]]:
    """Name and value of each parameter of a model, with its deviation and unit; of many of a kind, their range.

    >>> parameter_lines({"slope": 0.9, "gap_1": 0.1, "gap_2": 0.2, "gap_3": 0.2, "gap_4": 0.3}, {"slope": 0.01})
    [('slope', '0.9 ± 0.01 rad/rad'), ('gap_1 … gap_4', '0.1 to 0.3 rad')]
    """
    kinds: dict[str, list[str]] = {}
    for name in parameters:
        stem, _, last = name.rpartition("_")
        kinds.setdefault(stem if last.isdigit() else name, []).append(name)
    found = []
    for names in kinds.values():
        if len(names) > _MOST_OF_A_KIND:
            values = [parameters[name] for name in names]
            found.append((f"{names[0]} … {names[-1]}", f"{min(values):.4g} to {max(values):.4g}{_unit(names[0])}"))
        else:
            texts = [f"{parameters[name]:.4g}{_spread(spreads.get(name, math.nan), _unit(name))}" for name in names]
            found += list(zip(names, texts, strict=True))
    return found


_MOST_OF_A_KIND = 3


def _unit(name: str) -> str:
    unit = meaning(name)[0]
    return "" if unit in ("1", "as given") else f" {unit}"


def _spread(value: float, unit: str) -> str:
    if math.isnan(value):
        return unit
    return f"{unit} (not shown by this log)" if math.isinf(value) else f" ± {value:.2g}{unit}"


def in_degrees(name: str, value: float, unit: str = "") -> tuple[float, str]:
    """A load as it is, and a bend, which is an angle [rad], in degrees: for whoever reads it; value and unit."""
    return (value * DEGREES, "°") if name == "bend" else (value, unit)


def shown_value(name: str, value: float, unit: str = "") -> str:
    """The same as text.

    >>> shown_value("load", 0.12, "N·m"), shown_value("bend", 3.14159265)
    ('0.12 N·m', '180°')
    """
    found, its = in_degrees(name, value, unit)
    return f"{found:.4g}{its}" if its == "°" else f"{found:.4g} {its}".strip()


def outside(parameters: Mapping[str, float], values: Mapping[str, float]) -> list[str]:
    """A warning for each variable whose value lies beyond those that were identified by a tenth of their range."""
    found = []
    for name, value in values.items():
        if f"{name}_low" not in parameters:
            continue
        low, high = parameters[f"{name}_low"], parameters[f"{name}_high"]
        if max(low - value, value - high) > 0.1 * (high - low):
            found.append(
                f"the {name} {shown_value(name, value)} lies outside those of the logs that the model was identified "
                f"from ({shown_value(name, low)} to {shown_value(name, high)}): the model goes on straight, at most as "
                "far as that range is wide"
            )
    return found
