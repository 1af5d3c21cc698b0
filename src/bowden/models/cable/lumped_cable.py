"""The lumped-mass tendon: n masses on springs in a sheath, with Coulomb or Dahl friction, and the joint's inertia.

Node 0 is the spool and node n the joint; u is how far a node has moved towards the motor.

    m[i]·d²u[i]/dt² = T[i−1] − T[i] − F[i]·z[i],     T[i] = max(0, p + k·(u[i] − u[i+1]))
    F[i] = tanh(α[i]/2)·(T[i−1] + T[i])

and at the joint the spring p + K·u[n] and a viscous damping stand in place of T[n]. The limit F makes a sliding node
hold the capstan's ratio exactly, T[i] = T[i−1]·e^(∓α[i]), so that a slow motion is that of `sliding_cable` on the same
grid. z is the share of the limit that friction has reached (`bowden.models.cable.friction`).

A step is implicit (backward Euler), with the limits F of its beginning: the positions then minimise a strictly convex
function, found by Newton's method with a line search, one tridiagonal solve a turn. It is stable for any step, which
matters because the tendon's own waves last microseconds; they are damped away, the joint's motion is resolved.

Source: the lumped masses of Kaneko et al. 1991 (the paper's [9]) with Coulomb friction, and of Palli and Melchiorri
([6]) with Dahl friction; the limit that keeps the capstan's ratio and the implicit step are this file's.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import ParameterError
from bowden.core.kernel import kernel, noinline, tanh
from bowden.models.cable.capstan import Tendon
from bowden.models.cable.friction import coulomb, coulomb_slope, dahl, dahl_slope
from bowden.models.cable.sliding_cable import PreparedTendon, prepare_tendon, start_tendon


class LumpedTendon(NamedTuple):
    """A tendon with mass; the defaults are a stated choice."""

    tendon: Tendon = Tendon(elements=10)
    """The parameters that the tendon without mass has too."""
    density: float = 0.01
    """Of the tendon [kg/m]."""
    inertia: float = 2e-4
    """Of the joint [kg·m²]."""
    damping: float = 0.01
    """Of the joint [N·m·s/rad]."""
    dahl: bool = False
    """Dahl friction in place of Coulomb's."""
    presliding: float = 1e-7
    """z₀, how far a node gives before it slides [m]; with Dahl friction something like 1e-4."""
    step: float = 5e-4
    """Longest step; the joint's own motion is damped by about ω·step/2 more than it should be [s]."""


class PreparedLumped(NamedTuple):
    """Constants of a lumped tendon for the kernels."""

    tendon: PreparedTendon
    masses: NDArray[np.float64]
    """Of each node (n + 1,) [kg]."""
    damping: float
    """Of the joint, at the tendon [N·s/m]."""
    dahl: bool
    presliding: float
    """[m]"""
    step: float
    """[s]"""


class LumpedMemory(NamedTuple):
    """Where the tendon is; the arrays are changed in place by whoever owns them."""

    moved: NDArray[np.float64]
    """u of each node (n + 1,) [m]."""
    speed: NDArray[np.float64]
    """du/dt (n + 1,) [m/s]."""
    share: NDArray[np.float64]
    """z of each node (n + 1,) [–]."""


class _Step(NamedTuple):
    """All that is given in one step."""

    before: NDArray[np.float64]
    """u at its beginning (n + 1,) [m]; node 0 has already gone to its end."""
    coasting: NDArray[np.float64]
    """How far each node would go unforced (n + 1,) [m]."""
    limits: NDArray[np.float64]
    """F (n + 1,) [N]."""
    share: NDArray[np.float64]
    """z at its beginning (n + 1,) [–]."""
    dt: float
    """[s]"""


def prepare_lumped(lumped: LumpedTendon) -> PreparedLumped:
    """The constants of a tendon.

    Raises:
        ParameterError: a number that cannot be.
    """
    for name in ("density", "inertia", "presliding", "step"):
        value = getattr(lumped, name)
        if not 0.0 < value < float("inf"):
            raise ParameterError(f"lumped tendon: {name} is {value}", expected="a number above 0")
    if not 0.0 <= lumped.damping < float("inf"):
        raise ParameterError(f"lumped tendon: damping is {lumped.damping}", expected="a number not below 0")
    tendon = prepare_tendon(lumped.tendon)
    masses = np.full(tendon.angles.size, lumped.density * lumped.tendon.length / lumped.tendon.elements)
    masses[-1] = 0.5 * masses[-1] + lumped.inertia / tendon.joint_radius**2
    damping = lumped.damping / tendon.joint_radius**2
    return PreparedLumped(tendon, masses, damping, bool(lumped.dahl), lumped.presliding, lumped.step)


@noinline
def start_lumped(cable: PreparedLumped, motor: float, width: float) -> LumpedMemory:
    """At rest at a `motor` angle [rad], with one tension all along and no friction."""
    moved = start_tendon(cable.tendon, motor, width).moved
    return LumpedMemory(moved, np.zeros(moved.size), np.zeros(moved.size))


@kernel
def advance_lumped(
    cable: PreparedLumped, memory: LumpedMemory, before: float, after: float, width: float, dt: float
) -> LumpedMemory:
    """After the motor has gone evenly from an angle to another [rad] within `dt` [s]; in place."""
    count = max(1, math.ceil(dt / cable.step * (1.0 - 1e-9)))
    for i in range(count):
        motor = before + (i + 1.0) / count * (after - before)
        _step(cable, memory, cable.tendon.motor_radius * motor - cable.tendon.slack, width, dt / count)
    return memory


@kernel
def lumped_tension(cable: PreparedLumped, memory: LumpedMemory, element: int) -> float:
    """Tension of an element, 0 at the motor [N]."""
    return _tension(memory.moved, element, cable.tendon)


