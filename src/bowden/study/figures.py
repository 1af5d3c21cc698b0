"""What the runs of a campaign show together: how figures are spread, shares, worst cases, what they depend on.

The last is a sensitivity. Both measures are of ranks, so that a few extreme runs do not decide them; a run that ran
away has the highest rank.

- *rank correlation*: Spearman's ρ, −1 … 1: whether the figure rises or falls with the parameter.
- *share of variance*: how much of the variance of the figure's rank is between the means of bins of the parameter, each
  with as many runs (Sobol's first-order index by binned conditional means; Pearson's correlation ratio η²), without
  what chance alone would give (Kelley, Proceedings of the National Academy of Sciences 21(9), 1935: ε²). It sees what
  rises and falls again, too.
- *chance*: the share below which 95 % of parameters stay that change nothing, with as many runs in as many bins. η² of
  ranks without any dependence is nearly Beta((g − 1)/2, (n − g)/2) of g bins and n runs.
"""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.special import betaincinv
from scipy.stats import rankdata

from bowden.records.metrics import finite
from bowden.study.results import FigureSpread, LawCampaign, ParameterShare, WorstRun
from bowden.study.store import Store

if TYPE_CHECKING:
    import pyarrow as pa

Array = NDArray[np.float64]

SHOWN = ("rmse_deg", "rmse_after_10s_deg", "peak_deg", "lag_s", "command_travel_deg", "electrical_energy_j")
"""Figures whose spread is shown of every study."""
RANKING = "rmse_deg"
"""The figure by which cases are the worst, and whose dependence is looked at."""
_WORST, _POINTS = 5, 201
OSCILLATES = 5.0
"""A command that travels more than this many times as far as the reference oscillates: those of laws that hold
travel 1.2 to 4 times as far on the default bench, a limit cycle of the joint's whole range seven times and more [–]."""
_STEPS = 10
BASELINE = "uncompensated"
"""Law that the others are compared with, where it ran."""
UNSTABLE = (
    "Unstable: the joint was further from the reference than the reference's whole stroke (5° at least), or the run "
    "ran away: a command beyond 1000 rad."
)
"""What counts as unstable, in words."""
MOVING = (
    f"Oscillating: the command travelled more than {OSCILLATES:g} times as far as the reference, or the run ran away; "
    "such a run may be stable by that measure and still be a limit cycle or a chatter that bowden check refuses. "
    f"Worse: a larger RMSE than {BASELINE} on the same plant. A dash: not known in this study."
)
"""What the other two shares are, in words."""


@dataclass(frozen=True)
class LawFigures(LawCampaign):
    """Figures of one law, with its curves."""

    _: KW_ONLY
    quantiles: dict[str, Array] = field(default_factory=dict)
    """Figure → its values at even shares from 0 to 1."""
    steps: dict[str, tuple[Array, Array]] = field(default_factory=dict)
    """Parameter → its median, and the median of `RANKING`, in tenths of the runs by the parameter; of one that is a
    word, its place in `words`."""
    words: dict[str, tuple[str, ...]] = field(default_factory=dict)
    """Parameter that is a word, such as a fault's kind → the words that were drawn, sorted."""


