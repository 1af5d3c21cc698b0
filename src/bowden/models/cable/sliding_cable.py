"""The partially moving, partially sticking tendon: elastic, with capstan friction, quasi-static, in n elements.

The tendon is n springs between n + 1 nodes; u is how far a node has moved towards the motor, and a node slides only
while the tensions on its two sides are in the ratio that the capstan gives its share of the bend:

    T[i] = p + k·(u[i] − u[i+1]),    T[i] = T[i−1]·e^(∓α[i]) where node i slides,    between the two where it sticks

with the spring p + K·u[n] in place of T[n], k = EA·n/L and K = spring/r_j². When the motor moves, what slides reaches
from the motor to a front, beyond which nothing has changed. Inside it every tension is a known multiple of the first,
so the front is found by one walk along the nodes, without iteration, whatever the length of the move: the result is
exact for the n elements, rate-independent, and cutting a move in two changes nothing. Tension is never negative; where
the spring comes to rest the whole tendon is slack, and moves nothing until the slack is taken up.

When the sheath is bent more, what stuck sticks; when it straightens, nodes slide until all hold again (`_settle`).

Left out: the tendon's mass, friction that does not grow with tension, and the path's change of length with the bend.

Source: the partly moving, partly sticking cable of Tian et al. (the paper's [14]) and Agrawal et al. 2010 ([13]); the
front in place of their partial differential equations is this file's.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.kernel import exp, kernel, noinline
from bowden.models.cable.capstan import Tendon, check_tendon, node_angles


class PreparedTendon(NamedTuple):
    """Constants of a tendon for the kernels."""

    angles: NDArray[np.float64]
    """α of each node at relative width 1 (n + 1,) [–]."""
    element: float
    """k, stiffness of one element [N/m]."""
    end: float
    """K, the joint's spring at the tendon [N/m]."""
    preload: float
    """p, tension everywhere when nothing has moved [N]."""
    motor_radius: float
    """[m]"""
    joint_radius: float
    """[m]"""
    slack: float
    """[m]"""


class TendonMemory(NamedTuple):
    """Where the tendon is; the arrays are changed in place by whoever owns them."""

    moved: NDArray[np.float64]
    """u of each node (n + 1,) [m]."""
    ratios: NDArray[np.float64]
    """e^(−α·width) of each node (n + 1,) [–]."""
    last: NDArray[np.float64]
    """The relative width that `ratios` holds for, and the direction of the last move (2,) [–]."""


def prepare_tendon(tendon: Tendon) -> PreparedTendon:
    """The constants of a tendon.

    Raises:
        ParameterError: a tendon that cannot be.
    """
    check_tendon(tendon)
    return PreparedTendon(
        angles=node_angles(tendon),
        element=tendon.stiffness * tendon.elements / tendon.length,
        end=tendon.spring / tendon.joint_radius**2,
        preload=tendon.pretension / tendon.joint_radius,
        motor_radius=tendon.motor_radius,
        joint_radius=tendon.joint_radius,
        slack=tendon.slack,
    )


@noinline
def start_tendon(tendon: PreparedTendon, motor: float, width: float) -> TendonMemory:
    """At rest at a `motor` angle [rad], with one tension all along, as a tendon that was shaken into place."""
    n = tendon.angles.size - 1
    pulled = tendon.motor_radius * motor - tendon.slack
    stretch = max(pulled / (n / tendon.element + 1.0 / tendon.end) + tendon.preload, 0.0) - tendon.preload
    moved, ratios = np.empty(n + 1), np.empty(n + 1)
    for i in range(n + 1):
        moved[i] = stretch / tendon.end + (n - i) * stretch / tendon.element
        ratios[i] = exp(-width * tendon.angles[i])
    moved[0] = pulled
    return TendonMemory(moved, ratios, np.array([width, 1.0]))


@kernel
def advance_tendon(tendon: PreparedTendon, memory: TendonMemory, motor: float, width: float) -> TendonMemory:
    """After the motor has gone one way to an angle [rad] in a sheath of that relative width; in place."""
    if width != memory.last[0]:
        _bend(tendon, memory, width)
    pulled = tendon.motor_radius * motor - tendon.slack
    if pulled != memory.moved[0]:
        _pull(tendon, memory, pulled)
    return memory


@kernel
def tendon_joint(tendon: PreparedTendon, memory: TendonMemory) -> float:
    """Joint angle [rad]."""
    return memory.moved[-1] / tendon.joint_radius


@kernel
def tension(tendon: PreparedTendon, memory: TendonMemory, element: int) -> float:
    """Tension of an element, 0 at the motor; of the joint's spring for element n [N]."""
    u = memory.moved
    if element == u.size - 1:
        return max(tendon.preload + tendon.end * u[element], 0.0)
    return max(tendon.preload + tendon.element * (u[element] - u[element + 1]), 0.0)


