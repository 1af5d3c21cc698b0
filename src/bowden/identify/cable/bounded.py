"""Least squares for a few unknowns within bounds: the trust-region reflective method.

Minimised is ½·|r(θ)|² for low ≤ θ ≤ high. A step p is taken in scaled unknowns, θ' = θ + d·p, where d² is an unknown's
distance to the bound that it is drawn to: what comes near a bound moves less and less, and never reaches it. There

    ½·|J·d·p + r|² + ½·pᵀ·C·p,   |p| ≤ radius

is a model of the cost, with C the change of d² along the gradient. Of its minimum, of that minimum reflected at the
first bound that it meets, and of the steepest descent, the best is tried; the radius follows how well the model
foretold it.

SciPy's `least_squares` does the same and comes to the same θ, which a test compares; to import it takes longer than to
fit a log.

Sources: Branch, Coleman and Li, SIAM Journal on Scientific Computing 21(1), 1999; for the step in the ball, Moré, *The
Levenberg–Marquardt algorithm: implementation and theory*, 1978.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_SINGULAR = float(np.finfo(float).eps)
_INSIDE = 0.995
"""Share of the way to a bound that a step may take; more of it near the minimum."""


class ProblemAt(NamedTuple):
    """The problem at one θ."""

    residual: Array
    """r (m,)."""
    jacobian: Array
    """∂r/∂θ (m, k)."""
    linear: Array
    """What is linear in the problem, at its best for that θ (p,)."""


class Least(NamedTuple):
    """A minimum."""

    theta: Array
    """θ (k,)."""
    cost: float
    """½·|r|²."""
    linear: Array
    """What is linear in the problem, at its best there (p,)."""


class _Model(NamedTuple):
    """Of the cost, in scaled unknowns."""

    jacobian: Array
    gradient: Array
    curvature: Array
    """Diagonal of C (k,)."""
    scale: Array
    """d (k,)."""

    def at(self, step: Array) -> float:
        """How the cost changes with a step."""
        moved = self.jacobian @ step
        return float(0.5 * (moved @ moved + (step * self.curvature) @ step) + self.gradient @ step)

    def along(self, way: Array, origin: Array, low: float, high: float) -> Array:
        """The best step `origin` + t·`way`, low ≤ t ≤ high."""
        moved, before = self.jacobian @ way, self.jacobian @ origin
        bend = 0.5 * float(moved @ moved + (way * self.curvature) @ way)
        rise = float(self.gradient @ way + before @ moved + (origin * self.curvature) @ way)
        tried = [low, high]
        if bend != 0.0 and low < -0.5 * rise / bend < high:
            tried.append(-0.5 * rise / bend)
        return np.asarray(origin + min(tried, key=lambda t: t * (bend * t + rise)) * way)


def bounded_least_squares(
    problem: Callable[[Array], ProblemAt],
    start: Array,
    low: Array,
    high: Array,
    scale: Array,
    *,
    step_tolerance: float,
    cost_tolerance: float,
    most: int,
) -> Least:
    """The minimum nearest to `start`.

    Args:
        problem: r and ∂r/∂θ at a θ.
        start: θ (k,) inside the bounds.
        low: smallest θ (k,).
        high: largest θ (k,).
        scale: how far each unknown moves for a noticeable change (k,).
        step_tolerance: ends the search where a step is a smaller share of θ.
        cost_tolerance: ends it where a step lowers the cost by a smaller share.
        most: how often the problem is looked at.
    """
    theta, here, seen = start, problem(start), 1
    cost = 0.5 * float(here.residual @ here.residual)
    gradient = here.jacobian.T @ here.residual
    room, inward = _room(theta, gradient, low, high)
    radius = _length(theta / scale / np.sqrt(np.where(inward != 0.0, room / scale, room))) or 1.0
    damping, ended = 0.0, False
    while not ended and seen < most:
        room, inward = _room(theta, gradient, low, high)
        steepest = float(np.abs(gradient * room).max())
        if steepest < 1e-14:
            break
        scaled = np.sqrt(np.where(inward != 0.0, room / scale, room)) * scale
        model = _Model(here.jacobian * scaled, scaled * gradient, gradient * inward * scale, scaled)
        inside = max(_INSIDE, 1.0 - steepest)
        widened = np.vstack([model.jacobian, np.diag(np.sqrt(model.curvature))])
        left, values, right = np.linalg.svd(widened, full_matrices=False)
        turned = left.T @ np.concatenate([here.residual, np.zeros(len(theta))])
        gained = -1.0
        while not ended and gained <= 0.0 and seen < most:
            wanted, damping = _in_ball(turned, values, right.T, len(here.residual), radius, damping)
            step = _best_step(model, theta, wanted, radius, low, high, inside)
            after = _strictly_inside(theta + model.scale * step, low, high)
            there, seen = problem(after), seen + 1
            length = _length(step)
            new_cost = 0.5 * float(there.residual @ there.residual)
            if not np.isfinite(new_cost):
                radius = 0.25 * length
                continue
            gained, foretold = cost - new_cost, -model.at(step)
            kept = gained / foretold if foretold > 0.0 else float(foretold == gained == 0.0)
            narrowed = radius
            if kept < 0.25:
                narrowed = 0.25 * length
            elif kept > 0.75 and length > 0.95 * radius:
                narrowed = 2.0 * radius
            moved, enough = _length(model.scale * step), step_tolerance * (step_tolerance + _length(theta))
            ended = moved < enough or (gained < cost_tolerance * cost and kept > 0.25)
            if not ended:
                damping, radius = damping * radius / narrowed, narrowed
        if gained > 0.0:
            theta, here, cost = after, there, new_cost
            gradient = here.jacobian.T @ here.residual
    return Least(theta, cost, here.linear)


def _length(vector: Array) -> float:
    return float(np.sqrt(vector @ vector))


def _room(theta: Array, gradient: Array, low: Array, high: Array) -> tuple[Array, Array]:
    """Distance to the bound that descent leads to (k,), and its sign: how it changes with θ."""
    room = np.where(gradient < 0.0, high - theta, np.where(gradient > 0.0, theta - low, 1.0))
    return room, np.sign(gradient)


def _in_ball(turned: Array, values: Array, right: Array, rows: int, radius: float, near: float) -> tuple[Array, float]:
    """The p that minimises |J·p + r|² in |p| ≤ radius, and the damping α for which (JᵀJ + α)·p = −Jᵀr.

    Args:
        turned: Uᵀr, of the singular value decomposition J = U·S·Vᵀ.
        values: S.
        right: V.
        rows: of J.
        radius: of the ball.
        near: α where the search for it begins.
    """
    weighted = values * turned
    full = bool(values[-1] > _SINGULAR * rows * values[0])
    if full:
        newton = -right @ (turned / values)
        if _length(newton) <= radius:
            return newton, 0.0
    most = _length(weighted) / radius

    def beyond(damping: float) -> tuple[float, float]:
        """How far p is out of the ball with a damping, and its derivative."""
        denominator = values**2 + damping
        length = _length(weighted / denominator)
        return length - radius, -float(np.sum(weighted**2 / denominator**3)) / length

    least = 0.0
    if full:
        out, slope = beyond(0.0)
        least = -out / slope
    damping = near
    if not full and near == 0.0:
        damping = max(0.001 * most, (least * most) ** 0.5)
    for _ in range(10):
        if not least <= damping <= most:
            damping = max(0.001 * most, (least * most) ** 0.5)
        out, slope = beyond(damping)
        if out < 0.0:
            most = damping
        least = max(least, damping - out / slope)
        damping -= (out + radius) * out / slope / radius
        if abs(out) < 0.01 * radius:
            break
    step = -right @ (weighted / (values**2 + damping))
    return step * (radius / _length(step)), damping


def _best_step(
    model: _Model, theta: Array, wanted: Array, radius: float, low: Array, high: Array, inside: float
) -> Array:
    """The step to try: `wanted` where it stays inside the bounds, else the best of three that do."""
    there = theta + model.scale * wanted
    if ((there >= low) & (there <= high)).all():
        return wanted
    share, met = _to_bound(theta, model.scale * wanted, low, high)
    to_it = share * wanted
    steps = [inside * to_it]
    reflected = np.where(met, -wanted, wanted)
    to_ball = _to_ball(to_it, reflected, radius)
    to_next = _to_bound(theta + model.scale * to_it, model.scale * reflected, low, high)[0]
    furthest = min(to_next, to_ball)
    if furthest > 0.0:
        nearest, furthest = (1.0 - inside) * share / furthest, inside * to_next if furthest == to_next else to_ball
        if nearest <= furthest:
            steps.append(model.along(reflected, to_it, nearest, furthest))
    descent = -model.gradient
    to_ball, to_next = radius / _length(descent), _to_bound(theta, model.scale * descent, low, high)[0]
    steps.append(model.along(descent, np.zeros_like(descent), 0.0, inside * to_next if to_next < to_ball else to_ball))
    return min(steps, key=model.at)


def _to_bound(theta: Array, way: Array, low: Array, high: Array) -> tuple[float, NDArray[np.bool_]]:
    """How often `way` fits in before the first bound, and which unknowns meet theirs then (k,)."""
    moving = way != 0.0
    shares = np.full(len(way), np.inf)
    shares[moving] = np.maximum((low - theta)[moving] / way[moving], (high - theta)[moving] / way[moving])
    return float(shares.min()), (shares == shares.min()) & moving


def _to_ball(origin: Array, way: Array, radius: float) -> float:
    """The t > 0 with |origin + t·way| = radius, for an origin inside."""
    a, b, c = float(way @ way), float(origin @ way), float(origin @ origin) - radius**2
    q = -(b + float(np.copysign(np.sqrt(b * b - a * c), b)))
    return max(q / a, c / q)


def _strictly_inside(theta: Array, low: Array, high: Array) -> Array:
    return np.clip(theta, np.nextafter(low, high), np.nextafter(high, low))