def wilson(count: int, of: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a share [–]."""
    z, n, p = 1.959964, of, count / of
    middle, half = p + z * z / (2 * n), z * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    low, high = (middle - half) / (1 + z * z / n), (middle + half) / (1 + z * z / n)
    return low if count > 0 else 0.0, high if count < of else 1.0  # which rounding misses by 1e-16


@dataclass(frozen=True)
class Summary:
    """Summary of a campaign."""

    study: str
    """A hash of all that the rows depend on."""
    rows_sha256: str
    """Of the sorted rows."""
    runs: int
    laws: tuple[LawFigures, ...]
    shown: tuple[str, ...] = SHOWN
    """Figures whose spread is shown."""


def summarise(
    store: Store,
    laws: Sequence[str],
    drawn: Sequence[str],
    more: Sequence[str] = (),
    *,
    lacking: Mapping[str, Collection[str]] | None = None,
    reference_travel: float | None = None,
) -> Summary:
    """Read the results, and sum them up.

    Args:
        store: with all its chunks.
        laws: names, in their order.
        drawn: columns that were drawn.
        more: figures beside `SHOWN` whose spread is to be shown.
        lacking: law → those of `drawn` that it does not have, such as gains of another law.
        reference_travel: total variation of the reference [deg]; None where the runs do not have one in common.

    Raises:
        OutputError: a chunk cannot be read.
    """
    import pyarrow.compute as pc

    digest, shown = store.digest(), (*SHOWN, *more)
    numbers = store.columns(["number", "law", "ended", "stable", *shown, *drawn])
    tables = {law: numbers.filter(pc.equal(numbers["law"], law)) for law in laws}
    base = None
    if BASELINE in tables:
        base = dict(zip(tables[BASELINE]["number"].to_pylist(), _ranking(tables[BASELINE]).tolist(), strict=True))
    found = []
    for law, table in tables.items():
        one = _of_law(law, table, drawn, shown, (lacking or {}).get(law, ()))
        oscillating = worse = None
        if reference_travel:
            travel = table["command_travel_deg"].to_numpy().astype(np.float64)
            oscillating = int(np.sum(~(travel <= OSCILLATES * reference_travel)))  # one that ran away, too
        if base is not None and law != BASELINE:
            pairs = zip(table["number"].to_pylist(), _ranking(table).tolist(), strict=True)
            worse = sum(error > base.get(number, math.inf) for number, error in pairs)
        found.append(replace(one, oscillating=oscillating, worse_than_uncompensated=worse))
    return Summary(store.study_hash, digest, found[0].runs, tuple(found), shown)


def _ranking(table: "pa.Table") -> Array:
    """`RANKING` of each run; infinite where it ran away."""
    values = table[RANKING].to_numpy().astype(np.float64)
    return np.where(np.isfinite(values), values, np.inf)


def _of_law(
    law: str, table: "pa.Table", drawn: Sequence[str], shown: Sequence[str], lacking: Collection[str]
) -> LawFigures:
    values = {name: table[name].to_numpy().astype(np.float64) for name in shown}
    ended, stable = table["ended"].to_numpy(), table["stable"].to_numpy()
    ranking = _ranking(table)
    number = table["number"].to_numpy()
    spreads, quantiles = {}, {}
    for name, column in values.items():
        there = column[np.isfinite(column)]
        if len(there):
            q = np.quantile(there, (0.0, 0.05, 0.5, 0.9, 0.99, 1.0)).tolist()
            spreads[name] = FigureSpread(len(there), *q)
            quantiles[name] = np.quantile(there, np.linspace(0.0, 1.0, _POINTS))
    worst = []
    for i in np.lexsort((number, -ranking))[:_WORST].tolist():
        row = {name: table[name][i].as_py() for name in drawn}
        worst.append(WorstRun(int(number[i]), finite(float(ranking[i])), row))
    dependences, steps, known = [], {}, {}
    for name in drawn:
        if name in lacking:
            dependences.append(ParameterShare(name, None, None, None, above_chance=False))
            continue
        column = table[name]
        words = tuple(sorted(set(column.to_pylist()))) if str(column.type) == "string" else ()
        parameter = _coded(column.to_pylist(), words) if words else column.to_numpy().astype(np.float64)
        dependences.append(sensitivity(name, parameter, ranking, ordered=not words))
        if words:
            known[name] = words
        if np.ptp(parameter) > 0.0:
            steps[name] = _steps(parameter, ranking, of_words=bool(words))
    return LawFigures(
        law=law,
        runs=len(table),
        ran_away=int(np.sum(~ended)),
        unstable=(unstable := int(np.sum(~stable))),
        unstable_interval=wilson(unstable, len(table)),
        oscillating=None,
        worse_than_uncompensated=None,
        figures=spreads,
        quantiles=quantiles,
        worst=tuple(worst),
        sensitivity=tuple(ranked(dependences)),
        steps=steps,
        words=known,
    )


def _coded(words: list[str], known: Sequence[str]) -> Array:
    place = {word: float(i) for i, word in enumerate(known)}
    return np.array([place[word] for word in words])


def _steps(parameter: Array, figure: Array, *, of_words: bool = False) -> tuple[Array, Array]:
    """Median of both in tenths by the parameter, or for each value of words, or where there are no more than ten."""
    distinct = np.unique(parameter)
    if of_words or len(distinct) <= _STEPS:
        groups = [parameter == value for value in distinct]
    else:
        order = np.argsort(parameter, kind="stable")
        groups = [part for part in np.array_split(order, _STEPS) if len(part)]
    medians = [(float(np.median(parameter[g])), float(np.median(figure[g]))) for g in groups]
    kept = [(x, y) for x, y in medians if math.isfinite(y)]
    return np.array([x for x, _ in kept]), np.array([y for _, y in kept])


_BINS, _IN_BIN = 20, 10


def sensitivity(name: str, parameter: Array, figure: Array, *, ordered: bool = True) -> ParameterShare:
    """Sensitivity of a figure to a parameter.

    Args:
        name: of the parameter.
        parameter: its value in each run (n,).
        figure: likewise; infinite where the run ran away (n,).
        ordered: whether the parameter's values have an order; words have none.
    """
    ranks, values = rankdata(figure) - 1.0, rankdata(parameter) - 1.0
    if np.ptp(ranks) == 0.0 or np.ptp(values) == 0.0:
        return ParameterShare(name, None, 0.0, 0.0, above_chance=False)
    correlation = float(np.corrcoef(ranks, values)[0, 1]) if ordered else None
    share, chance = _share(values, ranks)
    return ParameterShare(name, correlation, share, chance, above_chance=share > chance)


def _share(values: Array, ranks: Array) -> tuple[float, float]:
    """ε² of the ranks over bins of the values, equal values in one, and what chance exceeds in one of twenty cases."""
    n = len(values)
    distinct = np.unique(values)
    bins = min(_BINS, max(2, n // _IN_BIN))
    if len(distinct) <= bins:
        which = np.searchsorted(distinct, values)
    else:
        which = np.unique(np.minimum((values / n * bins).astype(np.int64), bins - 1), return_inverse=True)[1]
    counts = np.bincount(which)
    groups = len(counts)
    if groups < 2 or n <= groups:
        return 0.0, 1.0
    means = np.bincount(which, ranks) / counts
    between = float(np.sum(counts * (means - ranks.mean()) ** 2) / np.sum((ranks - ranks.mean()) ** 2))
    chance = (groups - 1) / (n - 1)
    by_chance = float(betaincinv(0.5 * (groups - 1), 0.5 * (n - groups), 0.95))
    return max(0.0, (between - chance) / (1.0 - chance)), (by_chance - chance) / (1.0 - chance)


def ranked(found: list[ParameterShare]) -> list[ParameterShare]:
    """From the parameter that matters most to the one that matters least."""
    return sorted(found, key=lambda one: -one.share)
