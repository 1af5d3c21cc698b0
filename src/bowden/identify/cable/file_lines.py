"""Lines of a model.toml that the texts of a fit, of several logs' fit and of a recalibration share."""

import math
from collections.abc import Iterable, Mapping

from bowden.core.toml_text import quoted
from bowden.core.units import DEGREES
from bowden.identify.cable.cycles import Cycles
from bowden.plants.cable_parameters import meaning


def cycles_row(cycles: Cycles, advice: str) -> str:
    """How many whole cycles there are, and what to record."""
    return f"whole_cycles = {cycles.whole}  # up and down; {advice or 'enough'}"


def warning_lines(warnings: Iterable[str]) -> list[str]:
    """The warnings, as a list."""
    return ["warnings = [" + "".join(f"\n  {quoted(one_line(warning))}," for warning in warnings) + "\n]"]


def error_lines(given: Mapping[str, float]) -> list[str]:
    """Those errors that there are, in degrees."""
    return [f"{name}_deg = {value * DEGREES:.6g}" for name, value in given.items() if math.isfinite(value)]


def parameter_rows(parameters: Mapping[str, float]) -> list[str]:
    """Each parameter with its unit and meaning."""
    said = {name: meaning(name) for name in parameters}
    return [f"{name} = {float(parameters[name])!r}  # [{unit}] {text}" for name, (unit, text) in said.items()]


def one_line(text: str) -> str:
    """The text without breaks and what cannot be printed."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())
