"""The runs of a chunk as a table: number, law, what was drawn, and the figures."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from bowden.core.quantity import Declared, declared
from bowden.core.units import DEGREES
from bowden.sim.many import Outcome, simulate_many
from bowden.study.study import Study

if TYPE_CHECKING:
    import pyarrow as pa

FIGURES = {one.quantity.named(one.name): one for one in declared(Outcome)}
"""Column → what is declared of it."""
SUIT_FIGURES = tuple(FIGURES)[-4:]
"""Those of a suit that is worn alone."""
_UNITS = {"–": "1", "°": "deg"}
_SECONDS, _WORN_SECONDS, _FEWEST = 15_000.0, 1_000.0, 16
"""Simulated seconds of one law in a chunk at most, a few seconds of work on the bench and on the suit; and how many
chunks there are at least, so that few runs spread over the cores, too."""


def chunks(study: Study) -> list[range]:
    """The numbers of the runs of each chunk; they do not depend on who computes them."""
    runs = study.file.runs
    seconds = _WORN_SECONDS if study.worn else _SECONDS
    size = max(1, min(5000, round(seconds / study.duration / len(study.laws)), -(-runs // _FEWEST)))
    return [range(first, min(first + size, runs)) for first in range(0, runs, size)]


def table_of(study: Study, numbers: Iterable[int]) -> "pa.Table":
    """The rows of these runs, one for each law.

    Raises:
        ParameterError: a run whose values do not fit one another.
    """
    import pyarrow as pa

    rows: list[list[Any]] = []
    runs = [(number, study.drawn(number)) for number in numbers]
    figures = {name: one for name, one in FIGURES.items() if study.worn or name not in SUIT_FIGURES}
    for (number, drawn), found in zip(runs, simulate_many(study.cases(runs), study.duration), strict=True):
        for law, outcome in zip(study.laws, found, strict=True):
            values = [_written(getattr(outcome, one.name), one) for one in figures.values()]
            rows.append([number, law.name, drawn.seed, *drawn.values.values(), *values])
    fields = [("number", pa.int64(), "1"), ("law", pa.string(), "1"), ("seed", pa.int64(), "1")]
    for column in study.columns:
        ends = column.spread.ends
        words, whole = any(isinstance(end, str) for end in ends), all(isinstance(end, int) for end in ends)
        fields.append((column.name, pa.string() if words else pa.int64() if whole else pa.float64(), column.unit))
    kinds = {"cycles": pa.int64(), "ended": pa.bool_(), "stable": pa.bool_()}
    for name, one in figures.items():
        unit = one.quantity.file_unit
        fields.append((name, kinds.get(name, pa.float64()), _UNITS.get(unit, unit)))
    schema = pa.schema([pa.field(name, kind, metadata={"unit": unit}) for name, kind, unit in fields])
    return pa.table([list(values) for values in zip(*rows, strict=True)], schema=schema)


def _written(value: float, one: Declared) -> Any:
    """A figure as it stands in the rows; None where it does not exist."""
    if one.name in ("cycles", "ended", "stable"):
        return int(value) if one.name == "cycles" else bool(value)
    return None if np.isnan(value) else value * DEGREES if one.quantity.unit == "rad" else value
