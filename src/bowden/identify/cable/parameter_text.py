"""Parameters of a model in words."""

import math
from collections.abc import Mapping

from bowden.identify.cable.model import meaning


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
