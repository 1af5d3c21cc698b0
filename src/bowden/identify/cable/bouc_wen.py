"""The Bouc–Wen cable (Eqs 6–7) fitted to a path, alone or with a smooth static nonlinearity.

    joint = slope·motor + offset + Σ static_k·T_k(u) + (hysteresis_gain + Σ hysteresis_gain_k·T_k(u))·h

u runs from −1 to 1 over the motor's range in the fitted part. The Chebyshev polynomials T_k bend the mean line
(k = 2 … ) and let the height of the loop vary over the stroke (k = 1 … ); the plain cable has neither. Everything but
ρ, σ, n and h(0) is linear and solved exactly. Outside the fitted range a static term goes on along its tangent, and the
loop keeps its height.

A cable that runs backwards has a negative slope and then a positive hysteresis_gain: Eq. 6 is linear in both, so the
loop's shape (ρ, σ, n) is the same.

The fitted part of the log decides the degrees. The richest form is fitted first. With its h held, every other choice
is linear, so that all of them can be judged on left-out strokes at almost no cost; the choice is then fitted properly.

The global stage is differential evolution over what is not linear, on a thinned path. It runs in coordinates in
which the loop's features are nearly independent:

    θ = (ln κ, ln γ, ln n, z₀),    κ = ρ/h_s,    γ = 1/(2σ − 1),    z₀ = h(0)/h_s,    h_s = (2σ−1)^(−1/n) = γ^(1/n)

For z = h/h_s Eq. 7 then reads dz/d|x| = κ·(1 − |z|ⁿ) while |z| grows and −κ·(1 + γ·|z|ⁿ) while it falls: κ is how fast
the cable answers, n how sharply it saturates, γ how much faster it lets go than it took up.
"""

import math

import numpy as np

from bowden.core.kernel import compiled, exp, kernel
from bowden.identify.cable.path import Path
from bowden.identify.cable.projection import Array, Estimate, minimise, products
from bowden.identify.cable.validation import folds, simplest_of_the_best
from bowden.models.cable.bouc_wen import BoucWen, saturation, slope_of_h, travel_step
from bowden.models.cable.bouc_wen_sensitivity import sensitivities
from bowden.plants.predicted import chebyshev, degrees_of

SEARCHED = ("rate", "shape", "exponent", "initial_h")
"""The parameters that are not linear."""
_RICHEST = (7, 2)
_CHOICES = [(static, heights) for static in (2, 3, 5, 7) for heights in (0, 1, 2)]


def fit_bouc_wen(path: Path, near: Estimate) -> Estimate:
    """The plain cable, seven parameters: four searched, three linear."""
    return fit_terms(path, near.theta, 1, 0, rough=True)


def fit_static(path: Path, near: Estimate) -> Estimate:
    """Between eight and fifteen parameters: four searched, the others linear; from the plain cable all of them."""
    if "static_centre" in near.parameters:
        return fit_terms(path, near.theta, *degrees_of(near.parameters), rough=True)
    rich = fit_terms(path, near.theta, *_RICHEST, rough=True)
    errors = _judge(path, rich, _CHOICES)
    return fit_terms(path, rich.theta, *simplest_of_the_best(errors, {choice: sum(choice) for choice in errors}))


