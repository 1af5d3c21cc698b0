"""The runs of a chunk as a table: number, law, what was drawn, and the figures."""

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from bowden.core.units import DEGREES
from bowden.sim.many import Outcome, SuitOutcome, simulate_many, simulate_suits
from bowden.study.study import Drawn, Study

if TYPE_CHECKING:
    import pyarrow as pa

FIGURES: dict[str, tuple[str, str]] = {
    "cycles": ("1", "how many control cycles the run lasted"),
    "ended": ("1", "whether it reached its end: no command beyond 1000 rad, nothing that is no number"),
    "stable": ("1", "whether, too, the joint was never further from the reference than its whole stroke (5° at least)"),
    "rmse_deg": ("deg", "root of the mean square of joint − reference, from rest"),
    "rmse_after_10s_deg": ("deg", "the same without the first ten seconds"),
    "peak_deg": ("deg", "largest |joint − reference|"),
    "lag_s": ("s", "−∫e·v dt / ∫v² dt with the reference's velocity v: the delay that explains most of a small error"),
    "command_travel_deg": ("deg", "total variation of the command"),
    "largest_command_deg": ("deg", "largest |command|"),
    "mechanical_energy_j": ("J", "∫Pm dt of the motor, Eq. 18"),
    "electrical_energy_j": ("J", "∫Pe dt of the motor, Eq. 18"),
}
"""Column → unit and meaning."""
SUIT_FIGURES: dict[str, tuple[str, str]] = {
    "shown_rmse_deg": ("deg", "RMSE from rest of the elbow as its sensor shows it to the law; rmse_deg is the elbow's"),
    "largest_tension_n": ("N", "of both cables, at the arm and at the spool"),
    "largest_torque_nm": ("N·m", "of the suit on the elbow, as a size"),
    "hottest_winding_c": ("°C", "of the motor"),
}
"""The same, of a suit that is worn."""
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
    for (number, drawn), found in zip(runs, _found(study, runs), strict=True):
        for law, values in zip(study.laws, found, strict=True):
            rows.append([number, law.name, drawn.seed, *drawn.values.values(), *values])
    fields = [("number", pa.int64(), "1"), ("law", pa.string(), "1"), ("seed", pa.int64(), "1")]
    for column in study.columns:
        ends = column.spread.ends
        words, whole = any(isinstance(end, str) for end in ends), all(isinstance(end, int) for end in ends)
        fields.append((column.name, pa.string() if words else pa.int64() if whole else pa.float64(), column.unit))
    kinds = {"cycles": pa.int64(), "ended": pa.bool_(), "stable": pa.bool_()}
    figures = FIGURES | (SUIT_FIGURES if study.worn else {})
    fields += [(name, kinds.get(name, pa.float64()), unit) for name, (unit, _) in figures.items()]
    schema = pa.schema([pa.field(name, kind, metadata={"unit": unit}) for name, kind, unit in fields])
    return pa.table([list(values) for values in zip(*rows, strict=True)], schema=schema)


def _found(study: Study, runs: list[tuple[int, Drawn]]) -> Iterator[list[list[Any]]]:
    """The figures of each run, for each law."""
    if study.worn:
        for worn in simulate_suits(study.cases(runs), study.duration):
            yield [[*_figures(one.run), *_suit_figures(one)] for one in worn]
    else:
        for outcomes in simulate_many(study.cases(runs), study.duration):
            yield [_figures(one) for one in outcomes]


def _figures(found: Outcome) -> list[Any]:
    angles = {"rmse", "rmse_after_10s", "peak", "command_travel", "largest_command"}
    values: list[Any] = [int(found.cycles), bool(found.ended), bool(found.stable)]
    for name, value in list(found._asdict().items())[3:]:
        values.append(_there(value * DEGREES if name in angles else value))
    return values


def _suit_figures(found: SuitOutcome) -> list[float | None]:
    return [_there(found.shown_rmse * DEGREES), *(_there(value) for value in found[2:])]


def _there(value: float) -> float | None:
    return None if np.isnan(value) else value
