"""The generalised play fitted to a path: two free branches, smooth as far as the log shows them to be.

Which plays there are, and how wide, comes first of a Prandtl–Ishlinskii stack round a bent line, fitted with weights of
one sign. With them held the joint is linear in the branches' nodes, as long as each play is in contact where it was: a
few rounds settle that. The branches are drawn to a straight mean and a constant gap,

    Σ w·(joint − model)² + W·(λₐ·Σ(Δ²a)² + λ_b·Σ v·(Δb)²),    W = Σ w

with λ chosen by stretches of the strokes left out in turn. With the branches held the joint is linear in the plays'
shares, so that the plays are found again between them, and the branches between those, three times.

Near either end of the motor's range a log shows one branch alone: after the reversal the joint has not come to the
other one yet. Where it is between both, a gap that is free explains how the joint goes over, which the plays should,
and the branch that is not seen goes wrong; a larger stroke shows it. So v is 1000 there, and 1 elsewhere.

Where a branch would go against the motor, or the gap below zero, λ grows until it does not; the limit, taken from some
λ on, is a straight mean with one gap.

Both branches may be straight lines with a slope each, and one play between them: Eq. 4 with c₁ ≠ c₂. Where these four
numbers leave hardly more than the free curves do, they are taken in their place.

Source: Eilers and Marx, Statistical Science 11(2), 1996 (penalised splines).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.identify.cable.path import Path
from bowden.identify.cable.plays import LAGS
from bowden.identify.cable.projection import (
    Array,
    Estimate,
    inverse_of,
    products,
    solve_linear,
    weights_of_one_sign,
    without,
)
from bowden.identify.cable.validation import folds
from bowden.models.cable.generalised_play import (
    Branches,
    design_of,
    half_gap,
    joint_angle,
    mean_branch,
    slots_of,
    with_curve,
)
from bowden.plants.predicted import branches_of, slots_along

_NODES = 40
"""Of each of the two curves; a cable's loop has bends of some 4 % of its stroke, which these draw to a tenth."""
_FINEST, _WIDTHS = 2e-3, 10
"""The narrowest play offered, over the motor's range, and how many."""
_WIDEST = {True: 0.3, False: 0.12}
"""The widest; a narrower one where the loop was not turned into at both ends: a wide play may then be a bend."""
_DEGREE = 8
"""Of the bent line round which the plays are found."""
_STRENGTHS = 10.0 ** np.array([-5.5, -4.0, -2.5, -1.0, 2.0])
"""λ tried, for either curve."""
_STIFFEST = 1e6
"""λ from which on the branches are taken to be straight."""
_STEPS = np.diff(np.eye(_NODES), axis=0)
_CURVATURE = np.diff(np.eye(_NODES), 2, axis=0).T @ np.diff(np.eye(_NODES), 2, axis=0)
"""What makes the steps of a curve's nodes, and the sum of its squared second differences."""
_ROUNDS, _PLAYS_ROUNDS = 3, 3
"""Until the contacts are settled, and in how many more the plays are found again."""
_REACHES = 1.15 ** np.arange(-20.0, 9.0)
"""Of the plays that are offered then: among them a pure play's, 1."""
_LEAST_SHARE = 1e-4
_SMALL = 1e-12
"""Of the mean square of a column, below what an encoder shows: so that a Gram matrix has a root."""
_ROUNDED = 1e-14
"""Of a penalty's mean diagonal element, above what rounding takes off what it leaves free: a gap of one height."""
_TOTAL = 30.0
"""Weight of a joint that moves with the motor as a whole, over that of the log."""
_TIED, _TAKEN_UP = 1000.0, 0.95
"""v where one branch is seen, which is until this share of the gap is taken up."""
_MOST_TIED = 0.3
"""Of the range, at either end."""


_ENDS = np.kron(np.eye(2), [[1.0, 0.0], [0.5, 0.5], [0.0, 1.0]])
"""What makes three nodes of two straight lines (6, 4) of the lines' ends."""
_AS_GOOD = 1.05**2
"""Squared error of straight branches over that of free ones, up to which they are taken."""