def fit_terms(path: Path, start: Array, static: int, heights: int, *, rough: bool = False) -> Estimate:
    """The gradient stage from θ = `start`, with static terms to degree `static` and a loop height to `heights`."""
    fitted = path.motor[path.weight > 0]
    centre, half_range = 0.5 * float(fitted.max() + fitted.min()), 0.5 * float(np.ptp(fitted))
    u = (path.motor - centre) / half_range
    plain = [path.motor, np.ones_like(u)] + [chebyshev(u, k) for k in range(2, static + 1)]
    looped = [np.ones_like(u)] + [chebyshev(np.clip(u, -1.0, 1.0), k) for k in range(1, heights + 1)]
    fixed, height = np.stack(plain, axis=1), np.stack(looped, axis=1)

    def basis(theta: Array) -> tuple[Array, Array]:
        cable, initial, change = cable_at(theta)
        found = sensitivities(path.motor, initial, cable)
        by_theta = np.einsum("na,ak->kn", found[:, 1:], change)
        return np.concatenate([fixed, height * found[:, :1]], axis=1), by_theta[:, :, None] * height

    low, high = bounds(path.span)
    theta, linear = minimise(basis, path.joint, path.weight, start, low, high, rough)
    cable, initial, _ = cable_at(theta)
    h = sensitivities(path.motor, initial, cable)
    gains = np.einsum("np,p->n", height, linear[fixed.shape[1] :])
    names = ["slope", "offset"] + [f"static_{k}" for k in range(2, static + 1)]
    names += ["hysteresis_gain"] + [f"hysteresis_gain_{k}" for k in range(1, heights + 1)]
    columns = np.concatenate([fixed, height * h[:, :1]], axis=1)
    values = dict(zip(names, map(float, linear), strict=True))
    values |= dict(zip(SEARCHED, (cable.rate, cable.shape, cable.exponent, initial), strict=True))
    if static > 1 or heights > 0:
        values |= {"static_centre": centre, "static_half_range": half_range}
    slopes = {name: columns[:, i] for i, name in enumerate(names)}
    slopes |= {name: gains * h[:, i] for i, name in enumerate(SEARCHED, start=1)}
    order = [name for name in (*BoucWen._fields, "initial_h") if name in values]
    order += [name for name in values if name not in order]
    forward = 1.0 if len(path.turning) < 2 or path.turning[1] >= path.turning[0] else -1.0
    at_edge = np.minimum(theta - low, high - theta) < 1e-3 * (high - low)
    steepness = float(slope_of_h(initial, forward, cable))
    return Estimate(
        parameters={name: values[name] for name in order},
        slopes=slopes,
        fitted=np.einsum("np,p->n", columns, linear),
        theta=theta,
        # at an edge the data ask for more than the search offers, and the error's curvature does not say how far
        variance={"initial_h": (steepness * path.start_error) ** 2}
        | {name: np.inf for name, close in zip(SEARCHED[:3], at_edge[:3], strict=True) if close},
    )


def _judge(path: Path, rich: Estimate, choices: list[tuple[int, int]]) -> dict[tuple[int, int], Array]:
    """For each choice of degrees the mean squared error of each fold (folds,), fitted without it."""
    names = [name for name in rich.slopes if name not in SEARCHED]
    columns = np.stack([*(rich.slopes[name] for name in names), path.joint], axis=1)
    total = products(columns, path.weight)
    masks = folds(path)
    blocks = [products(columns[mask], path.weight[mask]) for mask in masks]
    counts = [float(path.weight[mask].sum()) for mask in masks]
    errors: dict[tuple[int, int], Array] = {}
    for static, heights in choices:
        wanted = {"slope", "offset", "hysteresis_gain"} | {f"static_{k}" for k in range(2, static + 1)}
        wanted |= {f"hysteresis_gain_{k}" for k in range(1, heights + 1)}
        chosen = [i for i, name in enumerate(names) if name in wanted]
        errors[static, heights] = np.array(
            [_left_out(total - block, block, chosen) / count for block, count in zip(blocks, counts, strict=True)]
        )
    return errors


def _left_out(fitted: Array, judged: Array, chosen: list[int]) -> float:
    """Squared error on `judged` of the coefficients that solve `fitted`; both are Gram matrices, the joint last."""
    size = np.sqrt(np.maximum(np.diag(fitted)[chosen], 1e-300))
    gram = fitted[np.ix_(chosen, chosen)] / np.outer(size, size)
    linear = np.linalg.lstsq(gram, fitted[chosen, -1] / size, rcond=1e-13)[0] / size
    error = judged[-1, -1] - 2.0 * linear @ judged[chosen, -1] + linear @ judged[np.ix_(chosen, chosen)] @ linear
    return max(float(error), 0.0)


def bounds(span: float) -> tuple[Array, Array]:
    """Lowest and highest θ (4,) for a motor that moves over `span` [rad].

    κ from a third of the span's inverse (a loop that never saturates) to a corner of a two-thousandth of the span; σ
    from 0.54 to 550; n from 1 to 30, at which the corner is sharper than any encoder shows.
    """
    low = np.array([np.log(0.3 / span), -7.0, 0.0, -1.0])
    high = np.array([np.log(2000.0 / span), 2.5, np.log(30.0), 1.0])
    return low, high


