"""The lumped-mass tendon: its friction laws, its slow limit, its linear limit, and the balance of every step."""

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from bowden.core.errors import ParameterError
from bowden.core.kernel import compiled
from bowden.models.cable import friction, lumped_cable, sliding_cable
from bowden.models.cable.capstan import Tendon
from bowden.models.cable.lumped_cable import LumpedMemory, LumpedTendon, PreparedLumped, prepare_lumped
from bowden.models.cable.sliding_cable import prepare_tendon

START, ADVANCE = compiled(lumped_cable.start_lumped), compiled(lumped_cable.advance_lumped)
TENSION, PULL = compiled(lumped_cable.lumped_tension), compiled(lumped_cable.lumped_pull)
COULOMB = LumpedTendon()
DAHL = LumpedTendon(dahl=True, presliding=1e-4)
both = pytest.mark.parametrize("lumped", [COULOMB, DAHL], ids=["coulomb", "dahl"])
LAWS = [(friction.dahl, friction.dahl_slope), (friction.coulomb, friction.coulomb_slope)]
travels = st.floats(-3e-3, 3e-3)
shares = st.floats(-1.0, 1.0)


@given(shares, travels)
def test_dahl_is_the_solution_of_its_equation(z: float, travel: float) -> None:
    direction = math.copysign(1.0, travel)
    path = solve_ivp(lambda _, z: (direction - z) / 1e-3, (0.0, abs(travel)), [z], rtol=1e-9, atol=1e-11)
    assert friction.dahl(z, travel, 1e-3) == pytest.approx(path.y[0, -1], abs=1e-7)


@pytest.mark.parametrize(("law", "slope"), LAWS)
@given(shares, travels, st.floats(0.0, 1.0), st.floats(1e-6, 1e-2))
def test_friction_laws_are_bounded_rise_with_travel_and_know_no_time(
    law: Any, slope: Any, z: float, travel: float, part: float, presliding: float
) -> None:
    whole, halfway = law(z, travel, presliding), law(z, part * travel, presliding)
    assert abs(whole) <= 1.0
    assert law(halfway, (1.0 - part) * travel, presliding) == pytest.approx(whole, abs=1e-9)
    assert (whole - z) * math.copysign(1.0, travel) >= -1e-15
    assert slope(z, travel, presliding) >= 0.0
    small = 1e-5 * presliding
    middle = travel + math.copysign(2.0 * small, travel)
    across = (law(z, middle + small, presliding) - law(z, middle - small, presliding)) / (2.0 * small)
    near = {slope(z, middle - small, presliding), slope(z, middle, presliding), slope(z, middle + small, presliding)}
    assert min(near) - 1e-3 / presliding <= across <= max(near) + 1e-3 / presliding


def run(cable: PreparedLumped, times: np.ndarray, motor: np.ndarray, width: float = 1.0) -> np.ndarray:
    """Joint angles along a motion of the motor (n,) [rad]."""
    memory, joints = START(cable, float(motor[0]), width), [0.0] * len(times)
    joints[0] = memory.moved[-1] / cable.tendon.joint_radius
    for k, dt in enumerate(np.diff(times).tolist()):
        ADVANCE(cable, memory, float(motor[k]), float(motor[k + 1]), width, dt)
        joints[k + 1] = memory.moved[-1] / cable.tendon.joint_radius
    return np.array(joints)


def slow_difference(lumped: LumpedTendon, period: float = 1000.0, steps: int = 2000) -> float:
    """Largest difference of the joint from the tendon without mass on the same grid, over two strokes [rad]."""
    times = np.linspace(0.0, 2.0 * period, steps + 1)
    motor = 0.8 - 0.8 * np.cos(2.0 * np.pi * times / period)
    joints = run(prepare_lumped(lumped._replace(step=period)), times, motor)
    tendon, advance = prepare_tendon(lumped.tendon), compiled(sliding_cable.advance_tendon)
    still, worst = compiled(sliding_cable.start_tendon)(tendon, 0.0, 1.0), 0.0
    for angle, joint in zip(motor.tolist(), joints.tolist(), strict=True):
        advance(tendon, still, angle, 1.0)
        worst = max(worst, abs(joint - still.moved[-1] / tendon.joint_radius))
    return worst


