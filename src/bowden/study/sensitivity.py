"""Which of the parameters that were drawn a figure depends on.

Both measures are of ranks, so that a few extreme runs do not decide them; a run that ran away has the
highest rank.

- *rank correlation*: Spearman's ρ, −1 … 1: whether the figure rises or falls with the parameter.
- *share of variance*: how much of the variance of the figure's rank is between the means of bins of the parameter, each
  with as many runs (Sobol's first-order index by binned conditional means; Pearson's correlation ratio η²), without
  what chance alone would give (Kelley, Proceedings of the National Academy of Sciences 21(9), 1935: ε²). It sees what
  rises and falls again, too.
- *chance*: the share below which 95 % of parameters stay that change nothing, with as many runs in as many bins. η² of
  ranks without any dependence is nearly Beta((g − 1)/2, (n − g)/2) of g bins and n runs.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.special import betaincinv
from scipy.stats import rankdata

from bowden.study.results import ParameterShare

Array = NDArray[np.float64]

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
