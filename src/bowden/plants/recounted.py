"""The parameters of a model counted from other zeros, or with its motor counted the other way: `Counting`."""

import re
from collections.abc import Mapping

from bowden.core.errors import ParameterError
from bowden.models.cable import scheduled as scheduling
from bowden.plants.counting import Counting
from bowden.plants.predicted import DISTRIBUTED, whole_slope

_LINEAR = re.compile(
    r"slope|offset|(weight|bend|gap)_\d+|hysteresis_gain(_\d+)?|static_\d+|(middle|height)_\d+(_(load|bend)_\d)?"
)
"""Parameters in which a model's joint is linear."""
_OFFSETS = re.compile(r"offset|middle_\d+")
"""Parameters to which an offset is added."""


def fitted_range(parameters: Mapping[str, float]) -> tuple[float, float] | None:
    """Ends of the motor's fitted range, of a model that has them among its parameters [rad]."""
    if "knot_first" in parameters:
        knots = sum(re.fullmatch(r"middle_\d+", name) is not None for name in parameters)
        return parameters["knot_first"], parameters["knot_first"] + (knots - 1) * parameters["knot_step"]
    if "first_node" in parameters:
        return parameters["first_node"], parameters["last_node"]
    if "static_centre" in parameters:
        centre, half = parameters["static_centre"], parameters["static_half_range"]
        return centre - half, centre + half
    return None


def recounted(name: str, parameters: Mapping[str, float], counting: Counting) -> dict[str, float]:
    """The parameters of a model as a rig counts.

    >>> line = {"slope": -0.9, "offset": 1.0}
    >>> found = recounted("line", line, Counting(-1, 0.5, 0.4))
    >>> {key: round(value, 9) for key, value in found.items()}
    {'slope': 0.9, 'offset': 0.15}

    Raises:
        ParameterError: a model that is not identified from logs, and has no log's angles.
    """
    found = dict(parameters)
    if counting.as_recorded:
        return found
    if name in DISTRIBUTED:
        raise ParameterError(
            f"the model {name!r} is not identified from a log",
            expected="a model whose angles are a log's, for other zeros or another direction",
            do="leave out direction, motor_zero_deg and joint_zero_deg of [cable]",
        )
    if counting.direction < 0:
        found = _turned(found)
    zero = counting.direction * counting.motor_zero
    for node in ("static_centre", "first_node", "last_node", "knot_first"):
        if node in found:
            found[node] -= zero
    if "knot_first" not in found:
        found["offset"] += whole_slope(found) * zero
    return recalibrated(found, 1.0, -counting.joint_zero)


def recalibrated(parameters: Mapping[str, float], gain: float, offset: float) -> dict[str, float]:
    """The parameters of a model whose joint is gain·joint + offset of the old one's [rad]."""
    found = {name: gain * value if _LINEAR.fullmatch(name) else value for name, value in parameters.items()}
    return {name: value + offset if _OFFSETS.fullmatch(name) else value for name, value in found.items()}


def _turned(given: Mapping[str, float]) -> dict[str, float]:
    """The parameters with the motor counted the other way."""
    if "knot_first" in given:
        cable, values = scheduling.cable_of(given)
        variables = [one for one in scheduling.VARIABLES if f"{one}_low" in given]
        return scheduling.parameters_of(scheduling.turned(cable), variables, values)
    found = dict(given)
    for key, value in given.items():
        mirrored = re.fullmatch(r"(static|hysteresis_gain)_(\d+)", key)
        if mirrored:  # Tₖ(−u) = (−1)ᵏ·Tₖ(u), and h(−motor) = −h
            odd = int(mirrored[2]) + (mirrored[1] == "hysteresis_gain")
            found[key] = -value if odd % 2 else value
        elif re.fullmatch(r"slope|hysteresis_gain|weight_\d+|initial_(h|lag)|static_centre", key):
            found[key] = -value
    if "first_node" in given:
        found |= {"first_node": -given["last_node"], "last_node": -given["first_node"]}
        for kind in ("bend", "gap"):
            nodes = [key for key in given if re.fullmatch(rf"{kind}_\d+", key)]
            count = len(nodes)
            found |= {f"{kind}_{k}": given[f"{kind}_{count + 1 - k}"] for k in range(1, count + 1)}
    return found