@pytest.mark.parametrize("elements", [pytest.param(n, marks=pytest.mark.long) for n in (10, 25)])
def test_a_slow_motion_is_that_of_the_sliding_tendon(elements: int) -> None:
    """Inertia and damping fall with the speed; the limits of friction, a step late, with the step."""
    lumped = COULOMB._replace(tendon=Tendon(elements=elements))
    assert slow_difference(lumped, period=10.0) > 2e-3
    rough, fine = (slow_difference(lumped, steps=steps) for steps in (1000, 8000))
    assert fine < 1e-4
    assert fine < 0.2 * rough


def test_dahl_friction_goes_over_into_coulombs_as_it_gives_less() -> None:
    differences = [slow_difference(DAHL._replace(presliding=z), steps=8000) for z in (1e-4, 1e-5, 1e-6)]
    assert differences[0] > 5e-3
    assert all(b < 0.3 * a for a, b in pairwise(differences))


def test_dahl_friction_rounds_the_corner_of_the_reversal() -> None:
    """Coulomb's joint rests through the dead zone; Dahl's begins to give at once."""
    times = np.linspace(0.0, 1000.0, 3001)
    motor = np.interp(times, [0.0, 600.0, 1000.0], [0.0, 1.2, 1.17])
    given = [np.ptp(run(prepare_lumped(lumped._replace(step=1.0)), times, motor)[1801:]) for lumped in (COULOMB, DAHL)]
    assert given[0] < 1e-6
    assert given[1] > 20.0 * given[0]


def linear_error(step: float) -> float:
    """Without friction it is a chain of springs; against the matrix exponential, after 0.1 s of a ramp."""
    lumped = LumpedTendon(tendon=Tendon(friction=0.0, elements=3), density=2.0, step=step)
    cable = prepare_lumped(lumped)
    tendon, n = cable.tendon, 3
    stiffness = np.zeros((n, n))
    for i in range(n):
        stiffness[i, i] = 2.0 * tendon.element if i < n - 1 else tendon.element + tendon.end
        if i:
            stiffness[i, i - 1] = stiffness[i - 1, i] = -tendon.element
    mass = np.diag(cable.masses[1:])
    damping = np.zeros((n, n))
    damping[-1, -1] = cable.damping
    a = np.zeros((2 * n + 2, 2 * n + 2))  # u, v, the motor's u, its speed
    a[:n, n : 2 * n] = np.eye(n)
    a[n : 2 * n, :n] = -np.linalg.solve(mass, stiffness)
    a[n : 2 * n, n : 2 * n] = -np.linalg.solve(mass, damping)
    a[n, 2 * n] = tendon.element / cable.masses[1]
    a[2 * n, 2 * n + 1] = 1.0
    initial = np.zeros(2 * n + 2)
    initial[-1] = 5.0 * tendon.motor_radius
    exact = (expm(0.1 * a) @ initial)[n - 1] / tendon.joint_radius
    joint = run(cable, np.linspace(0.0, 0.1, 101), np.linspace(0.0, 0.5, 101))[-1]
    assert exact > 0.1
    return abs(float(joint - exact))


def test_without_friction_it_converges_to_the_chain_of_springs() -> None:
    """First order, backward Euler's."""
    errors = [linear_error(step) for step in (4e-5, 2e-5, 1e-5)]
    assert [a / b for a, b in pairwise(errors)] == pytest.approx([2.0, 2.0], rel=0.1)


def unbalanced(cable: PreparedLumped, before: LumpedMemory, after: LumpedMemory, width: float, dt: float) -> float:
    """The largest force that is missing from Newton's law at any node after one step, written down anew [N]."""
    t, old, new = cable.tendon, before.moved, after.moved
    past = np.maximum(0.0, t.preload + t.element * -np.diff(old))
    pull = np.maximum(0.0, t.preload + t.element * -np.diff(new))
    limits = np.tanh(0.5 * width * t.angles[1:]) * (past + np.append(past[1:], max(0.0, t.preload + t.end * old[-1])))
    speed = (new - old)[1:] / dt
    load = np.append(pull[1:], t.preload + t.end * new[-1] + cable.damping * speed[-1])
    missing = pull - load - limits * after.share[1:] - cable.masses[1:] * (speed - before.speed[1:]) / dt
    return float(np.abs(missing).max())


VIOLENT = ((0.4453125, 1.0), (0.0, 0.5), (0.5, 0.375), (1.7750503377489428, 1.0625), (0.0, 1.890625), (0.0, 1.125))
VIOLENT += ((0.0, 1.375), (1.7003012581200303, 1.375))
"""After these Newton's method alone was 8.7 N away from a balance."""