@kernel
def motor_tension(tendon: PreparedTendon, memory: TendonMemory) -> float:
    """Tension where the tendon leaves the spool: the first element's, and half an element of friction [N]."""
    first, ratio = tension(tendon, memory, 0), memory.ratios[0]
    return first / ratio if memory.last[1] > 0.0 else first * ratio


@noinline
def _pull(tendon: PreparedTendon, memory: TendonMemory, pulled: float) -> None:
    """The front's walk: node 0 goes to `pulled` [m]."""
    u, ratios, k, p = memory.moved, memory.ratios, tendon.element, tendon.preload
    n = u.size - 1
    direction = 1.0 if pulled > u[0] else -1.0
    memory.last[1] = direction
    share, total = 1.0, 1.0  # T of the element before the front over the first one's, and the sum of all of these
    first, front = 0.0, n + 1
    for j in range(1, n + 1):
        first = (k * (pulled - u[j]) + j * p) / total
        beyond = p + k * (u[j] - u[j + 1]) if j < n else p + tendon.end * u[n]
        share *= ratios[j] if direction > 0.0 else 1.0 / ratios[j]
        if direction * (beyond - share * first) >= 0.0:
            front = j
            break
        if j < n:
            total += share
    u[0] = pulled
    if front > n:  # all of it slides
        first = (tendon.end * (k * pulled + n * p) + k * p) / (tendon.end * total + k * share)
        if first <= 0.0:  # slack: it lies as if it had just lost its tension
            for i in range(n, 0, -1):
                u[i] = -p / tendon.end - (n - i) * p / k
            return
    share = 1.0
    for i in range(1, min(front, n + 1)):
        u[i] = u[i - 1] - (share * first - p) / k
        share *= ratios[i] if direction > 0.0 else 1.0 / ratios[i]


@noinline
def _bend(tendon: PreparedTendon, memory: TendonMemory, width: float) -> None:
    """Take the sheath to another width, the motor at rest; in shorter steps where `_settle` goes in circles."""
    part, before = width - memory.last[0], memory.moved.copy()
    while memory.last[0] < width or memory.last[0] > width:
        reached = memory.last[0]
        step_ends = width if abs(width - reached) <= abs(part) * (1.0 + 1e-9) else reached + part
        for i in range(tendon.angles.size):
            memory.ratios[i] = exp(-step_ends * tendon.angles[i])
        if step_ends > reached or _settle(tendon, memory) or abs(part) < 1e-4 * width:
            memory.last[0] = step_ends
            _copy(memory.moved, before)
        else:
            _copy(before, memory.moved)
            part *= 0.5


@kernel
def _copy(values: NDArray[np.float64], to: NDArray[np.float64]) -> None:
    """A slice would be checked for its shape, which takes three seconds to compile."""
    for i in range(values.size):
        to[i] = values[i]


@noinline
def _settle(tendon: PreparedTendon, memory: TendonMemory) -> bool:
    """Let every node slide that the straighter sheath no longer holds, the motor at rest.

    Which nodes slide, and which way, is found by solving for the positions and mending the choice until it holds; one
    solve is one sweep down and one up (a tridiagonal system). False if it went in circles.
    """
    u, ratios, k, p = memory.moved, memory.ratios, tendon.element, tendon.preload
    n = u.size - 1
    before, slides = u.copy(), np.zeros(n + 1)
    upper, right = np.zeros(n + 1), np.zeros(n + 1)
    for _ in range(4 * n + 8):
        mended = False
        for i in range(1, n + 1):
            near = max(p + k * (u[i - 1] - u[i]), 0.0)
            far = p + k * (u[i] - u[i + 1]) if i < n else p + tendon.end * u[n]
            if slides[i] != 0.0:
                if slides[i] * (u[i] - before[i]) < -1e-15:
                    slides[i], mended = 0.0, True
            elif far < ratios[i] * near - 1e-9:
                slides[i], mended = 1.0, True
            elif near < ratios[i] * far - 1e-9:
                slides[i], mended = -1.0, True
        if not mended:
            return True
        upper[0], right[0] = 0.0, u[0]
        for i in range(1, n + 1):  # −lower·u[i−1] + middle·u[i] − above·u[i+1] = side
            lower, middle, above, side = 0.0, 1.0, 0.0, before[i]
            if slides[i] != 0.0:
                ratio = ratios[i] if slides[i] > 0.0 else 1.0 / ratios[i]
                lower, side = ratio * k, (ratio - 1.0) * p
                above = k if i < n else 0.0
                middle = lower + (k if i < n else tendon.end)
            pivot = middle - lower * upper[i - 1]
            upper[i], right[i] = above / pivot, (side + lower * right[i - 1]) / pivot
        for i in range(n, 0, -1):
            u[i] = right[i] + (upper[i] * u[i + 1] if i < n else 0.0)
    return False