_NEARLY = 4.0
"""The same before it is known where the motor came from, up to which that is searched."""
_ONWARD = 0.25
"""Of the motor's range, by which straight branches go on beyond it."""


class BentStack(NamedTuple):
    """Which plays there are, round a bent line."""

    lag: float
    slope: float
    gap: float
    shares: Array
    reaches: Array
    left: float
    """Weighted sum of squares that it leaves of the joint."""


def fit_branches(path: Path, near: Estimate | None = None) -> Estimate:
    """Two curves of 40 nodes, and up to ten plays between them.

    From `near` the plays stay, and so does where each is in contact. Where the path reaches beyond the nodes they are
    laid again over all of it; λ and the contacts are found with them, and the plays once more.
    """
    if near is None:
        free = _searched(path, _PLAYS_ROUNDS)
        return _straightened(path, free) or free
    cable = branches_of(near.parameters)
    if len(near.theta) == 1:
        return _two_lines(path, float(near.theta[0]), cable)
    lag, of_mean, of_gap = (float(value) for value in near.theta)
    low, high = _range(path)
    if low < cable.low or high > cable.high:
        return _settled(path, lag, _laid(cable, min(low, cable.low), max(high, cable.high)), 1)
    columns = np.column_stack([design_of(path.motor, lag, cable), path.joint])
    cable, strengths = _solved(path, columns, cable, (of_mean, of_gap))
    return _free(path, lag, cable, strengths)


def rough_branches(path: Path) -> Estimate:
    """The same with the plays as they are found first, for `bowden.identify.cable.validation.settling`.

    Where the motor came from is known to one of seven values: better plays would show that as a first stroke that is
    unlike the others.
    """
    return _searched(path, 0)


def _searched(path: Path, again: int) -> Estimate:
    stack = bent_stack(path, LAGS * path.span)
    straight = np.zeros(_NODES), np.full(_NODES, stack.gap)
    cable = Branches(stack.slope, *straight, *_range(path), stack.reaches, stack.shares, 0.0, 0.0)
    return _settled(path, stack.lag, cable, again)


def bent_stack(path: Path, lags: Array) -> BentStack:
    """The plays of a stack round a bent line that fit best, the motor having come from one of the `lags` [rad]."""
    low, high = _range(path)
    u = np.clip((2.0 * path.motor - low - high) / (high - low), -1.0, 1.0)
    bent = np.delete(np.polynomial.chebyshev.chebvander(u, _DEGREE), 1, axis=1)
    widths = path.span * np.geomspace(_FINEST, _WIDEST[path.strokes > 3], _WIDTHS)
    best: tuple[float, float, Array] | None = None
    for lag in lags:
        slots = slots_along(path.motor, widths, lag)
        sums = products(np.column_stack([bent, path.motor, slots, path.joint]), path.weight)
        weights, cost = weights_of_one_sign(without(sums, bent.shape[1]), path.direction)
        if best is None or cost < best[0]:
            best = cost, float(lag), weights
    assert best is not None
    left, lag, weights = best
    slope = float(weights.sum())
    kept = np.abs(weights[1:]) > 1e-6 * abs(slope)
    gap = float(np.abs(weights[1:])[kept] @ widths[kept])
    if not gap > 0.0:
        return BentStack(lag, slope, 0.0, np.zeros(1), np.ones(1), left)
    return BentStack(lag, slope, gap, weights[1:][kept] / slope, widths[kept] * abs(slope) / gap, left)


def _range(path: Path) -> tuple[float, float]:
    """Lowest and highest motor angle that was fitted [rad]."""
    fitted = path.motor[path.weight > 0]
    return float(fitted.min()), float(fitted.max())


def _settled(path: Path, lag: float, cable: Branches, again: int) -> Estimate:
    """The branches and λ in a few rounds, in each of which the plays are in contact where they were before it.

    Where the plays are to be found `again` so many times, they are so once before λ is chosen too.
    """
    strengths = (float(_STRENGTHS[2]),) * 2
    for done in range(_ROUNDS + again):
        if again and (done == 1 or done >= _ROUNDS):
            cable = _with_plays(path, lag, cable)
        columns = np.column_stack([design_of(path.motor, lag, cable), path.joint])
        if done == 1:
            strengths = _strengths(path, columns, cable)
        cable, strengths = _solved(path, columns, cable, strengths)
    return _free(path, lag, cable, strengths)