@both
@example(path=list(VIOLENT))
@given(st.lists(st.tuples(st.floats(-1.0, 2.5), st.floats(0.2, 2.0)), min_size=1, max_size=12))
def test_every_step_balances_however_wild(lumped: LumpedTendon, path: list[tuple[float, float]]) -> None:
    """Jumps of the motor in one step, slack and taut again, in a sheath that jumps as well."""
    cable = prepare_lumped(lumped)
    memory, last = START(cable, 0.0, 1.0), 0.0
    for motor, width in path:
        before = LumpedMemory(*(array.copy() for array in memory))
        ADVANCE(cable, memory, last, motor, width, 2.5e-4)
        assert unbalanced(cable, before, memory, width, 2.5e-4) < 1e-6
        assert np.abs(memory.share).max() <= 1.0
        assert min(TENSION(cable, memory, i) for i in range(10)) >= 0.0
        last = motor


def energy(cable: PreparedLumped, memory: LumpedMemory) -> float:
    """Kinetic and elastic, with the motor's end at rest [J]."""
    pulls = [TENSION(cable, memory, i) for i in range(len(memory.moved) - 1)]
    spring = cable.tendon.preload + cable.tendon.end * memory.moved[-1]
    elastic = sum(pull**2 for pull in pulls) / (2.0 * cable.tendon.element) + spring**2 / (2.0 * cable.tendon.end)
    return float(elastic + 0.5 * cable.masses[1:] @ memory.speed[1:] ** 2)


@both
def test_with_the_motor_at_rest_energy_only_falls(lumped: LumpedTendon) -> None:
    cable = prepare_lumped(lumped._replace(damping=0.0))
    memory = START(cable, 1.0, 1.0)
    ADVANCE(cable, memory, 1.0, 0.3, 1.0, 0.01)  # let go: the joint swings, the tendon goes slack on the way
    memory.speed[0] = 0.0
    energies = [energy(cable, memory)]
    for _ in range(2000):
        ADVANCE(cable, memory, 0.3, 0.3, 1.0, 5e-4)
        energies.append(energy(cable, memory))
    # a bristle may give back what it holds: at most its limit, below 1 N here, over its length
    lowest = np.minimum.accumulate(energies)
    assert (energies - lowest).max() < 10 * 1.0 * lumped.presliding
    assert energies[-1] < 0.5 * energies[0]
    assert np.abs(memory.speed).max() < 1e-3


@both
def test_a_slack_tendon_pushes_nothing(lumped: LumpedTendon) -> None:
    cable = prepare_lumped(lumped)
    memory = START(cable, 0.5, 1.0)
    ADVANCE(cable, memory, 0.5, -3.0, 1.0, 0.1)
    ADVANCE(cable, memory, -3.0, -3.0, 1.0, 5.0)
    assert memory.moved[-1] / cable.tendon.joint_radius == pytest.approx(-0.5, abs=1e-6)  # where the spring rests
    assert TENSION(cable, memory, 0) == 0.0
    assert PULL(cable, memory, 1.0) == 0.0


@both
def test_the_capstan_ratio_of_a_steady_pull(lumped: LumpedTendon) -> None:
    cable = prepare_lumped(lumped)
    memory = START(cable, 0.0, 1.0)
    ADVANCE(cable, memory, 0.0, 1.5, 1.0, 1500.0 * cable.step)
    for _ in range(400):
        ADVANCE(cable, memory, 1.5, 1.5, 1.0, 0.01)
    ADVANCE(cable, memory, 1.5, 1.7, 1.0, 200.0)  # 1 mrad/s: what damps and accelerates is far below the friction
    load = cable.tendon.preload + cable.tendon.end * memory.moved[-1]
    assert PULL(cable, memory, 1.0) / load == pytest.approx(math.exp(0.15 * math.pi), rel=1e-3)


@pytest.mark.parametrize(
    "change",
    [
        {"density": 0.0},
        {"inertia": -1.0},
        {"damping": math.nan},
        {"presliding": 0.0},
        {"step": math.inf},
        {"tendon": Tendon(length=0.0)},
    ],
)
def test_absurd_tendons_are_refused(change: dict[str, Any]) -> None:
    with pytest.raises(ParameterError, match="expected"):
        prepare_lumped(COULOMB._replace(**change))