@kernel
def lumped_pull(cable: PreparedLumped, memory: LumpedMemory, width: float) -> float:
    """Tension where the tendon leaves the spool: the first element's, and half an element of friction [N]."""
    held = tanh(0.5 * width * cable.tendon.angles[0]) * memory.share[0]
    return _tension(memory.moved, 0, cable.tendon) * (1.0 + held) / (1.0 - held)


@kernel
def _tension(u: NDArray[np.float64], element: int, tendon: PreparedTendon) -> float:
    return max(0.0, tendon.preload + tendon.element * (u[element] - u[element + 1]))


@kernel
def _share(z: float, travel: float, dahls: bool, presliding: float) -> float:
    return dahl(z, travel, presliding) if dahls else coulomb(z, travel, presliding)


@kernel
def _share_slope(z: float, travel: float, dahls: bool, presliding: float) -> float:
    return dahl_slope(z, travel, presliding) if dahls else coulomb_slope(z, travel, presliding)


@noinline
def _step(cable: PreparedLumped, memory: LumpedMemory, pulled: float, width: float, dt: float) -> None:
    """One implicit step; node 0 goes to `pulled` [m]."""
    u, n, tendon = memory.moved, memory.moved.size - 1, cable.tendon
    limits = np.zeros(n + 1)
    for i in range(1, n + 1):
        far = _tension(u, i, tendon) if i < n else max(0.0, tendon.preload + tendon.end * u[n])
        limits[i] = tanh(0.5 * width * tendon.angles[i]) * (_tension(u, i - 1, tendon) + far)
    memory.share[0] = _share(memory.share[0], pulled - u[0], cable.dahl, cable.presliding)
    memory.speed[0] = (pulled - u[0]) / dt
    given = _Step(u.copy(), dt * memory.speed, limits, memory.share, dt)
    given.before[0], u[0] = pulled, pulled
    for i in range(1, n + 1):
        u[i] += given.coasting[i]
    _solve(cable, given, u)
    for i in range(1, n + 1):
        travel = u[i] - given.before[i]
        memory.speed[i] = travel / dt
        memory.share[i] = _share(memory.share[i], travel, cable.dahl, cable.presliding)


@kernel
def _solve(cable: PreparedLumped, given: _Step, u: NDArray[np.float64]) -> None:
    """The balance of forces, which is the gradient of a convex function of u; in place.

    After a violent jump Newton's method can creep from one node's narrow dead zone to the next; then the zones begin
    wide, and each solution is the next one's start.
    """
    for wider in (1.0, 1e4, 1e3, 100.0, 10.0, 1.0):
        if _newton(cable, given, u, wider * cable.presliding) and wider == 1.0:
            return


@noinline
def _newton(cable: PreparedLumped, given: _Step, u: NDArray[np.float64], presliding: float) -> bool:
    """Newton's method with a line search, and whether it has come to the balance; in place."""
    n = u.size - 1
    force, slope, onward = np.zeros(n + 1), np.zeros(n + 1), np.zeros(n + 1)
    _balance(cable, given, u, presliding, force, slope, onward)
    for _ in range(60):
        move, steep = np.zeros(n + 1), 0.0
        for i in range(2, n + 1):  # the symmetric tridiagonal system, down ...
            ratio = onward[i - 1] / slope[i - 1]
            slope[i] -= ratio * onward[i - 1]
            move[i] = ratio * (move[i - 1] + force[i - 1])
        for i in range(n, 0, -1):  # ... and up
            move[i] = (-(force[i] + move[i]) + (onward[i] * move[i + 1] if i < n else 0.0)) / slope[i]
        for i in range(1, n + 1):
            steep += force[i] * move[i]
        low, high, size, gone = 0.0, 1.0, 1.0, 0.0
        for _ in range(40):  # along the move, to where the function has stopped falling: its slope there only grows
            for i in range(1, n + 1):
                u[i] += (size - gone) * move[i]
            gone = size
            _balance(cable, given, u, presliding, force, slope, onward)
            left = 0.0
            for i in range(1, n + 1):
                left += force[i] * move[i]
            if abs(left) <= 0.5 * abs(steep) or (size == 1.0 and left <= 0.0):
                break
            if left > 0.0:
                high = size
            else:
                low = size
            size = 0.5 * (low + high)
        worst = 0.0
        for i in range(1, n + 1):
            worst = max(worst, abs(force[i]))
        if worst < 1e-8:
            return True
    return False


@noinline
def _balance(
    cable: PreparedLumped,
    given: _Step,
    u: NDArray[np.float64],
    presliding: float,
    force: NDArray[np.float64],
    slope: NDArray[np.float64],
    onward: NDArray[np.float64],
) -> None:
    """Force imbalance at each node [N], its derivative by the node's u, and minus that by the next one's."""
    n, tendon = u.size - 1, cable.tendon
    near = _tension(u, 0, tendon)
    for i in range(1, n + 1):
        travel = u[i] - given.before[i]
        inertia = cable.masses[i] / (given.dt * given.dt)
        force[i] = inertia * (travel - given.coasting[i]) - near
        force[i] += given.limits[i] * _share(given.share[i], travel, cable.dahl, presliding)
        slope[i] = inertia + given.limits[i] * _share_slope(given.share[i], travel, cable.dahl, presliding)
        slope[i] += tendon.element if near > 0.0 else 0.0
        if i < n:
            near = _tension(u, i, tendon)
            onward[i] = tendon.element if near > 0.0 else 0.0
            force[i] += near
            slope[i] += onward[i]
        else:
            force[i] += tendon.preload + tendon.end * u[n] + cable.damping / given.dt * travel
            slope[i] += tendon.end + cable.damping / given.dt
