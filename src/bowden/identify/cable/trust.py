"""Whether an identified model is to be trusted, in one line, from figures that its fit has."""

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Literal, NamedTuple

from bowden.core.units import DEGREES
from bowden.identify.cable.advice import FOLLOWS, SLIGHT, WORSE, following
from bowden.identify.cable.checks import look_swapped
from bowden.identify.cable.model import meaning

if TYPE_CHECKING:
    from bowden.identify.cable.fit import Fit

_OF_LINE = 0.5
"""Share of a straight line's error that a model leaves at most, if its loop is to be of use."""
_COUNTS = 3.0
"""Errors below this many times the encoders' counts are their noise."""


class Trust(NamedTuple):
    """Whether to trust a model."""

    level: Literal["yes", "with care", "no"]
    """``yes`` for motions like the log's."""
    why: str
    """In one line."""

    def __str__(self) -> str:
        return f"{self.level}: {self.why}"


def trust(fit: "Fit") -> Trust:
    """Whether to trust the recommended model.

    *No* where the joint does not follow the motor or turns round before it, or where the model errs by more than half
    of what a straight line does (and more than its encoders' counts explain), a line being no loop. *With care* where
    the angles hardly have the unit they were taken in, where the half that was not fitted is predicted clearly worse
    than the other one was fitted, or where that half helped to choose the model.
    """
    chosen, line, counts = fit.chosen, fit.models["line"], fit.forecast.resolution
    seen, unseen = chosen.train_rms, chosen.test_rms
    correlation = following(fit.log, fit.split)
    if correlation < FOLLOWS:
        return Trust("no", f"the joint does not follow the motor (correlation {correlation:.2f})")
    if look_swapped(fit.log.motor, fit.log.joint):
        return Trust("no", "the joint turns round before the motor does: motor and joint look swapped")
    said = f"{_degrees(unseen)} RMS on the half that was not fitted, {_degrees(seen)} on the fitted one"
    said += f", {_degrees(line.test_rms)} of a straight line" if fit.best.name != "line" else ""
    said += f"; the encoders' rounding alone makes {_degrees(counts)}" if counts else ""
    if fit.best.name == "line":
        return Trust("with care", f"no loop is shown by this log, a straight line is all; {said}")
    if unseen > _OF_LINE * line.test_rms and unseen > max(_COUNTS * counts, SLIGHT):
        return Trust("no", f"the model predicts hardly better than a straight line; {said}")
    if fit.log.unit_doubt:
        return Trust("with care", f"{fit.log.unit_doubt}; {said}")
    if fit.chosen_on_whole:
        return Trust("with care", f"too few strokes: the half that judges it helped to choose it; {said}")
    if unseen > WORSE * seen and unseen > SLIGHT:
        return Trust("with care", f"the cable changed during the log; {said}")
    covered = fit.log.covered
    ends = f"{covered.joint_low * DEGREES:.1f} to {covered.joint_high * DEGREES:.1f}°"
    return Trust("yes", f"within the motion of this log ({ends} at the joint); {said}")


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


def _degrees(angle: float) -> str:
    return f"{angle * DEGREES:.2g}°"
