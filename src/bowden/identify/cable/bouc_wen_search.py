"""The global stage for Bouc–Wen: differential evolution over what is not linear, on a thinned path.

The search runs in coordinates in which the loop's features are nearly independent:

    θ = (ln κ, ln γ, ln n, z₀),    κ = ρ/h_s,    γ = 1/(2σ − 1),    z₀ = h(0)/h_s,    h_s = (2σ−1)^(−1/n) = γ^(1/n)

For z = h/h_s Eq. 7 then reads dz/d|x| = κ·(1 − |z|ⁿ) while |z| grows and −κ·(1 + γ·|z|ⁿ) while it falls: κ is how fast
the cable answers, n how sharply it saturates, γ how much faster it lets go than it took up.
"""

import math

import numpy as np
from numpy.typing import NDArray

from bowden.core.kernel import compiled, exp, kernel
from bowden.identify.cable.path import Path
from bowden.models.cable.bouc_wen import BoucWen, saturation, travel_step

Array = NDArray[np.float64]


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