def _straightened(path: Path, free: Estimate) -> Estimate | None:
    """Two straight branches, if they leave hardly more than free ones; where the motor came from is searched then."""
    from scipy.optimize import minimize_scalar

    def left(one: Estimate, weight: Array) -> float:
        return float(weight @ (one.fitted - path.joint) ** 2)

    later, cable = np.where(path.stroke > 0, path.weight, 0.0), branches_of(free.parameters)  # known without the start
    if not later.any() or not cable.gaps.any():
        return None
    if left(_two_lines(path.with_weight(later), 0.0, cable), later) > _NEARLY * left(free, later):
        return None
    tried = LAGS[-1] * path.span * np.linspace(-1.0, 1.0, 15)
    near = float(tried[int(np.argmin([left(_two_lines(path, lag, cable), path.weight) for lag in tried]))])
    bounds = near - (tried[1] - tried[0]), near + (tried[1] - tried[0])
    lag = minimize_scalar(lambda at: left(_two_lines(path, at, cable), path.weight), bounds=bounds, method="bounded").x
    found = _two_lines(path, float(lag), cable)
    return found if left(found, path.weight) <= _AS_GOOD * left(free, path.weight) else None


def _two_lines(path: Path, lag: float, near: Branches) -> Estimate:
    """Two straight branches and a play, in a few rounds as in `_settled`; they go on by a part of the range."""
    ends = _range(path)
    far = _ONWARD * (ends[1] - ends[0])
    low, high = ends[0] - far, ends[1] + far
    cable = near._replace(bends=np.zeros(3), gaps=np.full(3, near.gaps.mean()), reaches=np.ones(1), shares=np.ones(1))
    cable = cable._replace(low=low, high=high, curve=0.0)
    for _ in range(_ROUNDS + _PLAYS_ROUNDS):
        columns = design_of(path.motor, lag, cable) @ _ENDS
        nodes = _ENDS @ solve_linear(columns, path.joint, path.weight)[0]
        mean, gap = (np.polynomial.Polynomial.fit(np.linspace(low, high, 3), one, 1) for one in np.split(nodes, 2))
        meet = float(gap.roots()[0]) if nodes[3] != nodes[5] else np.inf  # where the lines cross they end
        low = min(ends[0], max(ends[0] - far, meet if nodes[3] < nodes[5] else -np.inf))
        high = max(ends[1], min(ends[1] + far, meet if nodes[3] > nodes[5] else np.inf))
        place = np.linspace(low, high, 3)
        cable = _through(cable._replace(low=low, high=high), mean(place), np.maximum(gap(place), 0.0))
    return _estimate(path, lag, cable, columns, np.array([lag]), np.zeros((4, 4)))


def _with_plays(path: Path, lag: float, cable: Branches) -> Branches:
    """The same branches with the plays between them that fit best: shares of one sign, which sum to one at most."""
    from scipy.optimize import nnls

    if not cable.gaps.any():
        return cable
    slots = slots_of(path.motor, lag, cable._replace(reaches=np.append(0.0, _REACHES)))  # the first is the mean itself
    moved, wanted = slots[:, 1:] - slots[:, :1], path.joint - cable.offset - slots[:, 0]
    sums = products(np.column_stack([moved, wanted]), path.weight)
    root = np.linalg.cholesky(sums + _SMALL * float(np.trace(sums)) / len(sums) * np.eye(len(sums))).T
    total = _TOTAL * float(np.sqrt(sums[-1, -1]))
    of_motor = np.append(np.zeros(len(root)), total)  # what it moves by itself is none of `moved`
    rows = np.column_stack([np.vstack([root[:, :-1], np.full(len(_REACHES), total)]), of_motor])
    shares = nnls(rows, np.append(root[:, -1], total))[0][:-1]
    shares = shares / max(1.0, float(shares.sum()))
    kept = shares > _LEAST_SHARE
    size = float(shares[kept] @ _REACHES[kept])
    if not size > 0.0:
        return cable
    return cable._replace(reaches=_REACHES[kept] / size, shares=shares[kept], gaps=cable.gaps * size)