def cable_at(theta: Array) -> tuple[BoucWen, float, Array]:
    """The cable at θ (slope and gain left at one), h(0), and ∂(ρ, σ, n, h(0))/∂θ (4, 4)."""
    log_gamma, side = float(theta[1]), float(theta[3])
    n, gamma = float(np.exp(theta[2])), float(np.exp(theta[1]))
    bound = float(np.exp(log_gamma / n))
    rate = float(np.exp(theta[0])) * bound
    sharper = -log_gamma / n  # ∂ ln(bound) / ∂ ln n
    change = np.array(
        [
            [rate, rate / n, rate * sharper, 0.0],
            [0.0, -0.5 / gamma, 0.0, 0.0],
            [0.0, 0.0, n, 0.0],
            [0.0, side * bound / n, side * bound * sharper, bound],
        ]
    )
    return BoucWen(1.0, 1.0, rate, 0.5 * (1.0 + 1.0 / gamma), n, 0.0), side * bound, change


def search(path: Path, seed: int) -> Array:
    """The best θ (4,) that differential evolution finds."""
    from scipy.optimize import Bounds, differential_evolution  # half a second, which a simulation need not wait for

    def costs(candidates: Array) -> Array:
        found = np.empty(candidates.shape[1])
        compiled(projected_costs)(path.motor, path.joint, path.weight, np.ascontiguousarray(candidates.T), found)
        return found

    found = differential_evolution(
        costs,  # type: ignore[arg-type]  # of one candidate, as SciPy's types have it
        Bounds(*bounds(path.span)),
        popsize=8,
        maxiter=25,
        tol=1e-3,
        rng=seed,
        polish=False,
        vectorized=True,
        updating="deferred",
    )
    return np.asarray(found.x, dtype=np.float64)


@kernel
def projected_costs(motor: Array, joint: Array, weight: Array, candidates: Array, costs: Array) -> None:
    """The squared error of joint ≈ a·motor + b·h + c with the best a, b, c, for each θ of `candidates` (m, 4).

    Fills `costs` (m,).

    h takes coarse steps, exact to about 1e-3: this ranks candidates, the gradient stage follows.
    """
    total, motor_mean, joint_mean = 0.0, 0.0, 0.0
    for k in range(motor.size):
        total += weight[k]
        motor_mean += weight[k] * motor[k]
        joint_mean += weight[k] * joint[k]
    motor_mean, joint_mean = motor_mean / total, joint_mean / total
    xx, xy, yy = 0.0, 0.0, 0.0
    for k in range(motor.size):
        x, y = motor[k] - motor_mean, joint[k] - joint_mean
        xx += weight[k] * (x * x)
        xy += weight[k] * x * y
        yy += weight[k] * (y * y)
    for i in range(candidates.shape[0]):
        n, gamma = exp(candidates[i, 2]), exp(candidates[i, 1])
        scale = exp(candidates[i, 1] / n)
        cable = BoucWen(1.0, 1.0, exp(candidates[i, 0]) * scale, 0.5 * (1.0 + 1.0 / gamma), n, 0.0)
        bound = saturation(cable)
        piece = 0.5 / (cable.rate * (1.0 + n * max(1.0, gamma) / bound))
        h = candidates[i, 3] * bound
        sum_h, hh, hx, hy = 0.0, 0.0, 0.0, 0.0
        for k in range(motor.size):
            travel = motor[k] - motor[k - 1] if k > 0 else 0.0
            direction, left = math.copysign(1.0, travel), abs(travel)
            while left > 0.0 and abs(direction * bound - h) > 1e-4 * bound:
                h = travel_step(h, direction * min(left, piece), cable)
                left -= piece
            sum_h += weight[k] * h
            hh += weight[k] * h * h
            hx += weight[k] * h * (motor[k] - motor_mean)
            hy += weight[k] * h * (joint[k] - joint_mean)
        hh -= sum_h * sum_h / total
        determinant = xx * hh - hx * hx
        if determinant > 1e-9 * xx * hh:
            a, b = (xy * hh - hy * hx) / determinant, (hy * xx - xy * hx) / determinant
            costs[i] = yy - a * xy - b * hy
        else:
            costs[i] = yy - xy * xy / xx