def _laid(cable: Branches, low: float, high: float) -> Branches:
    """The same branches with their nodes from `low` to `high` [rad]."""
    place = np.linspace(low, high, _NODES)
    mean = np.array([mean_branch(at, cable) + cable.offset for at in place])
    gaps = np.array([half_gap(at, cable) for at in place])
    return _through(cable._replace(low=low, high=high), mean, gaps)


def _through(cable: Branches, mean: Array, gaps: Array) -> Branches:
    """The cable with other nodes, its slope and offset those of the mean's line."""
    place = np.linspace(cable.low, cable.high, len(mean))
    slope, offset = np.linalg.pinv(np.column_stack([place, np.ones(len(mean))])) @ mean  # of their least-squares line
    bends = mean - slope * place - offset
    return with_curve(cable._replace(slope=float(slope), offset=float(offset), bends=bends, gaps=gaps))


def _penalty(strengths: tuple[float, float], weight: float, one_seen: NDArray[np.bool_]) -> Array:
    """S (2k, 2k): cᵀSc is what the nodes c of both curves cost."""
    tied = min(_TIED * strengths[1], max(strengths[1], _STIFFEST))
    of_gap = np.where(one_seen, tied, strengths[1])
    found = np.zeros((2 * _NODES, 2 * _NODES))
    found[:_NODES, :_NODES] = strengths[0] * weight * _CURVATURE
    found[_NODES:, _NODES:] = weight * (_STEPS.T @ (of_gap[:, None] * _STEPS))
    return found


def _one_seen(cable: Branches) -> NDArray[np.bool_]:
    """Between which nodes (k − 1,) a stroke through them all shows one branch alone: near both ends."""
    order = np.argsort(cable.reaches)
    taken_up = np.cumsum((cable.shares * cable.reaches)[order])
    reach = cable.reaches[order][int(np.searchsorted(taken_up, _TAKEN_UP * taken_up[-1]))]
    width, rise = 2.0 * reach * float(np.mean(cable.gaps)), abs(cable.slope) * (cable.high - cable.low)
    share = width / rise if width < _MOST_TIED * rise else _MOST_TIED
    middle = (np.arange(_NODES - 1) + 0.5) / (_NODES - 1)
    return np.asarray((middle < share) | (middle > 1.0 - share))


def _strengths(path: Path, columns: Array, cable: Branches) -> tuple[float, float]:
    """λₐ and λ_b with the least error on left-out stretches.

    For each λₐ the mean's nodes are eliminated once, so that for each λ_b half of the nodes are left to solve for.
    """
    blocks = np.array([products(columns[mask], path.weight[mask]) for mask in folds(path)])
    kept, weight, one_seen = blocks.sum(axis=0) - blocks, float(path.weight.sum()), _one_seen(cable)
    of_gaps = [_penalty((0.0, float(of_gap)), weight, one_seen)[_NODES:, _NODES:] for of_gap in _STRENGTHS]
    # a play that no stroke takes up is an offset, which the mean has too, so that nothing holds the height of the gap
    of_gaps = [one + _ROUNDED * float(np.trace(one)) / _NODES * np.eye(_NODES) for one in of_gaps]
    across, crossed = kept[:, :_NODES, _NODES:], kept[:, _NODES:-1, :_NODES]
    best, found = np.inf, (float(_STRENGTHS[-1]),) * 2
    for of_mean in _STRENGTHS:
        gram = _gram(kept, _penalty((float(of_mean), 0.0), weight, one_seen))
        through = np.linalg.solve(gram[:, :_NODES, :_NODES], across)
        rest = np.concatenate([gram[:, _NODES:, _NODES:], kept[:, _NODES:-1, -1:]], axis=2) - crossed @ through
        for of_gap, penalty in zip(_STRENGTHS, of_gaps, strict=True):
            gaps = np.linalg.solve(rest[:, :, :-1] + penalty, rest[:, :, -1:])
            signs = np.concatenate([through[:, :, :-1] @ gaps - through[:, :, -1:], -gaps], axis=1)
            missed = np.concatenate([signs, np.ones((len(blocks), 1, 1))], axis=1)[:, :, 0]
            error = float(np.einsum("fa,fab,fb->", missed, blocks, missed))
            if error < best:
                best, found = error, (float(of_mean), float(of_gap))
    return found


def _gram(sums: Array, penalty: Array) -> Array:
    """The penalised Gram matrix (..., 2k, 2k) of sums (..., 2k + 1, 2k + 1), the joint last, of full rank."""
    of_data = sums[..., :-1, :-1]
    small = 1e-12 * np.trace(of_data, axis1=-2, axis2=-1)  # of the data: λ may be large
    small = (small + _ROUNDED * float(np.trace(penalty)))[..., None] / (2 * _NODES)
    with_play = np.any(of_data[..., _NODES:, _NODES:], axis=(-2, -1), keepdims=True)[..., 0]  # without it no gap shows
    ridge = np.where(with_play | (np.arange(2 * _NODES) < _NODES), small, 1.0)
    return np.asarray(of_data + penalty + ridge[..., None] * np.eye(2 * _NODES))


def _solved(
    path: Path, columns: Array, cable: Branches, strengths: tuple[float, float]
) -> tuple[Branches, tuple[float, float]]:
    """The best branches of a design and the λ that they took to rise, both, with the motor."""
    sums, weight, one_seen = products(columns, path.weight), float(path.weight.sum()), _one_seen(cable)
    while max(strengths) < _STIFFEST:
        nodes = np.asarray(np.linalg.solve(_gram(sums, _penalty(strengths, weight, one_seen)), sums[:-1, -1]))
        mean, gaps = nodes[:_NODES], nodes[_NODES:]
        steps = np.diff(mean) * (1.0 if mean[-1] >= mean[0] else -1.0)
        if (gaps >= 0.0).all() and (steps >= np.abs(np.diff(gaps))).all():
            return _through(cable, mean, gaps), strengths
        strengths = 10.0 * strengths[0], 10.0 * strengths[1]
    return _through(cable, *_line_and_gap(sums)), strengths


def _line_and_gap(sums: Array) -> tuple[Array, Array]:
    """The nodes of the best straight mean and of the best constant gap, which is zero where it would be below."""
    shapes = np.zeros((2 * _NODES, 3))
    shapes[:_NODES, 0], shapes[:_NODES, 1], shapes[_NODES:, 2] = np.linspace(-1.0, 1.0, _NODES), 1.0, 1.0
    gram, moments = shapes.T @ sums[:-1, :-1] @ shapes, shapes.T @ sums[:-1, -1]
    found = inverse_of(gram) @ moments
    if not found[2] > 0.0:
        found = np.append(inverse_of(gram[:2, :2]) @ moments[:2], 0.0)
    nodes = shapes @ found
    return nodes[:_NODES], nodes[_NODES:]


def _free(path: Path, lag: float, cable: Branches, strengths: tuple[float, float]) -> Estimate:
    prior = _penalty(strengths, float(path.weight.sum()), _one_seen(cable))
    return _estimate(path, lag, cable, design_of(path.motor, lag, cable), np.array([lag, *strengths]), prior)


def _estimate(path: Path, lag: float, cable: Branches, columns: Array, theta: Array, prior: Array) -> Estimate:
    parameters = {"slope": cable.slope, "offset": cable.offset}
    for name, values in (("reach", cable.reaches), ("share", cable.shares), ("bend", cable.bends), ("gap", cable.gaps)):
        parameters |= {f"{name}_{k}": float(value) for k, value in enumerate(values, 1)}
    parameters |= {"first_node": cable.low, "last_node": cable.high, "initial_lag": lag}
    names = [f"{what}_{k}" for what in ("mean", "gap") for k in range(1, columns.shape[1] // 2 + 1)]
    return Estimate(
        parameters=parameters,
        slopes=dict(zip(names, columns.T, strict=True)),
        fitted=joint_angle(path.motor, lag, cable),
        theta=theta,
        prior=prior,
    )
